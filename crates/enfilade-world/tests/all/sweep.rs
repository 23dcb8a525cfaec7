//! Passages of a moving door over a point at rest. Covers W5.

use enfilade_cpg::World;
use enfilade_geom::{DQuat, DVec3};
use enfilade_testkit::{GridParams, Rng, cabin, room_grid};
use enfilade_world::{PartId, Passing, Pose, Space};

/// Passages by straight lines between a number of poses on the way.
fn by_steps(
    space: &Space,
    world: &World,
    part: PartId,
    [start, end]: [&Pose; 2],
    p: DVec3,
    n: usize,
) -> Vec<(u32, bool, f64)> {
    let mut found = Vec::new();
    let at = |k: usize| start.toward(end, k as f64 / n as f64).point_back(p);
    for portal in world.graph.portal_ids() {
        let opening = space.layout(part).opening(portal);
        let mut a = at(0);
        for k in 0..n {
            let b = at(k + 1);
            let [ha, hb] = [a, b].map(|q| opening.height_of(q));
            if (ha > 0.0) != (hb > 0.0) {
                let q = a.lerp(b, ha / (ha - hb));
                let is_inside = opening.pieces().any(|piece| {
                    (0..piece.len()).all(|i| {
                        let along = piece[(i + 1) % piece.len()] - piece[i];
                        opening.normal().cross(along).dot(q - piece[i]) > 1e-4
                    })
                });
                if is_inside {
                    let is_up = hb > 0.0;
                    let outward = space.layout(part).cell(opening.cells()[1]).is_outdoor;
                    found.push((portal.0, is_up != outward, k as f64 / n as f64));
                }
            }
            a = b;
        }
    }
    found
}

#[test]
fn no_passing_is_missed() {
    let world = cabin(1, 1.0, 4);
    let root = room_grid(&GridParams::two_rooms());
    let mut space = Space::new(root.clone()).unwrap();
    let part = space
        .add_part(world.clone(), PartId::ROOT, Pose::IDENTITY)
        .unwrap();
    let mut rng = Rng::new(4);
    let mut passings: Vec<Passing> = Vec::new();
    let mut n_found = 0;
    for _ in 0..600 {
        let vector = |rng: &mut Rng, r: f64| DVec3::from_array([0, 1, 2].map(|_| rng.range(-r, r)));
        let turn = DQuat::from_axis_angle(vector(&mut rng, 1.0).normalize(), rng.range(0.0, 3.0));
        let start = Pose {
            turn,
            at: vector(&mut rng, 4.0),
        };
        let axis = vector(&mut rng, 1.0).normalize();
        let end = Pose {
            turn: DQuat::from_axis_angle(axis, rng.range(0.0, 0.52)) * turn,
            at: start.at + vector(&mut rng, 2.0),
        };
        // Near a window on its way.
        let windows = world.graph.portals.len();
        let window = enfilade_cpg::PortalId(rng.below(windows) as u32);
        let center = space.layout(part).opening(window).center();
        let middle = start.toward(&end, rng.unit());
        let p = middle.point(center + vector(&mut rng, 0.6));
        passings.clear();
        space.passings(part, [&start, &end], p, &mut passings);
        assert!(passings.is_sorted_by(|a, b| a.at <= b.at));
        for (portal, is_inward, t) in by_steps(&space, &world, part, [&start, &end], p, 1024) {
            n_found += 1;
            let is_known = passings.iter().any(|x| {
                x.portal.0 == portal
                    && x.is_inward == is_inward
                    && (t - 1e-6..=t + 1.0 / 1024.0 + 1e-6).contains(&x.at)
            });
            assert!(is_known, "{portal} {is_inward} at {t}: {passings:?}");
        }
    }
    assert!(n_found > 200, "{n_found}");
}

#[test]
fn an_arc_is_not_its_chord() {
    // A window swings about a far hinge: the straight line between its ends passes the point by.
    let world = cabin(1, 1.0, 4);
    let root = room_grid(&GridParams::two_rooms());
    let mut space = Space::new(root.clone()).unwrap();
    let part = space
        .add_part(world.clone(), PartId::ROOT, Pose::IDENTITY)
        .unwrap();
    let opening = space.layout(part).opening(enfilade_cpg::PortalId(0));
    let (center, normal) = (opening.center(), opening.normal());
    let hinge = center + normal.cross(DVec3::Y) * 30.0;
    let at = |angle: f64| Pose::about(hinge, DVec3::Y, angle);
    let end = at(0.5);
    // Half way, at the window's middle, by the motion between the two poses.
    let p = Pose::IDENTITY.toward(&end, 0.5).point(center);
    let mut passings = Vec::new();
    space.passings(part, [&Pose::IDENTITY, &end], p, &mut passings);
    let own: Vec<_> = passings.iter().filter(|x| x.portal.0 == 0).collect();
    assert_eq!(own.len(), 1, "{passings:?}");
    assert!((own[0].at - 0.5).abs() < 1e-6);
    // A straight line alone misses it.
    let first = by_steps(&space, &world, part, [&Pose::IDENTITY, &end], p, 1);
    assert!(first.iter().all(|x| x.0 != 0), "{first:?}");
}

#[test]
fn a_point_may_go_out_and_come_in_in_one_motion() {
    let world = cabin(1, 1.0, 4);
    let root = room_grid(&GridParams::two_rooms());
    let mut space = Space::new(root.clone()).unwrap();
    let part = space
        .add_part(world.clone(), PartId::ROOT, Pose::IDENTITY)
        .unwrap();
    let opening = space.layout(part).opening(enfilade_cpg::PortalId(0));
    let is_outward = space.layout(part).cell(opening.cells()[1]).is_outdoor;
    let outward = opening.normal() * if is_outward { 1.0 } else { -1.0 };
    // The cabin turns about an axis behind the window; the point is a little farther from it than the window's plane: out
    // while the two face each other, in before and after.
    let (distance, half) = (1.5, 10_f64.to_radians());
    let axis = opening.center() - outward * distance;
    let at = |degrees: f64| Pose::about(axis, DVec3::Y, degrees.to_radians());
    let p = axis + outward * distance / half.cos();
    let mut passings = Vec::new();
    space.passings(part, [&at(-15.0), &at(15.0)], p, &mut passings);
    let own = passings.iter().filter(|x| x.portal.0 == 0);
    assert_eq!(own.map(|x| x.is_inward).collect::<Vec<_>>(), [false, true]);
}
