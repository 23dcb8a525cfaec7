# Writes the products of an IFC file as GLB, by means of ifcopenshell: python read_ifc.py IN.ifc OUT.glb
#
# docs/import.md ("IFC") describes the result; read_ifc.mjs writes the same by means of web-ifc. Lines `note: ...` on standard
# output are shown to the user. Exit code 127: the package is missing.

import array
import json
import math
import os
import re
import struct
import sys

NOT_INSTALLED = 127

try:
    import ifcopenshell
    import ifcopenshell.geom
    import ifcopenshell.util.element
except ModuleNotFoundError as error:
    if not (error.name or "").startswith("ifcopenshell"):
        sys.exit("ifcopenshell cannot be loaded: %s" % error)
    sys.exit(NOT_INSTALLED)

# Nothing that one could touch, or parts of other products' bodies.
BODILESS = (
    "IfcFeatureElement", "IfcVirtualElement", "IfcSpatialZone", "IfcAnnotation", "IfcGrid", "IfcPort",
    "IfcStructuralActivity", "IfcStructuralItem",
)
# Groups of products that are called by their name.
SPATIAL = ("IfcSite", "IfcBuilding", "IfcBuildingStorey", "IfcFacility", "IfcFacilityPart")
# Properties that tell how a thing parts rooms.
KEPT = re.compile("external|fire|acoust|sound|absor|glaz|glass|transmi|transpar|loadbearing", re.IGNORECASE)
BODIES = ("Body", "Facetation", "Tessellation", "Body-FallBack")


def is_any(entity, classes):
    return any(entity.is_a(name) for name in classes)


def plain(value):
    """Returns text, truth values and numbers that JSON can hold; None for all else."""
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        return int(value) if value.is_integer() else value
    return value if isinstance(value, (str, int)) and value != "" else None


def linear(c):
    c = min(max(c, 0.0), 1.0)
    return round(c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4, 6)


def attribute(value):
    return value() if callable(value) else value


class Glb:
    def __init__(self):
        self.binary = bytearray()
        self.json = {"asset": {"version": "2.0", "generator": "enfilade, ifcopenshell %s" % ifcopenshell.version}}
        for key in ("nodes", "meshes", "materials", "accessors", "bufferViews"):
            self.json[key] = []
        # From z up to y up.
        self.root = self.add("nodes", {"matrix": [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1]})
        self.material_of = {}

    def add(self, key, item):
        self.json[key].append(item)
        return len(self.json[key]) - 1

    def add_node(self, parent, node):
        i = self.add("nodes", node)
        self.json["nodes"][parent].setdefault("children", []).append(i)
        return i

    def add_material(self, name, color, alpha):
        color = [linear(c) for c in color] + [round(min(max(alpha, 0.0), 1.0), 6)]
        key = (name, tuple(color))
        if key not in self.material_of:
            look = {"baseColorFactor": color, "metallicFactor": 0, "roughnessFactor": 0.9}
            material = {"name": name, "pbrMetallicRoughness": look, "doubleSided": True}
            if color[3] < 1:
                material["alphaMode"] = "BLEND"
            self.material_of[key] = self.add("materials", material)
        return self.material_of[key]

    def add_accessor(self, numbers, target, accessor):
        raw = array.array("f" if target == 34962 else "I", numbers)
        if sys.byteorder == "big":
            raw.byteswap()
        raw = raw.tobytes()
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(raw), "target": target}
        self.binary += raw
        return self.add("accessors", dict(accessor, bufferView=self.add("bufferViews", view)))

    def add_positions(self, values):
        axes = [array.array("f", values[k::3]) for k in range(3)]
        ends = {"min": [min(a) for a in axes], "max": [max(a) for a in axes]}
        return self.add_accessor(
            values, 34962, dict(ends, componentType=5126, count=len(values) // 3, type="VEC3")
        )

    def add_indices(self, values):
        return self.add_accessor(values, 34963, {"componentType": 5125, "count": len(values), "type": "SCALAR"})

    def write(self, path):
        self.json["scene"] = 0
        self.json["scenes"] = [{"nodes": [self.root]}]
        self.json["buffers"] = [{"byteLength": len(self.binary)}] if self.binary else []
        filled = {key: value for key, value in self.json.items() if value or value == 0}
        text = json.dumps(filled, separators=(",", ":"), sort_keys=True, ensure_ascii=False, allow_nan=False)
        text = text.encode(errors="replace")
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        if self.binary:
            chunks += struct.pack("<II", len(self.binary), 0x004E4942) + bytes(self.binary)
        with open(path, "wb") as file:
            file.write(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)


def recenter(values):
    """Returns the positions near their origin, and the offset; see `recenter` in soup.rs."""
    ends = [(min(values[k::3]), max(values[k::3])) for k in range(3)]
    size = max(b - a for a, b in ends)
    reach = max(abs(e) for pair in ends for e in pair)
    if not math.isfinite(reach) or size <= 0 or reach <= 16 * size:
        return values, None
    offset = [round((a + b) / 2) for a, b in ends]
    return [v - offset[i % 3] for i, v in enumerate(values)], offset


class Reader:
    def __init__(self, path):
        self.file = ifcopenshell.open(path)
        self.glb = Glb()
        self.parent_of = {}
        for relation in self.file.by_type("IfcRelAggregates"):
            for child in relation.RelatedObjects:
                self.parent_of[child.id()] = relation.RelatingObject
        for relation in self.file.by_type("IfcRelContainedInSpatialStructure"):
            for child in relation.RelatedElements:
                self.parent_of[child.id()] = relation.RelatingStructure
        self.groups = {}
        self.meshes = {}
        self.names = {}

    def facts(self, product):
        """Returns the extras of a product's node."""
        facts = {}
        for key in ("Name", "LongName", "ObjectType", "Elevation"):
            value = plain(getattr(product, key, None))
            if value is not None:
                facts[key] = value
        try:
            sets = ifcopenshell.util.element.get_psets(product)
        except Exception:
            # A damaged property is no reason to lose the building.
            sets = {}
        for name, properties in sets.items():
            kept = {key: plain(value) for key, value in properties.items() if KEPT.search(key)}
            kept = {key: value for key, value in kept.items() if value is not None}
            if kept:
                facts[name] = kept
        return {"ifc": facts} if facts else {}

    def group(self, entity):
        """Returns the node of a storey or an assembly, made on first use."""
        if entity is None or not entity.is_a("IfcProduct"):
            return self.glb.root
        if entity.id() not in self.groups:
            # A cycle of parents ends at the root.
            self.groups[entity.id()] = self.glb.root
            above = self.group(self.parent_of.get(entity.id()))
            name = "%s/%s" % (entity.is_a(), entity.GlobalId)
            if is_any(entity, SPATIAL) and entity.Name:
                name = entity.Name
            node = {"name": name, "extras": self.facts(entity)}
            self.groups[entity.id()] = self.glb.add_node(above, node)
        return self.groups[entity.id()]

    def material(self, style, product):
        number = attribute(style.instance_id)
        entity = self.file.by_id(number) if number > 0 else None
        name = getattr(entity, "Name", None)
        color = style.diffuse
        color = [attribute(color.r), attribute(color.g), attribute(color.b)]
        clear = style.transparency
        clear = clear if clear == clear else 0.0
        if entity is None:
            color, clear = [0.8, 0.8, 0.8], 0.0
        return self.glb.add_material(name or self.substance(product), color, 1.0 - clear)

    def substance(self, product):
        """Returns the name of a product's first material, or its class."""
        if product.id() not in self.names:
            try:
                found = ifcopenshell.util.element.get_materials(product)
            except Exception:
                found = []
            names = [m.Name for m in found if getattr(m, "Name", None)]
            self.names[product.id()] = names[0] if names else product.is_a()
        return self.names[product.id()]

    def mesh(self, geometry, product):
        """Returns the mesh and its offset; None without triangles."""
        styles = [self.material(style, product) for style in geometry.materials]
        key = (geometry.id, tuple(styles))
        if key in self.meshes:
            return self.meshes[key]
        faces, which = geometry.faces, geometry.material_ids
        parts = {}
        for i in range(len(faces) // 3):
            k = which[i] if i < len(which) else -1
            style = styles[k] if 0 <= k < len(styles) else None
            parts.setdefault(style, []).extend(faces[3 * i : 3 * i + 3])
        made = None
        if parts:
            values, offset = recenter(geometry.verts)
            positions = self.glb.add_positions(values)
            primitives = []
            for style, indices in parts.items():
                primitive = {"attributes": {"POSITION": positions}, "indices": self.glb.add_indices(indices)}
                if style is not None:
                    primitive["material"] = style
                primitives.append(primitive)
            made = (self.glb.add("meshes", {"primitives": primitives}), offset)
        self.meshes[key] = made
        return made

    def place(self, shape):
        product = self.file.by_id(shape.id)
        found = self.mesh(shape.geometry, product)
        if found is None:
            return
        mesh, offset = found
        matrix = list(shape.transformation.matrix)
        if offset:
            for row in range(3):
                matrix[12 + row] += sum(matrix[4 * k + row] * offset[k] for k in range(3))
        # As a group, it may have parts below it.
        above = self.group(self.parent_of.get(product.id()))
        name = "%s/%s" % (product.is_a(), product.GlobalId)
        self.glb.add_node(
            above, {"name": name, "mesh": mesh, "matrix": matrix, "extras": self.facts(product)}
        )

    def products(self):
        for product in self.file.by_type("IfcProduct"):
            if product.Representation and not is_any(product, BODILESS):
                yield product

    def read(self):
        wanted = list(self.products())
        if not wanted:
            return
        settings = ifcopenshell.geom.settings()
        iterator = ifcopenshell.geom.iterator(settings, self.file, os.cpu_count() or 1, include=wanted)
        placed = set()
        if iterator.initialize():
            while True:
                # The parts of a shape live no longer than the shape.
                shape = iterator.get()
                placed.add(shape.id)
                self.place(shape)
                if not iterator.next():
                    break
        lost = [p for p in wanted if p.id() not in placed and has_body(p)]
        for product in lost[:8]:
            print("note: %s/%s: its body cannot be made; left out" % (product.is_a(), product.GlobalId))
        if len(lost) > 8:
            print("note: %d more bodies cannot be made; left out" % (len(lost) - 8))


def has_body(product):
    return any(r.RepresentationIdentifier in BODIES for r in product.Representation.Representations)


def main():
    version = re.findall(r"\d+", ifcopenshell.version)
    if [int(n) for n in version[:2]] < [0, 8]:
        sys.exit("ifcopenshell %s is too old; run: pip install --upgrade ifcopenshell" % ifcopenshell.version)
    reader = Reader(sys.argv[1])
    reader.read()
    reader.glb.write(sys.argv[2])


try:
    main()
except Exception as error:
    sys.exit("ifcopenshell cannot read it: %s" % (error or type(error).__name__))
