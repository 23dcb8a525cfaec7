//! Boundaries of rooms: closed, as large as the cells, with the right spaces behind.

use enfilade_cpg::{CellId, World};
use enfilade_export::{
    Behind, BoundarySurface, RoomSurfaces, SurfaceCover, SurfaceLevel, SurfaceOptions,
    room_surfaces,
};
use enfilade_geom::DVec3;
use enfilade_testkit::{GridParams, furnished_house, room_grid, rotated};

use crate::common::{baked, house};

fn level(level: SurfaceLevel) -> SurfaceOptions {
    SurfaceOptions {
        level,
        ..SurfaceOptions::default()
    }
}

fn closes(world: &World, room: &RoomSurfaces) {
    let cell = &world.graph[room.cell];
    let off = (room.volume / f64::from(cell.volume) - 1.0).abs();
    assert_eq!(room.n_open_edges, 0, "{}", cell.name);
    assert!(room.gap <= 1e-3, "{}: {}", cell.name, room.gap);
    assert!(off <= 0.005, "{}: {off}", cell.name);
}

/// Steps along the normal from the surface until there is air again: an oracle that shares no code but the tree.
fn marched(world: &World, from: DVec3, normal: DVec3) -> Option<CellId> {
    // Welding moves vertices by two millimeters.
    let steps = (4..1500).map(|k| from + normal * (0.001 * f64::from(k)));
    steps.filter_map(|p| world.graph.locator.locate(p)).next()
}

/// Middles of the triangles of a fan around the outer loop, of surfaces without holes that are convex.
fn inner_points(surface: &BoundarySurface) -> Vec<DVec3> {
    if surface.loops.len() != 1 {
        return Vec::new();
    }
    let ring: Vec<DVec3> = surface.loops[0].iter().map(|&p| DVec3::from(p)).collect();
    let normal = DVec3::from(surface.normal);
    let n = ring.len();
    let turn = |i: usize| {
        let [a, b, c] = [ring[i], ring[(i + 1) % n], ring[(i + 2) % n]];
        (b - a).cross(c - b).dot(normal)
    };
    if (0..n).any(|i| turn(i) < 0.0) {
        return Vec::new();
    }
    let triangles = ring[1..].windows(2).map(|e| [ring[0], e[0], e[1]]);
    let large = triangles.filter(|[a, b, c]| (*b - *a).cross(*c - *a).length() > 0.02);
    large.map(|[a, b, c]| (a + b + c) / 3.0).collect()
}

fn neighbors_are_those_of_a_march(world: &World) -> usize {
    let mut n = 0;
    for room in room_surfaces(world, &level(SurfaceLevel::Second)) {
        for surface in &room.surfaces {
            for p in inner_points(surface) {
                n += 1;
                let found = marched(world, p, DVec3::from(surface.normal));
                let is_right = match surface.behind {
                    Behind::Cell(cell) => found == Some(cell),
                    Behind::Ground => found.is_none_or(|c| world.graph[c].outdoor),
                    Behind::Matter => found.is_none(),
                };
                assert!(is_right, "{:?} {found:?} {surface:?}", room.cell);
            }
        }
    }
    n
}

#[test]
fn rooms_of_the_house_close_at_both_levels() {
    let world = house();
    for level in [SurfaceLevel::First, SurfaceLevel::Second].map(level) {
        let rooms = room_surfaces(&world, &level);
        assert_eq!(rooms.len(), world.graph.indoor_cells().count());
        rooms.iter().for_each(|room| closes(&world, room));
    }
    assert!(neighbors_are_those_of_a_march(&world) > 100);
}

#[test]
fn turned_houses_close_too() {
    let world = baked(&rotated(furnished_house(), 17.0));
    let rooms = room_surfaces(&world, &SurfaceOptions::default());
    rooms.iter().for_each(|room| closes(&world, room));
    assert!(neighbors_are_those_of_a_march(&world) > 100);
}

#[test]
fn sheets_without_thickness_have_two_sides() {
    let mut n_sheets = 0;
    for seed in 0..6 {
        let world = room_grid(&GridParams {
            size: [3, 2, 2],
            seed,
            doors: 0.7,
            ..GridParams::two_rooms()
        });
        let rooms = room_surfaces(&world, &SurfaceOptions::default());
        rooms.iter().for_each(|room| closes(&world, room));
        for surface in rooms.iter().flat_map(|r| &r.surfaces) {
            let is_sheet = surface.thickness == 0.0 && surface.opening().is_none();
            n_sheets += usize::from(is_sheet && surface.pair.is_some());
        }
        neighbors_are_those_of_a_march(&world);
    }
    assert!(n_sheets > 20, "{n_sheets}");
}

#[test]
fn pairs_answer_each_other() {
    let world = house();
    let rooms = room_surfaces(&world, &SurfaceOptions::default());
    let room_of = |cell: CellId| rooms.iter().find(|r| r.cell == cell).unwrap();
    let mut n_pairs = 0;
    for room in &rooms {
        for (i, surface) in room.surfaces.iter().enumerate() {
            let (Behind::Cell(other), Some(pair)) = (surface.behind, surface.pair) else {
                continue;
            };
            n_pairs += 1;
            let answer = &room_of(other).surfaces[pair];
            assert_eq!(answer.pair, Some(i));
            assert_eq!(answer.behind, Behind::Cell(room.cell));
            assert_eq!(answer.opening(), surface.opening());
            assert!((answer.area - surface.area).abs() < 0.02 * surface.area + 1e-3);
            assert!((answer.thickness - surface.thickness).abs() < 5e-3);
        }
    }
    assert!(n_pairs > 20, "{n_pairs}");
}

#[test]
fn openings_are_in_walls_and_have_the_area_of_their_portals() {
    let world = house();
    let rooms = room_surfaces(&world, &level(SurfaceLevel::First));
    let mut areas = vec![0.0; world.graph.portals.len()];
    for room in &rooms {
        for (i, surface) in room.surfaces.iter().enumerate() {
            let Some(portal) = surface.opening() else {
                assert!(matches!(
                    surface.cover,
                    SurfaceCover::Object { .. } | SurfaceCover::Bare
                ));
                continue;
            };
            areas[portal.idx()] += surface.area;
            if let Some(host) = surface.host {
                assert!(room.openings_in(host).any(|k| k == i));
            }
        }
    }
    for (portal, area) in world.graph.portals.iter().zip(areas) {
        let n_sides = portal
            .cells
            .iter()
            .filter(|c| !world.graph[**c].outdoor)
            .count();
        let expected = f64::from(portal.area) * n_sides as f64;
        assert!(
            (area - expected).abs() < 0.01 * expected + 1e-3,
            "{area} {expected}"
        );
    }
}
