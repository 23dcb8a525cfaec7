//! The separate surfaces of an object: leaf, frame, handles of a door that is modeled in one piece.

use std::collections::HashMap;

use enfilade_geom::{DVec3, Sets, Triangle};

/// Corners nearer than this are one, by rounding. [Units: wu]
const WELD: f64 = 1e-4;
/// Faces at an edge whose angles differ by less coincide. [Units: rad]
const COINCIDE: f64 = 1e-4;
/// An object of more triangles is not taken apart: doors have fewer. [Units: triangles]
const MAX_TRIANGLES: usize = 50_000;

/// For each triangle the number of its shell, from 0 in the order in which they begin; and how many there are.
///
/// Two triangles are of one shell if one can walk from one to the other across edges. Where solids touch along an edge,
/// more than two triangles meet; there the walk goes around the solid whose inside lies between, so that a leaf that
/// touches its frame stays one of its own. `O(n log n)`.
pub(super) fn shells(triangles: &[Triangle]) -> (Vec<u32>, usize) {
    if triangles.len() > MAX_TRIANGLES {
        return (vec![0; triangles.len()], 1);
    }
    let mut number: HashMap<[i64; 3], u32> = HashMap::new();
    let mut points: Vec<DVec3> = Vec::new();
    let corners: Vec<[u32; 3]> = triangles
        .iter()
        .map(|t| {
            t.map(|p| {
                let key = (p / WELD).round().to_array().map(|x| x as i64);
                *number.entry(key).or_insert_with(|| {
                    points.push(p);
                    points.len() as u32 - 1
                })
            })
        })
        .collect();
    let mut sides: Vec<HalfEdge> = Vec::with_capacity(3 * triangles.len());
    for (t, c) in corners.iter().enumerate() {
        for k in 0..3 {
            let (a, b, apex) = (c[k], c[(k + 1) % 3], c[(k + 2) % 3]);
            if a != b {
                sides.push(HalfEdge {
                    edge: [a.min(b), a.max(b)],
                    is_forward: a < b,
                    apex,
                    triangle: t as u32,
                });
            }
        }
    }
    sides.sort_by_key(|s| (s.edge, s.triangle));
    let mut sets = Sets::new(triangles.len());
    for at_edge in sides.chunk_by(|a, b| a.edge == b.edge) {
        match at_edge {
            [_] => {}
            [a, b] => {
                sets.join(a.triangle, b.triangle);
            }
            many => join_around(many, &points, &mut sets),
        }
    }
    let least = sets.into_least();
    let mut shell_of_least: HashMap<u32, u32> = HashMap::new();
    let shells = least
        .iter()
        .map(|l| {
            let next = shell_of_least.len() as u32;
            *shell_of_least.entry(*l).or_insert(next)
        })
        .collect();
    (shells, shell_of_least.len())
}

/// A triangle at one of its edges.
struct HalfEdge {
    edge: [u32; 2],
    /// Whether the triangle runs along the edge from its lesser corner to its greater.
    is_forward: bool,
    apex: u32,
    triangle: u32,
}

/// Joins triangles that bound the same solid at an edge where more than two meet.
fn join_around(sides: &[HalfEdge], points: &[DVec3], sets: &mut Sets) {
    let [a, b] = sides[0].edge.map(|i| points[i as usize]);
    let along = (b - a).normalize_or_zero();
    let x = along.any_orthonormal_vector();
    let y = along.cross(x);
    let angle = |s: &HalfEdge| {
        let d = points[s.apex as usize] - a;
        d.dot(y)
            .atan2(d.dot(x))
            .rem_euclid(std::f64::consts::TAU - COINCIDE)
    };
    // A triangle that runs forward has its solid before it, turning around the edge; one that runs back, behind it. Of
    // two in one place, what ends comes before what begins.
    let mut around: Vec<(i64, bool, u32)> = sides
        .iter()
        .map(|s| {
            let at = (angle(s) / COINCIDE).round() as i64;
            (at, !s.is_forward, s.triangle)
        })
        .collect();
    around.sort_unstable();
    for (i, &(_, begins, triangle)) in around.iter().enumerate() {
        let (_, next_begins, next) = around[(i + 1) % around.len()];
        if begins && !next_begins {
            sets.join(triangle, next);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::Aabb;

    fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<Triangle> {
        Aabb::new(low.into(), high.into()).triangles()
    }

    #[test]
    fn solids_that_touch_are_shells_of_their_own() {
        // A leaf between two posts: whole faces of each coincide, and with them edges and corners.
        let left = cuboid([-0.1, 0.0, 0.0], [0.0, 2.0, 0.1]);
        let leaf = cuboid([0.0, 0.0, 0.0], [0.9, 2.0, 0.1]);
        let right = cuboid([0.9, 0.0, 0.0], [1.0, 2.0, 0.1]);
        let all = [left, leaf, right].concat();
        let (shells, n) = shells(&all);
        assert_eq!(n, 3);
        for (k, of) in shells.chunks(12).enumerate() {
            assert!(of.iter().all(|&s| s as usize == k), "{shells:?}");
        }
    }

    /// A frame along `profile`, seen from the front, as deep as it is, and the leaf in it, flush with its front.
    fn framed_leaf() -> Vec<Triangle> {
        let rim = [
            [0.0, 0.0],
            [0.05, 0.0],
            [0.05, 2.05],
            [0.95, 2.05],
            [0.95, 0.0],
            [1.0, 0.0],
            [1.0, 2.1],
            [0.0, 2.1],
        ];
        let at = |i: usize, z: f64| DVec3::new(rim[i % 8][0], rim[i % 8][1], z);
        let mut out = Vec::new();
        for i in 0..8 {
            out.push([at(i, 0.0), at(i + 1, 0.0), at(i + 1, 0.1)]);
            out.push([at(i, 0.0), at(i + 1, 0.1), at(i, 0.1)]);
        }
        for [a, b, c] in [
            [2, 1, 0],
            [7, 2, 0],
            [3, 5, 4],
            [6, 3, 2],
            [6, 2, 7],
            [6, 5, 3],
        ] {
            out.push([at(a, 0.0), at(b, 0.0), at(c, 0.0)]);
            out.push([at(a, 0.1), at(c, 0.1), at(b, 0.1)]);
        }
        out.extend(cuboid([0.05, 0.0, 0.0], [0.95, 2.05, 0.04]));
        out
    }

    #[test]
    fn a_leaf_flush_with_its_frame_is_a_shell_of_its_own() {
        let all = framed_leaf();
        for degrees in [0.0, 30.0, 90.0, 211.0_f64] {
            let turn = enfilade_geom::DMat4::from_rotation_y(degrees.to_radians());
            let turned: Vec<Triangle> = (all.iter())
                .map(|t| t.map(|p| turn.transform_point3(p).as_vec3().as_dvec3()))
                .collect();
            let (shells, n) = shells(&turned);
            assert_eq!(n, 2, "{degrees}: {shells:?}");
            assert!(
                shells[28..].iter().all(|&s| s == 1),
                "{degrees}: {shells:?}"
            );
        }
    }

    #[test]
    fn a_ring_is_one_shell() {
        // Faces between the posts and the head are left out, as of one solid.
        let inner = |p: &DVec3| (p.y - 2.0).abs() < 1e-9;
        let mut all = cuboid([0.0, 0.0, 0.0], [0.1, 2.0, 0.1]);
        all.retain(|t| !t.iter().all(inner));
        let (shells, n) = shells(&all);
        assert_eq!(n, 1, "{shells:?}");
    }
}
