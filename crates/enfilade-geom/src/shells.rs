//! Shells: an object's separate surfaces, such as leaf, frame and handles of a door modeled in one piece.

use std::collections::HashMap;
use std::f64::consts::TAU;

use crate::{DVec3, Sets, Triangle};

/// Distances within which vertices are welded: the first that pairs nearly all edges is used, else the last. Models
/// with moved vertices need a larger one. [Units: wu]
const WELDS: [f64; 3] = [1e-4, 1e-3, 5e-3];
/// Share of edges that counts as nearly all.
const PAIRED: f64 = 0.9;
/// Angle, per unit of weld, within which faces at an edge coincide: the turn of a 5 cm face when its vertices move by
/// the weld. [Units: rad/wu]
const COINCIDE: f64 = 20.0;

/// Returns the shell number of each triangle, from 0 in order of first triangles, and the number of shells.
///
/// Two triangles belong to one shell if a path across edges joins them. Where solids touch along an edge, more than two
/// triangles meet; there those that another path joins belong together, and for the others the path goes around the solid
/// between them, so that a leaf that touches its frame stays separate. `O(n log n)`, as long as few vertices lie in one place.
#[must_use]
pub fn shells(triangles: &[Triangle]) -> (Vec<u32>, usize) {
    let (_, shells, n) = joined(triangles);
    (shells, n)
}

/// Returns `true` for each triangle of a closed shell: each of its edges has two triangles of its shell. `O(n log n)` as [`shells`].
#[must_use]
pub fn in_closed_shells(triangles: &[Triangle]) -> Vec<bool> {
    let (welded, shell_of, n) = joined(triangles);
    let mut is_closed = vec![true; n];
    for at_edge in welded.sides.chunk_by(|a, b| a.edge == b.edge) {
        let of = |s: &HalfEdge| shell_of[s.triangle as usize];
        for side in at_edge {
            let own = at_edge.iter().filter(|s| of(s) == of(side)).count();
            is_closed[of(side) as usize] &= own == 2;
        }
    }
    shell_of.iter().map(|&s| is_closed[s as usize]).collect()
}

/// Returns the triangles welded so that they fit, the shell of each, and the number of shells.
fn joined(triangles: &[Triangle]) -> (Welded, Vec<u32>, usize) {
    let [least, larger @ ..] = WELDS;
    let mut welded = Welded::new(triangles, least);
    for weld in larger {
        if welded.paired_share() < PAIRED {
            welded = Welded::new(triangles, weld);
        }
    }
    let mut sets = Sets::new(triangles.len());
    let edges = || welded.sides.chunk_by(|a, b| a.edge == b.edge);
    for at_edge in edges() {
        if let [a, b] = at_edge {
            sets.join(a.triangle, b.triangle);
        }
    }
    for many in edges().filter(|at_edge| at_edge.len() > 2) {
        welded.join_around(many, &mut sets);
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
    (welded, shells, shell_of_least.len())
}

/// A triangle at one of its edges.
struct HalfEdge {
    edge: [u32; 2],
    /// The triangle runs along the edge from the lesser vertex to the greater.
    is_forward: bool,
    apex: u32,
    triangle: u32,
}

/// Triangles after welding nearby vertices.
struct Welded {
    points: Vec<DVec3>,
    /// Sorted by edge.
    sides: Vec<HalfEdge>,
    weld: f64,
}

impl Welded {
    fn new(triangles: &[Triangle], weld: f64) -> Self {
        let (corners, points) = welded_corners(triangles, weld);
        let mut sides: Vec<HalfEdge> = Vec::with_capacity(3 * triangles.len());
        for (t, c) in corners.iter().enumerate() {
            for k in 0..3 {
                let (a, b, apex) = (c[k], c[(k + 1) % 3], c[(k + 2) % 3]);
                if a != b && apex != a && apex != b {
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
        Self {
            points,
            sides,
            weld,
        }
    }

    /// Returns the share of half-edges whose edge belongs to another triangle, too.
    fn paired_share(&self) -> f64 {
        let edges = self.sides.chunk_by(|a, b| a.edge == b.edge);
        let n_alone = edges.filter(|e| e.len() == 1).count();
        1.0 - n_alone as f64 / self.sides.len().max(1) as f64
    }

    /// Joins triangles that bound the same solid at an edge where more than two meet, unless others there are joined to them.
    fn join_around(&self, sides: &[HalfEdge], sets: &mut Sets) {
        let set_of = |s: &HalfEdge, sets: &mut Sets| sets.find(s.triangle);
        let mut taken: Vec<u32> = sides.iter().map(|s| set_of(s, sets)).collect();
        taken.sort_unstable();
        let is_single = |set: u32| {
            let first = taken.partition_point(|&t| t < set);
            taken.get(first + 1) != Some(&set)
        };
        let single: Vec<&HalfEdge> = sides
            .iter()
            .filter(|s| is_single(set_of(s, sets)))
            .collect();
        if single.len() < 2 {
            return;
        }
        let [a, b] = sides[0].edge.map(|i| self.points[i as usize]);
        let along = (b - a).normalize_or_zero();
        let x = along.any_orthonormal_vector();
        let y = along.cross(x);
        let angle = |s: &HalfEdge| {
            let d = self.points[s.apex as usize] - a;
            d.dot(y).atan2(d.dot(x))
        };
        let mut around: Vec<(f64, &HalfEdge)> = single.iter().map(|s| (angle(s), *s)).collect();
        around.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.triangle.cmp(&q.1.triangle)));
        // Begin at the widest gap, so that no place is at both ends.
        let n = around.len();
        let gap = |i: usize| (around[i].0 - around[(i + n - 1) % n].0).rem_euclid(TAU);
        let begin = (0..n).max_by(|&i, &k| gap(i).total_cmp(&gap(k)));
        let begin = begin.unwrap_or_default();
        // Turning around the edge, a forward triangle has its solid ahead, a backward one behind. In one place,
        // triangles that end a solid come before those that begin one.
        let mut place = 0;
        let mut ordered: Vec<(u32, bool, u32)> = Vec::with_capacity(n);
        for i in (begin..n).chain(0..begin) {
            if !ordered.is_empty() && gap(i) > COINCIDE * self.weld {
                place += 1;
            }
            let side = around[i].1;
            ordered.push((place, !side.is_forward, side.triangle));
        }
        ordered.sort_unstable();
        let mut is_left = vec![true; n];
        for i in 0..n {
            let next = (i + 1) % n;
            if ordered[i].1 && !ordered[next].1 {
                sets.join(ordered[i].2, ordered[next].2);
                (is_left[i], is_left[next]) = (false, false);
            }
        }
        // Surfaces that end here without a partner, as flipped triangles do, are rather one than several.
        let mut left = ordered.iter().zip(&is_left).filter(|o| *o.1);
        if let Some(((.., first), _)) = left.next() {
            left.for_each(|((.., other), _)| {
                sets.join(*first, *other);
            });
        }
    }
}

/// Returns the vertex numbers of each triangle, and the position of each number. Vertices within `weld` of each other,
/// directly or through a chain of others, have one number.
fn welded_corners(triangles: &[Triangle], weld: f64) -> (Vec<[u32; 3]>, Vec<DVec3>) {
    let mut number: HashMap<[u64; 3], u32> = HashMap::new();
    let mut points: Vec<DVec3> = Vec::new();
    let corners: Vec<[u32; 3]> = (triangles.iter())
        .map(|t| {
            t.map(|p| {
                // Adding zero turns -0 into 0.
                let key = (p + 0.0).to_array().map(f64::to_bits);
                *number.entry(key).or_insert_with(|| {
                    points.push(p);
                    points.len() as u32 - 1
                })
            })
        })
        .collect();
    let cell = |p: DVec3| (p / weld).floor().to_array().map(|x| x as i64);
    let mut in_cell: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut sets = Sets::new(points.len());
    for (i, p) in (0..).zip(&points) {
        let own = cell(*p);
        for k in 0..27 {
            let by = [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1];
            let beside = [0, 1, 2].map(|axis| own[axis].saturating_add(by[axis]));
            for &other in in_cell.get(&beside).into_iter().flatten() {
                if points[other as usize].distance(*p) <= weld {
                    sets.join(i, other);
                }
            }
        }
        in_cell.entry(own).or_default().push(i);
    }
    let least = sets.into_least();
    let welded = corners.iter().map(|c| c.map(|i| least[i as usize]));
    (welded.collect(), points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Aabb, DMat4};

    fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<Triangle> {
        Aabb::new(low.into(), high.into()).triangles()
    }

    #[test]
    fn solids_that_touch_are_shells_of_their_own() {
        // A leaf between two posts: whole faces of each coincide, and with them edges and vertices.
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

    /// Returns a frame along `rim`, 0.1 deep, and a leaf in it, flush with its front.
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
            let turn = DMat4::from_rotation_y(degrees.to_radians());
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
    fn corners_that_were_moved_make_no_difference() {
        let all = framed_leaf();
        let turn = DMat4::from_rotation_y(0.7);
        let mut random = 8_u64;
        let mut unit = move || {
            // Knuth's linear congruential generator.
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (random >> 32) as f64 / f64::from(u32::MAX) * 2.0 - 1.0
        };
        for by in [1e-6, 1e-5, 1e-4, 1e-3] {
            for _ in 0..20 {
                let mut moved = |p: DVec3| p + DVec3::from([0, 1, 2].map(|_| by * unit()));
                let spoilt: Vec<Triangle> = (all.iter())
                    .map(|t| t.map(|p| moved(turn.transform_point3(p))))
                    .collect();
                let (shells, n) = shells(&spoilt);
                assert_eq!(n, 2, "{by}: {shells:?}");
                assert!(shells[28..].iter().all(|&s| s == 1), "{by}: {shells:?}");
            }
        }
    }

    #[test]
    fn a_solid_turned_inside_out_is_joined_to_no_neighbor() {
        // A block flush with the front of a plate: four triangles at each edge of one face, the others its own.
        for is_inside_out in [false, true] {
            let mut block = cuboid([0.0, 0.0, 0.0], [1.0, 2.0, 0.04]);
            if is_inside_out {
                block.iter_mut().for_each(|t| t.swap(1, 2));
            }
            let plate = cuboid([0.0, 0.0, -0.1], [1.0, 2.0, 0.0]);
            assert_eq!(shells(&[block, plate].concat()).1, 2);
        }
    }

    #[test]
    fn a_flipped_face_stays_with_others() {
        // Two blocks that share a face; a side of one is flipped.
        let mut all = cuboid([0.0, 0.0, 0.0], [1.0, 1.0, 1.0]);
        let is_side = |t: &Triangle| t.iter().all(|p| p.z == 1.0);
        all.iter_mut()
            .filter(|t| is_side(t))
            .for_each(|t| t.swap(1, 2));
        all.extend(cuboid([1.0, 0.0, 0.0], [2.0, 1.0, 1.0]));
        let (shell_of, _) = shells(&all);
        for (t, shell) in all.iter().zip(&shell_of).filter(|(t, _)| is_side(t)) {
            let beyond = all.iter().zip(&shell_of);
            let mut beyond = beyond.filter(|(other, _)| !is_side(other));
            assert!(beyond.any(|(_, other)| other == shell), "{t:?}");
        }
    }

    #[test]
    fn a_ring_is_one_shell() {
        // Faces between the posts and the head are left out, as in one solid.
        let inner = |p: &DVec3| (p.y - 2.0).abs() < 1e-9;
        let mut all = cuboid([0.0, 0.0, 0.0], [0.1, 2.0, 0.1]);
        all.retain(|t| !t.iter().all(inner));
        let (shells, n) = shells(&all);
        assert_eq!(n, 1, "{shells:?}");
    }

    #[test]
    fn a_box_is_closed_and_a_partition_in_it_and_a_box_without_a_face_are_not() {
        let a_box = Aabb::new(DVec3::ZERO, DVec3::new(4.0, 2.5, 3.0)).triangles();
        assert!(in_closed_shells(&a_box).iter().all(|&is| is));
        assert!(!in_closed_shells(&a_box[2..]).iter().any(|&is| is));
        // It runs through the box, and shares no edge with it; a second box beside the first shares four.
        let at = |y: f64, z: f64| DVec3::new(2.0, y, z);
        let [p, q, r, s] = [at(0.0, 0.0), at(2.5, 0.0), at(2.5, 3.0), at(0.0, 3.0)];
        let beside = Aabb::new(DVec3::new(4.0, 0.0, 0.0), DVec3::new(6.0, 2.5, 3.0));
        let all = [&a_box[..], &[[p, q, r], [p, r, s]], &beside.triangles()].concat();
        let is_closed = in_closed_shells(&all);
        let n_closed = is_closed.iter().filter(|is| **is).count();
        assert_eq!((n_closed, is_closed[12], is_closed[13]), (24, false, false));
    }
}
