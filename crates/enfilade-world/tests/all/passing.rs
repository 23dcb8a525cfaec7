//! Points and bodies that pass special portals meet what they would meet without them.

use enfilade_cpg::{DetailObject, PortalId, SpecialId, SpecialPortal, SpecialShape, World};
use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{Aabb, DMat4, DQuat, DVec3, Similarity};
use enfilade_testkit::{GridParams, Rng, endless_room, linked_copies, room_grid, traced_step};
use enfilade_world::{Agent, Body, Cast, Caster, PartId, Place, Space, Walker};

const ROOT: PartId = PartId::ROOT;

/// Positions of vertices 40 m from the origin, in `f32`. [Units: wu]
const ROUNDING: f64 = 2e-5;

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

fn far_away(rng: &mut Rng, scale: f64) -> Similarity {
    let axis = DVec3::from_array([0, 1, 2].map(|_| rng.range(-1.0, 1.0)));
    let turn = DQuat::from_axis_angle(axis.normalize_or(DVec3::Y), rng.range(-3.0, 3.0));
    let at = DVec3::new(40.0, 3.0, 0.0);
    Similarity { turn, at, scale }
}

/// A world, and the same with a doorway that leads into a copy.
fn twins(rng: &mut Rng, seed: u64, scale: f64) -> [World; 2] {
    // Concave rooms: a part of a room may be behind its own doorway.
    let rooms = |seed: u64| {
        room_grid(&GridParams {
            outdoors: false,
            doors: 1.0,
            merges: 0.5,
            furniture: 5,
            ..GridParams::offices(8, seed)
        })
    };
    let mut worlds = (0..).map(|k| rooms(seed + 1000 * k));
    let world = worlds
        .find(|w| !w.graph.portals.is_empty())
        .expect("a doorway");
    let map = far_away(rng, scale);
    let linked = linked_copies(&world, PortalId(0), &map);
    [world, linked]
}

fn random_body(rng: &mut Rng) -> Body {
    let axis = DVec3::from_array([0, 1, 2].map(|_| rng.range(-1.0, 1.0)));
    let axis = axis.normalize_or(DVec3::X);
    match rng.below(3) {
        0 => Body::Sphere {
            radius: [0.0, 0.05, 0.3][rng.below(3)],
        },
        1 => Body::Capsule {
            half: axis * rng.range(0.05, 0.4),
            radius: rng.range(0.02, 0.2),
        },
        _ => Body::Box {
            half: DVec3::from_array([0, 1, 2].map(|_| rng.range(0.02, 0.3))),
            turn: DQuat::from_axis_angle(axis, rng.range(0.0, 3.0)),
        },
    }
}

// Covers W9.
#[test]
fn bodies_meet_in_and_beyond_a_special_portal_what_they_meet_in_a_doorway() {
    let mut rng = Rng::new(3);
    let (mut n_hits, mut n_beyond, mut n_contacts, mut n_both) = (0, 0, 0, 0);
    for seed in 0..24 {
        let scale = [1.0, 1.0, 0.5, 2.0][seed as usize % 4];
        let [plain, linked] = twins(&mut rng, seed, scale).map(|w| Space::new(w).unwrap());
        let door = plain.layout(ROOT).opening(PortalId(0));
        let here = door.cells()[0];
        let mut casters = [Caster::new(), Caster::new()];
        for _ in 0..600 {
            let body = random_body(&mut rng);
            let at = |d: f64, rng: &mut Rng| {
                let spread = DVec3::from_array([0, 1, 2].map(|_| rng.range(-1.0, 1.0)));
                door.center() - door.normal() * d + spread * DVec3::new(0.3, 0.9, 0.9)
            };
            let farthest = [0.3, 1.0][rng.below(2)];
            let away = rng.range(0.0, farthest);
            let from = at(away, &mut rng);
            let place = Place {
                part: ROOT,
                cell: here,
            };
            // In the room, and not beside the doorway's plane, where the rounding of a vertex decides.
            let depth = -door.height_of(from);
            if plain.locate(ROOT, from) != Some(place) || depth < 1e-3 {
                continue;
            }
            let by = at(-rng.range(-1.0, 3.0), &mut rng) - from;
            let cast = Cast {
                body: &body,
                frame: ROOT,
                from,
                by,
                place,
            };
            let mut deepest = [0.0_f64; 2];
            let mut is_in_two = false;
            for (i, space) in [&plain, &linked].into_iter().enumerate() {
                casters[i].for_each_contact(space, &body, ROOT, from, place, |contact| {
                    deepest[i] = deepest[i].max(contact.depth);
                    is_in_two |= contact.map != Similarity::IDENTITY;
                });
            }
            assert!(
                (deepest[0] - deepest[1]).abs() < 4.0 * ROUNDING,
                "seed {seed}: {deepest:?} {body:?} at {from}"
            );
            n_contacts += usize::from(deepest[0] > 0.0);
            n_both += usize::from(is_in_two);
            // Which way out of a wall is the shortest depends on its triangles.
            if deepest[0] > 0.0 {
                continue;
            }
            let [a, b] =
                [(&plain, 0), (&linked, 1)].map(|(space, i)| casters[i].cast(space, &cast));
            // There, and not straight back.
            assert!(casters[1].counts().images <= 2);
            let is_beyond = b.is_some_and(|hit| hit.map != Similarity::IDENTITY);
            match (a, b) {
                (Some(a), Some(b)) => {
                    // Almost parallel faces amplify the rounding of their vertices.
                    let slant = (a.normal.dot(by) / by.length()).abs().max(1e-3);
                    let off = (a.t - b.t).abs() * by.length() * slant;
                    assert!(off < 4.0 * ROUNDING, "seed {seed}: {a:?} {b:?} {cast:?}");
                    n_hits += 1;
                    n_beyond += usize::from(is_beyond);
                }
                (None, None) => {}
                (Some(hit), None) | (None, Some(hit)) => {
                    // Touched at the end, or in passing.
                    let slant = (hit.normal.dot(by) / by.length()).abs();
                    let is_close =
                        (1.0 - hit.t) * by.length() * slant < 4.0 * ROUNDING || slant < 1e-3;
                    assert!(is_close, "seed {seed}: {a:?} {b:?} {cast:?}");
                }
            }
        }
    }
    let counts = [n_hits, n_beyond, n_contacts, n_both];
    assert!(
        n_hits > 2_000 && n_beyond > 1_000 && n_contacts > 500 && n_both > 100,
        "{counts:?}"
    );
}

// Covers W9.
#[test]
fn steps_through_many_special_portals_end_at_the_right_place_and_lead_back() {
    for turned in [false, true] {
        let world = endless_room(turned);
        let space = Space::new(world.clone()).unwrap();
        let [low, high] = world.graph.cells[0].aabb.map(point);
        let mut rng = Rng::new(8);
        let (mut most, mut total, mut n) = (0, 0, 0);
        while n < 20_000 {
            let share = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.3, 0.7)));
            let from = low + (high - low) * share;
            let angle = rng.range(0.0, std::f64::consts::TAU);
            let along = DVec3::new(angle.cos(), 0.0, angle.sin());
            let by = along * rng.range(0.0, 80.0);
            let (end, whole, crossings, _) = traced_step(&world, from, by);
            let n_passed = crossings.len() as u32;
            if n_passed > 20 {
                continue;
            }
            n += 1;
            let step = space.follow(ROOT, from, by);
            assert_eq!(step.n_passed, n_passed, "{from} {by}");
            assert!(step.at.distance(end) < 1e-9, "{} {end}", step.at);
            assert!(step.map.matrix().abs_diff_eq(whole, 1e-9));
            let is_inside = step.at.cmpge(low).all() && step.at.cmple(high).all();
            assert_eq!(step.place.is_some(), is_inside);
            // There, and by the inverse back.
            let back = step.map.inverse().after(&step.map);
            assert!(back.is_near(&Similarity::IDENTITY, 100.0, 1e-9));
            total += n_passed;
            most = most.max(n_passed);
        }
        assert!(most == 20 && total > 20_000, "{most} {total}");
    }
}

// Covers W9.
#[test]
fn a_step_that_does_not_end_is_cut_off() {
    let world = endless_room(false);
    let space = Space::new(world.clone()).unwrap();
    let [low, high] = world.graph.cells[0].aabb.map(point);
    let step = space.follow(ROOT, (low + high) * 0.5, DVec3::X * 1e6);
    assert!(step.is_capped && step.n_passed == 64);
    assert!(step.place.is_some());
}

// Covers W9.
#[test]
fn a_walker_goes_through_and_back_without_a_jump() {
    let mut rng = Rng::new(2);
    let params = GridParams::two_rooms();
    for seed in 0..6 {
        let world = room_grid(&GridParams {
            seed,
            ..params.clone()
        });
        let turn = DQuat::from_rotation_y(rng.range(-3.0, 3.0));
        let map = Similarity::rigid(turn, DVec3::new(40.0, 7.0, -5.0));
        let linked = linked_copies(&world, PortalId(0), &map);
        let [plain, linked] = [world, linked].map(|w| Space::new(w).unwrap());
        let door = plain.layout(ROOT).opening(PortalId(0));
        let start = (door.center() - door.normal()).with_y(1.6);
        let mut walkers = [0, 1].map(|_| Walker::new(Agent::default(), ROOT, start));
        // The map from the plain world to where the walker is.
        let mut so_far = Similarity::IDENTITY;
        let mut n_passed = 0;
        for i in 0..600 {
            let wish = door.normal() * if i < 300 { 1.2 } else { -1.2 };
            let wish = wish + DVec3::Z * (f64::from(i) * 0.05).sin() * 0.5;
            walkers[0].step(&plain, wish, 0.02);
            let before = walkers[1].eye;
            walkers[1].step(&linked, so_far.vector(wish), 0.02);
            let passed = walkers[1].passed();
            assert!(
                passed.point(before).distance(walkers[1].eye) < 0.2,
                "a jump"
            );
            n_passed += u32::from(passed != Similarity::IDENTITY);
            so_far = passed.after(&so_far);
            let expected = so_far.point(walkers[0].eye);
            assert!(
                expected.distance(walkers[1].eye) < 1e-3,
                "seed {seed}, step {i}: {expected} {}",
                walkers[1].eye
            );
        }
        assert!(n_passed == 2, "{n_passed}");
    }
}

// Covers W9.
#[test]
fn a_ball_that_fits_through_an_opening_does_not_catch_on_the_wall_behind_it() {
    let world = endless_room(true);
    let space = Space::new(world.clone()).unwrap();
    let [low, high] = world.graph.cells[0].aabb.map(point);
    let (mut rng, mut caster) = (Rng::new(5), Caster::new());
    let radius = 0.05;
    let body = Body::Sphere { radius };
    let (mut n, mut n_slanted) = (0, 0);
    for _ in 0..100_000 {
        let share = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.05, 0.95)));
        let from = low + (high - low) * share;
        let spread = DVec3::new(
            rng.range(-1.0, 1.0),
            rng.range(-0.1, 0.1),
            rng.range(-1.0, 1.0),
        );
        let by = spread.normalize() * rng.range(1.0, 4.0);
        let fits = |special: &SpecialPortal, p: DVec3, along: DVec3| {
            let SpecialShape::Surface { normal, pieces } = &special.shape else {
                return false;
            };
            let slant = point(*normal).dot(along).abs();
            let corners = &pieces[0];
            (0..4).all(|k| {
                let (a, b) = (point(corners[k]), point(corners[(k + 1) % 4]));
                let inward = point(*normal).cross(b - a).normalize();
                inward.dot(p - a) > radius / slant + 1e-3
            })
        };
        let (end, _, crossings, _) = traced_step(&world, from, by);
        let inside =
            |p: DVec3| p.cmpgt(low + radius + 0.01).all() && p.cmplt(high - radius - 0.01).all();
        let all_fit = crossings
            .iter()
            .all(|&(k, p, along)| fits(&world.graph.specials[k], p, along));
        if crossings.is_empty() || !inside(from) || !inside(end) || !all_fit {
            continue;
        }
        let place = space.locate(ROOT, from).expect("the room");
        let cast = Cast {
            body: &body,
            frame: ROOT,
            from,
            by,
            place,
        };
        assert_eq!(caster.cast(&space, &cast), None, "{from} {by}");
        n += 1;
        let is_slanted = |&(k, _, along): &(usize, DVec3, DVec3)| {
            let (normal, _) = world.graph.special_opening(SpecialId(k as u32));
            normal.dot(along) < 0.5
        };
        n_slanted += usize::from(crossings.iter().any(is_slanted));
    }
    assert!(n > 2_000 && n_slanted > 200, "{n} {n_slanted}");
}

// Covers W9.
#[test]
fn from_behind_a_special_portal_is_not_there() {
    let mut world = endless_room(false);
    let [low, high] = world.graph.cells[0].aabb.map(point);
    let middle = (low + high) * 0.5;
    // One in the middle of the room, seen from -x.
    let corners = [
        -DVec3::Y - DVec3::Z,
        DVec3::Y - DVec3::Z,
        DVec3::Y + DVec3::Z,
        DVec3::Z - DVec3::Y,
    ];
    let mut own = world.graph.specials[0].clone();
    own.shape = SpecialShape::Surface {
        normal: [1.0, 0.0, 0.0],
        pieces: vec![
            corners
                .map(|c| (middle + c * 0.5).as_vec3().to_array())
                .to_vec(),
        ],
    };
    world.graph.specials = vec![own];
    let space = Space::new(world).unwrap();
    let place = space.locate(ROOT, middle).expect("the room");
    let body = Body::Sphere { radius: 0.1 };
    let mut caster = Caster::new();
    for (side, is_passed) in [(-1.0, true), (1.0, false)] {
        let (from, by) = (middle + DVec3::X * 0.5 * side, -DVec3::X * side);
        let (frame, body) = (ROOT, &body);
        let _ = caster.cast(
            &space,
            &Cast {
                body,
                frame,
                from,
                by,
                place,
            },
        );
        assert_eq!(caster.counts().images, 1 + u32::from(is_passed));
        assert_eq!(space.follow(ROOT, from, by).n_passed, u32::from(is_passed));
    }
}

// Covers W9.
#[test]
fn a_step_that_ends_in_the_opening_passes_with_the_next_one() {
    let world = endless_room(false);
    let space = Space::new(world.clone()).unwrap();
    for id in world.graph.special_ids() {
        let (normal, pieces) = world.graph.special_opening(id);
        // Exactly on the plane, as the library has it.
        let opening = space.layout(ROOT).special_opening(id);
        let on = pieces[0].mean();
        let on = on - normal * opening.height_of(on);
        let to = space.follow(ROOT, on - normal, normal);
        let on = if opening.height_of(to.at) == 0.0 {
            to.at
        } else {
            on
        };
        let steps = [
            space.follow(ROOT, on - normal, on - (on - normal)),
            space.follow(ROOT, on, normal * 0.1),
        ];
        let n: u32 = steps.iter().map(|s| s.n_passed).sum();
        assert_eq!(n, 1, "{id}");
    }
}

/// Adds a box to both rooms of a doorway.
fn add_box(world: &mut World, bounds: Aabb) {
    let corners = bounds.triangles();
    let positions: Vec<[f32; 3]> = corners
        .iter()
        .flatten()
        .map(|p| p.as_vec3().to_array())
        .collect();
    let primitives = vec![Primitive {
        indices: (0..positions.len() as u32).collect(),
        positions,
        ..Primitive::default()
    }];
    let mesh = world.detail_meshes.len() as u32;
    world.detail_meshes.push(Mesh {
        primitives,
        ..Mesh::default()
    });
    world.details.push(DetailObject {
        name: String::new(),
        mesh,
        transform: DMat4::IDENTITY.to_cols_array().map(|x| x as f32),
        cells: world.graph.portals[0].cells.to_vec(),
        source: None,
        part_of: None,
    });
}

// Covers W8.
#[test]
fn a_leaf_with_a_face_in_the_plane_of_a_doorway_stops_what_comes() {
    let mut world = room_grid(&GridParams::two_rooms());
    let space = Space::new(world.clone()).unwrap();
    let door = space.layout(ROOT).opening(PortalId(0));
    let (bounds, normal, center) = (*door.bounds(), door.normal(), door.center());
    add_box(
        &mut world,
        bounds.union(Aabb::new(
            bounds.min + normal * 0.04,
            bounds.max + normal * 0.04,
        )),
    );
    let mut rng = Rng::new(3);
    let linked = linked_copies(&world, PortalId(0), &far_away(&mut rng, 1.0));
    let mut caster = Caster::new();
    for world in [world, linked] {
        let space = Space::new(world).unwrap();
        let from = center - normal;
        let cast = Cast {
            body: &Body::Sphere { radius: 0.1 },
            frame: ROOT,
            from,
            by: normal * 2.0,
            place: space.locate(ROOT, from).expect("a room"),
        };
        let impact = caster.cast(&space, &cast).expect("the leaf");
        assert!((impact.t - 0.45).abs() < 1e-5, "{impact:?}");
    }
}
