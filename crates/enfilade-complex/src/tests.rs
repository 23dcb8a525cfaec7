//! Tests of the promises by brute force: segments against all triangles, sharing only the types with the complex.

use enfilade_cpg::PortalKind;
use enfilade_geom::{Aabb, DMat3, DVec3, Triangle, Winding, triangle_area_normal};
use proptest::prelude::*;

use super::*;

fn quad(out: &mut Vec<Triangle>, p: [DVec3; 4]) {
    out.push([p[0], p[1], p[2]]);
    out.push([p[0], p[2], p[3]]);
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z).as_vec3().as_dvec3()
}

/// Adds a box whose faces point outwards.
fn block(out: &mut Vec<Triangle>, a: [f64; 3], b: [f64; 3]) {
    let pick = |i: usize, axis: usize| if i >> axis & 1 == 0 { a[axis] } else { b[axis] };
    let corner = |i: usize| v(pick(i, 0), pick(i, 1), pick(i, 2));
    for f in Aabb::FACES {
        quad(out, f.map(corner));
    }
}

/// Adds a vertical rectangle without thickness at `x`.
fn sheet(out: &mut Vec<Triangle>, x: f64, y: [f64; 2], z: [f64; 2]) {
    quad(
        out,
        [
            v(x, y[0], z[0]),
            v(x, y[1], z[0]),
            v(x, y[1], z[1]),
            v(x, y[0], z[1]),
        ],
    );
}

fn candidate_at_x(x: f64, y: [f64; 2], z: [f64; 2]) -> Winding {
    Winding::new(vec![
        v(x, y[0], z[0]),
        v(x, y[1], z[0]),
        v(x, y[1], z[1]),
        v(x, y[0], z[1]),
    ])
}

/// Deterministic numbers in `0..1`.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn point(&mut self, b: &Aabb) -> DVec3 {
        b.min + DVec3::new(self.next(), self.next(), self.next()) * b.size()
    }
}

/// Returns the position along `a + d`, 0 to 1, where a triangle is hit (Möller and Trumbore).
fn hit(t: &Triangle, a: DVec3, d: DVec3) -> Option<f64> {
    let (e1, e2) = (t[1] - t[0], t[2] - t[0]);
    let p = d.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = a - t[0];
    let u = s.dot(p) / det;
    let q = s.cross(e1);
    let w = d.dot(q) / det;
    let at = e2.dot(q) / det;
    (u >= 0.0 && w >= 0.0 && u + w <= 1.0 && (0.0..=1.0).contains(&at)).then_some(at)
}

/// Counts of a walk along many segments.
#[derive(Debug, Default)]
struct Walk {
    n_through: usize,
    n_unsealed: usize,
    n_incomplete: usize,
    n_hits: usize,
}

/// Follows random segments through portals to their end, or to the first triangle.
fn walk(triangles: &[Triangle], partition: &Partition, bounds: &Aabb, n: usize, seed: u64) -> Walk {
    let mut random = Random(seed | 1);
    let mut found = Walk::default();
    let locate = |p| partition.locator.locate(p).map(|c| c.0);
    for i in 0..n {
        let a = random.point(bounds);
        let mut e = random.point(bounds);
        if i % 2 == 0 {
            e = a.lerp(e, 0.2);
        }
        let d = e - a;
        let first = triangles
            .iter()
            .enumerate()
            .filter_map(|(t, tri)| hit(tri, a, d).map(|at| (at, t)))
            .min_by(|x, y| x.0.total_cmp(&y.0));
        let end = first.map_or(1.0, |f| f.0);
        let mut crossed: Vec<(f64, usize)> = Vec::new();
        let portals: Vec<&PartitionPortal> = partition
            .portals
            .iter()
            .chain(&partition.hairlines)
            .collect();
        for (k, portal) in portals.iter().enumerate() {
            let (da, de) = (
                portal.plane.signed_distance(a),
                portal.plane.signed_distance(e),
            );
            if (da < 0.0) != (de < 0.0) {
                let at = da / (da - de);
                let p = a + d * at;
                if at < end && portal.pieces.iter().any(|w| w.contains_in_plane(p, 0.0)) {
                    crossed.push((at, k));
                }
            }
        }
        crossed.sort_by(|x, y| x.0.total_cmp(&y.0));
        let mut at = locate(a);
        let mut is_sealed = true;
        for &(_, k) in &crossed {
            let portal = portals[k];
            let along = d.dot(portal.plane.normal) > 0.0;
            let (from, to) = (
                portal.cells[usize::from(!along)],
                portal.cells[usize::from(along)],
            );
            is_sealed &= at == Some(from);
            at = Some(to);
        }
        match first {
            None => {
                found.n_through += crossed.len();
                is_sealed &= at == locate(e);
            }
            Some((_, t)) => {
                if let Some(cell) = at {
                    let seen = &partition.triangle_cells;
                    let is_front = triangle_area_normal(&triangles[t]).dot(d) < 0.0;
                    let list = if is_front {
                        seen.front(t)
                    } else {
                        seen.back(t)
                    };
                    found.n_hits += 1;
                    found.n_incomplete += usize::from(!list.contains(&cell));
                }
            }
        }
        found.n_unsealed += usize::from(!is_sealed);
    }
    found
}

fn assert_promises(triangles: &[Triangle], partition: &Partition, bounds: &Aabb, n: usize) {
    let found = walk(triangles, partition, bounds, n, 0x2545_f491_4f6c_dd1d);
    assert_eq!((found.n_unsealed, found.n_incomplete), (0, 0), "{found:?}");
}

/// Votes on a grid, labeled by the caller.
fn votes(b: &Aabb, step: f64, label: impl Fn(DVec3) -> Option<u32>) -> Vec<Vote> {
    let n = (b.size() / step).as_uvec3();
    let mut out = Vec::new();
    for z in 0..n.z {
        for y in 0..n.y {
            for x in 0..n.x {
                // Off the round numbers at which walls stand.
                let offset = DVec3::new(0.4567, 0.4321, 0.5678);
                let point = b.min + (DVec3::new(x.into(), y.into(), z.into()) + offset) * step;
                if let Some(label) = label(point) {
                    out.push(Vote {
                        point,
                        label: Label::Region(label),
                        weight: (step * step * step) as f32,
                    });
                }
            }
        }
    }
    out
}

fn build(triangles: &[Triangle], candidates: &[Winding]) -> Complex<'static> {
    let bounds = triangles
        .iter()
        .flatten()
        .fold(Aabb::EMPTY, |b, &p| b.including(p))
        .expanded(0.3);
    build_complex(&ComplexInput {
        triangles,
        candidates,
        missing: &[],
        bounds,
        gap: 0.0,
        has_seals: false,
    })
}

/// Two rooms of 3 x 2.5 x 4 m, x in 0..3 and 3.2..6.2, in walls of 0.2 m, with a door of 0.9 x 2.1 m between them,
/// its lower edge on the floor, z in 1..1.9. A slit may be cut at z in 3..3+slit.
fn two_rooms(slit: f64) -> Vec<Triangle> {
    let mut t = Vec::new();
    block(&mut t, [-0.2, -0.2, -0.2], [6.4, 0.0, 4.2]);
    block(&mut t, [-0.2, 2.5, -0.2], [6.4, 2.7, 4.2]);
    block(&mut t, [-0.2, 0.0, -0.2], [0.0, 2.5, 4.2]);
    block(&mut t, [6.2, 0.0, -0.2], [6.4, 2.5, 4.2]);
    block(&mut t, [0.0, 0.0, -0.2], [6.2, 2.5, 0.0]);
    block(&mut t, [0.0, 0.0, 4.0], [6.2, 2.5, 4.2]);
    block(&mut t, [3.0, 0.0, 0.0], [3.2, 2.5, 1.0]);
    block(&mut t, [3.0, 2.1, 1.0], [3.2, 2.5, 1.9]);
    if slit > 0.0 {
        block(&mut t, [3.0, 0.0, 1.9], [3.2, 2.5, 3.0]);
        block(&mut t, [3.0, 0.0, 3.0 + slit], [3.2, 2.5, 4.0]);
    } else {
        block(&mut t, [3.0, 0.0, 1.9], [3.2, 2.5, 4.0]);
    }
    t
}

fn room_votes(b: &Aabb) -> Vec<Vote> {
    votes(b, 0.1, |p| {
        let inside = p.y > 0.0 && p.y < 2.5 && p.z > 0.0 && p.z < 4.0;
        if inside && p.x > 0.0 && p.x < 3.0 {
            Some(10)
        } else if inside && p.x > 3.2 && p.x < 6.2 {
            Some(20)
        } else if Aabb::new(DVec3::new(-0.2, -0.2, -0.2), DVec3::new(6.4, 2.7, 4.2)).contains(p) {
            None
        } else {
            Some(99)
        }
    })
}

#[test]
fn a_door_between_two_rooms_is_one_portal_of_the_exact_area() {
    let t = two_rooms(0.0);
    let c = build(&t, &[candidate_at_x(3.1, [-0.1, 2.3], [0.8, 2.1])]);
    let p = c.partition(&room_votes(&c.bounds()), &LabelSettings::default());
    assert_eq!(p.label_of_cell, [10, 20, 99].map(Label::Region));
    assert_eq!(p.outside, Some(2));
    assert_eq!(p.portals.len(), 1);
    let portal = &p.portals[0];
    assert_eq!(
        (portal.cells, portal.candidate, portal.is_leak),
        ([0, 1], Some(0), false)
    );
    // Vertices are f32: 1e-6 of meters times a few meters of edge.
    assert!((portal.area - 0.9 * 2.1).abs() < 2e-6, "{}", portal.area);
    assert_eq!(portal.pieces.len(), 1);
    assert!(
        portal
            .outline
            .points
            .iter()
            .all(|q| (q.x - 3.1).abs() < 1e-6)
    );
    assert!(portal.plane.normal.x > 0.99 && portal.outline.area_normal().x > 0.0);
    let room = 3.0 * 2.5 * 4.0 + 0.1 * 0.9 * 2.1;
    assert!((p.volumes[0] - room).abs() < 1e-4 && (p.volumes[1] - room).abs() < 1e-4);
    assert!(
        (p.aabbs[0].max - DVec3::new(3.1, 2.5, 4.0))
            .abs()
            .max_element()
            < 1e-6
    );
    assert_promises(&t, &p, &c.bounds(), 20_000);
}

#[test]
fn rooms_that_no_plane_separates_are_one() {
    let door = candidate_at_x(3.1, [-0.1, 2.3], [0.8, 2.1]);
    let labels = |slit, candidates: &[Winding], may_join: fn(u32) -> bool| {
        let c = build(&two_rooms(slit), candidates);
        let votes = room_votes(&c.bounds());
        let cells = c.label(&LabelInput {
            may_join: &may_join,
            ..votes[..].into()
        });
        c.realize(cells).label_of_cell
    };
    let [two, one] = [&[10, 20, 99][..], &[10, 99]].map(|l| l.iter().map(|&r| Label::Region(r)));
    let [two, one]: [Vec<Label>; 2] = [two.collect(), one.collect()];
    let door = std::slice::from_ref(&door);
    // The door has 1.89 m², the slit beside it 1.75 or 2.25.
    assert_eq!(labels(0.7, door, |_| true), two);
    assert_eq!(labels(0.9, door, |_| true), one);
    assert_eq!(labels(0.9, door, |r| r != 20), two);
    // In the open, without a plane.
    assert_eq!(labels(0.0, &[], |_| true), one);
    assert_eq!(labels(0.0, &[], |_| false), two);
}

#[test]
fn what_no_vote_reaches_is_a_void_where_a_point_says_so() {
    let t = two_rooms(0.0);
    let c = build(&t, &[candidate_at_x(3.1, [-0.1, 2.3], [0.8, 2.1])]);
    let votes = room_votes(&c.bounds());
    // Inside the wall, in both rooms, outdoors.
    let wall = v(3.1, 1.0, 0.5);
    let elsewhere = [v(1.0, 1.0, 1.0), v(5.0, 1.0, 1.0), v(-9.0, 0.0, 0.0)];
    let voids: Vec<_> = [wall]
        .into_iter()
        .chain(elsewhere)
        .map(|p| (p, 10))
        .collect();
    let cells = c.label(&LabelInput {
        voids: &voids,
        ..votes[..].into()
    });
    let p = c.realize(cells);
    let regions = [10, 20, 99].map(Label::Region);
    assert_eq!(p.label_of_cell, [&regions[..], &[Label::Void(10)]].concat());
    assert_eq!(p.locator.locate(wall).map(|c| c.0), Some(3));
    assert!((p.volumes[3] - 0.5).abs() < 1e-6, "{}", p.volumes[3]);
}

#[test]
fn a_crooked_candidate_seals_as_well() {
    let t = two_rooms(0.0);
    let crooked = Winding::new(vec![
        v(3.02, -0.1, 0.8),
        v(3.12, 2.3, 0.8),
        v(3.16, 2.3, 2.1),
        v(3.06, -0.1, 2.1),
    ]);
    let c = build(&t, &[crooked]);
    let p = c.partition(&room_votes(&c.bounds()), &LabelSettings::default());
    assert_eq!(p.portals.len(), 1);
    assert!((p.portals[0].area - 1.89).abs() < 0.02);
    assert_promises(&t, &p, &c.bounds(), 20_000);
}

#[test]
fn a_crack_beside_the_door_becomes_a_portal_of_its_own() {
    let t = two_rooms(0.005);
    let c = build(&t, &[candidate_at_x(3.1, [-0.1, 2.3], [0.8, 2.1])]);
    let p = c.partition(&room_votes(&c.bounds()), &LabelSettings::default());
    assert_eq!(p.label_of_cell, [10, 20, 99].map(Label::Region));
    let cracks: Vec<_> = p
        .portals
        .iter()
        .filter(|q| q.kind == PortalKind::Crack)
        .collect();
    assert_eq!((p.portals.len(), cracks.len(), p.leaks.len()), (2, 1, 1));
    assert!(
        (cracks[0].area - 0.005 * 2.5).abs() < 1e-5,
        "{}",
        cracks[0].area
    );
    assert!((p.leaks[0].width - 0.005).abs() < 1e-5);
    assert!(
        (p.leaks[0].position - DVec3::new(3.1, 1.25, 3.0025))
            .abs()
            .max_element()
            < 0.11
    );
    // Few segments meet a slit of 5 mm; aim some at it.
    let slit = Aabb::new(DVec3::new(2.7, 0.0, 2.95), DVec3::new(3.5, 2.5, 3.06));
    let found = walk(&t, &p, &slit, 40_000, 7);
    assert_eq!((found.n_unsealed, found.n_incomplete), (0, 0), "{found:?}");
    assert!(found.n_through > 50, "{found:?}");
}

#[test]
fn a_candidate_that_misses_part_of_the_door_leaves_a_leak_and_no_hole() {
    let t = two_rooms(0.0);
    let c = build(&t, &[candidate_at_x(3.1, [-0.1, 1.7], [0.8, 2.1])]);
    let p = c.partition(&room_votes(&c.bounds()), &LabelSettings::default());
    assert_eq!(p.label_of_cell, [10, 20, 99].map(Label::Region));
    let total: f64 = p.portals.iter().map(|q| q.area).sum();
    assert!(total > 1.88, "{total}");
    assert_promises(&t, &p, &c.bounds(), 20_000);
}

#[test]
fn walls_without_thickness_part_rooms_and_show_both_sides() {
    let mut t = Vec::new();
    // One closed box of sheets, with faces inwards or outwards alike.
    block(&mut t, [0.0, 0.0, 0.0], [6.0, 2.5, 4.0]);
    sheet(&mut t, 3.0, [0.0, 2.5], [0.0, 1.0]);
    sheet(&mut t, 3.0, [2.0, 2.5], [1.0, 2.0]);
    sheet(&mut t, 3.0, [0.0, 2.5], [2.0, 4.0]);
    let c = build(&t, &[candidate_at_x(3.0, [-0.1, 2.1], [0.9, 2.1])]);
    let p = c.partition(
        &votes(&c.bounds(), 0.1, |p| {
            if !Aabb::new(DVec3::ZERO, DVec3::new(6.0, 2.5, 4.0)).contains(p) {
                return Some(3);
            }
            Some(if p.x < 3.0 { 1 } else { 2 })
        }),
        &LabelSettings::default(),
    );
    assert_eq!(p.label_of_cell, [1, 2, 3].map(Label::Region));
    assert_eq!(p.portals.len(), 1);
    assert!((p.portals[0].area - 2.0).abs() < 1e-6);
    for sheet in 12..t.len() {
        assert_eq!(p.triangle_cells.both(sheet), [0, 1]);
        assert_eq!(p.triangle_cells.front(sheet).len(), 1);
    }
    assert_promises(&t, &p, &c.bounds(), 20_000);
}

/// The planes of two sheets cross in the opening between them at an angle of 3e-6: too large to be one plane, and the
/// wedges between them are thinner than the tolerance.
#[test]
fn slivers_in_an_opening_are_as_open_as_the_rest() {
    let mut t = Vec::new();
    block(&mut t, [-3.0, 0.0, 0.0], [3.0, 2.5, 4.0]);
    sheet(&mut t, 0.0, [0.0, 2.5], [0.0, 1.0]);
    let x = |z: f64| 3e-6 * (z - 2.0);
    quad(
        &mut t,
        [
            v(x(3.0), 0.0, 3.0),
            v(x(3.0), 2.5, 3.0),
            v(x(4.0), 2.5, 4.0),
            v(x(4.0), 0.0, 4.0),
        ],
    );
    // Objects beside the opening, so that boxes are cut across it.
    for i in 0..8 {
        let z = 1.1 + 0.2 * f64::from(i);
        block(&mut t, [0.5, 0.4, z], [0.6, 0.5, z + 0.1]);
        block(&mut t, [-0.6, 1.4, z], [-0.5, 1.5, z + 0.1]);
    }
    let c = build(&t, &[]);
    let inside = Aabb::new(DVec3::new(-3.0, 0.0, 0.0), DVec3::new(3.0, 2.5, 4.0));
    let label = |p: DVec3| {
        Some(if !inside.contains(p) {
            3
        } else {
            1 + u32::from(p.x > 0.0)
        })
    };
    let p = c.partition(&votes(&c.bounds(), 0.1, label), &LabelSettings::default());
    assert_eq!(p.label_of_cell, [1, 2, 3].map(Label::Region));
    let thin = Aabb::new(DVec3::new(-6e-6, 0.1, 0.5), DVec3::new(6e-6, 2.4, 3.5));
    let found = walk(&t, &p, &thin, 20_000, 3);
    assert_eq!((found.n_unsealed, found.n_incomplete), (0, 0), "{found:?}");
    assert!(found.n_through > 1_000, "{found:?}");
    assert_promises(&t, &p, &c.bounds(), 20_000);
}

#[test]
fn the_hollow_of_a_wall_is_solid() {
    let t = two_rooms(0.0);
    let c = build(&t, &[candidate_at_x(3.1, [-0.1, 2.3], [0.8, 2.1])]);
    let p = c.partition(&room_votes(&c.bounds()), &LabelSettings::default());
    assert_eq!(p.locator.locate(DVec3::new(3.1, 1.0, 3.0)), None);
    assert_eq!(p.locator.locate(DVec3::new(3.1, 1.0, 0.5)), None);
    assert!(p.locator.locate(DVec3::new(3.05, 1.0, 1.5)).is_some());
}

#[test]
fn votes_that_got_into_a_closed_hollow_make_a_cell_of_it_only_if_asked() {
    let mut t = two_rooms(0.0);
    block(&mut t, [1.0, 0.5, 1.0], [2.0, 1.5, 2.0]);
    let c = build(&t, &[candidate_at_x(3.1, [-0.1, 2.3], [0.8, 2.1])]);
    // The room's votes ignore the block.
    let votes = room_votes(&c.bounds());
    let at = |keeps_closed| {
        let settings = LabelSettings {
            keeps_closed,
            ..LabelSettings::default()
        };
        let p = c.partition(&votes, &settings);
        assert_promises(&t, &p, &c.bounds(), 2_000);
        [[1.5, 1.0, 1.5], [0.5, 1.0, 0.5], [4.0, 1.0, 2.0]]
            .map(|q| p.locator.locate(DVec3::from_array(q)))
    };
    let [hollow, room, other] = at(true);
    assert!(hollow.is_some() && hollow != room, "{hollow:?} {room:?}");
    let [hollow, room, next] = at(false);
    assert!(hollow.is_none() && room.is_some(), "{hollow:?} {room:?}");
    assert!(next.is_some() && other.is_some());
}

#[test]
fn what_rounding_leaves_between_surfaces_is_no_cell() {
    // A region whose only votes fall between two blocks that all but touch, closed all around.
    let mut t = two_rooms(0.0);
    block(&mut t, [1.0, 0.5, 1.0], [2.0, 1.0, 2.0]);
    block(&mut t, [1.4, 0.7, 1.4], [1.6, 0.7002, 1.6]);
    let c = build(&t, &[candidate_at_x(3.1, [-0.1, 2.3], [0.8, 2.1])]);
    let mut votes = room_votes(&c.bounds());
    let between = DVec3::new(1.5, 0.7001, 1.5);
    votes.retain(|v| v.point.distance(between) > 1.0);
    votes.push(Vote {
        point: between,
        label: Label::Region(30),
        weight: 1.0,
    });
    let p = c.partition(&votes, &LabelSettings::default());
    assert_promises(&t, &p, &c.bounds(), 2_000);
    assert!(
        !p.label_of_cell.contains(&Label::Region(30)),
        "{:?}",
        p.label_of_cell
    );
    assert_eq!(p.locator.locate(between), None);
}

/// A closed box of 4 x 4 x 2 m whose top is a pyramid of 1 cm, all in small triangles, turned about `axis`; then its
/// vertices are rounded to `f32`.
fn turned_box(axis: DVec3, angle: f64) -> Vec<Triangle> {
    const N: usize = 6;
    let turn = DMat3::from_axis_angle(axis.normalize(), angle);
    let mut out = Vec::new();
    for face in 0..6 {
        let (axis, is_high) = (face % 3, face >= 3);
        let at = |i: usize, j: usize| {
            let mut p = DVec3::ZERO;
            p[axis] = [0.0, 1.0][usize::from(is_high)];
            p[(axis + 1) % 3] = i as f64 / N as f64;
            p[(axis + 2) % 3] = j as f64 / N as f64;
            let rise = 0.01 * [i, j, N - i, N - j].into_iter().min().unwrap_or(0) as f64 / 3.0;
            let lift = if face == 5 { rise } else { 0.0 };
            let p = turn * (p * DVec3::new(4.0, 4.0, 2.0) + DVec3::Z * lift);
            v(p.x, p.y, p.z)
        };
        for i in 0..N {
            for j in 0..N {
                quad(
                    &mut out,
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
                );
            }
        }
    }
    out
}

#[test]
fn a_closed_surface_of_nearly_flat_triangles_lets_nothing_through() {
    let mut random = Random(77);
    for _ in 0..12 {
        let axis = DVec3::new(random.next(), random.next(), random.next()) - 0.4;
        let angle = 3.0 * random.next();
        let triangles = turned_box(axis, angle);
        let back = DMat3::from_axis_angle(axis.normalize(), -angle);
        let b = Aabb::of_points(triangles.iter().flatten()).expanded(0.5);
        let ballots = votes(&b, 0.25, |p| {
            let q = back * p;
            let near = (q - q.clamp(DVec3::ZERO, DVec3::new(4.0, 4.0, 2.0))).length();
            let is_in = near == 0.0;
            (is_in || near > 0.1).then_some(u32::from(is_in))
        });
        let partition = build(&triangles, &[]).partition(&ballots, &LabelSettings::default());
        assert_eq!(partition.label_of_cell.len(), 2, "{axis} {angle}");
        // Slopes that differ by 0.5 % and vertices moved by a tolerance make wedges 0.4 mm wide.
        for p in &partition.portals {
            assert!(p.width < 1e-4, "{axis} {angle}: {p:?}");
        }
        assert!(partition.portals.len() <= 1, "{axis} {angle}");
        assert_promises(&triangles, &partition, &b, 100);
    }
}

#[test]
fn no_input_at_all_is_one_leaf() {
    let c = build_complex(&ComplexInput {
        triangles: &[],
        candidates: &[],
        missing: &[],
        bounds: Aabb::EMPTY,
        gap: 0.0,
        has_seals: false,
    });
    assert_eq!((c.n_leaves(), c.graph.facets.len()), (1, 0));
    let p = c.partition(&[], &LabelSettings::default());
    assert!(p.volumes.is_empty() && p.portals.is_empty());
}

#[test]
fn hostile_triangles_are_survived() {
    let nan = DVec3::splat(f64::NAN);
    let mut t = two_rooms(0.0);
    let n = t.len();
    t.push([nan, DVec3::ZERO, DVec3::X]);
    t.push([DVec3::INFINITY, DVec3::ZERO, DVec3::X]);
    t.push([DVec3::ONE; 3]);
    t.push([v(1.0, 1.0, 1.0), v(2.0, 1.0, 1.0), v(1.5, 1.0, 1.0)]);
    let bent = Winding::new(vec![v(1.0, 1.0, 1.0)]);
    let c = build(
        &t[..n],
        &[bent, Winding::default(), Winding::new(vec![nan; 4])],
    );
    let bounds = c.bounds();
    let d = build_complex(&ComplexInput {
        triangles: &t,
        candidates: &[],
        missing: &[],
        bounds,
        gap: 0.0,
        has_seals: false,
    });
    let p = d.partition(&room_votes(&bounds), &LabelSettings::default());
    assert_eq!(p.triangle_cells.len(), t.len());
    assert!(p.triangle_cells.both(n).is_empty());
    assert_promises(&t[..n], &p, &bounds, 2_000);
}

/// A hundred triangles that meet in one point make a knot that boxes cannot undo.
#[test]
fn a_cone_of_many_triangles_is_cut_in_full() {
    let mut t = Vec::new();
    let ring = |i: u32| {
        let a = f64::from(i) * std::f64::consts::TAU / 100.0;
        v(a.cos(), 0.0, a.sin())
    };
    for i in 0..100 {
        t.push([v(0.0, 1.5, 0.0), ring(i), ring(i + 1)]);
        t.push([v(0.0, 0.0, 0.0), ring(i), ring(i + 1)]);
    }
    let c = build(&t, &[]);
    let inside = |p: DVec3| p.y > 0.0 && (p.x * p.x + p.z * p.z).sqrt() < 0.99 * (1.0 - p.y / 1.5);
    let p = c.partition(
        &votes(&c.bounds(), 0.1, |p| Some(u32::from(inside(p)))),
        &LabelSettings::default(),
    );
    assert_eq!(
        (p.label_of_cell.as_slice(), p.portals.len()),
        (&[0, 1].map(Label::Region)[..], 0)
    );
    let polygon = 0.5 * 100.0 * (std::f64::consts::TAU / 100.0).sin();
    assert!(
        (p.volumes[1] - polygon * 1.5 / 3.0).abs() < 1e-5,
        "{}",
        p.volumes[1]
    );
    assert_promises(&t, &p, &c.bounds(), 5_000);
}

/// Summarizes a partition by its geometry alone.
fn summary(p: &Partition) -> Vec<String> {
    let mut out: Vec<String> = p.portals.iter().map(|q| format!("{q:?}")).collect();
    out.push(format!(
        "{:?} {:?} {:?}",
        p.label_of_cell, p.volumes, p.aabbs
    ));
    out.push(format!("{:?}", p.locator));
    out
}

#[test]
fn the_order_of_triangles_and_the_number_of_threads_change_nothing() {
    let mut t = Vec::new();
    for i in 0..9 {
        for j in 0..9 {
            let (x, z) = (f64::from(i) * 1.3, f64::from(j) * 1.1);
            block(&mut t, [x, 0.0, z], [x + 0.2, 2.0, z + 0.9]);
            block(&mut t, [x, 0.0, z], [x + 1.0, 2.0, z + 0.15]);
            block(&mut t, [x + 0.4, 0.2, z + 0.3], [x + 0.7, 0.9, z + 0.6]);
        }
    }
    let turn = DMat3::from_axis_angle(DVec3::new(0.1, 1.0, 0.3).normalize(), 0.5);
    for tri in &mut t {
        *tri = tri.map(|p| (turn * p).as_vec3().as_dvec3());
    }
    let blocks = |p: DVec3| Some((p.x.max(0.0) as u32) / 2 * 100 + (p.z.max(0.0) as u32) / 2);
    let run = |t: &[Triangle], n_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(n_threads)
            .build()
            .unwrap();
        pool.install(|| {
            let c = build(t, &[]);
            let p = c.partition(&votes(&c.bounds(), 0.2, blocks), &LabelSettings::default());
            (c.n_leaves(), p)
        })
    };
    let (n_leaves, one) = run(&t, 1);
    // Otherwise there are too few parallel subtrees to prove anything.
    assert!(n_leaves > 5_000, "{n_leaves}");
    for n_threads in [2, 16] {
        let (_, other) = run(&t, n_threads);
        assert_eq!(summary(&one), summary(&other));
        assert_eq!(one.triangle_cells, other.triangle_cells);
    }
    let mut random = Random(5);
    let mut order: Vec<usize> = (0..t.len()).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, (random.next() * (i + 1) as f64) as usize);
    }
    let shuffled: Vec<Triangle> = order.iter().map(|&i| t[i]).collect();
    let (_, other) = run(&shuffled, 2);
    assert_eq!(summary(&one), summary(&other));
    for (new, &old) in order.iter().enumerate() {
        assert_eq!(one.triangle_cells.both(old), other.triangle_cells.both(new));
    }
}

fn soup() -> impl Strategy<Value = Vec<Triangle>> {
    let coordinate = prop_oneof![
        // Round values make coplanar, overlapping and duplicate triangles; the others do not.
        (0..5i32).prop_map(f64::from),
        (0.0..4.0f64).prop_map(|x| f64::from(x as f32)),
    ];
    let corner = prop::array::uniform3(coordinate).prop_map(|[x, y, z]| DVec3::new(x, y, z));
    prop::collection::vec(prop::array::uniform3(corner), 1..60)
}

fn blocks_2m(p: DVec3) -> Option<u32> {
    let q = (p.max(DVec3::ZERO) * 0.5).as_uvec3();
    Some(q.x + 10 * q.y + 100 * q.z)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..Default::default() })]

    #[test]
    fn any_soup_with_any_labels_is_sealed_and_complete(t in soup(), seed in any::<u64>()) {
        let c = build(&t, &[]);
        let p = c.partition(&votes(&c.bounds(), 0.25, blocks_2m), &LabelSettings::default());
        let found = walk(&t, &p, &c.bounds(), 2_000, seed);
        prop_assert_eq!((found.n_unsealed, found.n_incomplete), (0, 0), "{:?}", found);
    }

    #[test]
    fn leaf_volumes_agree_with_counted_points(t in soup(), seed in any::<u64>()) {
        let c = build(&t, &[]);
        let n = 20_000;
        let mut random = Random(seed | 1);
        let mut counts = vec![0usize; c.n_leaves()];
        for _ in 0..n {
            counts[c.leaf_of(random.point(&c.bounds())).unwrap() as usize] += 1;
        }
        let total = c.bounds().volume();
        let mut sum = 0.0;
        for (leaf, &count) in counts.iter().enumerate() {
            let share = c.graph.volumes[leaf] / total;
            sum += share;
            // Six standard deviations of a count, and one more for the rare leaf.
            let slack = 6.0 * (share / n as f64).sqrt() + 6.0 / n as f64;
            prop_assert!((count as f64 / n as f64 - share).abs() < slack, "{count} {share}");
        }
        // Vertices are cut at 1e-9; thousands of facets add up to this.
        prop_assert!((sum - 1.0).abs() < 1e-6, "{sum}");
    }
}

/// The space beyond the box is one cell: whatever the votes, everything that reaches its border is part of that.
#[test]
fn two_regions_at_the_border_are_one_outside() {
    let mut t = two_rooms(0.0);
    sheet(&mut t, 3.1, [2.7, 4.0], [-0.2, 4.2]);
    let candidate = candidate_at_x(3.1, [2.7, 6.0], [-2.0, 6.0]);
    let c = build(
        &t,
        &[candidate_at_x(3.1, [-0.1, 2.3], [0.8, 2.1]), candidate],
    );
    let sides = votes(&c.bounds(), 0.1, |p| {
        let walls = Aabb::new(DVec3::new(-0.2, -0.2, -0.2), DVec3::new(6.4, 2.7, 4.2));
        (!walls.contains(p)).then_some(if p.x < 3.1 { 98 } else { 99 })
    });
    let mut all = room_votes(&c.bounds());
    all.retain(|v| v.label != Label::Region(99));
    all.extend(sides);
    let p = c.partition(&all, &LabelSettings::default());
    assert_eq!(p.label_of_cell.len(), 3, "{:?}", p.label_of_cell);
    let outside = p.outside.unwrap();
    for corner in 0..8 {
        let b = c.bounds();
        let pick = |k: usize| {
            if corner >> k & 1 == 0 {
                b.min[k] + 1e-3
            } else {
                b.max[k] - 1e-3
            }
        };
        let at = DVec3::new(pick(0), pick(1), pick(2));
        assert_eq!(p.locator.locate(at).map(|c| c.0), Some(outside), "{at}");
    }
    assert!(p.portals.iter().all(|q| q.cells[0] != q.cells[1]));
}
