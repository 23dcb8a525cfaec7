//! Cross-sections beside an opening: how much of what lies on either side of it an opening leaves
//! open.

use enfilade_geom::DVec3;

use super::flooded::Flooded;
use super::fronts::{Front, face_center};
use crate::structure::{MergeSettings, OUTDOORS, connected_count, rim_share};

/// Share of a front that leaves must hold for it to stand between them.
const LEAVES: f64 = 0.2;
/// An opening lies elsewhere than the front of the flood where it is narrower by this.
const PINCHED: f64 = 0.9;

/// Area of the opening of `front`, between the cells of `pair`, ÷ the smaller of their largest cross-sections
/// beside it; and the share of its rim that is wall. `cell_of` tells the cell of a basin.
pub(super) fn section_ratio(
    flooded: Flooded<'_>,
    settings: &MergeSettings,
    front: &Front,
    [a, b]: [u32; 2],
    cell_of: &impl Fn(u32) -> u32,
) -> (f64, f64) {
    let opening = &front.opening;
    let slices = Slices::beside(flooded, settings, front, cell_of);
    let unit = slices.step * slices.step;
    let reach = (settings.reach / slices.step).round() as i64;
    let (mut in_a, mut in_b) = (slices.nowhere(), slices.nowhere());
    let mut stack = Vec::new();

    // The front of a flood may stand past the doorway, between the leaves of an open door, say: the
    // opening is where what both have is narrowest.
    let (mut n_open, mut at) = (opening.area / unit, 0);
    if opening.closed >= LEAVES {
        for s in (1..=reach).flat_map(|s| [s, -s]) {
            slices.visit(s, |k, cell| in_a[k] = cell == a || cell == b);
            let n = connected_count(&mut in_a, slices.side, &slices.seeds, &mut stack, |_| ());
            if n > 0 && (n as f64) < PINCHED * n_open {
                (n_open, at) = (n as f64, s);
            }
        }
    }

    let (mut best_a, mut best_b) = (0, 0);
    let (mut beside_a, mut beside_b) = (slices.nowhere(), slices.nowhere());
    let smaller = |best_a: usize, best_b: usize| {
        if a == OUTDOORS {
            best_b
        } else {
            best_a.min(best_b)
        }
    };
    // Once both are this large, the opening is a pinch whatever else there is.
    let enough = n_open / settings.threshold;
    // From the opening outward, as far sections are the large ones.
    let outward = (0..=reach + at.abs()).flat_map(|s| [s, -s]).skip(1);
    for s in outward.map(|s| at + s) {
        slices.visit(s, |k, cell| {
            in_a[k] = cell == a;
            in_b[k] = cell == b;
        });
        let mut section = |inside: &mut [bool], beside: &mut [bool], this_side: bool| {
            let mark = |k: usize| beside[k] |= this_side;
            connected_count(inside, slices.side, &slices.seeds, &mut stack, mark)
        };
        best_a = best_a.max(section(&mut in_a, &mut beside_a, s <= at));
        best_b = best_b.max(section(&mut in_b, &mut beside_b, s >= at));
        let n = smaller(best_a, best_b) as f64;
        if n > enough {
            return (n_open / n, 0.0);
        }
    }
    let wall = rim_share(&slices.seeds, slices.side, |k| beside_a[k] && beside_b[k]);
    match smaller(best_a, best_b) {
        0 => (1.0, wall),
        n => (n_open / n as f64, wall),
    }
}

/// Planes parallel to an opening, as lattices of points.
struct Slices<'a, F> {
    flooded: Flooded<'a>,
    cell_of: &'a F,
    /// Between points, and between slices. [Units: wu]
    step: f64,
    /// First point of the slice in the opening, then to the next along the rows, the columns, and to
    /// the next slice. [Units: vx]
    base: DVec3,
    along: [DVec3; 3],
    /// Points along both sides.
    side: [usize; 2],
    /// Points that lie in the opening.
    seeds: Vec<bool>,
}

impl<'a, F: Fn(u32) -> u32> Slices<'a, F> {
    fn beside(
        flooded: Flooded<'a>,
        settings: &MergeSettings,
        front: &Front,
        cell_of: &'a F,
    ) -> Self {
        let (grid, opening) = (flooded.grid, &front.opening);
        let (u, v) = opening.plane.basis();
        let in_plane = |f: u64| {
            let p = face_center(grid, f) - opening.center;
            [u.dot(p), v.dot(p)]
        };
        let (mut lo, mut hi) = ([f64::MAX; 2], [f64::MIN; 2]);
        for &f in &front.faces {
            for (k, t) in in_plane(f).into_iter().enumerate() {
                lo[k] = lo[k].min(t);
                hi[k] = hi[k].max(t);
            }
        }
        let step = grid.voxel.max(0.1);
        let start = lo.map(|t| t - settings.surround);
        let side = [0, 1].map(|k| {
            (((hi[k] - lo[k] + 2.0 * settings.surround) / step).ceil() as usize).max(1) + 1
        });
        let mut seeds = vec![false; side[0] * side[1]];
        for &f in &front.faces {
            let [x, y] = in_plane(f);
            let at = [x - start[0], y - start[1]].map(|t| (t / step).round() as usize);
            seeds[at[0].min(side[0] - 1) + at[1].min(side[1] - 1) * side[0]] = true;
        }
        Self {
            flooded,
            cell_of,
            step,
            base: grid.to_voxel(opening.center + u * start[0] + v * start[1]),
            along: [u, v, opening.plane.normal].map(|d| d * (step / grid.voxel)),
            side,
            seeds,
        }
    }

    fn nowhere(&self) -> Vec<bool> {
        vec![false; self.seeds.len()]
    }

    /// Visits each point of the slice `s` steps along the normal, with the cell that it lies in.
    fn visit(&self, s: i64, mut point: impl FnMut(usize, u32)) {
        let grid = self.flooded.grid;
        let end = DVec3::from(grid.dims.map(|n| n as f64));
        let [du, dv, dn] = self.along;
        // In voxels, so that a lattice point costs an addition and a look-up.
        let base = self.base + dn * s as f64;
        let mut last = (0, 0);
        for j in 0..self.side[1] {
            let row = base + dv * j as f64;
            for i in 0..self.side[0] {
                let p = row + du * i as f64;
                let is_in = p.cmpge(DVec3::ZERO).all() && p.cmplt(end).all();
                let label = if is_in {
                    // Positive, so the cast rounds down.
                    let at = grid.index(p.x as usize, p.y as usize, p.z as usize);
                    self.flooded.labels.get(at)
                } else {
                    0
                };
                if label != last.0 {
                    last = (label, if label == 0 { 0 } else { (self.cell_of)(label) });
                }
                point(j * self.side[0] + i, last.1);
            }
        }
    }
}
