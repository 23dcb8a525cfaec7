// A whole reader of baked worlds for Unity and other .NET programs. It needs Newtonsoft.Json, in Unity the package
// com.unity.nuget.newtonsoft-json. Coordinates are those of the file: meters, right-handed, +Y up.
using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Text;
using Newtonsoft.Json.Linq;

public sealed class EnfiladeWorld {
    public sealed class Cell { public string Name; public string Kind; public int[] Portals; }
    public sealed class Portal { public int[] Cells; public string Kind; public float[][] Outline; public float[][][] Pieces; }

    public readonly List<Cell> Cells;
    public readonly List<Portal> Portals;
    readonly byte[] glb;
    readonly JObject gltf;
    readonly JToken locator;
    readonly int binary, planes, nodes, rows, runs;

    public EnfiladeWorld(byte[] glb) {
        if (glb.Length < 28 || BitConverter.ToUInt32(glb, 0) != 0x46546C67) throw new InvalidDataException("this is not a .glb file");
        int length = BitConverter.ToInt32(glb, 12);
        this.glb = glb;
        binary = 20 + length + 8;
        gltf = JObject.Parse(Encoding.UTF8.GetString(glb, 20, length));
        JToken world = gltf["extensions"]?["ENFILADE_cell_portal_graph"];
        if (world == null) throw new InvalidDataException("this is not a world: bake it first");
        if ((int)world["version"] > 2) throw new InvalidDataException("the world is of version " + world["version"]);
        Cells = world["cells"].Select(c => new Cell {
            Name = (string)c["name"], Portals = c["portals"].Values<int>().ToArray(),
            Kind = (bool?)c["outdoor"] == true ? "outdoors" : (bool?)c["void"] == true ? "void" : "room",
        }).ToList();
        int at = Start(world["portalCorners"]);
        Func<int, float[]> corner = _ => {
            at += 12;
            return new[] { BitConverter.ToSingle(glb, at - 12), BitConverter.ToSingle(glb, at - 8), BitConverter.ToSingle(glb, at - 4) };
        };
        Func<int, float[][]> polygon = n => Enumerable.Range(0, n).Select(corner).ToArray();
        Portals = world["portals"].Select(p => new Portal {
            Cells = p["cells"].Values<int>().ToArray(), Kind = (string)p["kind"],
            Outline = polygon((int)p["outline"]), Pieces = p["pieces"].Values<int>().Select(polygon).ToArray(),
        }).ToList();
        locator = world["locator"];
        planes = Start(locator["planes"]);
        nodes = Start(locator["nodes"]);
        rows = Start(world["pvs"]?["rows"]);
        runs = Start(world["pvs"]?["runs"]);
    }

    int Start(JToken view) => view == null ? -1 : binary + ((int?)gltf["bufferViews"][(int)view]["byteOffset"] ?? 0);

    /// <summary>Returns the cell of a point, or -1 in solid matter.</summary>
    public int Locate(double x, double y, double z) {
        double[] p = { x, y, z };
        JToken box = locator["bounds"];
        if (box == null || Enumerable.Range(0, 3).Any(k => p[k] < (double)box[0][k] || p[k] > (double)box[1][k])) return (int?)locator["outside"] ?? -1;
        int at = (int)locator["root"];
        while (at >= 0) {
            int plane = planes + 32 * BitConverter.ToInt32(glb, nodes + 12 * at);
            double side = Enumerable.Range(0, 3).Sum(k => BitConverter.ToDouble(glb, plane + 8 * k) * p[k]) + BitConverter.ToDouble(glb, plane + 24);
            at = BitConverter.ToInt32(glb, nodes + 12 * at + (side < 0 ? 8 : 4));
        }
        return -2 - at;
    }

    /// <summary>Returns the cells that may be visible from a cell: all of them in a world without a potentially visible set.</summary>
    public IEnumerable<int> VisibleFrom(int cell) {
        if (rows < 0) return Enumerable.Range(0, Cells.Count);
        int first = cell == 0 ? 0 : BitConverter.ToInt32(glb, rows + 4 * cell - 4), end = BitConverter.ToInt32(glb, rows + 4 * cell);
        return Enumerable.Range(first, end - first).SelectMany(run => {
            int from = BitConverter.ToInt32(glb, runs + 8 * run), to = BitConverter.ToInt32(glb, runs + 8 * run + 4);
            return Enumerable.Range(from, to - from);
        });
    }
}
