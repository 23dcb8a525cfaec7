//! Polygons as narrow as the tolerance: they collapse to lines, together with the edges of their neighbors.
//!
//! The vertices of a sliver, in their order along it, divide each of its edges, in all polygons that have it. Then the sliver's own
//! edges cancel, and those of its neighbors meet. **Complexity:** O(n log n) for n vertices in each of a few rounds.

use std::collections::BTreeMap;

use enfilade_geom::DVec3;

use super::merge::{Rings, merged};
use super::weld::tidied;

/// Most rounds: a sliver beside another may wait for it.
const ROUNDS: usize = 12;

/// A polygon with its normal and what else is known about it.
pub(crate) struct Told<T> {
    pub(crate) rings: Rings,
    pub(crate) normal: DVec3,
    pub(crate) about: T,
}

/// Collapses all loops that are narrower than the tolerance.
pub(crate) fn collapse<T: Copy>(points: &[DVec3], polygons: &mut Vec<Told<T>>, tolerance: f64) {
    for _ in 0..ROUNDS {
        let mut divided: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        for ring in polygons.iter().flat_map(|p| &p.rings) {
            if let Some(order) = order_along(points, ring, tolerance) {
                divide_edges(ring, &order, &mut divided);
            }
        }
        if divided.is_empty() {
            break;
        }
        let mut left = Vec::with_capacity(polygons.len());
        for polygon in polygons.drain(..) {
            let has_some = edges(&polygon.rings).any(|[a, b]| divided.contains_key(&key(a, b)));
            if !has_some {
                left.push(polygon);
                continue;
            }
            let rings: Rings = (polygon.rings.iter().map(|r| with_vertices(r, &divided)))
                .filter(|r| !r.is_empty())
                .collect();
            let pieces: Vec<&[u32]> = rings.iter().map(Vec::as_slice).collect();
            for rings in merged(points, polygon.normal, &pieces) {
                left.push(Told { rings, ..polygon });
            }
        }
        *polygons = left;
    }
}

fn key(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

fn edges(rings: &Rings) -> impl Iterator<Item = [u32; 2]> {
    let ends = |ring: &'_ Vec<u32>| -> Vec<[u32; 2]> {
        let next = ring.iter().cycle().skip(1);
        ring.iter().zip(next).map(|(&a, &b)| [a, b]).collect()
    };
    rings.iter().flat_map(ends)
}

/// Returns the vertices of a loop in their order along it, if all are within the tolerance of one line.
fn order_along(points: &[DVec3], ring: &[u32], tolerance: f64) -> Option<Vec<u32>> {
    let at = |v: u32| points[v as usize];
    let farthest_from = |p: DVec3| {
        let by = |a: &&u32, b: &&u32| {
            at(**a)
                .distance_squared(p)
                .total_cmp(&at(**b).distance_squared(p))
        };
        ring.iter().max_by(by).map(|&v| at(v))
    };
    let start = farthest_from(at(*ring.first()?))?;
    let end = farthest_from(start)?;
    let direction = (end - start).try_normalize()?;
    let mut order = Vec::with_capacity(ring.len());
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    let mut across = DVec3::ZERO;
    for &v in ring {
        let from = at(v) - start;
        let t = from.dot(direction);
        let off = from - direction * t;
        if across == DVec3::ZERO && off.length() > 1e-9 {
            across = off.normalize_or_zero();
        }
        (low, high) = (low.min(off.dot(across)), high.max(off.dot(across)));
        if off.length() > tolerance || high - low > tolerance {
            return None;
        }
        order.push((t, v));
    }
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    order.dedup_by_key(|o| o.1);
    Some(order.into_iter().map(|o| o.1).collect())
}

/// Notes the vertices between the ends of each edge of a sliver, unless another sliver has divided one of them.
fn divide_edges(ring: &[u32], order: &[u32], divided: &mut BTreeMap<[u32; 2], Vec<u32>>) {
    let place: BTreeMap<u32, usize> = order.iter().enumerate().map(|(i, &v)| (v, i)).collect();
    let mut own = Vec::new();
    for (i, &a) in ring.iter().enumerate() {
        let [a, b] = key(a, ring[(i + 1) % ring.len()]);
        if divided.contains_key(&[a, b]) {
            return;
        }
        let (from, to) = (place[&a], place[&b]);
        let mut between = order[from.min(to) + 1..from.max(to)].to_vec();
        if from > to {
            between.reverse();
        }
        own.push(([a, b], between));
    }
    divided.extend(own);
}

/// Returns a loop with the noted vertices in its edges.
fn with_vertices(ring: &[u32], divided: &BTreeMap<[u32; 2], Vec<u32>>) -> Vec<u32> {
    let mut out = Vec::with_capacity(ring.len());
    for (i, &a) in ring.iter().enumerate() {
        let b = ring[(i + 1) % ring.len()];
        out.push(a);
        let between = divided.get(&key(a, b)).map_or(&[][..], Vec::as_slice);
        if a < b {
            out.extend(between);
        } else {
            out.extend(between.iter().rev());
        }
    }
    tidied(out)
}
