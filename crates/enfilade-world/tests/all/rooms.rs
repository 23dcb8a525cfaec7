//! Rooms that move within rooms: everything that rays hit at a pose is in the answer, and nothing is out of place. Covers W5.

use std::collections::HashSet;

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::{Bvh, DQuat, DVec3, Ray};
use enfilade_runtime::{ChunkId, DetailId, Sight, View};
use enfilade_testkit::{GridParams, Rng, Solids, cabin, room_grid};
use enfilade_world::{PartId, Place, Pose, Space, SpaceError, SpaceViewer};

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

fn offices(seed: u64) -> World {
    room_grid(&GridParams {
        merges: 0.2,
        turn: 0.3,
        ..GridParams::offices(24, seed)
    })
}

#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
enum Item {
    Chunk(PartId, ChunkId),
    Detail(PartId, DetailId),
}

fn outdoors_of(world: &World) -> CellId {
    world.graph.outdoors().unwrap()
}

/// All triangles of all parts where they are now, as one model without cells.
struct Model {
    bvh: Bvh,
    items: Vec<Item>,
}

impl Model {
    fn new(space: &Space, worlds: &[&World]) -> Self {
        let mut all = Solids::default();
        for (part, world) in (0..).map(PartId).zip(worlds) {
            let (sight, pose) = (space.sight(part), space.pose(part));
            for (id, chunk) in (0..).map(ChunkId).zip(sight.chunks()) {
                let indices = &sight.indices(chunk.batch)[chunk.first_index as usize..];
                let indices = &indices[..chunk.n_indices as usize];
                let item = Item::Chunk(part, id);
                all.add(world, chunk.batch, indices, |p| pose.point(p), item);
            }
            let item = |id| Item::Detail(part, DetailId(id));
            all.add_objects(world, pose.matrix(), item);
        }
        let (bvh, items) = all.built();
        Self { bvh, items }
    }
}

/// Compares the view of a random eye in the frame of a part with the first hits of rays in the model; returns the number of hits.
fn check_view(
    space: &Space,
    model: &Model,
    viewer: &mut SpaceViewer,
    frame: PartId,
    eye: DVec3,
    rng: &mut Rng,
    n_rays: usize,
) -> usize {
    let random = |rng: &mut Rng| DVec3::from_array([0, 1, 2].map(|_| rng.range(-1.0, 1.0)));
    let forward = (random(rng) * DVec3::new(1.0, 0.4, 1.0)).normalize_or(DVec3::X);
    let (eye, fov, aspect) = (eye.as_vec3(), 1.1_f32, 1.5_f32);
    let view = View::perspective(
        eye.to_array(),
        forward.as_vec3().to_array(),
        [0.0, 1.0, 0.0],
        fov,
        aspect,
    )
    .unwrap();
    let forward = forward.as_vec3().as_dvec3().normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let up = right.cross(forward);
    let seen = viewer.see(space, frame, &view);
    let mut items = HashSet::new();
    for (part, seen) in seen.parts() {
        items.extend(seen.chunks().iter().map(|c| Item::Chunk(part, *c)));
        items.extend(seen.details().iter().map(|d| Item::Detail(part, *d)));
    }
    let pose = space.pose(frame);
    let mut n_hits = 0;
    for _ in 0..n_rays {
        let tan = (f64::from(fov) * 0.5).tan();
        let x = rng.range(-1.0, 1.0) * tan * f64::from(aspect);
        let y = rng.range(-1.0, 1.0) * tan;
        let ray = Ray {
            origin: pose.point(eye.as_dvec3()),
            direction: pose.direction(forward + right * x + up * y),
            t_max: f64::INFINITY,
        };
        if let Some(hit) = model.bvh.closest_hit(&ray, |_| false) {
            let item = model.items[hit.triangle as usize];
            n_hits += 1;
            assert!(
                items.contains(&item),
                "{item:?} lost: eye {eye} of {frame:?}, ray {x} {y}, t {}, {:?}",
                hit.t,
                space.locate(frame, eye.as_dvec3()),
            );
        }
    }
    n_hits
}

/// A random point of a part's hull, in its frame.
fn random_in(space: &Space, part: PartId, rng: &mut Rng) -> DVec3 {
    let layout = space.layout(part);
    let cells = (0..layout.n_cells() as u32).map(CellId);
    let bounds: Vec<_> = cells.map(|c| layout.cell(c).bounds).collect();
    let b = bounds[rng.below(bounds.len())];
    DVec3::from_array([0, 1, 2].map(|k| rng.range(b.min[k], b.max[k])))
}

/// A small motion about the middle of a cabin's position, where the cabin of one size stands in one `ratio` times as large.
fn pose_within(rng: &mut Rng, own: &World, host: &World) -> Pose {
    let middle = |w: &World| {
        let b = w.graph.cells[0].aabb.map(point);
        ((b[0] + b[1]) * 0.5, b[1] - b[0])
    };
    let ((own, _), (host, size)) = (middle(own), middle(host));
    let turn = DQuat::from_euler(
        glam::EulerRot::YXZ,
        rng.range(-0.15, 0.15),
        rng.range(-0.05, 0.05),
        rng.range(-0.05, 0.05),
    );
    let shift = [0, 1, 2].map(|k| rng.range(-0.03, 0.03) * size[k]);
    let at = host + DVec3::from_array(shift) - turn * own;
    Pose { turn, at }
}

/// Nested cabins, the smallest a room of 4 m.
fn nested(depth: usize) -> Vec<World> {
    let size = |k: usize| 1.6_f32.powi((depth - k) as i32);
    // Furniture would stand in the way of the next.
    (0..=depth)
        .map(|k| cabin(7, size(k), if k == depth { 2 } else { 0 }))
        .collect()
}

#[test]
fn ray_hits_are_seen_through_sixteen_nested_rooms() {
    let worlds = nested(16);
    let refs: Vec<&World> = worlds.iter().collect();
    let mut space = Space::new(worlds[0].clone()).unwrap();
    let mut host = PartId::ROOT;
    for world in &worlds[1..] {
        host = space.add_part(world.clone(), host, Pose::IDENTITY).unwrap();
    }
    let mut viewer = SpaceViewer::new(&space);
    let mut rng = Rng::new(1);
    let mut n_hits = 0;
    let mut n_parts = 0;
    for _ in 0..10 {
        for k in 1..worlds.len() {
            let pose = pose_within(&mut rng, &worlds[k], &worlds[k - 1]);
            space.set_pose(PartId(k as u32), pose).unwrap();
        }
        let model = Model::new(&space, &refs);
        for _ in 0..6 {
            let frame = PartId(rng.below(worlds.len()) as u32);
            let eye = (frame, random_in(&space, frame, &mut rng));
            n_hits += check_view(&space, &model, &mut viewer, eye.0, eye.1, &mut rng, 100);
        }
        let eye = random_in(&space, PartId(16), &mut rng).as_vec3().to_array();
        let view = View::around(eye).unwrap();
        n_parts += viewer.see(&space, PartId(16), &view).parts().len();
    }
    assert!(n_hits > 3000, "{n_hits}");
    assert!(
        n_parts > 50,
        "all around, other parts are seen through the windows: {n_parts}"
    );
}

#[test]
fn ray_hits_are_seen_between_adjacent_rooms() {
    let root = offices(3);
    let cabins: Vec<World> = (0..4).map(|k| cabin(k, 1.0, 2)).collect();
    let mut worlds = vec![&root];
    worlds.extend(&cabins);
    let mut space = Space::new(root.clone()).unwrap();
    for cabin in &cabins {
        space
            .add_part(cabin.clone(), PartId::ROOT, Pose::IDENTITY)
            .unwrap();
    }
    // Beside the building, in a row, the gaps between them down to nothing.
    let layout = space.layout(PartId::ROOT);
    let cells = (0..layout.n_cells() as u32).map(CellId);
    let indoors = cells.filter(|c| !layout.cell(*c).is_outdoor);
    let far = indoors
        .map(|c| layout.cell(c).bounds.max.x)
        .fold(0.0, f64::max);
    let mut viewer = SpaceViewer::new(&space);
    let mut rng = Rng::new(2);
    let mut n_hits = 0;
    for round in 0..12 {
        let mut at = far + rng.range(0.5, 3.0);
        for (k, cabin) in cabins.iter().enumerate() {
            let b = cabin.graph.cells[0].aabb;
            let y = rng.range(-0.5, 0.5);
            let pose = Pose::from_translation(DVec3::new(at - f64::from(b[0][0]), y, 2.0));
            space.set_pose(PartId(k as u32 + 1), pose).unwrap();
            let gap = if round % 3 == 0 {
                0.0
            } else {
                rng.range(0.0, 0.4)
            };
            at += f64::from(b[1][0] - b[0][0]) + gap;
        }
        let model = Model::new(&space, &worlds);
        for _ in 0..12 {
            let frame = PartId(rng.below(worlds.len()) as u32);
            let eye = (frame, random_in(&space, frame, &mut rng));
            n_hits += check_view(&space, &model, &mut viewer, eye.0, eye.1, &mut rng, 100);
        }
    }
    assert!(n_hits > 5000, "{n_hits}");
}

#[test]
fn a_point_is_in_the_innermost_room_that_holds_it() {
    let worlds = nested(3);
    let mut space = Space::new(worlds[0].clone()).unwrap();
    let mut host = PartId::ROOT;
    let mut rng = Rng::new(4);
    for k in 1..worlds.len() {
        let pose = pose_within(&mut rng, &worlds[k], &worlds[k - 1]);
        host = space.add_part(worlds[k].clone(), host, pose).unwrap();
    }
    let sights: Vec<Sight> = worlds.iter().map(|w| Sight::build(w).unwrap()).collect();
    let mut found = [0; 4];
    for _ in 0..20_000 {
        let frame = PartId(rng.below(4) as u32);
        let p = random_in(&space, frame, &mut rng);
        let p = space.pose(frame).point(p);
        let inner = (0..4_u32).rev().find_map(|k| {
            let own = space.pose(PartId(k)).point_back(p);
            let cell = sights[k as usize].locate(own.as_vec3().to_array())?;
            let is_indoor = k == 0 || !worlds[k as usize].graph.cells[cell.idx()].outdoor;
            is_indoor.then_some(Place {
                part: PartId(k),
                cell,
            })
        });
        found[inner.map_or(0, |place| place.part.0 as usize)] += 1;
        assert_eq!(space.locate(PartId::ROOT, p), inner);
    }
    assert!(found.iter().all(|&n| n > 100), "{found:?}");
}

#[test]
fn a_room_far_away_is_as_exact_as_a_near_one() {
    let worlds = [offices(5), cabin(5, 1.0, 2), cabin(6, 0.3, 2)];
    let mut space = Space::new(worlds[0].clone()).unwrap();
    let far = DVec3::new(10_000.0, 3.0, -7_000.0);
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, 0.9, 0.1).normalize(), 1.234);
    let ship = space
        .add_part(worlds[1].clone(), PartId::ROOT, Pose { turn, at: far })
        .unwrap();
    let boat = space
        .add_part(
            worlds[2].clone(),
            ship,
            pose_within(&mut Rng::new(3), &worlds[2], &worlds[1]),
        )
        .unwrap();
    // Turned a thousand times, and back.
    let start = *space.local_pose(ship);
    for k in 0..1000 {
        let step = Pose::about(far, DVec3::Y, if k % 2 == 0 { 0.01 } else { -0.01 });
        let pose = step.after(space.local_pose(ship));
        space.set_pose(ship, pose).unwrap();
    }
    let p = DVec3::new(0.4, 0.2, 0.3);
    let there = space.between(boat, PartId::ROOT).point(p);
    assert!(space.between(PartId::ROOT, boat).point(there).distance(p) < 1e-9);
    assert!(space.local_pose(ship).point(p).distance(start.point(p)) < 1e-6);
}

#[test]
fn doors_lead_to_their_surroundings_and_meet_on_contact() {
    let root = offices(3);
    let [a, b] = [cabin(1, 1.0, 2), cabin(1, 1.0, 2)];
    let mut space = Space::new(root.clone()).unwrap();
    let far = DVec3::new(100.0, 0.0, 0.0);
    let pose = Pose::from_translation(far);
    let [a_id, b_id] = [&a, &b].map(|w| space.add_part(w.clone(), PartId::ROOT, pose).unwrap());
    let outdoors = Place {
        part: PartId::ROOT,
        cell: outdoors_of(&root),
    };
    // The second stands before the first's window, turned so that their windows meet.
    let window = space.layout(a_id).opening(PortalId(0));
    let outward = window.normal()
        * if window.cells()[1] == outdoors_of(&a) {
            1.0
        } else {
            -1.0
        };
    let turned = Pose::about(window.center(), DVec3::Y, std::f64::consts::PI);
    for (gap, n) in [
        (1.0, 0),
        (0.0, 1),
        (0.01, 1),
        (-0.01, 1),
        (0.011, 0),
        (-0.011, 0),
    ] {
        let apart = Pose::from_translation(far + outward * gap);
        space.set_pose(b_id, apart.after(&turned)).unwrap();
        let met = space.meets(a_id, PortalId(0));
        assert_eq!(met.len(), n, "{gap}");
        assert!(met.iter().all(|m| *m == (b_id, PortalId(0))));
        assert_eq!(space.meets(b_id, PortalId(0)).len(), n);
    }
    for portal in a.graph.portal_ids() {
        assert_eq!(space.leads_to(a_id, portal), [outdoors]);
    }
    assert_eq!(space.guests(outdoors), [a_id, b_id]);
}

#[test]
fn invalid_motions_are_refused_and_change_nothing() {
    let root = offices(3);
    let mut space = Space::new(root.clone()).unwrap();
    let part = space
        .add_part(cabin(1, 1.0, 2), PartId::ROOT, Pose::IDENTITY)
        .unwrap();
    let broken = Pose::from_translation(DVec3::NAN);
    let stretched = Pose {
        turn: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0),
        at: DVec3::ZERO,
    };
    for pose in [broken, stretched] {
        let refused = SpaceError::NotRigid { part: part.0 };
        assert_eq!(space.set_pose(part, pose).unwrap_err(), refused);
    }
    assert_eq!(space.local_pose(part), &Pose::IDENTITY);
    let moved = space.set_pose(PartId::ROOT, Pose::IDENTITY);
    assert_eq!(moved.unwrap_err(), SpaceError::RootMoved);
    let none = SpaceError::NoPart {
        part: 9,
        n_parts: 2,
    };
    assert_eq!(space.set_pose(PartId(9), Pose::IDENTITY).unwrap_err(), none);
    assert_eq!(space.locate(PartId::ROOT, DVec3::NAN), None);
}

#[test]
fn doors_that_meet_lead_from_one_to_the_other_without_air_between() {
    // Beyond a world without outdoors there is nothing.
    let root = room_grid(&GridParams::two_rooms());
    let [a, b] = [cabin(1, 1.0, 2), cabin(1, 1.0, 2)];
    let mut space = Space::new(root.clone()).unwrap();
    let far = Pose::from_translation(DVec3::new(100.0, 0.0, 0.0));
    let [a_id, b_id] = [&a, &b].map(|w| space.add_part(w.clone(), PartId::ROOT, far).unwrap());
    let mut viewer = SpaceViewer::new(&space);
    let window = space.layout(a_id).opening(PortalId(0));
    let turned = Pose::about(window.center(), DVec3::Y, std::f64::consts::PI);
    let eye = a.graph.cells[0].aabb.map(point);
    let eye = ((eye[0] + eye[1]) * 0.5).as_vec3().to_array();
    let view = View::around(eye).unwrap();
    for (turn, sees) in [(Pose::IDENTITY, false), (turned, true)] {
        space.set_pose(b_id, far.after(&turn)).unwrap();
        let apart = Pose::from_translation(DVec3::X * 50.0);
        if !sees {
            space.set_pose(b_id, apart).unwrap();
        }
        let seen = viewer.see(&space, a_id, &view);
        let is_room = |s: enfilade_runtime::Seen| s.cells().contains(&CellId(0));
        assert_eq!(seen.of_part(b_id).is_some_and(is_room), sees);
    }
}

#[test]
fn rooms_behind_docked_doors_are_seen_despite_gaps_and_overlaps() {
    let root = room_grid(&GridParams::two_rooms());
    let [a, b] = [cabin(1, 1.0, 2), cabin(1, 1.0, 2)];
    let mut space = Space::new(root.clone()).unwrap();
    let far = Pose::from_translation(DVec3::new(100.0, 0.0, 0.0));
    let [a_id, b_id] = [&a, &b].map(|w| space.add_part(w.clone(), PartId::ROOT, far).unwrap());
    let mut viewer = SpaceViewer::new(&space);
    let window = space.layout(a_id).opening(PortalId(0));
    let (center, radius) = (window.center(), window.radius());
    let sign = if window.cells()[1] == outdoors_of(&a) {
        1.0
    } else {
        -1.0
    };
    let outward = window.normal() * sign;
    for gap in [-0.01, -0.001, -0.0001, 0.0, 0.0001, 0.001, 0.01] {
        for degrees in [-1.0, 0.0, 1.0_f64] {
            let turn = Pose::about(
                center,
                DVec3::Y,
                std::f64::consts::PI + degrees.to_radians(),
            );
            let shift = Pose::from_translation(far.at + outward * gap);
            space.set_pose(b_id, shift.after(&turn)).unwrap();
            // From afar, near the seam, and where both rooms are.
            for back in [2.0, 0.1, 0.005] {
                let eye = (center - outward * back).as_vec3().to_array();
                for id in [a_id, b_id] {
                    let view = View::around(eye).unwrap();
                    let seen = viewer.see(&space, id, &view);
                    let other = if id == a_id { b_id } else { a_id };
                    let is_room = |s: enfilade_runtime::Seen| s.cells().contains(&CellId(0));
                    assert!(
                        seen.of_part(other).is_some_and(is_room),
                        "{gap} {degrees} {back}"
                    );
                }
            }
        }
    }
    // Not side by side.
    let along = outward.cross(DVec3::Y) * (2.0 * radius);
    let turn = Pose::about(center, DVec3::Y, std::f64::consts::PI);
    space
        .set_pose(b_id, Pose::from_translation(far.at + along).after(&turn))
        .unwrap();
    assert_eq!(space.meets(a_id, PortalId(0)), []);
}

#[test]
fn things_beside_a_moving_room_are_found_in_their_new_cells() {
    let root = cabin(2, 30.0, 0);
    let mut space = Space::new(root.clone()).unwrap();
    let away = Pose::from_translation(DVec3::X * -500.0);
    let ship = space
        .add_part(cabin(1, 1.0, 2), PartId::ROOT, away)
        .unwrap();
    let beside = Pose::from_translation(DVec3::X * 8.0);
    let boat = space.add_part(cabin(1, 0.5, 2), ship, beside).unwrap();
    let hall = |cell| Place {
        part: PartId::ROOT,
        cell,
    };
    assert_eq!(space.guests(hall(outdoors_of(&root))), [ship, boat]);
    let [low, high] = root.graph.cells[0].aabb.map(point);
    let inside = Pose::from_translation((low + high) * 0.5);
    space.set_pose(ship, inside).unwrap();
    assert_eq!(space.guests(hall(outdoors_of(&root))), []);
    assert_eq!(space.guests(hall(CellId(0))), [ship, boat]);
    let found = space.locate(boat, DVec3::splat(0.5));
    assert_eq!(found.map(|p| p.part), Some(boat));
}
