"""Energy models as gbXML, from the sheets and the truth of a scene, and what a gbXML file says.

    gbxml_source.py write SCENE OUT    the model of which the scene was made, as far as its sheets, panes and spaces tell it
    gbxml_source.py read FILE          its spaces and openings, as JSON

Coordinates are turned: gbXML has Z up.
"""

import json
import struct
import sys
import xml.etree.ElementTree as ET
from collections import defaultdict

NAMESPACE = "{http://www.gbxml.org/schema}"
KINDS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}


def meshes(path):
    """The name of each node of a binary glTF file, with its triangles."""
    data = open(path, "rb").read()
    length = struct.unpack_from("<I", data, 12)[0]
    gltf, blob = json.loads(data[20 : 20 + length]), 28 + length

    def values(number, n):
        accessor = gltf["accessors"][number]
        view = gltf["bufferViews"][accessor["bufferView"]]
        start = blob + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        kind = KINDS[accessor["componentType"]]
        flat = struct.unpack_from(f"<{accessor['count'] * n}{kind}", data, start)
        return [flat[i : i + n] for i in range(0, len(flat), n)]

    for node in gltf["nodes"]:
        triangles = []
        for primitive in gltf["meshes"][node["mesh"]]["primitives"]:
            points = [tuple(round(c, 5) for c in p) for p in values(primitive["attributes"]["POSITION"], 3)]
            indices = [i for i, in values(primitive["indices"], 1)]
            triangles += [[points[i] for i in indices[k : k + 3]] for k in range(0, len(indices), 3)]
        yield node["name"], triangles


def area_vector(loop):
    """Twice the area of a loop, along its normal."""
    x, y, z = (list(c) for c in zip(*loop))
    sums = lambda a, b: sum(a[i - 1] * b[i] - a[i] * b[i - 1] for i in range(len(a)))
    return sums(y, z), sums(z, x), sums(x, y)


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def rings(triangles):
    """The loops around triangles of a plane, the largest first."""
    edges = {(t[i], t[(i + 1) % 3]) for t in triangles for i in range(3)}
    after = defaultdict(list)
    for a, b in edges:
        if (b, a) not in edges:
            after[a].append(b)
    loops = []
    while after:
        start = next(iter(after))
        loop, at = [], start
        while after.get(at):
            loop.append(at)
            following = after[at].pop()
            if not after[at]:
                del after[at]
            at = following
        if len(loop) > 2:
            loops.append(loop)
    return sorted(loops, key=lambda r: -dot(area_vector(r), area_vector(r)))


def add_polygon(parent, points):
    loop = ET.SubElement(parent, "PolyLoop")
    for x, y, z in points:
        point = ET.SubElement(loop, "CartesianPoint")
        for c in (x, -z, y):
            ET.SubElement(point, "Coordinate").text = repr(c)


def write(scene, out):
    truth = json.load(open(f"{scene}/truth.json"))
    panes = {name: rings(triangles) for name, triangles in meshes(f"{scene}/detail.glb")}
    hosted = defaultdict(list)
    for opening in truth["openings"]:
        if opening["kind"] != "virtual":
            kind = opening["type"]
            pane = panes.get(f"{kind}/{opening['id']}")
            hosted[opening["host"]].append((opening["id"], kind, pane[0] if pane else opening["corners"]))
    root = ET.Element("gbXML", {"xmlns": NAMESPACE[1:-1], "lengthUnit": "Meters", "version": "6.01"})
    campus = ET.SubElement(root, "Campus", id="campus")
    building = ET.SubElement(campus, "Building", id="building")
    for room in truth["rooms"]:
        space = ET.SubElement(building, "Space", id=room["id"])
        ET.SubElement(space, "Name").text = room["name"]
        shell = ET.SubElement(ET.SubElement(space, "ShellGeometry"), "ClosedShell")
        vertices = room["mesh"]["vertices"]
        for triangle in room["mesh"]["triangles"]:
            add_polygon(shell, [vertices[i] for i in triangle])
    for opening in truth["openings"]:
        if opening["kind"] == "virtual":
            surface = ET.SubElement(campus, "Surface", id=opening["id"], surfaceType="Air")
            add_polygon(ET.SubElement(surface, "PlanarGeometry"), opening["corners"])
    for name, triangles in meshes(f"{scene}/scene.glb"):
        kind, number = name.split("/")
        loops = rings(triangles)
        surface = ET.SubElement(campus, "Surface", id=number, surfaceType=kind)
        add_polygon(ET.SubElement(surface, "PlanarGeometry"), loops[0])
        own = hosted.pop(number, [])
        # Holes in a sheet that no opening has are ways; several panes may be in one.
        middle = lambda points: [sum(c) / len(points) for c in zip(*points)]
        box = lambda points: [(min(c) - 0.01, max(c) + 0.01) for c in zip(*points)]
        inside = lambda p, hole: all(a <= c <= b for c, (a, b) in zip(p, box(hole)))
        for i, hole in enumerate(loops[1:]):
            if not any(inside(middle(points), hole) for _, _, points in own):
                own.append((f"{number}-hole-{i}", "Air", hole))
        for number, kind, points in own:
            opening = ET.SubElement(surface, "Opening", id=number, openingType=kind)
            add_polygon(ET.SubElement(opening, "PlanarGeometry"), points)
    ET.ElementTree(root).write(out, encoding="utf-8", xml_declaration=True)


def points_of(node):
    loop = node.find(f"{NAMESPACE}PlanarGeometry/{NAMESPACE}PolyLoop")
    turned = ([float(c.text) for c in point] for point in loop)
    return [[x, z, -y] for x, y, z in turned]


def read(path):
    root = ET.parse(path).getroot()
    of = lambda node, name: node.find(NAMESPACE + name).text
    spaces = {s.get("id"): s for s in root.iter(f"{NAMESPACE}Space")}
    openings = []
    for surface in root.iter(f"{NAMESPACE}Surface"):
        sides = {s.get("spaceIdRef") for s in surface.findall(f"{NAMESPACE}AdjacentSpaceId")}
        names = sorted(of(spaces[s], "Name") for s in sides)
        own = surface.findall(f"{NAMESPACE}Opening")
        # A way between rooms is all of its surface.
        own += [surface] if surface.get("surfaceType") == "Air" else []
        openings += [{"spaces": names, "points": points_of(node)} for node in own]
    spaces = [{"name": of(s, "Name"), "area": float(of(s, "Area"))} for s in spaces.values()]
    print(json.dumps({"spaces": spaces, "openings": openings}))


if __name__ == "__main__":
    {"write": write, "read": read}[sys.argv[1]](*sys.argv[2:])
