//! Things are in the cells that they reach, change over as they move or as rooms move, and are seen. Covers W3 and W4.

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::{Aabb, DVec3, Sets};
use enfilade_runtime::{SightState, Sightlines, View};
use enfilade_testkit::oracle::{ball_meets, box_meets};
use enfilade_testkit::{GridParams, Rng, cabin, room_grid};
use enfilade_world::{
    Flood, PartId, Place, Pose, Posted, Shape, Space, SpaceViewer, ThingError, ThingId, Things, Tie,
};

fn offices(seed: u64) -> World {
    room_grid(&GridParams {
        merges: 0.2,
        turn: 0.3,
        holes: 0.2,
        ..GridParams::offices(60, seed)
    })
}

fn place(part: PartId, cell: CellId) -> Place {
    Place { part, cell }
}

/// A random point in a cell that is not outdoors.
fn random_indoors(space: &Space, rng: &mut Rng) -> DVec3 {
    let layout = space.layout(PartId::ROOT);
    loop {
        let cell = CellId(rng.below(layout.n_cells()) as u32);
        let p = rng.point_in(&layout.cell(cell).bounds);
        let found = layout.locate(p);
        if found.is_some_and(|c| !layout.cell(c).is_outdoor) {
            return p;
        }
    }
}

#[test]
fn a_shape_reaches_the_cells_that_openings_which_it_meets_join_to_its_own() {
    let world = offices(1);
    let space = Space::new(world.clone()).unwrap();
    let layout = space.layout(PartId::ROOT);
    let mut flood = Flood::default();
    let mut rng = Rng::new(1);
    let mut n_several = 0;
    for i in 0..4000 {
        let center = random_indoors(&space, &mut rng);
        let pose = Pose {
            turn: rng.turn(),
            at: center,
        };
        let half = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.05, 2.5)));
        let is_ball = i % 2 == 0;
        let shape = if is_ball {
            Shape::sphere(half.x).unwrap()
        } else {
            Shape::block(&Aabb::new(-half, half)).unwrap()
        };
        let mut sets = Sets::new(layout.n_cells());
        for portal in (0..layout.n_portals() as u32).map(PortalId) {
            let opening = layout.opening(portal);
            let meets = |piece: &[DVec3]| {
                if is_ball {
                    ball_meets(half.x, center, piece)
                } else {
                    box_meets(half, pose.turn, pose.at, piece)
                }
            };
            if opening.pieces().any(meets) {
                let [a, b] = opening.cells();
                sets.join(a.0, b.0);
            }
        }
        let start = layout.locate(center).unwrap();
        let cells = (0..layout.n_cells() as u32).map(CellId);
        let expected: BTreeSet<_> = cells
            .filter(|c| sets.find(c.0) == sets.find(start.0))
            .map(|c| place(PartId::ROOT, c))
            .collect();
        let start = place(PartId::ROOT, start);
        let posted = Posted::new(&shape, PartId::ROOT, &pose);
        let reached = flood.reach(&space, start, &posted, |_, _| true);
        n_several += usize::from(reached.len() > 1);
        assert_eq!(reached.iter().copied().collect::<BTreeSet<_>>(), expected);
        assert_eq!(reached.len(), expected.len(), "each once");
    }
    assert!(n_several > 500, "{n_several}");
}

#[test]
fn a_flood_stops_where_it_may_not_pass() {
    let world = room_grid(&GridParams::two_rooms());
    let space = Space::new(world.clone()).unwrap();
    let opening = space.layout(PartId::ROOT).opening(PortalId(0));
    let pose = Pose::from_translation(opening.center());
    let shape = Shape::sphere(0.5).unwrap();
    let posted = Posted::new(&shape, PartId::ROOT, &pose);
    let start = place(PartId::ROOT, CellId(0));
    let mut flood = Flood::default();
    assert_eq!(flood.reach(&space, start, &posted, |_, _| true).len(), 2);
    assert_eq!(flood.reach(&space, start, &posted, |_, _| false), [start]);
}

/// Both lists agree with each other, and with the flood.
fn check_lists(space: &Space, things: &mut Things, ids: &[ThingId]) {
    let mut by_thing = BTreeSet::new();
    for &id in ids {
        by_thing.extend(things.places(space, id).map(|p| (p, id)));
    }
    let mut by_cell = BTreeSet::new();
    for part in (0..space.n_parts() as u32).map(PartId) {
        for cell in (0..space.layout(part).n_cells() as u32).map(CellId) {
            let at = place(part, cell);
            by_cell.extend(things.things_in(space, at).map(|id| (at, id)));
        }
    }
    assert_eq!(by_thing, by_cell);
}

#[test]
fn things_that_move_are_where_the_locator_and_a_new_flood_say() {
    let world = offices(2);
    let space = Space::new(world.clone()).unwrap();
    let mut things = Things::new();
    let mut rng = Rng::new(3);
    let shapes = [0.1, 0.4, 1.5].map(|r| Shape::sphere(r).unwrap());
    let ids: Vec<ThingId> = (0..60)
        .map(|i| {
            let pose = Pose::from_translation(random_indoors(&space, &mut rng));
            let tie = if i % 2 == 0 { Tie::Carried } else { Tie::Free };
            let shape = shapes[i % 3].clone();
            things.add(&space, shape, PartId::ROOT, pose, tie).unwrap()
        })
        .collect();
    let mut flood = Flood::default();
    let mut n_moved = 0;
    for step in 0..20_000 {
        let k = rng.below(ids.len());
        let at = things.pose(&space, ids[k]).unwrap().1.at;
        let stride = if step % 50 == 0 { 4.0 } else { 0.1 };
        let to = at + rng.turn() * DVec3::X * stride;
        let pose = Pose::from_translation(to);
        let moved = things.set_pose(&space, ids[k], PartId::ROOT, pose).unwrap();
        assert_eq!(moved.to, space.locate(PartId::ROOT, to));
        n_moved += usize::from(moved.from != moved.to);
        let Some(start) = moved.to else {
            // Back out of the wall.
            let back = Pose::from_translation(at);
            things.set_pose(&space, ids[k], PartId::ROOT, back).unwrap();
            continue;
        };
        let posted = Posted::new(&shapes[k % 3], PartId::ROOT, &pose);
        let anew: BTreeSet<_> = flood
            .reach(&space, start, &posted, |_, _| true)
            .iter()
            .copied()
            .collect();
        let listed: BTreeSet<_> = things.places(&space, ids[k]).collect();
        assert_eq!(listed, anew, "step {step}");
        if step % 1000 == 0 {
            check_lists(&space, &mut things, &ids);
        }
    }
    assert!(n_moved > 200, "{n_moved}");
    check_lists(&space, &mut things, &ids);
    for &id in &ids[..30] {
        things.remove(id).unwrap();
        assert_eq!(things.place(&space, id), Err(ThingError::NoThing));
    }
    check_lists(&space, &mut things, &ids);
}

#[test]
fn carried_things_move_with_the_room_and_free_ones_do_not() {
    let root = offices(4);
    let mut space = Space::new(root.clone()).unwrap();
    let away = Pose::from_translation(DVec3::X * -60.0);
    let ship = space
        .add_part(cabin(1, 1.0, 4), PartId::ROOT, away)
        .unwrap();
    let mut things = Things::new();
    let middle = Pose::from_translation(DVec3::new(1.5, 1.0, 1.5));
    let ball = || Shape::sphere(0.2).unwrap();
    let [man, bird] = [Tie::Carried, Tie::Free].map(|tie| {
        let added = things.add(&space, ball(), ship, middle, tie);
        added.unwrap()
    });
    let above = Pose::from_translation(DVec3::Y * 0.5);
    let hat = things
        .add(&space, ball(), PartId::ROOT, above, Tie::Child(man))
        .unwrap();
    let still = Pose::from_translation(DVec3::new(-40.0, 1.0, 0.0) + middle.at);
    let buoy = things
        .add(&space, ball(), PartId::ROOT, still, Tie::Carried)
        .unwrap();
    let cabin_place = place(ship, CellId(0));
    let sea_place = place(PartId::ROOT, root.graph.outdoors().unwrap());
    let (inside, sea) = (Some(cabin_place), Some(sea_place));
    let places = |things: &mut Things, space: &Space| {
        [man, bird, hat, buoy].map(|id| things.place(space, id).unwrap())
    };
    assert_eq!(places(&mut things, &space), [inside, inside, inside, sea]);
    // A man who leans out of a window is at sea, too.
    let window = space.layout(ship).opening(PortalId(0)).center();
    let lean = things.add(
        &space,
        ball(),
        ship,
        Pose::from_translation(window),
        Tie::Carried,
    );
    let both = BTreeSet::from([cabin_place, sea_place]);
    assert_eq!(
        things
            .places(&space, lean.unwrap())
            .collect::<BTreeSet<_>>(),
        both
    );
    things.remove(lean.unwrap()).unwrap();
    // The ship sails on: the man on deck comes along, the bird is left behind, and the buoy, which did not move, is inside.
    let on = Pose::from_translation(DVec3::new(-40.0, 0.0, 0.0));
    space.set_pose(ship, on).unwrap();
    assert_eq!(places(&mut things, &space), [inside, sea, inside, inside]);
    let mut in_root = |id| {
        let (frame, pose) = things.pose(&space, id).unwrap();
        space.between(frame, PartId::ROOT).after(&pose).at
    };
    assert!(in_root(man).distance(on.point(middle.at)) < 1e-9);
    assert!(in_root(hat).distance(on.point(middle.at) + DVec3::Y * 0.5) < 1e-9);
    assert!(in_root(bird).distance(away.point(middle.at)) < 1e-9);
    // A removed thing leaves its child where it was.
    things.remove(man).unwrap();
    assert_eq!(things.place(&space, hat).unwrap(), inside);
    check_lists(&space, &mut things, &[bird, hat, buoy]);
}

#[test]
fn a_thing_in_a_door_between_rooms_is_in_both_until_they_separate() {
    let root = room_grid(&GridParams::two_rooms());
    let mut space = Space::new(root.clone()).unwrap();
    let far = Pose::from_translation(DVec3::X * 100.0);
    let world = cabin(1, 1.0, 4);
    let [a, b] = [0, 1].map(|_| space.add_part(world.clone(), PartId::ROOT, far).unwrap());
    let window = space.layout(a).opening(PortalId(0));
    let (center, normal, [inner, outer]) = (window.center(), window.normal(), window.cells());
    let turned = Pose::about(center, DVec3::Y, std::f64::consts::PI);
    let apart = far.after(&Pose::from_translation(DVec3::X * 50.0));
    space.set_pose(b, apart).unwrap();
    let mut things = Things::new();
    let inward = if space.layout(a).cell(inner).is_outdoor {
        normal
    } else {
        -normal
    };
    let cell = if inward == normal { outer } else { inner };
    let pose = Pose::from_translation(center + inward * 0.1);
    let shape = Shape::sphere(0.3).unwrap();
    let man = things.add(&space, shape, a, pose, Tie::Carried).unwrap();
    let places = |things: &mut Things, space: &Space| {
        let places: BTreeSet<_> = things.places(space, man).map(|p| p.part).collect();
        places
    };
    assert_eq!(things.place(&space, man).unwrap(), Some(place(a, cell)));
    assert_eq!(places(&mut things, &space), BTreeSet::from([a]));
    space.set_pose(b, far.after(&turned)).unwrap();
    assert_eq!(places(&mut things, &space), BTreeSet::from([a, b]));
    space.set_pose(b, apart).unwrap();
    assert_eq!(places(&mut things, &space), BTreeSet::from([a]));
}

#[test]
fn a_thing_that_can_be_seen_is_in_the_answer() {
    let mut world = offices(5);
    // Furniture may hide a thing; it does not matter here.
    world.details.clear();
    let space = Space::new(world.clone()).unwrap();
    let lines = Sightlines::build(&world);
    let state = SightState::new(space.sight(PartId::ROOT));
    let mut things = Things::new();
    let mut rng = Rng::new(8);
    let mut balls = Vec::new();
    for i in 0..300 {
        let (center, radius) = (random_indoors(&space, &mut rng), rng.range(0.05, 0.8));
        let pose = Pose::from_translation(center);
        let shape = Shape::sphere(radius).unwrap();
        let tie = if i == 0 { Tie::Global } else { Tie::Carried };
        let id = things.add(&space, shape, PartId::ROOT, pose, tie).unwrap();
        balls.push((id, center, radius));
    }
    let mut viewer = SpaceViewer::new(&space);
    let (mut n_seen, mut n_checked) = (0, 0);
    for _ in 0..400 {
        let eye = random_indoors(&space, &mut rng).as_vec3();
        let toward = rng.turn() * DVec3::X;
        let up = [0.0, 1.0, 0.0];
        let toward_f32 = toward.as_vec3().to_array();
        let view = View::perspective(eye.to_array(), toward_f32, up, 1.2, 1.0).unwrap();
        let seen = viewer.see(&space, PartId::ROOT, &view);
        let seen = things.see(&space, &seen).to_vec();
        assert!(seen.contains(&balls[0].0), "global things are always seen");
        n_seen += seen.len();
        for &(id, center, radius) in &balls[1..] {
            // A point of the ball in reach of its cell's air that the eye sees.
            let p = center + rng.turn() * DVec3::X * radius * rng.unit();
            let to = p - eye.as_dvec3();
            let forward = toward.normalize();
            let is_in_view = to.dot(forward) > 0.0 && {
                let right = forward.cross(DVec3::Y).normalize();
                let up = right.cross(forward);
                let tan = 0.599_f64.tan();
                to.dot(right).abs() < to.dot(forward) * tan
                    && to.dot(up).abs() < to.dot(forward) * tan
            };
            let ends = [center, eye.as_dvec3()].map(|q| q.as_vec3().to_array());
            let p = p.as_vec3().to_array();
            if is_in_view && ends.iter().all(|&q| lines.is_clear(&state, p, q)) {
                n_checked += 1;
                assert!(seen.contains(&id), "{id:?} at {center} from {eye}");
            }
        }
    }
    assert!(n_checked > 200, "{n_checked}");
    assert!(n_seen < 400 * 300 / 4, "most are hidden: {n_seen}");
}

#[test]
fn invalid_motions_and_removed_things_are_refused() {
    let space = Space::new(offices(6)).unwrap();
    let mut things = Things::new();
    let ball = || Shape::sphere(0.2).unwrap();
    let root = PartId::ROOT;
    let broken = Pose::from_translation(DVec3::INFINITY);
    let refused = things.add(&space, ball(), root, broken, Tie::Free);
    assert_eq!(refused, Err(ThingError::NotRigid));
    let elsewhere = things.add(&space, ball(), PartId(7), Pose::IDENTITY, Tie::Free);
    assert_eq!(elsewhere, Err(ThingError::NoPart));
    let id = things.add(&space, ball(), root, Pose::IDENTITY, Tie::Free);
    let id = id.unwrap();
    things.remove(id).unwrap();
    let child = things.add(&space, ball(), root, Pose::IDENTITY, Tie::Child(id));
    assert_eq!(child, Err(ThingError::NoThing));
    // Its slot is reused, but its id does not refer to the new thing.
    let other = things.add(&space, ball(), root, Pose::IDENTITY, Tie::Free);
    assert_ne!(other, Ok(id));
    let moved = things.set_pose(&space, id, root, Pose::IDENTITY);
    assert_eq!(moved, Err(ThingError::NoThing));
}
