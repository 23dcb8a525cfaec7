//! Measures how narrow the opening of a separator is, on sections of space beside it, sampled by lattices.

use std::sync::OnceLock;

use enfilade_geom::DVec3;

use crate::MergeSettings;
use crate::structure::{connected_count, rim_share};

use super::leaves::Bsp;
use super::separator::Separator;
use super::tree::leaf_index;

/// Points of a lattice along its longer side, and its least step. [Units: wu]
const POINTS: f64 = 40.0;
const MIN_STEP: f64 = 0.1;
/// Sections on each side of a separator.
pub(super) const SLICES: usize = 6;
/// Marks the absence of a leaf or portal.
pub(super) const NONE: u32 = u32::MAX;

/// The sampled space around a separator.
pub(super) struct Lattice {
    pub(super) side: [usize; 2],
    pub(super) step: f64,
    /// The portal of the separator at each point, as an index into the separator's list.
    pub(super) portal_at: Vec<u32>,
    /// Leaves at each point of the sections, outwards; the first, third, … lie on the positive side.
    slices: Vec<OnceLock<Vec<u32>>>,
    base: DVec3,
    across: [DVec3; 3],
}

/// Narrowness of an opening.
pub(super) struct Section {
    /// Its area divided by that of the smaller of the two sections beside it.
    pub(super) ratio: f64,
    /// Share of its rim that is a wall with both cells beside it.
    pub(super) wall: f64,
}

impl Lattice {
    pub(super) fn of(bsp: &Bsp<'_>, s: &Separator, settings: &MergeSettings) -> Self {
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
        let mut portal_at = vec![NONE; side[0] * side[1]];
        for (n, &p) in s.portals.iter().enumerate() {
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
                        portal_at[j * side[0] + i] = n as u32;
                    }
                }
            }
            // Even the smallest portal has a point.
            let middle = points.iter().sum::<DVec3>() / points.len() as f64;
            let [i, j] = place(middle).map(|t| t.round() as usize);
            let slot = &mut portal_at[j * side[0] + i];
            if *slot == NONE {
                *slot = n as u32;
            }
        }
        Self {
            side,
            step,
            portal_at,
            slices: vec![OnceLock::new(); 2 * SLICES],
            base,
            across: [u * step, v * step, plane.normal],
        }
    }

    /// Returns the leaves at the points of section `k`. Looks them up on first use, as most measures need few.
    pub(super) fn slice(&self, bsp: &Bsp<'_>, k: usize, settings: &MergeSettings) -> &[u32] {
        self.slices[k].get_or_init(|| {
            let off = settings.reach * (k / 2 + 1) as f64 / SLICES as f64;
            let off = self.across[2] * if k.is_multiple_of(2) { off } else { -off };
            let mut leaves = vec![NONE; self.side[0] * self.side[1]];
            let all = [[0, self.side[0] - 1], [0, self.side[1] - 1]];
            self.look_up(bsp, off, bsp.tree.root, all, &mut leaves);
            leaves
        })
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

    /// Measures the opening, of this area, of the portals that satisfy `is_seed`, between two sides. `in_side`
    /// returns the side of a leaf (0 or 1; anything else is neither), given its position before (0) or behind (1)
    /// the plane. One side may be endless.
    pub(super) fn section(
        &self,
        bsp: &Bsp<'_>,
        area: f64,
        is_seed: &dyn Fn(u32) -> bool,
        in_side: &dyn Fn(usize, u32) -> u8,
        endless: Option<usize>,
        settings: &MergeSettings,
    ) -> Section {
        let seeds: Vec<bool> = self
            .portal_at
            .iter()
            .map(|&p| p != NONE && is_seed(p))
            .collect();
        let mut beside = [vec![false; seeds.len()], vec![false; seeds.len()]];
        let mut best = [0_usize; 2];
        let mut stack = Vec::new();
        let unit = self.step * self.step;
        // Once both are this large, it is a pinch, whatever other sections show.
        let enough = area / (settings.threshold * unit);
        let smaller = |best: [usize; 2]| match endless {
            Some(side) => best[1 - side],
            None => best[0].min(best[1]),
        };
        for k in 0..self.slices.len() {
            if !bsp.purse.spend(1 + seeds.len() as u64 / 8) {
                break;
            }
            let of: Vec<u8> = self
                .slice(bsp, k, settings)
                .iter()
                .map(|&l| if l == NONE { 2 } else { in_side(k % 2, l) })
                .collect();
            for c in 0..2 {
                let mut inside: Vec<bool> = of.iter().map(|&o| usize::from(o) == c).collect();
                let count = connected_count(&mut inside, self.side, &seeds, &mut stack, |k| {
                    beside[c][k] = true;
                });
                best[c] = best[c].max(count);
            }
            if smaller(best) as f64 > enough {
                return Section {
                    ratio: area / (smaller(best) as f64 * unit),
                    wall: 0.0,
                };
            }
        }
        let ratio = match smaller(best) {
            0 => 1.0,
            n => area / (n as f64 * unit),
        };
        let wall = rim_share(&seeds, self.side, |k| beside[0][k] && beside[1][k]);
        Section { ratio, wall }
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
