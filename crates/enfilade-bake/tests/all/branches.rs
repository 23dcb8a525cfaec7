//! Branches of tubes through the Delaunay builder, and forks through the watershed: one cell each, though nothing pinches them.

use std::collections::BTreeSet;

use enfilade_bake::delaunay::Session;
use enfilade_bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade_cpg::PortalKind;
use enfilade_geom::DVec3;
use enfilade_testkit::{Generated, Tube, tubes};
use enfilade_verify::{VerifyOptions, verify_world};
use proptest::prelude::*;

/// A tube that leaves the axis of another at `foot`, in the direction `away`, and has this `length` from there.
fn side_tube(foot: DVec3, away: DVec3, length: f64, radius: f64) -> Tube {
    let away = away.normalize();
    Tube {
        ends: [foot, foot + away * (length - radius)],
        radius,
    }
}

fn trunk(half: f64, radius: f64) -> Tube {
    Tube {
        ends: [DVec3::X * -half, DVec3::X * half],
        radius,
    }
}

/// Returns the room of each point after the default stop.
fn rooms_at(g: &Generated, scale: f64, points: &[DVec3]) -> Vec<u32> {
    let mut config = BakeConfig::of(Method::Delaunay);
    config.min_opening *= scale;
    config.merge.min_radius *= scale;
    let context = BakeContext::new(&Silent, None);
    let session = Session::begin(&g.scene, &config, &context).unwrap();
    let room_of_cell = session.decimation.after(session.decimation.stop);
    let space = &session.space;
    let room = |&p: &DVec3| {
        let t = space.delaunay.locate(p, 0);
        room_of_cell[session.cells.cell_of_part[t as usize] as usize]
    };
    points.iter().map(room).collect()
}

/// A trunk with three side tubes of various widths and angles, and a stub.
fn vessel() -> (Vec<Tube>, [DVec3; 3], DVec3) {
    let sides = [
        side_tube(DVec3::X * -4.0, DVec3::Y, 5.0, 0.6),
        side_tube(DVec3::X * -0.5, DVec3::new(0.7, 0.0, 1.0), 5.5, 0.5),
        side_tube(DVec3::X * 3.0, DVec3::new(-0.6, -0.8, -0.3), 5.0, 0.4),
    ];
    // Less than twice as deep as wide.
    let stub = side_tube(DVec3::X * 3.5, DVec3::Y, 2.7, 0.5);
    let tips = sides.map(|t| t.ends[1]);
    let mut all = vec![trunk(6.0, 1.0)];
    all.extend(sides);
    all.push(stub);
    (all, tips, stub.ends[1])
}

// Covers V10, and T6: the rooms left by decimation are divided where branches leave them, and decimated again.
#[test]
fn side_tubes_are_cells_and_a_stub_is_none() {
    let (all, tips, stub) = vessel();
    let g = tubes(&all, 0.17);
    let context = BakeContext::new(&Silent, None);
    let world = bake(&g.scene, &BakeConfig::of(Method::Delaunay), &context)
        .unwrap()
        .world;
    let at = |p: DVec3| world.graph.locator.locate(p).unwrap();
    let trunk = at(DVec3::ZERO);
    for p in [DVec3::X * 5.5, DVec3::X * -5.5, stub] {
        assert_eq!(at(p), trunk, "{p}");
    }
    let cells: BTreeSet<_> = tips.iter().map(|&p| at(p)).chain([trunk]).collect();
    assert_eq!(cells.len(), 4);
    let indoor = world.graph.indoor_cells().count();
    assert_eq!(indoor, 4);
    let open: Vec<_> = world
        .graph
        .portals
        .iter()
        .filter(|p| p.kind != PortalKind::Crack)
        .collect();
    assert_eq!(open.len(), 3);
    for (tube, tip) in all[1..4].iter().zip(tips) {
        let portal = open.iter().find(|p| p.cells.contains(&at(tip))).unwrap();
        assert!(portal.cells.contains(&trunk));
        let n = portal.outline.len() as f64;
        let sum: DVec3 = portal
            .outline
            .iter()
            .map(|p| DVec3::from_array(p.map(f64::from)))
            .sum();
        let along = (tube.ends[1] - tube.ends[0]).normalize();
        let from_foot = sum / n - tube.ends[0];
        let off = from_foot - along * from_foot.dot(along);
        // Within a diameter of the point where the tube's axis leaves the trunk.
        let wall = 1.0 / (1.0 - along.x * along.x).sqrt();
        let out = from_foot.dot(along) - wall;
        assert!(
            out > -tube.radius && out < 2.0 * tube.radius,
            "{out} of {tube:?}"
        );
        assert!(off.length() < 0.5 * tube.radius, "{off} of {tube:?}");
    }
    let options = VerifyOptions {
        rays: 20_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(&world, None, &options);
    assert!(report.holds(), "{report}");
}

#[test]
fn a_neck_between_chambers_and_a_handle_are_none() {
    let tube = |a: [f64; 3], b: [f64; 3], radius: f64| Tube {
        ends: [a, b].map(DVec3::from_array),
        radius,
    };
    // A narrow passage of nine diameters between two chambers, which are rooms: it is part of one of them.
    let neck = [
        tube([-7.0, 0.0, 0.0], [-6.0, 0.0, 0.0], 1.2),
        tube([-6.0, 0.0, 0.0], [6.0, 0.0, 0.0], 0.55),
        tube([6.0, 0.0, 0.0], [7.0, 0.0, 0.0], 1.2),
    ];
    let points = [-6.5, -3.0, 3.0, 6.5].map(|x| DVec3::X * x);
    let rooms = rooms_at(&tubes(&neck, 0.2), 1.0, &points);
    assert_ne!(rooms[0], rooms[3]);
    for neck in &rooms[1..3] {
        assert!([rooms[0], rooms[3]].contains(neck), "{rooms:?}");
    }
    // A handle leaves the trunk and returns to it.
    let handle = [
        trunk(4.0, 1.0),
        tube([-2.5, 0.0, 0.0], [-2.5, 3.0, 0.0], 0.5),
        tube([-2.5, 3.0, 0.0], [2.5, 3.0, 0.0], 0.5),
        tube([2.5, 3.0, 0.0], [2.5, 0.0, 0.0], 0.5),
    ];
    let points = [DVec3::ZERO, DVec3::Y * 3.0];
    let rooms = rooms_at(&tubes(&handle, 0.2), 1.0, &points);
    assert_eq!(rooms[0], rooms[1]);
}

#[test]
fn an_alcove_and_a_crevice_are_none() {
    let lies_in_the_trunk = |extra: &[Tube], tip: DVec3, what: &str| {
        let mut all = vec![trunk(3.0, 1.0)];
        all.extend(extra);
        let rooms = rooms_at(&tubes(&all, 0.2), 1.0, &[DVec3::ZERO, tip]);
        assert_eq!(rooms[0] == rooms[1], what != "tube", "{what}");
    };
    // Half as wide as the trunk, and this many diameters deep: the bound is two.
    let deep = |depth: f64| side_tube(DVec3::ZERO, DVec3::Y, 1.0 + depth, 0.5);
    lies_in_the_trunk(&[deep(2.6)], deep(2.6).ends[1], "tube");
    lies_in_the_trunk(&[deep(1.9)], deep(1.9).ends[1], "alcove");
    // A gap between parallel walls, four times as long as wide and four times as deep.
    let slit: Vec<Tube> = (-6..=6)
        .map(|i| side_tube(DVec3::X * (0.2 * f64::from(i)), DVec3::Y, 4.4, 0.4))
        .collect();
    lies_in_the_trunk(&slit, DVec3::Y * 3.8, "crevice");
}

/// Scales a scene about the origin.
fn times(mut g: Generated, scale: f64) -> Generated {
    let meshes = g.scene.meshes.iter_mut();
    for p in meshes.flat_map(|m| &mut m.primitives) {
        for x in p.positions.iter_mut().flatten() {
            *x *= scale as f32;
        }
    }
    g
}

proptest! {
    // Each case divides a few thousand triangles.
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Two tubes leave a trunk of radius 1 at random angles. One is a cell if it is narrow and deep, the other if
    /// it is narrow enough, at any scale.
    #[test]
    fn narrow_and_deep_is_a_cell(
        narrow in 0.35..0.6_f64,
        // Mouth to tip in diameters: well below the bound of two, or well above it.
        depth in prop_oneof![0.6..1.8_f64, 2.6..3.2],
        // Narrower than the bound of 1 : 1.5 by a tenth, or wider by a tenth.
        other in prop_oneof![0.4..0.6_f64, 0.74..0.9],
        lean in -0.6..0.6_f64,
        turn in 0.8..2.4_f64,
        scale in prop::sample::select(vec![0.01, 1.0, 40.0]),
    ) {
        // The mouth is at the trunk's wall, slightly farther out if the tube leans.
        let one = side_tube(
            DVec3::X * -1.5,
            DVec3::new(lean, 1.0, 0.0),
            (1.0 + lean * lean).sqrt() + depth * 2.0 * narrow,
            narrow,
        );
        let two = side_tube(
            DVec3::X * 1.5,
            DVec3::new(0.0, turn.cos(), turn.sin()),
            1.0 + 2.6 * 2.0 * other,
            other,
        );
        let g = times(tubes(&[trunk(3.0, 1.0), one, two], 0.2), scale);
        let tip = |t: &Tube| t.ends[1] - (t.ends[1] - t.ends[0]).normalize() * 0.01;
        let points = [DVec3::ZERO, DVec3::X * 2.5, DVec3::X * -2.5, tip(&one), tip(&two)];
        let rooms = rooms_at(&g, scale, &points.map(|p| p * scale));
        prop_assert_eq!(rooms[0], rooms[1]);
        prop_assert_eq!(rooms[0], rooms[2]);
        prop_assert_eq!(rooms[3] != rooms[0], depth > 2.0, "deep");
        prop_assert_eq!(rooms[4] != rooms[0], other < 0.65, "narrow");
        prop_assert!(rooms[3] != rooms[4] || rooms[3] == rooms[0]);
    }
}

/// Tubes from the origin, with directions as angles in degrees, `length` meters long.
fn star(angles: &[f64], length: f64, radius: f64) -> Vec<Tube> {
    let arm = |angle: &f64| {
        let (sin, cos) = angle.to_radians().sin_cos();
        side_tube(DVec3::ZERO, DVec3::new(cos, sin, 0.0), length, radius)
    };
    angles.iter().map(arm).collect()
}

fn n_different(rooms: &[u32]) -> usize {
    rooms.iter().collect::<BTreeSet<_>>().len()
}

#[test]
fn arms_as_wide_as_their_stem_are_cells() {
    for (angles, what) in [
        (&[0.0, 120.0, 240.0][..], "star of three"),
        (&[0.0, 90.0, 180.0], "T"),
        (&[0.0, 90.0, 180.0, 270.0], "cross"),
        (&[0.0, 150.0, 210.0], "Y"),
        (&[0.0, 160.0, 200.0], "Y of 40 degrees"),
    ] {
        let arms = star(angles, 5.0, 0.5);
        let tips: Vec<DVec3> = arms.iter().map(|t| t.ends[1]).collect();
        let rooms = rooms_at(&tubes(&arms, 0.12), 1.0, &tips);
        assert_eq!(n_different(&rooms), tips.len(), "{what}: {rooms:?}");
    }
    // A bend is not a fork, and neither is a junction with an arm less than two diameters long.
    let mut bend = star(&[0.0, 90.0], 5.0, 0.5);
    bend.extend(star(&[220.0], 2.0, 0.5));
    let tips: Vec<DVec3> = bend.iter().map(|t| t.ends[1]).collect();
    let rooms = rooms_at(&tubes(&bend, 0.12), 1.0, &tips);
    assert_eq!(n_different(&rooms), 1, "{rooms:?}");
}

/// A tube in the plane z = 0.
fn flat_tube(ends: [[f64; 2]; 2]) -> Tube {
    Tube {
        ends: ends.map(|p| DVec3::new(p[0], p[1], 0.0)),
        radius: 0.4,
    }
}

/// A stem, two arms, and two more at the end of each.
fn tree() -> [Tube; 7] {
    [
        flat_tube([[-4.0, 0.0], [0.0, 0.0]]),
        flat_tube([[0.0, 0.0], [3.0, 3.0]]),
        flat_tube([[0.0, 0.0], [3.0, -3.0]]),
        flat_tube([[3.0, 3.0], [3.0, 6.5]]),
        flat_tube([[3.0, 3.0], [6.5, 3.0]]),
        flat_tube([[3.0, -3.0], [3.0, -6.5]]),
        flat_tube([[3.0, -3.0], [6.5, -3.0]]),
    ]
}

/// Returns the cell of each point, by the watershed.
fn cells_at(g: &Generated, points: &[DVec3]) -> Vec<u32> {
    let context = BakeContext::new(&Silent, None);
    let config = BakeConfig::of(Method::Watershed);
    let world = bake(&g.scene, &config, &context).unwrap().world;
    let cell = |&p: &DVec3| world.graph.locator.locate(p).unwrap().0;
    points.iter().map(cell).collect()
}

// Covers V10: the rule for forks is one for all builders.
#[test]
fn arms_of_forks_are_cells_by_the_watershed() {
    let middle = |t: &Tube| (t.ends[0] + t.ends[1]) * 0.5;
    let twice = |tubes_of: &[Tube]| times(tubes(tubes_of, 0.12), 2.0);
    // Nobody stands in these tubes, except that the stem of the second is as high as a room: low branches are not voids.
    let mut high = tree();
    high[0].radius = 0.53;
    for (tubes_of, what) in [(tree(), "tree"), (high, "with a high stem")] {
        let points: Vec<DVec3> = tubes_of.iter().map(|t| middle(t) * 2.0).collect();
        let cells = cells_at(&twice(&tubes_of), &points);
        assert_eq!(n_different(&cells), 7, "{what}: {cells:?}");
    }
    // A bend is not a fork, and neither is a junction with an arm less than two diameters long.
    let mut bend = star(&[0.0, 90.0], 5.0, 0.5);
    bend.extend(star(&[220.0], 1.9, 0.5));
    let tips: Vec<DVec3> = bend.iter().map(|t| t.ends[1] * 2.0).collect();
    let cells = cells_at(&twice(&bend), &tips);
    assert_eq!(n_different(&cells), 1, "{cells:?}");
    // A ring with a spur: three arms leave the fork, but two of them are one.
    let (ring, spur) = ring_with_spur();
    let mut points: Vec<DVec3> = ring.iter().map(|t| middle(t) * 2.0).collect();
    points.push(DVec3::X * 14.0);
    let cells = cells_at(&twice(&[&ring[..], &[spur]].concat()), &points);
    assert_eq!(n_different(&cells), 2, "{cells:?}");
    assert_eq!(n_different(&cells[..12]), 1, "{cells:?}");
}

fn ring_with_spur() -> (Vec<Tube>, Tube) {
    let ring = (0..12).map(|i| {
        let at = |i: i32| (f64::from(i) * 30.0).to_radians().sin_cos();
        let (p, q) = (at(i), at(i + 1));
        flat_tube([[3.5 * p.0, 3.5 * p.1], [3.5 * q.0, 3.5 * q.1]])
    });
    (ring.collect(), flat_tube([[3.5, 0.0], [8.0, 0.0]]))
}

#[test]
fn arms_that_part_again_and_meet_again_are_cells() {
    let tree = tree();
    let middle = |t: &Tube| (t.ends[0] + t.ends[1]) * 0.5;
    let mut points: Vec<DVec3> = tree.iter().map(middle).collect();
    points.extend(tree[3..].iter().map(|t| t.ends[1]));
    let rooms = rooms_at(&tubes(&tree, 0.12), 1.0, &points);
    assert_eq!(n_different(&rooms), 7, "{rooms:?}");
    assert_eq!(rooms[3..7], rooms[7..]);
    // A ring with a spur: three arms leave the fork, but two of them are one.
    let (ring, spur) = ring_with_spur();
    let all = [&ring[..], &[spur]].concat();
    let mut points: Vec<DVec3> = ring.iter().map(middle).collect();
    points.push(DVec3::X * 7.0);
    let rooms = rooms_at(&tubes(&all, 0.12), 1.0, &points);
    assert_eq!(n_different(&rooms), 2, "{rooms:?}");
    assert_eq!(n_different(&rooms[..12]), 1, "{rooms:?}");
}

/// Crossing corridors of one height are one room to their architect.
#[test]
fn corridors_that_cross_are_one_room() {
    let (half, height, long) = (0.9, 2.4, 8.0);
    let mut g = tubes(&star(&[0.0], 2.0, 0.5), 0.3);
    let mesh = &mut g.scene.meshes[0].primitives[0];
    mesh.positions.clear();
    mesh.indices.clear();
    let mut quad = |c: [[f64; 3]; 4]| {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(c.map(|p| p.map(|x| x as f32)));
        mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    };
    // Counter-clockwise seen from above: a cross.
    let plan: Vec<[f64; 2]> = (0..4)
        .flat_map(|k| {
            let (sin, cos) = (f64::from(k) * 90.0).to_radians().sin_cos();
            [[long, -half], [long, half], [half, half]]
                .map(|[x, z]| [x * cos - z * sin, x * sin + z * cos])
        })
        .collect();
    for i in 0..12 {
        let ([ax, az], [bx, bz]) = (plan[i], plan[(i + 1) % 12]);
        quad([
            [ax, 0.0, az],
            [bx, 0.0, bz],
            [bx, height, bz],
            [ax, height, az],
        ]);
    }
    let arms = [
        [-long, -half, -half, half],
        [-half, -half, half, half],
        [half, -half, long, half],
    ];
    let ends = [[-half, -long, half, -half], [-half, half, half, long]];
    for [x0, z0, x1, z1] in arms.into_iter().chain(ends) {
        quad([[x0, 0.0, z0], [x0, 0.0, z1], [x1, 0.0, z1], [x1, 0.0, z0]]);
        quad([
            [x0, height, z0],
            [x1, height, z0],
            [x1, height, z1],
            [x0, height, z1],
        ]);
    }
    let y = height / 2.0;
    let points = [[7.0, 0.0], [0.0, 7.0], [-7.0, 0.0], [0.0, -7.0], [0.0, 0.0]];
    let rooms = rooms_at(&g, 1.0, &points.map(|[x, z]| DVec3::new(x, y, z)));
    assert_eq!(n_different(&rooms), 1, "{rooms:?}");
    assert_ne!(rooms[0], 0);
    let cells = cells_at(&g, &points.map(|[x, z]| DVec3::new(x, y, z)));
    assert_eq!(n_different(&cells), 1, "{cells:?}");
}

/// Opens tubes at some ends: removes everything beyond.
fn opened(mut g: Generated, ends: &[(DVec3, DVec3)]) -> Generated {
    let mesh = &mut g.scene.meshes[0].primitives[0];
    let is_gone = |i: &u32| {
        let p = DVec3::from_array(mesh.positions[*i as usize].map(f64::from));
        ends.iter()
            .any(|(end, out)| (p - *end).dot(*out) > 0.0 && p.distance(*end) < 1.5)
    };
    let kept = mesh.indices.chunks(3).filter(|t| !t.iter().any(is_gone));
    mesh.indices = kept.flatten().copied().collect();
    g
}

#[test]
fn a_vessel_that_is_open_at_its_ends_is_indoors() {
    for (angles, what) in [
        (&[0.0, 180.0][..], "pipe"),
        (&[0.0, 120.0, 240.0], "star of three"),
    ] {
        let arms = star(angles, 5.0, 0.5);
        let end = |t: &Tube| (t.ends[1], (t.ends[1] - t.ends[0]).normalize());
        let ends: Vec<(DVec3, DVec3)> = arms.iter().map(end).collect();
        let middles: Vec<DVec3> = arms.iter().map(|t| t.ends[1] * 0.6).collect();
        for n_open in 1..=ends.len() {
            let g = opened(tubes(&arms, 0.12), &ends[..n_open]);
            let context = BakeContext::new(&Silent, None);
            let world = bake(&g.scene, &BakeConfig::of(Method::Delaunay), &context)
                .unwrap()
                .world;
            let graph = &world.graph;
            let at = |p: &DVec3| graph.locator.locate(*p).unwrap().0;
            let cells: BTreeSet<u32> = middles.iter().map(at).collect();
            assert!(!cells.contains(&0), "{what}, {n_open} open: {cells:?}");
            let n_cells = if angles.len() == 2 { 1 } else { 3 };
            assert_eq!(cells.len(), n_cells, "{what}, {n_open} open: {cells:?}");
            // At the end of the tube there is a portal to the outdoors, as wide as the tube.
            let out: Vec<_> = graph
                .portals
                .iter()
                .filter(|p| p.kind != PortalKind::Crack && p.cells.iter().any(|c| c.0 == 0))
                .collect();
            assert_eq!(out.len(), n_open, "{what}");
        }
    }
    // A ring is not a tunnel: less than two diameters for each of its ends.
    let ring = star(&[0.0, 180.0], 1.7, 0.5);
    let end = |t: &Tube| (t.ends[1], (t.ends[1] - t.ends[0]).normalize());
    let g = opened(
        tubes(&ring, 0.12),
        &ring.iter().map(end).collect::<Vec<_>>(),
    );
    assert_eq!(rooms_at(&g, 1.0, &[DVec3::ZERO]), [0]);
}

proptest! {
    // Each case divides ten thousand triangles.
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Three tubes of nearly one width that meet at any angles are three cells, at any scale; one cell if one of them
    /// is shorter than two diameters, from where it leaves the others.
    #[test]
    fn where_three_tubes_meet_are_three_cells(
        angles in prop::array::uniform3((-0.9..0.9_f64, 0.0..6.3_f64)),
        // With narrower ones, those are branches and the other two a bend.
        narrow in 0.8..1.0_f64,
        is_short in any::<bool>(),
        scale in prop::sample::select(vec![0.01, 1.0, 40.0]),
    ) {
        let directions = angles.map(|(z, turn)| {
            let flat = (1.0 - z * z).sqrt();
            DVec3::new(flat * turn.cos(), flat * turn.sin(), z)
        });
        for i in 0..3 {
            // Closer ones are a flat room until they part.
            prop_assume!(directions[i].dot(directions[(i + 1) % 3]) < 0.6);
        }
        let radii = [0.5, 0.5 * narrow, 0.5];
        let lengths = [5.0, 4.5, if is_short { 1.4 } else { 5.0 }];
        let arms = [0, 1, 2].map(|i| side_tube(DVec3::ZERO, directions[i], lengths[i], radii[i]));
        let g = times(tubes(&arms, 0.14), scale);
        let tips = arms.map(|t| t.ends[1] * scale);
        let rooms = rooms_at(&g, scale, &tips);
        prop_assert_eq!(n_different(&rooms), if is_short { 1 } else { 3 }, "{:?}", rooms);
    }
}
