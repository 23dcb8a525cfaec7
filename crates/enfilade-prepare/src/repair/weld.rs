//! Welds points that lie close together.
//!
//! The first half of cutting and stitching (Guéziec, Taubin, Lazarus & Horn 2001): joins vertices that nearly meet
//! along the rims of the surface. Closed surfaces stay unchanged, however fine they are.

use std::cmp::Ordering;
use std::collections::HashMap;

use enfilade_geom::DVec3;

use super::surface::{Surface, open_of};

/// Points nearer than this are one, even off the rims, as in the cleaning report. [Units: wu]
pub(super) const ONE_POINT: f64 = 1e-5;

/// Most neighbors counted to measure the crowd around a point; more make no difference.
const CROWD: u32 = 256;

/// Welds all points within [`ONE_POINT`], or `tolerance` if that is less. Returns the number of moved points.
pub(super) fn weld_all(surface: &mut Surface, tolerance: f64) -> u64 {
    let weights = weights(surface);
    let used: Vec<u32> = (0..weights.len() as u32)
        .filter(|&p| weights[p as usize] > 0)
        .collect();
    weld(surface, &used, &weights, tolerance.min(ONE_POINT))
}

/// Welds the ends of open edges within `tolerance`. Returns the number of moved points.
pub(super) fn weld_rims(surface: &mut Surface, tolerance: f64) -> u64 {
    let mut ends: Vec<u32> = open_of(&surface.uses())
        .iter()
        .flat_map(|e| e.ends)
        .collect();
    ends.sort_unstable();
    ends.dedup();
    let weights = weights(surface);
    weld(surface, &ends, &weights, tolerance)
}

/// Returns the number of vertices at each point.
fn weights(surface: &Surface) -> Vec<u32> {
    let mut weights = vec![0; surface.points.len()];
    for face in 0..surface.faces.len() {
        for p in surface.ends(face) {
            weights[p as usize] += 1;
        }
    }
    weights
}

fn weld(surface: &mut Surface, chosen: &[u32], weights: &[u32], tolerance: f64) -> u64 {
    let heads = heads(&surface.points, chosen, weights, tolerance);
    let n = chosen.iter().filter(|&&p| heads[p as usize] != p).count();
    if n == 0 {
        return 0;
    }
    let parts = surface.parts.iter_mut();
    for part in parts {
        for p in &mut part.points {
            let head = heads[*p as usize];
            if head != *p {
                *p = head;
                surface.is_changed[part.object as usize] = true;
            }
        }
    }
    n as u64
}

/// Returns the point that each point becomes: itself, unless it is chosen and a chosen head lies within `tolerance`.
///
/// Picks heads one by one, those with most vertices around them first, equal ones by position; every other point goes
/// to the nearest head. Heads stay in place and lie more than `tolerance` apart, so that welding again changes
/// nothing, and no chain of points collapses into one. The order of the points makes no difference, unless 256 lie
/// around one. Time: `n log n` for `n` points; each examines at most 256 neighbors, and the heads around it.
pub(super) fn heads(points: &[DVec3], chosen: &[u32], weights: &[u32], tolerance: f64) -> Vec<u32> {
    let mut into: Vec<u32> = (0..points.len() as u32).collect();
    let at = |p: u32| points[p as usize];
    let mut all = Grid::new(tolerance);
    chosen.iter().for_each(|&p| all.add(at(p), p));
    let mut order: Vec<(u32, u32)> = Vec::with_capacity(chosen.len());
    for &p in chosen {
        let (mut n_around, mut looked) = (0, 0);
        all.near(at(p), |q| {
            looked += 1;
            if at(q).distance_squared(at(p)) <= tolerance * tolerance {
                n_around += weights[q as usize];
            }
            looked < CROWD
        });
        order.push((n_around, p));
    }
    let by_place = |p: u32, q: u32| {
        let (a, b) = (at(p).to_array(), at(q).to_array());
        let unequal = (0..3).map(|k| a[k].total_cmp(&b[k])).find(|o| o.is_ne());
        unequal.unwrap_or(Ordering::Equal)
    };
    order.sort_by(|(m, p), (n, q)| n.cmp(m).then_with(|| by_place(*p, *q)));
    let mut heads = Grid::new(tolerance);
    let nearest = |heads: &Grid, p: u32| {
        let mut best: Option<(f64, u32)> = None;
        heads.near(at(p), |q| {
            let d = at(q).distance_squared(at(p));
            let is_nearer = best.is_none_or(|(least, of)| {
                d.total_cmp(&least).then_with(|| by_place(q, of)).is_lt()
            });
            if d <= tolerance * tolerance && is_nearer {
                best = Some((d, q));
            }
            true
        });
        best.map(|(_, q)| q)
    };
    for &(_, p) in &order {
        if nearest(&heads, p).is_none() {
            heads.add(at(p), p);
        }
    }
    for &p in chosen {
        into[p as usize] = nearest(&heads, p).unwrap_or(p);
    }
    into
}

/// Points by their grid cell.
struct Grid {
    reach: f64,
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl Grid {
    fn new(reach: f64) -> Self {
        Self {
            reach,
            cells: HashMap::new(),
        }
    }

    /// Cells four distances wide: most points lie well inside and need one lookup.
    fn cell(&self, p: DVec3) -> [i64; 3] {
        let width = 4.0 * self.reach;
        (p / width).floor().to_array().map(|c| c as i64)
    }

    fn add(&mut self, p: DVec3, number: u32) {
        self.cells.entry(self.cell(p)).or_default().push(number);
    }

    /// Visits points within reach, and some beyond, until the visitor has enough.
    fn near(&self, p: DVec3, mut visit: impl FnMut(u32) -> bool) {
        let reach = DVec3::splat(self.reach);
        let (low, high) = (self.cell(p - reach), self.cell(p + reach));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    for &q in self.cells.get(&[x, y, z]).map_or(&[][..], Vec::as_slice) {
                        if !visit(q) {
                            return;
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn heads_lie_apart_and_every_point_near_its_own(
            numbers in prop::collection::vec(prop::array::uniform3(0_i32..40), 1..80),
            turn in 0_usize..80,
        ) {
            let tolerance = 3.1;
            let points: Vec<DVec3> =
                numbers.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
            let chosen: Vec<u32> = (0..points.len() as u32).collect();
            let weights = vec![1; points.len()];
            let into = heads(&points, &chosen, &weights, tolerance);
            for (p, &head) in into.iter().enumerate() {
                prop_assert_eq!(into[head as usize], head);
                prop_assert!(points[p].distance(points[head as usize]) <= tolerance);
                for &other in &into {
                    let d = points[head as usize].distance(points[other as usize]);
                    prop_assert!(head == other || d > tolerance);
                }
            }
            // In another order the same points are heads of the same points.
            let mut turned = points.clone();
            turned.rotate_left(turn % points.len());
            let again = heads(&turned, &chosen, &weights, tolerance);
            for p in 0..points.len() {
                let q = (p + points.len() - turn % points.len()) % points.len();
                prop_assert_eq!(points[into[p] as usize], turned[again[q] as usize]);
            }
        }
    }
}
