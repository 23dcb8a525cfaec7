//! Bodies that move among rooms that move hit what they would hit in all triangles at that instant. Covers W12, W5.

use enfilade_cpg::World;
use enfilade_geom::{DQuat, DVec3, Triangle, closest_point_on_triangle};
use enfilade_testkit::{GridParams, Rng, cabin, room_grid};
use enfilade_world::{Agent, Body, Cast, Caster, PartId, Pose, Space, Walker};

/// All triangles of all parts where they are now, in the frame of the root.
fn model(space: &Space) -> Vec<Triangle> {
    let mut all = Vec::new();
    for part in (0..space.n_parts() as u32).map(PartId) {
        let (world, pose): (&World, _) = (space.world(part), space.pose(part).matrix());
        for batch in &world.batches {
            all.extend(batch.primitive.placed_triangles(pose));
        }
        for object in &world.details {
            let place = pose * object.placement();
            for p in &world.detail_meshes[object.mesh as usize].primitives {
                all.extend(p.placed_triangles(place));
            }
        }
    }
    all
}

/// The first time at which a ball touches a triangle: steps by its distance from all of them, so it never passes one.
fn first_touch(model: &[Triangle], radius: f64, from: DVec3, by: DVec3) -> f64 {
    let mut t = 0.0;
    for _ in 0..10_000 {
        let at = from + by * t;
        let distances = model
            .iter()
            .map(|t| closest_point_on_triangle(at, t).distance(at));
        let gap = distances.fold(f64::INFINITY, f64::min) - radius;
        if gap < 1e-7 {
            break;
        }
        t += gap / by.length();
        if t > 1.0 {
            return f64::INFINITY;
        }
    }
    t
}

/// Casts balls from random points about a part, in its frame, and compares them with the model; returns the numbers of impacts
/// and of casts that reached several parts.
fn compare(space: &Space, rng: &mut Rng, n: usize) -> [usize; 2] {
    let model = model(space);
    let mut caster = Caster::new();
    let (mut n_impacts, mut n_several) = (0, 0);
    for _ in 0..n {
        let frame = PartId(rng.below(space.n_parts()) as u32);
        let place = PartId(rng.below(space.n_parts()) as u32);
        let layout = space.layout(place);
        let bounds = layout.cell(enfilade_cpg::CellId(0)).bounds;
        let share = DVec3::from_array([0, 1, 2].map(|_| rng.unit()));
        let from = space
            .between(place, frame)
            .point(bounds.min + bounds.size() * share);
        let radius = rng.range(0.0, 0.3);
        let by = DVec3::from_array([4.0, 1.0, 4.0].map(|x| rng.range(-x, x)));
        let Some(place) = space.locate(frame, from) else {
            continue;
        };
        let to_root = space.between(frame, PartId::ROOT);
        let (start, along) = (to_root.point(from), to_root.direction(by));
        if first_touch(&model, radius + 1e-3, start, along) == 0.0 {
            continue;
        }
        let cast = Cast {
            body: &Body::Sphere { radius },
            frame,
            from,
            by,
            place,
        };
        let found = caster.cast(space, &cast);
        let first = caster.places()[0].part;
        n_several += usize::from(caster.places().iter().any(|p| p.part != first));
        let t = found.map_or(f64::INFINITY, |i| i.t);
        let earliest = first_touch(&model, radius + 1e-5, start, along);
        let latest = first_touch(&model, (radius - 1e-5).max(0.0), start, along);
        let what = format!("{cast:?} {place:?}: {found:?}, {earliest} to {latest}");
        assert!(t >= earliest - 1e-5 && t <= latest + 1e-5, "{what}");
        if let Some(impact) = found {
            n_impacts += 1;
            let center = from + by * impact.t;
            let off = center.distance(impact.point) - radius;
            assert!(off.abs() < 1e-6 && impact.normal.dot(by) < 0.0, "{what}");
            let p = to_root.point(impact.point);
            let near = model
                .iter()
                .map(|t| closest_point_on_triangle(p, t).distance(p));
            assert!(near.fold(f64::INFINITY, f64::min) < 1e-6, "{what}");
        }
    }
    [n_impacts, n_several]
}

/// A pose of a cabin in the middle of a larger one, a little turned and moved.
fn within(rng: &mut Rng, own: &Space, [part, host]: [PartId; 2]) -> Pose {
    let bounds = |p: PartId| own.layout(p).cell(enfilade_cpg::CellId(0)).bounds;
    let turn = DQuat::from_euler(glam::EulerRot::YXZ, rng.range(-0.15, 0.15), 0.04, 0.02);
    let shift = DVec3::from_array([0, 1, 2].map(|_| rng.range(-0.03, 0.03)));
    let at = bounds(host).center() + shift - turn * bounds(part).center();
    Pose { turn, at }
}

#[test]
fn balls_hit_the_same_as_in_all_triangles() {
    let worlds: Vec<World> = (0..4)
        .map(|k| cabin(7, 1.6_f32.powi(3 - k), if k == 3 { 2 } else { 0 }))
        .collect();
    let mut space = Space::new(worlds[0].clone()).unwrap();
    let mut host = PartId::ROOT;
    for world in &worlds[1..] {
        host = space.add_part(world.clone(), host, Pose::IDENTITY).unwrap();
    }
    let mut rng = Rng::new(1);
    let mut n = [0; 2];
    for _ in 0..6 {
        for k in 1..4 {
            let pose = within(&mut rng, &space, [PartId(k), PartId(k - 1)]);
            space.set_pose(PartId(k), pose).unwrap();
        }
        let more = compare(&space, &mut rng, 120);
        n = [n[0] + more[0], n[1] + more[1]];
    }
    assert!(n[0] > 200 && n[1] > 100, "{n:?}");
}

/// Two cabins whose windows face each other, from 1 cm apart to 1 cm into each other: a ball flies through, and a wall beside
/// the window stops it.
#[test]
fn a_ball_flies_through_windows_that_dock() {
    let root = room_grid(&GridParams {
        outdoors: false,
        ..GridParams::two_rooms()
    });
    let world = std::sync::Arc::new(cabin(1, 1.0, 0));
    let mut caster = Caster::new();
    for gap in [-0.01, -0.004, 0.0, 0.005, 0.01] {
        let mut space = Space::new(root.clone()).unwrap();
        // Far from the building, in solid matter: only the doors lead on.
        let far = Pose::from_translation(DVec3::X * 100.0);
        let [a, b] = [0, 1].map(|_| {
            let part = space.add_part(world.clone(), PartId::ROOT, far);
            part.unwrap()
        });
        let window = space.layout(a).opening(enfilade_cpg::PortalId(0));
        let out = if space.layout(a).cell(window.cells()[1]).is_outdoor {
            window.normal()
        } else {
            -window.normal()
        };
        let center = window.center();
        let turned = Pose::about(center, DVec3::Y, std::f64::consts::PI);
        let apart = Pose::from_translation(out * gap);
        space.set_pose(b, far.after(&apart).after(&turned)).unwrap();
        for radius in [0.0, 0.001, 0.1] {
            let body = Body::Sphere { radius };
            let from = center - out;
            let cast = Cast {
                body: &body,
                frame: a,
                from,
                by: out * 3.0,
                place: space.locate(a, from).unwrap(),
            };
            let through = caster.cast(&space, &cast);
            let is_in_b = caster.places().iter().any(|p| p.part == b);
            assert!(is_in_b, "{gap} {radius}: {through:?}");
            let length = through.map_or(3.0, |i| i.t * 3.0);
            assert!(length > 2.0, "{gap} {radius}: {through:?}");
        }
    }
}

/// A lift carries a walker who steps in, and lets go of one who steps out.
#[test]
fn a_walker_rides_a_lift() {
    let hall = room_grid(&GridParams {
        size: [1, 1, 1],
        windows: 0.0,
        doors: 0.0,
        furniture: 0,
        ..GridParams::offices(1, 4)
    });
    let cabin = cabin(1, 0.5, 0);
    let mut space = Space::new(hall).unwrap();
    let lift = space.add_part(cabin, PartId::ROOT, Pose::IDENTITY).unwrap();
    let room = space
        .layout(PartId::ROOT)
        .cell(enfilade_cpg::CellId(0))
        .bounds;
    let own = space.layout(lift).cell(enfilade_cpg::CellId(0)).bounds;
    // On the floor of the hall, whose thickness is none.
    let at = room.center().with_y(room.min.y) - own.center().with_y(own.min.y - 0.01);
    space.set_pose(lift, Pose::from_translation(at)).unwrap();
    let eye = own.center().with_y(own.min.y + 1.0);
    let agent = Agent {
        eye: 1.0,
        height: 1.1,
        radius: 0.1,
        ..Agent::default()
    };
    let mut walker = Walker::new(
        agent,
        PartId::ROOT,
        space.between(lift, PartId::ROOT).point(eye),
    );
    walker.step(&space, DVec3::ZERO, 0.02);
    assert_eq!(walker.frame, lift);
    for i in 0..100 {
        let up = DVec3::Y * 0.02 * f64::from(i);
        space
            .set_pose(lift, Pose::from_translation(at + up))
            .unwrap();
        walker.step(&space, DVec3::ZERO, 0.02);
        assert_eq!(walker.frame, lift);
        assert!(
            (walker.eye.y - own.min.y - 1.0).abs() < 0.02,
            "{}",
            walker.eye
        );
        let inside = walker.place().unwrap();
        assert_eq!(inside.part, lift);
    }
    // Beside it, it stays where it is.
    let beside = DVec3::new(room.min.x + 0.3, room.min.y + 1.0, room.min.z + 0.3);
    (walker.frame, walker.eye) = (PartId::ROOT, beside);
    for i in (0..100).rev() {
        let up = DVec3::Y * 0.02 * f64::from(i);
        space
            .set_pose(lift, Pose::from_translation(at + up))
            .unwrap();
        walker.step(&space, DVec3::ZERO, 0.02);
    }
    assert_eq!(walker.frame, PartId::ROOT);
    assert!(walker.eye.distance(beside) < 0.02);
}
