// Prints a world's graph, then the cell of each point of a file of `x y z` lines: dump.exe WORLD POINTS
using System;
using System.Globalization;
using System.IO;
using System.Linq;

static class Program {
    static void Main(string[] args) {
        CultureInfo.CurrentCulture = CultureInfo.InvariantCulture;
        var world = new EnfiladeWorld(File.ReadAllBytes(args[0]));
        for (int i = 0; i < world.Cells.Count; i++) {
            var cell = world.Cells[i];
            Console.WriteLine($"cell {cell.Kind} {string.Join(" ", cell.Portals)}");
            Console.WriteLine($"sees {string.Join(" ", world.VisibleFrom(i))}");
        }
        foreach (var portal in world.Portals) {
            Console.WriteLine($"portal {portal.Kind} {string.Join(" ", portal.Cells)}");
            foreach (var polygon in new[] { portal.Outline }.Concat(portal.Pieces))
                Console.WriteLine($"polygon {string.Join(" ", polygon.SelectMany(v => v).Select(c => c.ToString("G9")))}");
        }
        foreach (var line in File.ReadLines(args[1])) {
            var p = line.Split(' ').Select(double.Parse).ToArray();
            Console.WriteLine($"at {world.Locate(p[0], p[1], p[2])}");
        }
    }
}
