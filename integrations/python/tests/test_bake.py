"""Input of bakes: arrays, meshes, files, settings, and what is wrong with them."""

import os
import pickle
import re
import signal
import threading
import time
import types

import numpy as np
import pytest
import trimesh

import enfilade
from conftest import box, two_rooms


def rooms_of(world):
    return [(c.kind, round(c.volume, 3)) for c in world.cells]


def test_two_rooms_have_a_doorway_between_them():
    vertices, faces = two_rooms()
    world = enfilade.bake(vertices, faces)
    rooms = sorted(c.volume for c in world.cells if c.kind == "room")
    np.testing.assert_allclose(rooms, [60, 75], rtol=1e-4)
    assert len(world.cells) == 3
    assert len(world.portals) == 1
    portal = world.portals[0]
    np.testing.assert_allclose(portal.size, [0.9, 2.1], atol=1e-4)
    np.testing.assert_allclose(portal.center, [5, 1.05, 2.45], atol=1e-4)
    assert portal.polygon.shape[1] == 3 and portal.polygon.dtype == np.float32


@pytest.mark.parametrize("floats", ["f4", "f8", ">f8", "i4"])
@pytest.mark.parametrize("integers", ["i4", "i8", "u4", "u8", "i2", ">i4"])
def test_types_of_numbers_do_not_matter(floats, integers):
    vertices, faces = box((0, 0, 0), (4, 3, 5))
    expected = bytes(enfilade.bake(vertices, faces))
    assert bytes(enfilade.bake(vertices.astype(floats), faces.astype(integers))) == expected


def test_strides_and_lists_do_not_matter():
    vertices, faces = box((0, 0, 0), (4, 3, 5))
    expected = bytes(enfilade.bake(vertices, faces))
    wide = np.zeros((len(vertices), 6))
    wide[:, ::2] = vertices
    assert bytes(enfilade.bake(wide[:, ::2], np.asfortranarray(faces))) == expected
    assert bytes(enfilade.bake(vertices.tolist(), faces.tolist())) == expected
    vertices.flags.writeable = False
    assert bytes(enfilade.bake(vertices, faces)) == expected


def test_a_mesh_of_trimesh_is_its_arrays():
    mesh = trimesh.Trimesh(*two_rooms(), process=False)
    assert bytes(enfilade.bake(mesh)) == bytes(enfilade.bake(*two_rooms()))


def test_a_mesh_of_open3d_has_triangles():
    vertices, faces = two_rooms()
    mesh = types.SimpleNamespace(vertices=vertices.tolist(), triangles=faces.tolist())
    assert bytes(enfilade.bake(mesh)) == bytes(enfilade.bake(vertices, faces))


def test_nodes_of_a_trimesh_scene_place_and_name_its_meshes():
    scene = trimesh.Scene()
    shell = trimesh.Trimesh(*box((0, 0, 0), (4, 3, 5)), process=False)
    move = np.eye(4)
    scene.add_geometry(shell, node_name="one room", geom_name="shell")
    move[0, 3] = 20
    scene.add_geometry(shell, node_name="another", geom_name="shell", transform=move)
    scene.add_geometry(trimesh.creation.box((1, 1, 1)), node_name="chair", geom_name="chair")
    world = enfilade.bake(scene)
    assert world.cells.kinds.count("room") == 2
    here, there = world.locate([[1, 2, 4], [21, 2, 4]])
    assert min(here, there) >= 0 and here != there
    seen = world.see([2, 1.5, 4], [2, 1.5, 0])
    assert len(seen.details) == 1, "the chair is furniture by its name"


def test_names_come_from_mappings_meshes_and_metadata():
    shell, chair = box((0, 0, 0), (4, 3, 5)), box((1, 0, 1), (1.5, 1, 1.5))
    given = [
        {"walls": shell, "chair": chair},
        [enfilade.Mesh(*shell, name="walls"), enfilade.Mesh(*chair, name="chair")],
        [
            trimesh.Trimesh(*shell, process=False, metadata={"name": "walls"}),
            trimesh.Trimesh(*chair, process=False, metadata={"name": "chair"}),
        ],
    ]
    worlds = {bytes(enfilade.bake(meshes)) for meshes in given}
    assert len(worlds) == 1
    as_detail = [
        enfilade.bake({"walls": shell}, detail={"thing": chair}),
        enfilade.bake({"walls": shell, "thing": chair}, detail_names="th?ng"),
        enfilade.bake({"walls": shell, "thing": chair}, settings={"detail_names": ["thing"]}),
        enfilade.bake([enfilade.Mesh(*shell, "walls"), enfilade.Mesh(*chair, "thing", detail=True)]),
    ]
    for world in as_detail:
        assert len(world.see([0.5, 1, 3], [1.2, 0.5, 1.2]).details) == 1


def test_units_and_axes():
    vertices, faces = two_rooms()
    up_z = np.column_stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]]) * 1000
    world = enfilade.bake(up_z, faces, unit="mm", up="z")
    assert rooms_of(world) == rooms_of(enfilade.bake(vertices, faces))
    assert rooms_of(enfilade.bake(up_z, faces, unit=0.001, up="z")) == rooms_of(world)
    in_file = {"unit": np.float32(0.001), "up": "z"}
    assert rooms_of(enfilade.bake(up_z, faces, settings=in_file)) == rooms_of(world)


def test_coordinates_of_maps_lose_nothing():
    vertices, faces = two_rooms()
    offset = np.array([50_000.125, 0, -60_000.375])
    world = enfilade.bake(vertices + offset, faces)
    assert world.cells.kinds.count("room") == 2


def test_settings_come_from_a_mapping_or_a_file_and_arguments_take_precedence(tmp_path):
    vertices, faces = two_rooms()
    file = tmp_path / "enfilade.toml"
    file.write_text("min_opening = 0.7\n[merge]\nmin_radius = 0.2\n")
    of_file = enfilade.bake(vertices, faces, settings=file)
    of_mapping = enfilade.bake(vertices, faces, settings={"min_opening": 0.7, "merge": {"min_radius": 0.2}})
    assert bytes(of_file) == bytes(of_mapping)
    assert of_file.provenance["min_opening"] == "0.7"
    given = enfilade.bake(vertices, faces, settings=file, min_opening=0.8)
    assert given.provenance["min_opening"] == "0.8"
    with pytest.warns(enfilade.BakeWarning, match="1 of 3 cells named"):
        named = enfilade.bake(vertices, faces, settings={"names": {"Hall": [1, 1.5, 2]}})
    assert named.cells["Hall"].id == named.locate([1, 1.5, 2])
    for settings, word in [
        ({"names": {"Hall": [1, 2]}}, "three numbers"),
        ({"voxell": 1}, "`voxell`"),
        ({"unit": "feet"}, "ft"),
        ({"min_opening": -1}, "above 0"),
        ({"bsp": {"min_cost": 3, "max_cost": 2}}, "max_cost"),
    ]:
        with pytest.raises(ValueError, match=word):
            enfilade.bake(vertices, faces, settings=settings)
    file.write_text("\nvoxel = -1")
    with pytest.raises(ValueError, match="line 2"):
        enfilade.bake(vertices, faces, settings=file)
    with pytest.raises(ValueError, match="method"):
        enfilade.bake(vertices, faces, method="magic")
    with pytest.raises(ValueError, match="above 0"):
        enfilade.bake(vertices, faces, min_opening=0)


def test_wrong_arrays_are_refused_with_the_row():
    vertices, faces = box((0, 0, 0), (4, 3, 5))
    holed = vertices.copy()
    holed[3, 1] = np.nan
    far = faces.copy()
    far[5, 2] = 8
    below = faces.copy()
    below[2, 0] = -1
    for args, words in [
        ((holed, faces), [r"vertices\[3\]", "finite"]),
        ((holed.astype("f4"), faces), [r"vertices\[3\]", "finite"]),
        ((vertices, far), [r"faces\[5\]", "from 0 to 7"]),
        ((vertices, below.astype("i4")), [r"faces\[2\]", "-1"]),
        ((vertices, faces + 2**33), [r"faces\[0\]", "from 0 to 7"]),
        ((vertices[:, :2], faces), [r"vertices has the shape \(8, 2\)", r"\(n, 3\)"]),
        ((vertices.ravel(), faces), [r"\(24,\)"]),
        ((vertices, np.ones((2, 4), int)), [r"faces has the shape \(2, 4\)"]),
        ((vertices, faces.astype(float)), ["faces has the type float64", "integers"]),
        ((vertices.astype(str), faces), ["vertices has the type", "numbers"]),
        ((vertices + 0j, faces), ["complex128"]),
        (({"wall": (vertices, far)},), [r"faces\[5\]"]),
        (({"a": (vertices, faces), "wall": (vertices, far)},), [r"mesh 'wall': faces\[5\]"]),
        ((np.empty((0, 3)), faces), ["no vertices"]),
    ]:
        with pytest.raises(ValueError) as error:
            enfilade.bake(*args)
        for word in words:
            assert re.search(word, str(error.value)), (word, str(error.value))
    for wrong in [3, None, [1, 2, 3], {"wall": 3}]:
        with pytest.raises(TypeError, match="expected a mesh"):
            enfilade.bake(wrong)


def test_scenes_that_hold_no_rooms_are_errors_that_name_arguments():
    vertices, faces = box((0, 0, 0), (4, 3, 5))
    with pytest.raises(enfilade.BakeError, match=r"no room was found: .*structural_names=\['PATTERN'\].*; allow_empty=True returns"):
        enfilade.bake(vertices, faces[:2])
    with pytest.warns(enfilade.BakeWarning, match="no room was found"):
        world = enfilade.bake(vertices, faces[:2], allow_empty=True)
    assert world.cells.kinds == ["outdoors"]
    assert world.verdict.startswith("trust: none")
    with pytest.raises(enfilade.SceneError, match="unit="):
        enfilade.bake(vertices * 1000, faces)
    with pytest.raises(enfilade.EnfiladeError):
        enfilade.bake(vertices, faces[:0])
    with pytest.raises(enfilade.BakeError, match="no structural"):
        enfilade.bake({"chair": (0.2 * vertices, faces)})
    # Alone and as large as a room, it is one, whatever it is called.
    assert enfilade.bake({"chair": (vertices, faces)}).cells.kinds.count("room") == 1
    with pytest.raises(enfilade.BakeError, match="max_time"):
        enfilade.bake(vertices, faces, max_time=0)


def test_doubts_are_warnings():
    text = r"1 of 3 rooms without a doorway \(try detail_names=\['PATTERN'\]\)"
    with pytest.warns(enfilade.BakeWarning, match=text) as caught:
        enfilade.bake({"two": two_rooms(), "one": box((30, 0, 0), (34, 3, 5))})
    assert caught[0].filename == __file__


def test_progress_is_told_in_this_thread_and_its_exception_ends_the_bake():
    stages = []

    def told(stage, number, count):
        stages.append((stage, number, count, threading.get_ident()))

    enfilade.bake(*two_rooms(), progress=told)
    numbers = [s[1] for s in stages]
    assert numbers == sorted(numbers) and numbers[0] == 1 and numbers[-1] == stages[0][2]
    assert {s[3] for s in stages} == {threading.get_ident()}

    def broken(stage, number, count):
        raise LookupError(stage)

    with pytest.raises(LookupError):
        enfilade.bake(*two_rooms(), progress=broken)


def large():
    """Returns a grid of rooms that takes long to bake."""
    parts = [box((12 * i, 4 * k, 12 * j), (12 * i + 10, 4 * k + 3, 12 * j + 10)) for i in range(12) for j in range(12) for k in range(3)]
    n = np.cumsum([0] + [len(v) for v, _ in parts])
    return np.concatenate([v for v, _ in parts]), np.concatenate([f + k for (_, f), k in zip(parts, n)])


def test_an_interrupt_ends_a_bake():
    vertices, faces = large()
    sent = []

    def interrupt(stage, number, count):
        if number == 2 and not sent:
            sent.append(time.monotonic())
            threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()

    with pytest.raises(KeyboardInterrupt):
        enfilade.bake(vertices, faces, progress=interrupt)
    assert sent
    # The process goes on as before.
    assert len(enfilade.bake(*two_rooms()).portals) == 1


def test_other_threads_run_during_a_bake():
    counted = [0]
    is_over = threading.Event()

    def count():
        while not is_over.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    try:
        before = counted[0]
        enfilade.bake(enfilade.demo_house())
        assert counted[0] > before + 20
    finally:
        is_over.set()
        thread.join()


def test_threads_do_not_change_a_world():
    one = bytes(enfilade.bake(enfilade.demo_house(), threads=1))
    assert bytes(enfilade.bake(enfilade.demo_house()[::-1], threads=2)) == one


def test_files_are_baked_as_by_the_command(command, tmp_path):
    command("demo", "-o", tmp_path)
    baked = enfilade.bake_file(tmp_path / "house.glb")
    assert bytes(baked) == (tmp_path / "world.glb").read_bytes()
    assert bytes(enfilade.bake_file([str(tmp_path / "house.glb")], threads=1)) == bytes(baked)
    assert bytes(enfilade.bake(tmp_path / "house.glb")) == bytes(baked)
    # Arrays have no materials, but the same rooms.
    of_arrays = enfilade.bake(enfilade.demo_house())
    volumes = [np.sort(w.cells.volumes[1:]) for w in (of_arrays, baked)]
    np.testing.assert_allclose(*volumes, rtol=0.01)
    of_trimesh = enfilade.bake(trimesh.load(tmp_path / "house.glb"))
    assert len(of_trimesh.cells) == len(baked.cells)
    assert of_trimesh.portals.kinds.count("door") == baked.portals.kinds.count("door")


def test_files_that_are_missing_or_no_scenes_are_errors_of_the_command(command, tmp_path):
    missing = tmp_path / "missing.glb"
    with pytest.raises(FileNotFoundError) as error:
        enfilade.bake_file(missing)
    assert str(error.value) in command.refusal("bake", missing, "-o", tmp_path / "w.glb")
    text = tmp_path / "text.glb"
    text.write_text("no scene")
    with pytest.raises(enfilade.SceneError) as error:
        enfilade.bake_file(text)
    assert str(error.value) in command.refusal("bake", text, "-o", tmp_path / "w.glb")


LEAKING_MAP = """{
"classname" "worldspawn"
%s
}
{
"classname" "info_player_start"
"origin" "64 64 32"
}
"""


def brush(low, high):
    """Returns a cuboid of a Quake map."""
    (a, b, c), (x, y, z) = low, high
    planes = [
        ((a, 0, 0), (a, 1, 0), (a, 0, 1)),
        ((x, 0, 0), (x, 0, 1), (x, 1, 0)),
        ((0, b, 0), (0, b, 1), (1, b, 0)),
        ((0, y, 0), (1, y, 0), (0, y, 1)),
        ((0, 0, c), (1, 0, c), (0, 1, c)),
        ((0, 0, z), (0, 1, z), (1, 0, z)),
    ]
    lines = [" ".join("( %g %g %g )" % p for p in plane) + " wall 0 0 0 1 1" for plane in planes]
    return "{\n" + "\n".join(lines) + "\n}"


def test_a_map_that_leaks_is_an_error_of_the_command(command, tmp_path):
    walls = [
        brush((-8, -8, -8), (136, 136, 0)),
        brush((-8, -8, 0), (0, 136, 136)),
        brush((128, -8, 0), (136, 136, 136)),
        brush((0, -8, 0), (128, 0, 136)),
        brush((-8, -8, 136), (136, 136, 144)),
    ]
    path = tmp_path / "open.map"
    path.write_text(LEAKING_MAP % "\n".join(walls))
    with pytest.raises(enfilade.BakeError, match="allow_leak=True") as error:
        enfilade.bake_file(path)
    said = str(error.value).split(";")[0]
    assert said.startswith("the map leaks: info_player_start")
    assert said in command.refusal("bake", path, "-o", tmp_path / "w.glb")


def test_worlds_travel_as_files_bytes_and_pickles(tmp_path):
    world = enfilade.bake(*two_rooms())
    path = tmp_path / "world.glb"
    world.save(path)
    assert path.read_bytes() == bytes(world)
    for copy in (enfilade.open(path), enfilade.World.from_bytes(bytes(world)), pickle.loads(pickle.dumps(world))):
        assert bytes(copy) == bytes(world)
    with pytest.raises(FileNotFoundError):
        enfilade.open(tmp_path / "none.glb")
    with pytest.raises(FileNotFoundError):
        world.save(tmp_path / "nowhere" / "world.glb")
    for damaged in (b"", b"glTF", bytes(world)[:-1], bytes(world)[:1000]):
        with pytest.raises(enfilade.WorldError):
            enfilade.World.from_bytes(damaged)
    path.write_bytes(b"no world")
    with pytest.raises(enfilade.WorldError, match="world.glb"):
        enfilade.open(path)
