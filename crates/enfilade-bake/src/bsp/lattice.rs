//! Compares a separator with the sections of space beside it, sampled by lattices.

use enfilade_geom::DVec3;

use crate::MergeSettings;
use crate::structure::connected_count;

use super::leaves::Bsp;
use super::separator::Separator;
use super::tree::leaf_index;

/// Points of a lattice along its longer side, and its least step. [Units: wu]
const POINTS: f64 = 40.0;
const MIN_STEP: f64 = 0.1;
/// Sections on each side of a separator.
const SLICES: usize = 6;
/// Marks the absence of a leaf.
const NONE: u32 = u32::MAX;

/// Returns `true` if a separator can be a pinch for some division of the space around it: if the larger of the two
/// sections beside it, with all open space taken together, is larger than the separator.
pub(super) fn may_be_pinch(bsp: &Bsp<'_>, s: &Separator, settings: &MergeSettings) -> bool {
    let lattice = Lattice::of(bsp, s, settings);
    let enough = s.area / (settings.wall_threshold * lattice.step * lattice.step);
    let mut stack = Vec::new();
    (0..2 * SLICES).any(|k| {
        let mut is_open: Vec<bool> = lattice
            .slice(bsp, k, settings)
            .iter()
            .map(|&l| l != NONE)
            .collect();
        let (side, seeds) = (lattice.side, &lattice.is_in);
        connected_count(&mut is_open, side, seeds, &mut stack, |_| ()) as f64 > enough
    })
}

/// The sampled space around a separator.
struct Lattice {
    side: [usize; 2],
    step: f64,
    /// `true` for each point in the separator.
    is_in: Vec<bool>,
    base: DVec3,
    across: [DVec3; 3],
}

impl Lattice {
    fn of(bsp: &Bsp<'_>, s: &Separator, settings: &MergeSettings) -> Self {
        let plane = &bsp.tree.planes[s.plane as usize];
        let (u, v) = plane.basis();
        let polygon = |p: u32| &bsp.portals[p as usize].points;
        let flat = |p: DVec3| [u.dot(p), v.dot(p)];
        let (mut lo, mut hi) = ([f64::MAX; 2], [f64::MIN; 2]);
        for p in s.portals.iter().flat_map(|&p| polygon(p)) {
            for (k, t) in flat(*p).into_iter().enumerate() {
                lo[k] = lo[k].min(t);
                hi[k] = hi[k].max(t);
            }
        }
        for k in 0..2 {
            lo[k] -= settings.surround;
            hi[k] += settings.surround;
        }
        let step = (f64::max(hi[0] - lo[0], hi[1] - lo[1]) / POINTS).max(MIN_STEP);
        let side = [0, 1].map(|k| ((hi[k] - lo[k]) / step).ceil() as usize + 1);
        let base = plane.normal * -plane.d + u * lo[0] + v * lo[1];
        let at = |i: usize, j: usize| base + u * (i as f64 * step) + v * (j as f64 * step);
        let mut is_in = vec![false; side[0] * side[1]];
        for &p in &s.portals {
            let points = polygon(p);
            let place = |p: DVec3| {
                let f = flat(p);
                [0, 1].map(|k| (f[k] - lo[k]) / step)
            };
            let (mut from, mut to) = ([f64::MAX; 2], [f64::MIN; 2]);
            for &p in points {
                for (k, t) in place(p).into_iter().enumerate() {
                    from[k] = from[k].min(t);
                    to[k] = to[k].max(t);
                }
            }
            for j in from[1].ceil() as usize..=to[1].floor() as usize {
                if !bsp.purse.spend(1 + (to[0] - from[0]) as u64 / 4) {
                    break;
                }
                for i in from[0].ceil() as usize..=to[0].floor() as usize {
                    if contains(points, plane.normal, at(i, j)) {
                        is_in[j * side[0] + i] = true;
                    }
                }
            }
            // Even the smallest portal has a point.
            let middle = points.iter().sum::<DVec3>() / points.len() as f64;
            let [i, j] = place(middle).map(|t| t.round() as usize);
            is_in[j * side[0] + i] = true;
        }
        Self {
            side,
            step,
            is_in,
            base,
            across: [u * step, v * step, plane.normal],
        }
    }

    /// Returns the leaves at the points of section `k`, outwards; the first, third, … lie on the positive side.
    fn slice(&self, bsp: &Bsp<'_>, k: usize, settings: &MergeSettings) -> Vec<u32> {
        let off = settings.reach * (k / 2 + 1) as f64 / SLICES as f64;
        let off = self.across[2] * if k.is_multiple_of(2) { off } else { -off };
        let mut leaves = vec![NONE; self.side[0] * self.side[1]];
        if bsp.purse.spend(1 + leaves.len() as u64 / 8) {
            let all = [[0, self.side[0] - 1], [0, self.side[1] - 1]];
            self.look_up(bsp, off, bsp.tree.root, all, &mut leaves);
        }
        leaves
    }

    /// Looks up a block of points (first and last along each side), from a node of the tree on: if its outermost
    /// points are on one side of a plane, all its points are, so that large leaves cost little.
    fn look_up(
        &self,
        bsp: &Bsp<'_>,
        off: DVec3,
        mut child: i32,
        [[i0, i1], [j0, j1]]: [[usize; 2]; 2],
        leaves: &mut [u32],
    ) {
        if !bsp.purse.spend(2) {
            return;
        }
        let tree = &bsp.tree;
        let at = |i: usize, j: usize| {
            self.base + self.across[0] * i as f64 + self.across[1] * j as f64 + off
        };
        let corners = [at(i0, j0), at(i1, j0), at(i0, j1), at(i1, j1)];
        let n_inside = corners.iter().filter(|&&p| tree.bounds.contains(p)).count();
        let is_mixed = loop {
            if n_inside < 4 {
                break i0 != i1 || j0 != j1;
            }
            if child < 0 {
                break false;
            }
            let node = &tree.nodes[child as usize];
            let plane = &tree.planes[node.plane as usize];
            let n_behind = corners
                .iter()
                .filter(|&&p| plane.signed_distance(p) < 0.0)
                .count();
            match n_behind {
                0 => child = node.children[0],
                4 => child = node.children[1],
                _ => break true,
            }
        };
        if is_mixed {
            // A single point is never mixed: its outermost points coincide.
            let halves = if i1 - i0 >= j1 - j0 {
                let m = (i0 + i1) / 2;
                [[[i0, m], [j0, j1]], [[m + 1, i1], [j0, j1]]]
            } else {
                let m = (j0 + j1) / 2;
                [[[i0, i1], [j0, m]], [[i0, i1], [m + 1, j1]]]
            };
            for half in halves {
                self.look_up(bsp, off, child, half, leaves);
            }
            return;
        }
        if n_inside == 0 {
            return;
        }
        let leaf = leaf_index(child);
        if bsp.is_open[leaf as usize] {
            for j in j0..=j1 {
                leaves[j * self.side[0] + i0..=j * self.side[0] + i1].fill(leaf);
            }
        }
    }
}

/// Returns `true` if a point of the plane lies in a convex polygon that turns about `normal`.
fn contains(points: &[DVec3], normal: DVec3, p: DVec3) -> bool {
    let n = points.len();
    (0..n).all(|i| {
        let (a, b) = (points[i], points[(i + 1) % n]);
        normal.cross(b - a).dot(p - a) >= 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsp::tests::random_hall;
    use crate::bsp::{arrange, separator};

    #[test]
    fn points_looked_up_in_blocks_are_in_the_leaves_that_each_is_in_alone() {
        let settings = MergeSettings::default();
        let mut n = [0; 2];
        for seed in 0..6 {
            let mut bsp = random_hall(seed);
            arrange::refine(&mut bsp, &settings);
            for s in separator::find(&bsp).iter().take(40) {
                let lattice = Lattice::of(&bsp, s, &settings);
                for k in 0..2 * SLICES {
                    let off = settings.reach * (k / 2 + 1) as f64 / SLICES as f64;
                    let off = lattice.across[2] * if k % 2 == 0 { off } else { -off };
                    for (at, &leaf) in lattice.slice(&bsp, k, &settings).iter().enumerate() {
                        let (i, j) = (at % lattice.side[0], at / lattice.side[0]);
                        let p = lattice.base
                            + lattice.across[0] * i as f64
                            + lattice.across[1] * j as f64
                            + off;
                        let alone = if bsp.tree.bounds.contains(p) {
                            Some(bsp.tree.leaf_of(p)).filter(|&l| bsp.is_open[l as usize])
                        } else {
                            None
                        };
                        assert_eq!(leaf, alone.unwrap_or(NONE), "{p}");
                        n[usize::from(leaf == NONE)] += 1;
                    }
                }
            }
        }
        assert!(n.iter().all(|&n| n > 10_000), "{n:?}");
    }
}
