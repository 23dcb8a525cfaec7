"""What `enfilade export` writes for other trades, as programs of those trades read it."""

import json
import sys

import honeybee_energy  # noqa: F401: knows the adiabatic boundary
import ifcopenshell
import ifcopenshell.api
import ifcopenshell.api.owner.settings
import ifcopenshell.geom
import ifcopenshell.guid
import ifcopenshell.util.element
import ifcopenshell.util.shape
import ifcopenshell.validate
import numpy as np
import pyroomacoustics as pra
import pytest
from honeybee.door import Door
from honeybee.facetype import face_types
from honeybee.model import Model
from honeybee.room import Room
from ladybug_geometry.geometry3d import Face3D, Point3D

import enfilade

# The checker's own: it leaves its files open.
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")

# Two rooms of 4 m by 5 m and one of 3 m by 5 m, 2.5 m high, in millimeters: class, low and high end. Walls are 200 mm thick.
WALLS = [
    ("IfcWall", (-200, -200, 0), (11600, 0, 2500)),
    ("IfcWall", (-200, 5000, 0), (11600, 5200, 2500)),
    ("IfcWall", (-200, 0, 0), (0, 5000, 2500)),
    ("IfcWall", (11400, 0, 0), (11600, 5000, 2500)),
    # Around a door of 1 m by 2 m.
    ("IfcWall", (4000, 0, 0), (4200, 1000, 2500)),
    ("IfcWall", (4000, 2000, 0), (4200, 5000, 2500)),
    ("IfcWall", (4000, 1000, 2000), (4200, 2000, 2500)),
    # Around a way without a door.
    ("IfcWall", (8200, 0, 0), (8400, 3000, 2500)),
    ("IfcWall", (8200, 4000, 0), (8400, 5000, 2500)),
    ("IfcWall", (8200, 3000, 2000), (8400, 4000, 2500)),
    ("IfcSlab", (-200, -200, -200), (11600, 5200, 0)),
    ("IfcSlab", (-200, -200, 2500), (11600, 5200, 2700)),
    ("IfcDoor", (4080, 1000, 0), (4120, 2000, 2000)),
]
AREAS = [15.0, 20.0, 20.0]


def box(file, context, low, high):
    size = [float(b - a) for a, b in zip(low, high)]
    at = file.createIfcCartesianPoint([float(c) for c in low])
    middle = file.createIfcAxis2Placement2D(file.createIfcCartesianPoint([size[0] / 2, size[1] / 2]))
    profile = file.createIfcRectangleProfileDef("AREA", None, middle, size[0], size[1])
    up = file.createIfcDirection([0.0, 0.0, 1.0])
    solid = file.createIfcExtrudedAreaSolid(profile, file.createIfcAxis2Placement3D(at), up, size[2])
    shape = file.createIfcShapeRepresentation(context, "Body", "SweptSolid", [solid])
    return file.createIfcProductDefinitionShape(None, None, [shape])


def model(schema):
    """Returns the building as IFC, on a storey that begins 3 m above the origin."""
    file = ifcopenshell.file(schema=schema)
    run = ifcopenshell.api.run
    settings = ifcopenshell.api.owner.settings
    settings.get_user = settings.get_application = lambda _: None
    if schema == "IFC2X3":
        person = run("owner.add_person", file)
        organisation = run("owner.add_organisation", file)
        user = run("owner.add_person_and_organisation", file, person=person, organisation=organisation)
        application = run("owner.add_application", file, application_developer=organisation)
        settings.get_user = lambda _: user
        settings.get_application = lambda _: application
    project = run("root.create_entity", file, ifc_class="IfcProject", name="House")
    run("unit.assign_unit", file, length={"is_metric": True, "raw": "MILLIMETERS"})
    context = run("context.add_context", file, context_type="Model")
    body = run(
        "context.add_context", file, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW", parent=context
    )
    building = run("root.create_entity", file, ifc_class="IfcBuilding", name="House")
    run("aggregate.assign_object", file, products=[building], relating_object=project)
    storeys = []
    for name, height in (("Cellar", 0.0), ("Ground floor", 3.0)):
        storey = run("root.create_entity", file, ifc_class="IfcBuildingStorey", name=name)
        run("aggregate.assign_object", file, products=[storey], relating_object=building)
        matrix = np.eye(4)
        matrix[2, 3] = height
        run("geometry.edit_object_placement", file, product=storey, matrix=matrix)
        storeys.append(storey)
    matrix = np.eye(4)
    matrix[2, 3] = 3.0
    for ifc_class, low, high in WALLS:
        element = run("root.create_entity", file, ifc_class=ifc_class, name=ifc_class)
        element.Representation = box(file, body, low, high)
        run("geometry.edit_object_placement", file, product=element, matrix=matrix)
        run("spatial.assign_container", file, products=[element], relating_structure=storeys[1])
    return file


def faults(file):
    logger = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(file, logger, express_rules=True)
    return [str(s["message"]) for s in logger.statements]


def volume(space):
    settings = ifcopenshell.geom.settings()
    return ifcopenshell.util.shape.get_volume(ifcopenshell.geom.create_shape(settings, space).geometry)


def quantities(space):
    return ifcopenshell.util.element.get_psets(space, qtos_only=True)["Qto_SpaceBaseQuantities"]


def polygon_area(boundary):
    face = boundary.ConnectionGeometry.SurfaceOnRelatingElement
    total = 0.0
    for sign, curve in [(1, face.OuterBoundary), *((-1, c) for c in face.InnerBoundaries)]:
        x, y = np.array([p.Coordinates for p in curve.Points]).T
        total += sign * abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / 2
    # Square millimeters.
    return total / 1e6


@pytest.fixture(scope="module", params=["IFC2X3", "IFC4", "IFC4X3"])
def written(request, tmp_path_factory, command):
    """Paths of a model and of the same with spaces, and the world."""
    folder = tmp_path_factory.mktemp(request.param)
    paths = [folder / name for name in ("house.ifc", "world.glb", "rooms.ifc")]
    file = model(request.param)
    assert not faults(file)
    file.write(str(paths[0]))
    command("bake", "-q", paths[0], "--ifc-convert", sys.executable, "-o", paths[1])
    said = command.json("export", paths[1], "--ifc", paths[0], "-o", paths[2])
    assert (said["spaces_added"], said["spaces_kept"], said["surfaces_without_element"]) == (3, 0, 0)
    return paths


def test_spaces_are_valid_and_as_large_as_the_rooms(written):
    house, _, rooms = written
    before, after = house.read_bytes(), rooms.read_bytes()
    end = before.rindex(b"ENDSEC")
    assert after.startswith(before[:end]) and after.endswith(before[end:])
    file = ifcopenshell.open(str(rooms))
    assert not faults(file)
    spaces = file.by_type("IfcSpace")
    assert len({s.GlobalId for s in spaces}) == 3
    assert sorted(volume(s) for s in spaces) == pytest.approx([2.5 * a for a in AREAS], rel=1e-4)
    assert sorted(quantities(s)["NetFloorArea"] for s in spaces) == pytest.approx(AREAS, rel=0.01)
    for space in spaces:
        assert quantities(space)["NetVolume"] == pytest.approx(volume(space), rel=1e-6)
        assert ifcopenshell.util.element.get_aggregate(space).Name == "Ground floor"


def test_boundaries_cover_each_room_once_and_name_what_makes_them(written):
    file = ifcopenshell.open(str(written[2]))
    by_space = {}
    doors = []
    for boundary in file.by_type("IfcRelSpaceBoundary"):
        element = boundary.RelatedBuildingElement
        is_virtual = boundary.PhysicalOrVirtualBoundary == "VIRTUAL"
        assert is_virtual == (element is None or element.is_a("IfcVirtualElement"))
        by_space.setdefault(boundary.RelatingSpace, []).append(boundary)
        if element is not None and element.is_a("IfcDoor"):
            doors.append(boundary)
    assert len(by_space) == 3
    for space, boundaries in by_space.items():
        floor = quantities(space)["NetFloorArea"]
        whole = 2 * floor + 2 * 2.5 * (floor / 5 + 5)
        assert sum(map(polygon_area, boundaries)) == pytest.approx(whole, rel=1e-3)
    assert len(doors) == 2
    assert [polygon_area(door) for door in doors] == pytest.approx([2.0, 2.0], rel=1e-3)
    if file.schema != "IFC2X3":
        assert doors[0].CorrespondingBoundary == doors[1] and doors[1].CorrespondingBoundary == doors[0]
        assert all(door.ParentBoundary.RelatedBuildingElement.is_a("IfcWall") for door in doors)


def test_spaces_are_not_doubled(written, command, tmp_path):
    house, world, rooms = written
    # Named after the spaces now.
    named = tmp_path / "named.glb"
    command("bake", "-q", rooms, "--ifc-convert", sys.executable, "-o", named)
    same = tmp_path / "same.ifc"
    said = command.json("export", named, "--ifc", rooms, "-o", same)
    assert (said["spaces_added"], said["spaces_kept"]) == (0, 3)
    again = tmp_path / "again.ifc"
    said = command.json("export", named, "--ifc", rooms, "-o", again, "--replace-spaces", "--first-level")
    assert (said["spaces_replaced"], said["spaces_kept"]) == (3, 0)
    file = ifcopenshell.open(str(again))
    assert not faults(file)
    spaces = file.by_type("IfcSpace")
    old = {s.GlobalId for s in ifcopenshell.open(str(rooms)).by_type("IfcSpace")}
    assert {s.GlobalId for s in spaces} == old
    assert sorted(volume(s) for s in spaces) == pytest.approx([2.5 * a for a in AREAS], rel=1e-4)
    assert {b.Name for b in file.by_type("IfcRelSpaceBoundary")} == {"1stLevel"}
    said = command.refusal("export", world, "--ifc", world, "-o", tmp_path / "no.ifc")
    assert "ISO-10303-21" in said


def places(file):
    """Returns low and high end of each space, in meters."""
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    shapes = [ifcopenshell.geom.create_shape(settings, s).geometry for s in file.by_type("IfcSpace")]
    vertices = [ifcopenshell.util.shape.get_vertices(shape) for shape in shapes]
    return sorted([*v.min(axis=0), *v.max(axis=0)] for v in vertices)


def test_spaces_lie_in_the_model_wherever_the_bake_put_its_origin(written, command, tmp_path):
    house, _, rooms = written
    world, moved = tmp_path / "moved.glb", tmp_path / "moved.ifc"
    command("bake", "-q", house, "--ifc-convert", sys.executable, "--origin", "3.5,2,-1.25", "-o", world)
    command("export", world, "--ifc", house, "-o", moved)
    expected = places(ifcopenshell.open(str(rooms)))
    assert np.allclose(places(ifcopenshell.open(str(moved))), expected, atol=2e-3)
    assert expected[0][2] == pytest.approx(3.0, abs=2e-3)


def test_doors_are_told_with_the_rooms_on_both_sides(written, command, tmp_path):
    house, world, _ = written
    table = tmp_path / "doors.csv"
    command("export", world, "-o", table)
    head, *lines = [line.split(",") for line in table.read_text().splitlines()]
    door = ifcopenshell.open(str(house)).by_type("IfcDoor")[0]
    (row,) = [dict(zip(head, line)) for line in lines if line[1] == "door"]
    assert row["object"] == f"IfcDoor/{door.GlobalId}"
    assert row["name_a"] != row["name_b"]


def test_python_writes_what_the_command_writes(written, command, tmp_path):
    house, path, rooms = written
    world = enfilade.open(path)
    out = tmp_path / "python.ifc"
    report = world.to_ifc(house, out)
    assert out.read_bytes() == rooms.read_bytes()
    assert (report.added, report.replaced, report.kept, report.without_element) == (3, 0, 0, 0)
    with pytest.raises(ValueError, match="ISO-10303-21"):
        world.to_ifc(path, out)
    for name, text in (
        ("house.gbxml", world.to_gbxml()),
        ("house.hbjson", world.to_hbjson()),
        ("house.gml", world.to_indoorgml()),
    ):
        command("export", path, "-o", tmp_path / name)
        assert (tmp_path / name).read_text() == text


def test_honeybee_finds_no_error_and_all_neighbors(written):
    model = Model.from_dict(json.loads(enfilade.open(written[1]).to_hbjson()))
    assert model.check_all(raise_exception=False, detailed=True) == []
    assert sorted(r.floor_area for r in model.rooms) == pytest.approx(AREAS)
    assert sorted(r.volume for r in model.rooms) == pytest.approx([2.5 * a for a in AREAS])
    inner = [f for f in model.faces if f.boundary_condition.name == "Surface"]
    # Two walls, each seen from both sides, with a door or a way in it.
    assert [f.area for f in inner] == pytest.approx([12.5] * 4)
    assert [len(f.doors) for f in inner] == [1] * 4
    assert {f.boundary_condition.name for f in model.faces if f.type.name == "Floor"} == {"Ground"}


def test_surfaces_close_and_answer_each_other(written):
    world = enfilade.open(written[1])
    rooms = world.surfaces()
    assert sorted(rooms) == [room.id for room in world.rooms]
    for cell, surfaces in rooms.items():
        assert np.abs(sum(s.area * np.array(s.normal) for s in surfaces)).max() < 1e-3
        for index, surface in enumerate(surfaces):
            assert all(ring.shape[1] == 3 for ring in surface.loops)
            if surface.behind == "room" and surface.pair is not None:
                answer = rooms[surface.cell][surface.pair]
                assert (answer.cell, answer.pair) == (cell, index)
                assert answer.thickness == pytest.approx(surface.thickness, abs=2e-3)
            if surface.portal is not None:
                assert surface.host is not None and surface.thickness == 0.0
            elif surface.object is not None:
                assert surface.object.startswith("Ifc")
    # The wall between the first two rooms, its parts around the door.
    between = [s for s in rooms[1] if s.behind == "room" and s.portal is None]
    assert {round(s.thickness, 3) for s in between} == {0.2}
    assert len(world.surfaces(level="first")[1]) <= len(rooms[1])
    with pytest.raises(ValueError, match="third"):
        world.surfaces(level="third")


def test_the_sound_of_a_room_is_simulated(written, command, tmp_path):
    folder = tmp_path / "solids"
    command("export", written[1], "--rooms-solid", "-o", folder)
    listed = json.loads((folder / "_rooms.json").read_text())["rooms"]
    assert len(listed) == 3
    for room in listed:
        solid = json.loads((folder / f"{room['file']}.json").read_text())
        walls = []
        absorbing = 0.0
        for wall in solid["walls"]:
            material = pra.Material(wall["absorption"], wall["scattering"])
            corners = np.array(wall["corners"])
            walls.append(pra.wall_factory(corners, material.absorption_coeffs, material.scattering_coeffs, wall["name"]))
            absorbing += walls[-1].area() * wall["absorption"]["coeffs"][3]
        simulated = pra.Room(walls, fs=16000, max_order=0, ray_tracing=True)
        assert simulated.get_volume() == pytest.approx(solid["volume"], rel=1e-4)
        assert absorbing > 0.0


def test_a_model_by_honeybee_becomes_its_rooms(tmp_path):
    """Two rooms of boxes with a door between them and a window, and a gallery behind a wall of air; all by Honeybee's own functions."""
    names = ["101 Office", "102 Office", "Gallery"]
    boxes = [((0, 0, 0), (4, 5, 3)), ((4, 0, 0), (5, 5, 3)), ((0, 5, 0), (9, 3, 3))]
    rooms = []
    for i, ((x, y, z), size) in enumerate(boxes):
        room = Room.from_box(f"room{i}", *size, origin=Point3D(x, y, z))
        room.display_name = names[i]
        rooms.append(room)
    wall = next(f for f in rooms[0].faces if f.normal.x > 0.9)
    opening = [Point3D(4, y, z) for y, z in ((1, 0), (2, 0), (2, 2), (1, 2))]
    wall.add_door(Door("door0", Face3D(opening)))
    other = next(f for f in rooms[1].faces if f.normal.x < -0.9)
    other.add_door(Door("door1", Face3D(opening[::-1])))
    next(f for f in rooms[1].faces if f.normal.x > 0.9).apertures_by_ratio(0.2)
    Room.intersect_adjacency(rooms, 0.01, 1)
    Room.solve_adjacency(rooms, 0.01)
    for room in rooms:
        for face in room.faces:
            if face.boundary_condition.name == "Surface" and len({"room0", "room2"} & ends(face)) == 2:
                face.type = face_types.air_boundary
    path = tmp_path / "house.hbjson"
    path.write_text(json.dumps(Model("house", rooms, units="Meters").to_dict()))
    with pytest.warns(enfilade.BakeWarning, match="named after rooms"):
        world = enfilade.bake(str(path))
    found = {room.name: room.floor_area for room in world.rooms}
    # The wall of air between the first room and the gallery is nothing, so they are one.
    assert len(found) == 2 and found["102 Office"] == pytest.approx(25.0, rel=0.01)
    assert sum(found.values()) == pytest.approx(20.0 + 25.0 + 27.0, rel=0.01)
    kinds = sorted(p.kind for p in world.portals if p.kind != "crack")
    assert kinds == ["door", "window"]


def ends(face):
    """Names of the rooms on both sides of a face."""
    return {face.parent.identifier, face.boundary_condition.boundary_condition_objects[-1]}
