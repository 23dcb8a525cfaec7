//! Caps: what closes a tube, a cave or a shell that ends in an open rim.
//!
//! A scanned cave, a vessel or a room without its ceiling is one sheet of triangles that just ends. No
//! pinch tells the flood where: inside and outdoors flow together through a mouth as wide as the tube.
//! But the rim itself tells: a closed loop of edges that only one triangle uses, about planar, with
//! the surface leaving its plane to one side all around. Such a mouth is capped for the flood (see
//! `closures`), and becomes an open portal. The rim of a flat sheet, a hill or a window in a thin wall
//! lies *in* the surface and gets no cap.
//!
//! Cost: a sort of the edges, `O(n log n)` in triangles.

use enfilade_geom::{DVec3, Triangle};

/// A rim strays from its plane by at most this share of the square root of its area.
const MAX_STRAY: f64 = 0.15;
/// Perimeter² ÷ area of the longest slit that counts; a circle has 4π, a square 16.
const MAX_SLIT: f64 = 40.0;
/// The surface leaves the rim's plane at more than about 30 degrees …
const MIN_SLOPE: f64 = 0.5;
/// … to the same side, along this share of the rim.
const MIN_SHARE: f64 = 0.8;

/// Triangles that cap the open rims of at least `min_area` wu². The order of the input has no say.
#[must_use]
pub(crate) fn rim_caps(triangles: &[Triangle], min_area: f64) -> Vec<Triangle> {
    let rims = Rims::of(triangles);
    let mut caps = Vec::new();
    for rim in rims.loops() {
        if let Some(center) = mouth_of(&rim, min_area) {
            let n = rim.len();
            caps.extend((0..n).map(|i| [center, rim[i].0, rim[(i + 1) % n].0]));
        }
    }
    caps
}

/// A corner of a rim, and the far corner of the triangle at the edge that leaves it.
type Corner = (DVec3, DVec3);

/// The middle of a rim that is the mouth of something.
fn mouth_of(rim: &[Corner], min_area: f64) -> Option<DVec3> {
    let n = rim.len();
    let center = rim.iter().map(|c| c.0).sum::<DVec3>() / n as f64;
    let edge = |i: usize| (rim[i].0, rim[(i + 1) % n].0);
    let vector: DVec3 = (0..n)
        .map(|i| (edge(i).0 - center).cross(edge(i).1 - center))
        .sum::<DVec3>()
        * 0.5;
    let area = vector.length();
    let perimeter: f64 = (0..n).map(|i| edge(i).0.distance(edge(i).1)).sum();
    if area < min_area || perimeter * perimeter > MAX_SLIT * area {
        return None;
    }
    let normal = vector / area;
    let is_planar = rim
        .iter()
        .all(|c| normal.dot(c.0 - center).abs() <= MAX_STRAY * area.sqrt());
    let (mut up, mut down) = (0.0, 0.0);
    for (i, &(_, apex)) in rim.iter().enumerate() {
        let (a, b) = edge(i);
        let along = (b - a).normalize_or_zero();
        let away = apex - a;
        let slope = normal.dot((away - along * along.dot(away)).normalize_or_zero());
        if slope > MIN_SLOPE {
            up += a.distance(b);
        } else if slope < -MIN_SLOPE {
            down += a.distance(b);
        }
    }
    (is_planar && f64::max(up, down) >= MIN_SHARE * perimeter).then_some(center)
}

/// Edges that only one triangle uses, as that triangle turns.
struct Rims {
    points: Vec<DVec3>,
    /// From, to, far corner; ascending by `from`.
    edges: Vec<[u32; 3]>,
}

impl Rims {
    fn of(triangles: &[Triangle]) -> Self {
        let key = |p: &DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
        let mut points: Vec<DVec3> = triangles.iter().flatten().copied().collect();
        points.sort_by_cached_key(key);
        points.dedup();
        let keys: Vec<[u64; 3]> = points.iter().map(key).collect();
        let index = |p: &DVec3| keys.partition_point(|k| *k < key(p)) as u32;
        let mut edges: Vec<[u32; 3]> = triangles
            .iter()
            .flat_map(|t| {
                let v = [0, 1, 2].map(|k| index(&t[k]));
                [[v[0], v[1], v[2]], [v[1], v[2], v[0]], [v[2], v[0], v[1]]]
            })
            .collect();
        let ends = |e: &[u32; 3]| (e[0].min(e[1]), e[0].max(e[1]));
        edges.sort_unstable_by_key(|e| (ends(e), *e));
        let mut single: Vec<[u32; 3]> = edges
            .chunk_by(|a, b| ends(a) == ends(b))
            .filter(|run| run.len() == 1)
            .map(|run| run[0])
            .collect();
        single.sort_unstable();
        Self {
            points,
            edges: single,
        }
    }

    /// Closed loops in which every corner has one edge in and one out.
    fn loops(&self) -> Vec<Vec<Corner>> {
        let next = |v: u32| -> Option<usize> {
            let at = self.edges.partition_point(|e| e[0] < v);
            let is_only = self.edges.get(at).is_some_and(|e| e[0] == v)
                && self.edges.get(at + 1).is_none_or(|e| e[0] != v);
            is_only.then_some(at)
        };
        let mut seen = vec![false; self.edges.len()];
        let mut out = Vec::new();
        for start in 0..self.edges.len() {
            let mut rim = Vec::new();
            let mut at = Some(start);
            while let Some(i) = at.filter(|&i| !seen[i]) {
                seen[i] = true;
                let [from, to, apex] = self.edges[i];
                rim.push((self.points[from as usize], self.points[apex as usize]));
                at = next(to);
            }
            if at == Some(start) && rim.len() >= 3 && next(self.edges[start][0]) == Some(start) {
                out.push(rim);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::Aabb;

    /// A tube of `n` sides along z, from 0 to `length`, cone-shaped with these two radii.
    fn tube(n: usize, length: f64, radii: [f64; 2]) -> Vec<Triangle> {
        let p = |i: usize, k: usize| {
            let a = std::f64::consts::TAU * (i % n) as f64 / n as f64;
            DVec3::new(a.cos() * radii[k], a.sin() * radii[k], length * k as f64)
        };
        (0..n)
            .flat_map(|i| {
                [
                    [p(i, 0), p(i + 1, 0), p(i + 1, 1)],
                    [p(i, 0), p(i + 1, 1), p(i, 1)],
                ]
            })
            .collect()
    }

    fn area(caps: &[Triangle]) -> f64 {
        caps.iter()
            .map(|t| (t[1] - t[0]).cross(t[2] - t[0]).length() * 0.5)
            .sum()
    }

    #[test]
    fn both_mouths_of_a_tube_are_capped_whatever_the_order() {
        let mut t = tube(24, 5.0, [1.0, 1.0]);
        let caps = rim_caps(&t, 0.3);
        assert!((area(&caps) - 2.0 * 12.0 * (15.0_f64).to_radians().sin()).abs() < 1e-9);
        t.reverse();
        assert_eq!(rim_caps(&t, 0.3), caps);
        assert!(rim_caps(&t, 4.0).is_empty());
    }

    #[test]
    fn flat_sheets_and_shallow_bowls_have_no_mouth() {
        assert!(rim_caps(&tube(24, 0.0, [1.0, 3.0]), 0.3).is_empty());
        assert!(rim_caps(&tube(24, 0.5, [1.0, 3.0]), 0.3).is_empty());
    }

    #[test]
    fn a_closed_box_has_no_rim() {
        let halves = |[a, b, c, d]: [DVec3; 4]| [[a, b, c], [a, c, d]];
        let block = Aabb::new(DVec3::ZERO, DVec3::splat(3.0));
        let mut t: Vec<Triangle> = block.faces().into_iter().flat_map(halves).collect();
        assert!(rim_caps(&t, 0.3).is_empty());
        // Without its lid it has one mouth.
        t.truncate(10);
        assert!((area(&rim_caps(&t, 0.3)) - 9.0).abs() < 1e-9);
    }
}
