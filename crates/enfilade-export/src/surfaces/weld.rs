//! One set of vertices for all pieces of a room: an edge of one piece is an edge of its neighbor.
//!
//! Snap rounding (Hobby 1999; Guibas & Marimont 1998) in space, with Voronoi cells in place of pixels. Some vertices are *centers*, no
//! two within the tolerance; each vertex becomes its nearest center, and each edge the chain of the centers whose cells it passes
//! through, within the tolerance. Places on a line meet the same cells in the same order, so edges that cancel where one piece's vertex
//! is in the middle of another's edge cancel as chains, too: a closed boundary stays closed, whatever was rounded. **Complexity:**
//! O(n) for n vertices spread out in space. **Numerics:** vertices move by the tolerance at most; pieces narrower than that may vanish.

use std::collections::{BTreeMap, HashMap};

use enfilade_geom::DVec3;

/// Side of the boxes in which centers near an edge are looked up. [Units: wu]
const COARSE: f64 = 0.5;
/// Vertices this close are one before edges are followed: rounding must not lead two edges of one line through different cells.
/// [Units: wu]
const ROUNDING: f64 = 1e-6;

/// Shared vertices, and polygons as lists of their numbers.
pub(crate) struct Welded {
    pub(crate) points: Vec<DVec3>,
    /// One for each polygon given; empty if it vanished.
    pub(crate) polygons: Vec<Vec<u32>>,
}

/// Welds the vertices of polygons, and divides their edges at each other's vertices.
pub(crate) fn weld<'p>(polygons: impl Iterator<Item = &'p [DVec3]>, tolerance: f64) -> Welded {
    let mut vertices = Vertices::within(ROUNDING);
    let loops: Vec<Vec<u32>> = polygons
        .map(|points| points.iter().map(|&p| vertices.number(p)).collect())
        .collect();
    let mut centers = Vertices::within(tolerance);
    for &p in &vertices.points {
        centers.number(p);
    }
    let mut coarse: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    for (v, &p) in (0..).zip(&centers.points) {
        coarse.entry(grid(p, COARSE)).or_default().push(v);
    }
    let mut known: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    let polygons = loops
        .iter()
        .map(|ring| {
            let mut out = Vec::with_capacity(ring.len());
            for (i, &a) in ring.iter().enumerate() {
                let b = ring[(i + 1) % ring.len()];
                if a == b {
                    continue;
                }
                let key = [a.min(b), a.max(b)];
                let chain = known.entry(key).or_insert_with(|| {
                    let ends = key.map(|v| vertices.points[v as usize]);
                    chain(&centers, &coarse, ends)
                });
                if a < b {
                    out.extend(chain.iter());
                } else {
                    out.extend(chain.iter().rev());
                }
            }
            tidied(out)
        })
        .collect();
    Welded {
        points: centers.points,
        polygons,
    }
}

/// Drops repeated vertices, and edges that are walked forth and back.
pub(crate) fn tidied(ring: Vec<u32>) -> Vec<u32> {
    let mut out: Vec<u32> = Vec::with_capacity(ring.len());
    for v in ring {
        if out.last() == Some(&v) {
            continue;
        }
        if out.len() >= 2 && out[out.len() - 2] == v {
            out.pop();
            continue;
        }
        out.push(v);
    }
    loop {
        let n = out.len();
        if n >= 2 && out[0] == out[n - 1] {
            out.pop();
        } else if n >= 3 && out[1] == out[n - 1] {
            out.pop();
            out.remove(0);
        } else if n >= 3 && out[0] == out[n - 2] {
            out.pop();
            out.pop();
        } else {
            break;
        }
    }
    if out.len() < 3 { Vec::new() } else { out }
}

/// Returns the centers whose cells an edge passes through, in order, from that of its first end to that of its second.
fn chain(centers: &Vertices, coarse: &HashMap<[i64; 3], Vec<u32>>, [p, q]: [DVec3; 2]) -> Vec<u32> {
    let tolerance = centers.tolerance;
    let along = q - p;
    let near = near_edge(&centers.points, coarse, [p, q], tolerance);
    let mut passed: Vec<(f64, u32)> = Vec::new();
    for &v in &near {
        let center = centers.points[v as usize];
        // Within the ball: |p + t along - center| <= tolerance.
        let from = p - center;
        let (a, b) = (along.length_squared(), from.dot(along));
        let inner = b * b - a * (from.length_squared() - tolerance * tolerance);
        if inner < 0.0 {
            continue;
        }
        let (mut low, mut high) = ((-b - inner.sqrt()) / a, (-b + inner.sqrt()) / a);
        (low, high) = (low.max(0.0), high.min(1.0));
        for &w in near.iter().filter(|&&w| w != v) {
            // Nearer to `center` than to the other: at + slope t <= 0.
            let other = centers.points[w as usize];
            let slope = 2.0 * along.dot(other - center);
            let at = p.distance_squared(center) - p.distance_squared(other);
            if slope > 0.0 {
                high = high.min(-at / slope);
            } else if slope < 0.0 {
                low = low.max(-at / slope);
            } else if at > 0.0 {
                high = -1.0;
            }
        }
        if low <= high {
            passed.push((low, v));
        }
    }
    passed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let [first, last] = [p, q].map(|end| centers.nearest(end));
    let between = passed.into_iter().map(|f| f.1);
    let between = between.filter(|&v| Some(v) != first && Some(v) != last);
    let mut out: Vec<u32> = first.into_iter().chain(between).collect();
    out.extend(last.filter(|_| last != first));
    out
}

/// Returns the centers within the tolerance of an edge, ascending.
fn near_edge(
    points: &[DVec3],
    coarse: &HashMap<[i64; 3], Vec<u32>>,
    [p, q]: [DVec3; 2],
    tolerance: f64,
) -> Vec<u32> {
    let along = q - p;
    let mut found = Vec::new();
    let low = grid(p.min(q) - tolerance, COARSE);
    let high = grid(p.max(q) + tolerance, COARSE);
    for x in low[0]..=high[0] {
        for y in low[1]..=high[1] {
            for z in low[2]..=high[2] {
                for &v in coarse.get(&[x, y, z]).map_or(&[][..], Vec::as_slice) {
                    let at = points[v as usize] - p;
                    let t = (at.dot(along) / along.length_squared()).clamp(0.0, 1.0);
                    if (at - along * t).length() <= tolerance {
                        found.push(v);
                    }
                }
            }
        }
    }
    found.sort_unstable();
    found
}

fn grid(p: DVec3, step: f64) -> [i64; 3] {
    (p / step).floor().to_array().map(|x| x as i64)
}

struct Vertices {
    tolerance: f64,
    points: Vec<DVec3>,
    by_place: HashMap<[i64; 3], Vec<u32>>,
}

impl Vertices {
    fn within(tolerance: f64) -> Self {
        Self {
            tolerance,
            points: Vec::new(),
            by_place: HashMap::new(),
        }
    }

    /// Returns the nearest vertex within the tolerance.
    fn nearest(&self, p: DVec3) -> Option<u32> {
        let [x, y, z] = grid(p, self.tolerance);
        let mut best: Option<(f64, u32)> = None;
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    let near = self.by_place.get(&[x + dx, y + dy, z + dz]);
                    for &v in near.map_or(&[][..], Vec::as_slice) {
                        let d = self.points[v as usize].distance(p);
                        if d <= self.tolerance && best.is_none_or(|b| (d, v) < b) {
                            best = Some((d, v));
                        }
                    }
                }
            }
        }
        best.map(|b| b.1)
    }

    /// Returns the number of the nearest vertex within the tolerance, or of a new one.
    fn number(&mut self, p: DVec3) -> u32 {
        if let Some(v) = self.nearest(p) {
            return v;
        }
        let v = self.points.len() as u32;
        self.points.push(p);
        self.by_place
            .entry(grid(p, self.tolerance))
            .or_default()
            .push(v);
        v
    }
}
