//! Tests that parts of the air are joined exactly where a free line leads from one to the next.

use enfilade_geom::{Bvh, DMat4, DVec3, Sets, Triangle};
use proptest::prelude::*;

use super::space::{Space, divide};

/// Returns `true` if a triangle meets a segment, by signs of volumes alone.
fn meets(t: &Triangle, p: DVec3, q: DVec3) -> bool {
    let volume = |a: DVec3, b: DVec3, c: DVec3| a.cross(b).dot(c);
    let side = |x: DVec3| volume(t[1] - t[0], t[2] - t[0], x - t[0]);
    if side(p) * side(q) > 0.0 {
        return false;
    }
    let turn = |i: usize| volume(q - p, t[i] - p, t[(i + 1) % 3] - p);
    let (a, b, c) = (turn(0), turn(1), turn(2));
    (a >= 0.0 && b >= 0.0 && c >= 0.0) || (a <= 0.0 && b <= 0.0 && c <= 0.0)
}

fn is_free(walls: &[Triangle], p: DVec3, q: DVec3) -> bool {
    !walls.iter().any(|t| meets(t, p, q))
}

/// Returns the connected region of each part.
fn regions(space: &Space) -> Vec<u32> {
    let mut sets = Sets::new(space.middles.len());
    for l in &space.links {
        sets.join(l.parts[0], l.parts[1]);
    }
    (0..sets.len() as u32).map(|x| sets.find(x)).collect()
}

/// Returns the regions of those parts of the tetrahedron around `p` that `p` sees, its own included.
fn regions_at(space: &Space, region: &[u32], walls: &[Triangle], p: DVec3) -> Vec<u32> {
    let t = space.delaunay.locate(p, 0);
    let parts = (0..space.middles.len()).filter(|&i| space.tetrahedron_of_part[i] == t);
    let seen = parts.filter(|&i| is_free(walls, p, space.middles[i]));
    seen.map(|i| region[i]).collect()
}

fn divided(walls: &[Triangle], narrowest: f64) -> Space {
    divide(walls, &[], &Bvh::build(walls), narrowest).unwrap()
}

fn point() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0_f64).prop_map(DVec3::from_array)
}

/// Returns a box with a wall across, and a hole in the wall from `lo` to `hi` if that is not empty.
fn parted_box(lo: [f64; 2], hi: [f64; 2]) -> Vec<Triangle> {
    let mut out = Vec::new();
    let mut quad = |c: [[f64; 3]; 4]| {
        let c = c.map(DVec3::from_array);
        out.extend([[c[0], c[1], c[2]], [c[0], c[2], c[3]]]);
    };
    for axis in 0..3 {
        for at in [-1.0, 1.0] {
            quad(
                [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(u, v)| {
                    let mut p = [at; 3];
                    (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (u, v);
                    p
                }),
            );
        }
    }
    let has_hole = lo[0] < hi[0] && lo[1] < hi[1];
    let bands = if has_hole {
        vec![
            ([-1.0, -1.0], [lo[0], 1.0]),
            ([hi[0], -1.0], [1.0, 1.0]),
            ([lo[0], -1.0], [hi[0], lo[1]]),
            ([lo[0], hi[1]], [hi[0], 1.0]),
        ]
    } else {
        vec![([-1.0, -1.0], [1.0, 1.0])]
    };
    for (a, b) in bands {
        quad([
            [0.0, a[0], a[1]],
            [0.0, b[0], a[1]],
            [0.0, b[0], b[1]],
            [0.0, a[0], b[1]],
        ]);
    }
    out
}

/// Returns `true` if the two sides of a box with a wall across are one region, for a wall with a square hole of half
/// side `s`, rotated and scaled.
fn is_joined(center: [f64; 2], s: f64, turn: DVec3, scale: f64) -> bool {
    let turned = DMat4::from_axis_angle(turn.normalize_or(DVec3::X), turn.length());
    let place = |p: DVec3| turned.transform_point3(p) * scale;
    let walls: Vec<Triangle> = parted_box(center.map(|x| x - s), center.map(|x| x + s))
        .into_iter()
        .map(|t| t.map(place))
        .collect();
    let space = divided(&walls, scale * 0.2);
    let region = regions(&space);
    let [left, right] = [-0.5, 0.5].map(|x| place(DVec3::new(x, 0.013, 0.027)));
    let [a, b] = [left, right].map(|p| regions_at(&space, &region, &walls, p));
    a.iter().any(|r| b.contains(r))
}

/// Tetrahedra cut the hole to pieces, each too narrow for a portal.
#[test]
fn a_hole_joins_though_each_piece_of_it_is_a_crack() {
    assert!(is_joined([0.0; 2], 0.002, DVec3::ZERO, 1.0));
    assert!(!is_joined([0.0; 2], 0.0, DVec3::ZERO, 1.0));
}

/// Points where the wall meets a side are rounded, so that a sliver of a cut facet lies on both sides of an edge.
#[test]
fn slivers_of_cut_facets_at_an_edge_of_the_box_are_closed() {
    let turn = DVec3::new(
        -0.705_024_788_678_412_8,
        0.765_056_558_937_940_9,
        0.921_618_801_528_096_9,
    );
    assert!(!is_joined([0.0; 2], 0.0, turn, 0.1));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Triangles that cross each other, wider apart than the points added to them.
    #[test]
    fn parts_are_joined_where_free_lines_go_and_nowhere_else(
        walls in prop::collection::vec(prop::array::uniform3(point()), 1..9),
        lines in prop::collection::vec((point(), point()), 40),
    ) {
        // Points are added only for balls of a fifth of the scene's size: polygons cut the rest.
        let space = divided(&walls, 0.6);
        let region = regions(&space);
        for l in &space.links {
            let outline = space.outline(l);
            let middle = outline.iter().sum::<DVec3>() / outline.len() as f64;
            for part in l.parts {
                // Half a micrometer off the outline: a polygon may lie in its plane beside it.
                let to = middle.lerp(space.middles[part as usize], 1e-6);
                prop_assert!(is_free(&walls, space.middles[part as usize], to), "{l:?}");
            }
        }
        let mut volumes = vec![0.0; space.delaunay.n_finite];
        for (part, &t) in space.tetrahedron_of_part.iter().enumerate() {
            volumes[t as usize] += space.volumes[part];
        }
        for (t, &volume) in volumes.iter().enumerate() {
            let [a, b, c, d] = space.delaunay.corners(t as u32);
            let whole = (a - d).cross(b - d).dot(c - d).abs() / 6.0;
            // Vertices within the tolerance of a plane stay with both parts.
            prop_assert!((volume - whole).abs() < 1e-6, "{volume} of {whole}");
        }
        for (p, q) in lines {
            // Wide enough not to be a crack: free lines all around.
            let around = [DVec3::ZERO, DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z];
            if around.iter().all(|&d| is_free(&walls, p + d * 0.02, q + d * 0.02)) {
                let [from, to] = [p, q].map(|x| regions_at(&space, &region, &walls, x));
                prop_assert!(from.iter().any(|r| to.contains(r)), "{p} {q}: {from:?} {to:?}");
            }
        }
    }

    /// For any size of the box relative to its hole, and any rotation.
    #[test]
    fn a_wall_parts_a_box_just_when_it_has_no_hole(
        center in prop::array::uniform2(-0.9..0.9_f64),
        // Half the side; the smallest hole is a fiftieth of the narrowest opening.
        size in prop::option::of(prop_oneof![0.002..0.01_f64, 0.01..0.08]),
        turn in point(),
        scale in 0.1..100.0_f64,
    ) {
        prop_assert_eq!(is_joined(center, size.unwrap_or(0.0), turn, scale), size.is_some());
    }
}
