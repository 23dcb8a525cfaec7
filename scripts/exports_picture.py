"""Draws what `enfilade export` writes of a world: needs Pillow.

    python3 scripts/exports_picture.py ENFILADE WORLD.glb OUT.png

Panels: the map and the labels for robots, the floors to walk on, and the surfaces of gbXML by what lies behind.
"""

import colorsys
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

from PIL import Image, ImageDraw

SIDE, MARGIN = 560, 24
NAMESPACE = "{http://www.gbxml.org/schema}"


def color(number, light=0.8):
    return tuple(int(255 * c) for c in colorsys.hsv_to_rgb(number * 0.618 % 1, 0.45, light + 0.15))


def fit(image):
    scale = min(SIDE / image.width, SIDE / image.height)
    return image.resize((round(image.width * scale), round(image.height * scale)), Image.NEAREST)


def labels(path):
    data = path.read_bytes()
    head = data.split(b"\n", 3) if data.count(b"\n", 0, 64) >= 3 else data.split(None, 4)
    width, height = (int(n) for n in head[1].split())
    numbers = memoryview(data[-2 * width * height :])
    image = Image.new("RGB", (width, height), "white")
    for i in range(width * height):
        number = numbers[2 * i] << 8 | numbers[2 * i + 1]
        if number:
            image.putpixel((i % width, i // width), color(number))
    return image


def polygons_picture(polygons):
    """Polygons as (depth, points, fill), farthest first."""
    points = [p for _, loop, _ in polygons for p in loop]
    low = [min(p[k] for p in points) for k in (0, 1)]
    high = [max(p[k] for p in points) for k in (0, 1)]
    scale = 2 * SIDE / max(high[0] - low[0], high[1] - low[1])
    image = Image.new("RGB", [max(1, round((high[k] - low[k]) * scale)) + 4 for k in (0, 1)], "white")
    draw = ImageDraw.Draw(image)
    for _, loop, fill in sorted(polygons, key=lambda p: -p[0]):
        draw.polygon([((p[0] - low[0]) * scale + 2, (p[1] - low[1]) * scale + 2) for p in loop], fill, "#444444")
    return image.resize((image.width // 2, image.height // 2), Image.LANCZOS)


def floors(path):
    """Floors of rooms below 1.5 m."""
    vertices, polygons, number, is_room = [], [], 0, False
    for line in path.read_text().splitlines():
        kind, *rest = line.split()
        if kind == "g":
            number, is_room = number + 1, rest != ["outdoors"]
        elif kind == "v":
            vertices.append([float(c) for c in rest])
        elif kind == "f":
            loop = [vertices[int(i)] for i in rest]
            if is_room and loop[0][1] < 1.5:
                polygons.append((-loop[0][1], [(x, z) for x, _, z in loop], color(number)))
    return polygons_picture(polygons)


COLORS = {"InteriorWall": "#e8b04a", "ExteriorWall": "#c96f5b", "Roof": "#7d8ca3", "Air": "#a9d6e5"}


def surfaces(path):
    polygons = []
    for surface in ET.parse(path).getroot().iter(NAMESPACE + "Surface"):
        kind = surface.get("surfaceType")
        if kind in ("Roof", "Ceiling", "InteriorFloor"):
            continue
        for node in [surface, *surface.findall(NAMESPACE + "Opening")]:
            loop = node.find(f"{NAMESPACE}PlanarGeometry/{NAMESPACE}PolyLoop")
            points = [[float(c.text) for c in p] for p in loop]
            turned = [(0.87 * x + 0.5 * y, 0.5 * (0.5 * x - 0.87 * y) * 1.1 - 0.87 * z) for x, y, z in points]
            depth = sum(0.87 * y - 0.5 * x - 0.3 * z for x, y, z in points) / len(points)
            fill = COLORS.get(kind, "#d9d9d9") if node is surface else "#6fb3e0"
            polygons.append((depth - 0.01 * (node is not surface), turned, fill))
    return polygons_picture(polygons)


def main(enfilade, world, out):
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for options in (["map.pgm", "--resolution", "0.02"], ["floors.obj", "--walkable"], ["house.gbxml"]):
            command = [enfilade, "export", world, "-o", str(folder / options[0]), *options[1:]]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        panels = [
            Image.open(folder / "map.pgm").convert("RGB"),
            labels(folder / "map.labels.pgm"),
            floors(folder / "floors.obj"),
            surfaces(folder / "house.gbxml"),
        ]
        panels = [fit(panel) for panel in panels]
        width = 2 * SIDE + 3 * MARGIN
        heights = [max(p.height for p in panels[k : k + 2]) for k in (0, 2)]
        picture = Image.new("RGB", (width, sum(heights) + 3 * MARGIN), "white")
        for i, panel in enumerate(panels):
            x = MARGIN + (i % 2) * (SIDE + MARGIN)
            y = MARGIN + (i // 2) * (heights[0] + MARGIN)
            picture.paste(panel, (x, y))
        picture.quantize(64).save(out, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
