"""Answers of worlds, compared with those of the command."""

import json
import re
import sys

import numpy as np
import pytest

import enfilade

# Points of the demo house, a little above the floor.
BEDROOM, BATH = [9, 3, 6.5], [5.75, 3, 1.25]


def test_cells_and_portals_are_sequences_with_columns(world):
    cells, portals = world.cells, world.portals
    assert len(cells) == 13 and len(portals) == len(list(portals))
    assert [c.id for c in cells] == list(range(len(cells)))
    assert cells[-1].id == len(cells) - 1 and [c.id for c in cells[1:3]] == [1, 2]
    assert cells[cells[3].name].id == 3
    assert repr(cells) == "<Cells: 12 room, 1 outdoors>"
    assert sum(c.outdoors for c in cells) == 1
    assert cells.bounds.shape == (13, 2, 3) and cells.volumes.dtype == np.float32
    for cell in cells:
        for p in cell.portals:
            assert cell.id in portals[p].cells
    assert portals.cells.shape == (len(portals), 2)
    assert (portals.cells[:, 0] != portals.cells[:, 1]).all()
    np.testing.assert_allclose(np.linalg.norm(portals.normals, axis=1), 1, atol=1e-5)
    for index in (len(cells), -len(cells) - 1):
        with pytest.raises(IndexError):
            cells[index]
    with pytest.raises(KeyError, match="nowhere"):
        cells["nowhere"]
    with pytest.raises(ValueError, match="read-only"):
        cells.volumes[0] = 1


def test_decisions_are_those_of_the_command(world, command, tmp_path):
    world.save(tmp_path / "w.glb")
    said = command.json("inspect", tmp_path / "w.glb", "--why", "all")["whys"]
    things = [*world.cells, *world.portals]
    assert all(len(thing.why) > 0 for thing in things)
    whys = [why for thing in things for why in thing.why] + [place.why for place in world.places]
    assert sorted(why.text for why in whys) == sorted(why["text"] for why in said)
    for why in whys:
        assert 0 <= why.margin <= 1 and str(why) == why.text
        assert (why.limit is None) or why.facts
    of_portal = {why["portal"]: why for why in said if "portal" in why}
    for portal in world.portals:
        (why,) = portal.why
        found = of_portal[portal.id]
        assert (why.reason, why.facts.keys()) == (found["reason"], found.get("facts", {}).keys())


def test_rooms_have_the_facts_that_the_command_prints(world, command, tmp_path):
    world.save(tmp_path / "w.glb")
    told = {c["id"]: c for c in command.json("inspect", tmp_path / "w.glb")["cells"]}
    assert [room.id for room in world.rooms] == [c.id for c in world.cells if c.kind == "room"]
    for room in world.rooms:
        cell = told[room.id]
        assert (room.name, list(room.storeys)) == (cell["name"], cell["storeys"])
        assert (room.doors, room.windows) == (cell["doors"], cell["windows"])
        assert room.floor_area == pytest.approx(cell["floor_area"], abs=1e-3)
        assert room.area_above_1_5 == pytest.approx(cell["area_above_1_5"], abs=1e-3)
        assert room.area_above_2_3 == pytest.approx(cell["area_above_2_3"], abs=1e-3)
        assert room.height == pytest.approx(cell["height"], abs=1e-3) and 2 < room.height < 4


def test_rooms_have_outlines_as_large_as_their_floors(world):
    polygons = world.polygons()
    assert set(polygons) == {room.id for room in world.rooms}
    attic = world.storeys[-1].name
    for room in world.rooms:
        # Recesses of doors and windows are on the plan and no floor area; its lines are as exact as its sampling grid.
        area = polygons[room.id].area
        assert area < 1.08 * room.floor_area, room.name
        # The cut is 1.2 m above the floor, where a roof leaves less.
        assert attic in room.storeys or area > 0.92 * room.floor_area, room.name
        assert room.kind == "room" and room.volume == world.cells[room.id].volume
        low, high = world.cells[room.id].bounds[:, [0, 2]]
        least_x, least_z, most_x, most_z = polygons[room.id].bounds
        assert (low - 0.1 < (least_x, least_z)).all() and (high + 0.1 > (most_x, most_z)).all()


def test_windows_to_the_outdoors_count_for_daylight(world):
    areas = {room.id: 0.0 for room in world.rooms}
    for portal in world.portals:
        kinds = [world.cells[cell].kind for cell in portal.cells]
        if portal.kind == "window" and sorted(kinds) == ["outdoors", "room"]:
            areas[portal.cells[kinds.index("room")]] += portal.area
    assert sum(areas.values()) > 5
    for room in world.rooms:
        assert room.window_area == pytest.approx(areas[room.id], rel=1e-5)


def test_tables_have_rooms_portals_and_visibility(world):
    rooms = world.to_dataframe()
    assert list(rooms.index) == [room.id for room in world.rooms]
    assert rooms.floor_area.sum() == pytest.approx(sum(room.floor_area for room in world.rooms))
    portals = world.to_dataframe("portals")
    assert len(portals) == len(world.portals)
    first = portals.loc[0]
    assert (first.kind, first.cell) == (world.portals[0].kind, world.cells[world.portals[0].cells[0]].name)
    assert [first.x, first.y, first.z] == pytest.approx(list(world.portals[0].center))
    seen = world.to_dataframe("visibility")
    assert (seen.to_numpy() == world.pvs().matrix()).all() and list(seen.columns) == world.cells.names
    with pytest.raises(ValueError, match="expected 'rooms'"):
        world.to_dataframe("doors")


def test_points_are_located(world):
    middle = [2, 1, 2]
    cell = world.locate(middle)
    assert isinstance(cell, int) and cell >= 0
    points = np.array([middle, [1e6, 0, 0], middle])
    found = world.locate(points)
    assert found.dtype == np.int32 and found.tolist()[0::2] == [cell, cell]
    assert (world.locate(points.astype("f4")) == found).all()
    assert (world.locate(np.asfortranarray(points)) == found).all()
    assert world.locate(np.empty((0, 3))).shape == (0,)
    points[1, 2] = np.inf
    with pytest.raises(ValueError, match=r"points\[1\]"):
        world.locate(points)
    for wrong in ([1, 2], [[1, 2]], "point", [[1, 2, None]]):
        with pytest.raises(ValueError, match="points"):
            world.locate(wrong)


def test_shut_doors_end_views(world):
    cell = world.cells[world.locate([2, 1, 2])]
    eye = [2, 1, 2]
    view = world.see(eye, [3, 1, 2], fov=360)
    assert view.eye_cell == cell.id and view.cells[0] == cell.id and len(view.cells) > 1
    assert view.draws.shape[1] == 3 and 0 < view.triangles <= view.of_triangles
    assert world.see(eye, [3, 1, 2], fov=360, closed=cell.portals).cells.tolist() == [cell.id]
    portals = [world.portals[p] for p in cell.portals]
    assert world.see(eye, [3, 1, 2], fov=360, closed=portals).cells.tolist() == [cell.id]
    with pytest.raises(IndexError, match="portal 999"):
        world.see(eye, [3, 1, 2], closed=[999])
    for wrong in ({"eye": [0, 0], "look": [1, 1, 1]}, {"eye": eye, "look": eye}, {"eye": eye, "look": [1, np.nan, 1]}):
        with pytest.raises(ValueError):
            world.see(**wrong)
    with pytest.raises(ValueError):
        world.see(eye, [3, 1, 2], fov=-1)


def test_views_lie_in_the_potentially_visible_set(world):
    pvs = world.pvs()
    matrix = pvs.matrix()
    assert matrix.shape == (13, 13) and matrix.diagonal().all()
    assert [row.nonzero()[0].tolist() for row in matrix] == [pvs.visible_from(c).tolist() for c in range(13)]
    scipy_sparse = pytest.importorskip("scipy.sparse")
    rows = scipy_sparse.csr_array((pvs.data, pvs.indices, pvs.indptr), shape=matrix.shape)
    assert (rows.toarray() == matrix).all()
    rng = np.random.default_rng(5)
    bounds = world.cells.bounds[np.array(world.cells.kinds) == "room"]
    for low, high in bounds:
        eye = rng.uniform(low, high)
        view = world.see(eye, eye + rng.normal(size=3), fov=90)
        if view.eye_cell >= 0:
            assert matrix[view.eye_cell, view.cells].all()
    fast = world.pvs(fast=True).matrix()
    assert (fast >= matrix).all()


def test_a_saved_set_is_read_again(world, tmp_path):
    world.save(tmp_path / "with.glb", pvs=True)
    again = enfilade.open(tmp_path / "with.glb")
    assert (again.pvs().matrix() == world.pvs().matrix()).all()
    assert len(bytes(again)) > len(bytes(world))


def test_walks_pass_doors_but_not_shut_ones(world):
    walk = world.path(BEDROOM, BATH)
    assert walk.length >= walk.length_in_plan > 4
    assert walk.points.shape[1] == 3
    np.testing.assert_allclose(walk.points[[0, -1]], [BEDROOM, BATH], atol=0.2)
    assert len(walk.cells) == len(walk.portals) + 1
    assert walk.cells[0] == world.locate(BEDROOM)
    with pytest.raises(enfilade.NoPathError, match=r"no way that a walker can go: portal-\d+, .* is closed; one gets \d+\.\d\d m far"):
        world.path(BEDROOM, BATH, closed=walk.portals)
    with pytest.raises(enfilade.NoPathError, match="no floor"):
        world.path(BEDROOM, [2, 500, 2])
    with pytest.raises(ValueError, match="radius"):
        world.path(BEDROOM, BATH, radius=-1)


def test_graphs_have_a_node_for_each_cell_and_an_edge_for_each_portal(world):
    graph = world.to_networkx()
    assert graph.number_of_nodes() == len(world.cells)
    assert graph.number_of_edges() == len(world.portals)
    for one, other, key, kind in graph.edges(keys=True, data="kind"):
        assert {one, other} == set(world.portals[key].cells)
        assert kind == world.portals[key].kind
    assert graph.nodes[0]["name"] == world.cells[0].name


@pytest.mark.parametrize("package, call", [("networkx", "to_networkx"), ("matplotlib.pyplot", "plot"), ("pandas", "to_dataframe"), ("shapely", "polygons")])
def test_a_package_that_is_missing_is_named_with_its_remedy(world, monkeypatch, package, call):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError, match=f"pip install {package.split('.')[0]}"):
        getattr(world, call)()


def test_plans_show_all_rooms(world):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    svg = world._repr_svg_()
    assert svg.startswith("<?xml") or svg.startswith("<svg")
    shown = set()
    for storey in world.storeys:
        figure, ax = pyplot.subplots()
        assert world.plot(ax, storey=storey.name) is ax
        kinds = {patch.get_gid() for patch in ax.patches}
        assert {"cell", "wall", "label"} <= kinds, kinds
        low, high = world.cells.bounds[list(storey.cells)].reshape(-1, 3)[:, [0, 2]].min(axis=0), 0
        (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
        assert left <= low[0] <= right and top <= low[1] <= bottom, "z points down"
        shown.update(storey.cells)
        pyplot.close(figure)
    axes = world.plot()
    assert [ax.get_title() for ax in axes] == [f"storey {storey.name}" for storey in world.storeys]
    pyplot.close("all")
    assert shown >= {c.id for c in world.cells if c.kind == "room"}
    with pytest.raises(ValueError, match="the storeys are"):
        world.plan_svg("cellar")
    with pytest.raises(ValueError, match="height"):
        world.plot(height=-1)
    pyplot.close("all")


def probes(world, n, seed):
    """Returns random points in and around a world, that text gives back exactly."""
    rng = np.random.default_rng(seed)
    rooms = [c.bounds for c in world.cells if c.kind != "outdoors"] or [world.cells.bounds[0]]
    low, high = np.min([b[0] for b in rooms], axis=0) - 1, np.max([b[1] for b in rooms], axis=0) + 1
    return rng.uniform(low, high, (n, 3)).round(3)


def text(point):
    return ",".join(repr(float(c)) for c in point)


def test_answers_are_those_of_the_command(command, worlds):
    for path in worlds:
        world = enfilade.open(path)
        points = probes(world, 2000, 1)
        lines = "".join(" ".join(map(repr, p)) + "\n" for p in points.tolist())
        located = command.json("locate", path, stdin=lines)["cells"]
        expected = [-1 if c is None else c for c in located]
        assert world.locate(points).tolist() == expected, path
        # In more than three cells, solid among them, or in all of a world of one room.
        assert len(set(expected)) > min(3, len(world.cells))

        told = command.json("inspect", path)
        assert [c["name"] for c in told["cells"]] == world.cells.names
        assert [c["kind"] for c in told["cells"]] == world.cells.kinds
        assert [c["portals"] for c in told["cells"]] == [list(c.portals) for c in world.cells]
        np.testing.assert_array_equal(np.float32([c["volume"] for c in told["cells"]]), world.cells.volumes)
        np.testing.assert_array_equal(np.float32([c["aabb"] for c in told["cells"]]), world.cells.bounds)
        assert [p["cells"] for p in told["portals"]] == world.portals.cells.tolist()
        assert [p["kind"] for p in told["portals"]] == world.portals.kinds
        for of_command, portal in zip(told["portals"], world.portals):
            np.testing.assert_array_equal(np.float32(of_command["outline"]), portal.polygon)
            assert np.float32(of_command["area"]) == np.float32(portal.area)
            np.testing.assert_array_equal(np.float32([of_command["width"], of_command["height"]]), portal.size)
        assert world.provenance["input_hash"] == told["stats"]["input_hash"]
        assert world.counts["input_triangles"] == told["stats"]["input_triangles"]

        inside = points[world.locate(points) >= 0]
        for eye, look in zip(inside[:6], inside[6:12]):
            seen = command.json("see", path, f"--eye={text(eye)}", f"--look={text(look)}", "--fov", 80)
            view = world.see(eye, look, fov=80)
            assert view.eye_cell == (-1 if seen["eye_cell"] is None else seen["eye_cell"])
            assert view.cells.tolist() == seen["cells"]
            assert view.portals.tolist() == seen["portals"]
            assert view.batches.tolist() == seen["batches"]
            assert view.details.tolist() == seen["details"]
            assert view.triangles == seen["counts"]["triangles"] + seen["counts"]["detail_triangles"]


def test_sets_walks_and_plans_are_those_of_the_command(command, worlds, tmp_path):
    path = worlds[0]
    world = enfilade.open(path)
    into = tmp_path / "pvs.glb"
    command("pvs", path, "--into", into, "-o", tmp_path / "world.pvs")
    assert (enfilade.open(into).pvs().matrix() == world.pvs().matrix()).all()
    walked = command.json("path", path, f"--from={text(BEDROOM)}", f"--to={text(BATH)}")
    walk = world.path(BEDROOM, BATH)
    assert walk.length == walked["length"]
    assert walk.cells == tuple(walked["cells"]) and walk.portals == tuple(walked["portals"])
    np.testing.assert_array_equal(walk.points, walked["points"])
    assert world.plan_svg() == command("plan", path, "-o", "-")
    assert re.match("trust: (good|fair|low)", world.verdict)
