//! Door leaves: the portals they shut, their poses, their visibility, and picking them. FEATURES: W5.

use enfilade_cpg::{CellId, Locator, PortalId, Pvs, VisibleParts, World};
use enfilade_geom::{DMat4, DVec3};
use enfilade_runtime::{DetailId, Sight, SightState, Sightlines, Target, View, Viewer};
use enfilade_testkit::{GridParams, Rng, room_grid, with_doors};

const DOOR: PortalId = PortalId(0);

fn two_rooms(is_glass: bool) -> World {
    let world = room_grid(&GridParams::two_rooms());
    with_doors(world, |_| is_glass)
}

fn vector(p: [f32; 3]) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

fn middle(world: &World) -> DVec3 {
    let outline = &world.graph[DOOR].outline;
    outline.iter().map(|&p| vector(p)).sum::<DVec3>() / outline.len() as f64
}

fn cells(sight: &Sight, state: &SightState, eye: DVec3, toward: DVec3) -> Vec<u32> {
    let [eye, toward] = [eye, toward].map(|p| p.as_vec3().to_array());
    let view = View::perspective(eye, toward, [0.0, 1.0, 0.0], 1.2, 1.5).unwrap();
    let mut viewer = Viewer::new(sight);
    let seen = viewer.see(sight, state, &view);
    let mut cells: Vec<u32> = seen.cells().iter().map(|c| c.0).collect();
    cells.sort_unstable();
    cells
}

#[test]
fn a_door_lets_sight_through_until_its_leaf_is_shut() {
    let world = two_rooms(false);
    let sight = Sight::build(&world).unwrap();
    let mut state = SightState::new(&sight);
    let eye = middle(&world) - DVec3::X * 1.5;
    let seen = |state: &SightState| cells(&sight, state, eye, DVec3::X);
    // Shut in the model: that must not hide anything.
    assert_eq!(state.leaves(DOOR), Some(0.0));
    assert_eq!(seen(&state), [0, 1]);
    assert_eq!(state.moved().count(), 0);
    state.set_leaves(DOOR, 0.0);
    assert_eq!(seen(&state), [0]);
    assert_eq!(state.shut_portals().collect::<Vec<_>>(), [DOOR]);
    state.set_leaves(DOOR, 0.01);
    assert_eq!(seen(&state), [0, 1]);
    // A closed portal stays closed, however its leaf moves, until it is opened.
    state.close(DOOR);
    state.set_leaves(DOOR, 1.0);
    assert_eq!(seen(&state), [0]);
    state.open(DOOR);
    assert_eq!((seen(&state), state.leaves(DOOR)), (vec![0, 1], Some(1.0)));
    state.set_leaves(DOOR, f32::NAN);
    state.set_leaves(PortalId(99), 0.0);
    assert_eq!(state.leaves(DOOR), Some(1.0));
    assert_eq!(state.leaves(PortalId(99)), None);
}

#[test]
fn one_sees_through_a_shut_door_of_glass() {
    let world = two_rooms(true);
    let sight = Sight::build(&world).unwrap();
    let mut state = SightState::new(&sight);
    let eye = middle(&world) - DVec3::X * 1.5;
    state.set_leaves(DOOR, 0.0);
    assert_eq!(cells(&sight, &state, eye, DVec3::X), [0, 1]);
    state.close(DOOR);
    assert_eq!(cells(&sight, &state, eye, DVec3::X), [0]);
}

#[test]
fn an_eye_between_a_portal_and_its_shut_leaf_sees_both_cells() {
    let world = two_rooms(false);
    let sight = Sight::build(&world).unwrap();
    let mut state = SightState::new(&sight);
    state.set_leaves(DOOR, 0.0);
    let depth = f64::from(sight.depth_of_leaves(DOOR));
    // The middle of a leaf 4 cm thick that ends 8 cm off the plane.
    assert!((depth - 0.06).abs() < 1e-5, "{depth}");
    let normal = vector(world.graph[DOOR].normal);
    for (at, both) in [(-0.02, false), (0.03, true), (depth + 0.02, false)] {
        let eye = middle(&world) + normal * at;
        let seen = cells(&sight, &state, eye, DVec3::X);
        assert_eq!(seen.len() == 2, both, "{at} m off: {seen:?}");
    }
}

#[test]
fn a_leaf_of_several_portals_moves_for_all() {
    let mut world = two_rooms(false);
    let mut twin = world.graph[DOOR].clone();
    twin.fittings.clone_from(&world.graph[DOOR].fittings);
    world.graph.portals.push(twin);
    for cell in &mut world.graph.cells {
        cell.portals.push(PortalId(1));
    }
    let sight = Sight::build(&world).unwrap();
    let mut state = SightState::new(&sight);
    state.set_leaves(PortalId(1), 0.0);
    assert_eq!(
        state.shut_portals().collect::<Vec<_>>(),
        [DOOR, PortalId(1)]
    );
    state.open(DOOR);
    assert_eq!(state.shut_portals().count(), 0);
    assert_eq!(state.leaves(PortalId(1)), Some(1.0));
    let leaf = sight.leaves(DOOR)[0].detail;
    assert_eq!(
        sight.portals_of(leaf).collect::<Vec<_>>(),
        [DOOR, PortalId(1)]
    );
}

/// Vertices of a detail in the pose that a state gives it.
fn corners(world: &World, state: &SightState, detail: DetailId) -> Vec<DVec3> {
    let object = &world[detail];
    let own = DMat4::from_cols_array(&object.transform.map(f64::from));
    let m = state.pose(detail).map_or(own, |p| p * own);
    let mesh = &world.detail_meshes[object.mesh as usize];
    let positions = mesh.primitives.iter().flat_map(|p| &p.positions);
    positions.map(|p| m.transform_point3(vector(*p))).collect()
}

/// Wherever a leaf stands, an eye with a clear line to a point of it sees it.
#[test]
fn a_leaf_is_seen_wherever_it_stands() {
    let world = with_doors(room_grid(&GridParams::offices(24, 3)), |p| p % 5 == 0);
    let sight = Sight::build(&world).unwrap();
    let lines = Sightlines::build(&world);
    let mut viewer = Viewer::new(&sight);
    let mut rng = Rng::new(11);
    let mut n_seen = 0;
    let n_doors = (0..sight.n_portals() as u32).map(PortalId);
    let doors: Vec<PortalId> = n_doors.filter(|p| !sight.leaves(*p).is_empty()).collect();
    assert!(doors.len() > 10);
    for round in 0..400 {
        let mut state = SightState::new(&sight);
        for &door in &doors {
            match rng.below(3) {
                0 => state.set_leaves(door, 0.0),
                1 => state.set_leaves(door, rng.range(0.0, 1.0) as f32),
                _ => {}
            }
        }
        let cell = &world.graph.cells[rng.below(world.graph.cells.len())];
        let eye = [0, 1, 2].map(|k| rng.range(cell.aabb[0][k].into(), cell.aabb[1][k].into()));
        let eye = DVec3::from(eye);
        if world.graph.locator.locate(eye).is_none() {
            continue;
        }
        let view = View::around(eye.as_vec3().to_array()).unwrap();
        let seen: Vec<DetailId> = viewer.see(&sight, &state, &view).details().to_vec();
        for &door in &doors {
            let leaf = sight.leaves(door)[0].detail;
            let own = corners(&world, &state, leaf);
            for _ in 0..4 {
                let weights: Vec<f64> = own.iter().map(|_| rng.range(0.0, 1.0)).collect();
                let sum: f64 = weights.iter().sum();
                let p = own
                    .iter()
                    .zip(&weights)
                    .map(|(c, w)| *c * *w)
                    .sum::<DVec3>()
                    / sum;
                let [a, b] = [eye, p].map(|p| p.as_vec3().to_array());
                let hit = lines.pick(&state, a, b).unwrap();
                let is_met = matches!(
                    hit.map(|h| h.target),
                    Some(Target::Detail { detail, .. }) if detail == leaf
                );
                if is_met {
                    n_seen += 1;
                    assert!(seen.contains(&leaf), "round {round}: {leaf:?} from {eye}");
                }
            }
        }
    }
    assert!(n_seen > 300, "{n_seen}");
}

/// Precomputed visibility holds leaves in the model's pose only, so it must never exclude a leaf.
#[test]
fn precomputed_visibility_never_hides_a_leaf() {
    let mut world = two_rooms(false);
    let n = world.graph.cells.len() as u32;
    let mut pvs = Pvs::of_ascending((0..n).map(|_| 0..n));
    let nothing: Vec<[u32; 0]> = vec![[]; pvs.n_pairs()];
    pvs.parts = Some(VisibleParts::of_ascending(nothing));
    world.pvs = Some(pvs);
    let sight = Sight::build(&world).unwrap();
    let mut state = SightState::new(&sight);
    state.set_leaves(DOOR, 0.7);
    let eye = (middle(&world) - DVec3::X * 1.5).as_vec3().to_array();
    let view = View::around(eye).unwrap();
    let mut viewer = Viewer::new(&sight);
    let seen = viewer.see(&sight, &state, &view);
    assert!(seen.chunks().is_empty());
    assert_eq!(seen.details(), [sight.leaves(DOOR)[0].detail]);
}

#[test]
fn a_turned_leaf_is_picked_where_it_stands() {
    let world = two_rooms(false);
    let sight = Sight::build(&world).unwrap();
    let lines = Sightlines::build(&world);
    let mut state = SightState::new(&sight);
    let center = middle(&world);
    let pick = |state: &SightState, from: DVec3, to: DVec3| {
        let [a, b] = [from, to].map(|p| p.as_vec3().to_array());
        let hit = lines.pick(state, a, b).unwrap()?;
        Some((hit.target, hit.position))
    };
    let (from, to) = (center - DVec3::X, center + DVec3::X);
    let leaf = sight.leaves(DOOR)[0].detail;
    let is_leaf = |t: Target| matches!(t, Target::Detail { detail, .. } if detail == leaf);
    // Shut, from both sides: hit the leaf, not the opening in front of it.
    state.set_leaves(DOOR, 0.0);
    for (a, b, off) in [(from, to, 0.04), (to, from, 0.08)] {
        let (target, at) = pick(&state, a, b).unwrap();
        assert!(is_leaf(target), "{target:?}");
        let off_plane = (vector(at) - center).dot(vector(world.graph[DOOR].normal));
        assert!((off_plane - off).abs() < 1e-4, "{off_plane}");
    }
    // Open: nothing is in the way, and the leaf stands at its hinge, along the normal.
    state.set_leaves(DOOR, 1.0);
    assert_eq!(pick(&state, from, to), None);
    let normal = vector(world.graph[DOOR].normal);
    let along = DVec3::Y.cross(normal);
    let beside = center + normal * 0.5;
    let hits = [along, -along].map(|d| pick(&state, beside, beside + d * 1.5));
    assert_eq!(
        hits.iter()
            .filter(|h| h.is_some_and(|h| is_leaf(h.0)))
            .count(),
        1,
        "{hits:?}"
    );
    // A shut portal without leaves is hit itself.
    let mut bare = world.clone();
    bare.graph.portals[0].fittings.clear();
    bare.details.clear();
    bare.graph
        .cells
        .iter_mut()
        .for_each(|c| c.n_detail_triangles = 0);
    let lines = Sightlines::build(&bare);
    let mut state = SightState::new(&Sight::build(&bare).unwrap());
    state.close(DOOR);
    let [a, b] = [from, to].map(|p| p.as_vec3().to_array());
    let hit = lines.pick(&state, a, b).unwrap().unwrap();
    assert_eq!(hit.target, Target::Portal(DOOR));
}

#[test]
fn no_cell_on_the_way_of_a_hull_is_missing() {
    let world = room_grid(&GridParams::offices(60, 5));
    let locator: &Locator = &world.graph.locator;
    let mut rng = Rng::new(3);
    let (low, high) = (locator.bounds.min - 1.0, locator.bounds.max + 1.0);
    for _ in 0..300 {
        let mut point = || DVec3::from([0, 1, 2].map(|k| rng.range(low[k], high[k])));
        let at = point();
        let hull: Vec<DVec3> = (0..5).map(|_| at + (point() - at) * 0.1).collect();
        let margin = rng.range(0.0, 0.5);
        let mut near: Vec<CellId> = Vec::new();
        locator.cells_near(&hull, margin, &mut near);
        assert!(near.is_sorted());
        for _ in 0..50 {
            let weights: Vec<f64> = hull.iter().map(|_| rng.range(0.0, 1.0)).collect();
            let sum: f64 = weights.iter().sum();
            let inside = hull
                .iter()
                .zip(&weights)
                .map(|(c, w)| *c * *w)
                .sum::<DVec3>()
                / sum;
            let away = DVec3::from([0, 1, 2].map(|_| rng.range(-1.0, 1.0)));
            let p = inside + away.normalize_or_zero() * rng.range(0.0, margin);
            if let Some(cell) = locator.locate(p) {
                assert!(near.contains(&cell), "{cell:?} at {p}");
            }
        }
    }
}
