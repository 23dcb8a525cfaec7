//! A plane's section with triangles, as a picture: the lattice cells that they block, and the connected open ones.
//!
//! The resolution is fixed, so that a section costs no more than a picture and the triangles near it.

use std::ops::Range;

use enfilade_geom::{DVec3, Plane, Triangle};

use crate::voxel::{BitVolume, for_runs, set_bits};

/// Most lattice cells along one side.
const MAX_SIDE: usize = 320;
/// Finest lattice spacing. [Units: wu]
const FINEST: f64 = 0.02;

/// A lattice of cells in a plane around an opening.
#[derive(Clone, Copy)]
pub(super) struct Picture {
    pub(super) origin: DVec3,
    pub(super) u: DVec3,
    pub(super) v: DVec3,
    pub(super) step: f64,
    pub(super) side: [usize; 2],
}

/// A connected set of open cells.
pub(super) struct OpenPatch {
    pub(super) cells: BitVolume,
    /// Number of the opening's points in it.
    pub(super) n_hits: usize,
    pub(super) meets_border: bool,
}

impl Picture {
    pub(super) fn around(plane: &Plane, centers: &[DVec3], margin: f64) -> Self {
        let (u, v) = plane.basis();
        let base = plane.project(centers[0]);
        let (mut lo, mut hi) = ([f64::MAX; 2], [f64::MIN; 2]);
        for &c in centers {
            for (k, t) in [u.dot(c - base), v.dot(c - base)].into_iter().enumerate() {
                lo[k] = lo[k].min(t);
                hi[k] = hi[k].max(t);
            }
        }
        let extent = (hi[0] - lo[0]).max(hi[1] - lo[1]) + 2.0 * margin;
        let step = (extent / MAX_SIDE as f64).max(FINEST);
        Self {
            origin: base + u * (lo[0] - margin) + v * (lo[1] - margin),
            u,
            v,
            step,
            side: [0, 1].map(|k| (((hi[k] - lo[k] + 2.0 * margin) / step).ceil() as usize).max(1)),
        }
    }

    fn place(&self, p: DVec3) -> [f64; 2] {
        [self.u, self.v].map(|d| d.dot(p - self.origin) / self.step)
    }

    /// Returns the cells that triangles lie in, cross, or touch with an edge: a floor of sheets may end in the plane of a wall.
    /// Vertices nearer than `rounding` lie in the plane.
    pub(super) fn blocked(&self, plane: &Plane, around: &[Triangle], rounding: f64) -> BitVolume {
        let mut blocked = BitVolume::new([self.side[0], self.side[1], 1]);
        for t in around {
            let d = t.map(|p| plane.signed_distance(p));
            let d = d.map(|d| if d.abs() < rounding { 0.0 } else { d });
            if d == [0.0; 3] {
                fill_triangle(&mut blocked, self.side, t.map(|p| self.place(p)));
            } else if let Some([p, q]) = crossing(t, d) {
                draw_segment(&mut blocked, self.side, self.place(p), self.place(q));
            }
        }
        blocked
    }

    /// Returns the connected sets of open cells that contain a point, in order of the points.
    pub(super) fn patches(&self, blocked: &BitVolume, points: &[DVec3]) -> Vec<OpenPatch> {
        let mut open = blocked.complement();
        let mut patches: Vec<OpenPatch> = Vec::new();
        for &p in points {
            let place = self.place(p);
            let [i, j] = [0, 1].map(|k| (place[k].max(0.0) as usize).min(self.side[k] - 1));
            if open.get(i, j, 0) {
                patches.push(self.take_patch(i, j, &mut open));
            }
            // The last patch most often holds the next point.
            let here = patches.iter_mut().rev().find(|p| p.cells.get(i, j, 0));
            if let Some(patch) = here {
                patch.n_hits += 1;
            }
        }
        patches
    }

    /// Returns a set of cells with all cells up to `reach` from it, along both sides.
    pub(super) fn grown(&self, cells: &BitVolume, reach: usize) -> BitVolume {
        if reach == 0 {
            return cells.clone();
        }
        let [nu, nv] = self.side;
        let near =
            |from: usize, to: usize, n: usize| from.saturating_sub(reach)..(to + reach).min(n);
        let mut out = BitVolume::new(cells.dims());
        let mut wide = vec![0; cells.row(0).len()];
        for j in 0..nv {
            wide.fill(0);
            for_runs(cells.row(j), |from, to| {
                let along = near(from as usize, to as usize, nu);
                set_bits(&mut wide, along.start, along.end);
            });
            for row in near(j, j + 1, nv) {
                out.unite_row(row, &wide);
            }
        }
        out
    }

    /// Takes the open cells connected to `(i, j)`: a scan line fill, with a step for each run of cells.
    fn take_patch(&self, i: usize, j: usize, open: &mut BitVolume) -> OpenPatch {
        let [nu, nv] = self.side;
        let mut cells = BitVolume::new(open.dims());
        let mut meets_border = false;
        let mut stack = vec![(i, j)];
        while let Some((i, j)) = stack.pop() {
            if !open.get(i, j, 0) {
                continue;
            }
            let run = run_around(open.row(j), i);
            meets_border |= j == 0 || j + 1 == nv || run.start == 0 || run.end == nu;
            open.clear_row(j, run.clone());
            cells.fill_row(j, run.clone());
            let beside = [(j > 0, j.wrapping_sub(1)), (j + 1 < nv, j + 1)];
            for (_, row) in beside.into_iter().filter(|b| b.0) {
                let mut at = run.start;
                while let Some(next) = next_set(open.row(row), at).filter(|&i| i < run.end) {
                    stack.push((next, row));
                    at = run_around(open.row(row), next).end;
                }
            }
        }
        OpenPatch {
            cells,
            n_hits: 0,
            meets_border,
        }
    }
}

/// Returns the first set bit of a row from `at` on.
fn next_set(row: &[u64], at: usize) -> Option<usize> {
    let first = row.get(at / 64)? & (!0 << (at % 64));
    let rest = row[at / 64 + 1..].iter().copied();
    let mut words = std::iter::once(first).chain(rest).zip(at / 64..);
    words
        .find(|w| w.0 != 0)
        .map(|(word, w)| w * 64 + word.trailing_zeros() as usize)
}

/// Returns the run of set bits around `at`, which is set.
fn run_around(row: &[u64], at: usize) -> Range<usize> {
    let (mut start, mut end) = (at, at + 1);
    // Bits before `at` in its word, aligned to the top.
    loop {
        let in_word = start % 64;
        if in_word > 0 {
            let ones = (row[start / 64] << (64 - in_word)).leading_ones() as usize;
            start -= ones.min(in_word);
            if ones < in_word {
                break;
            }
        }
        if start == 0 || row[start / 64 - 1] >> 63 == 0 {
            break;
        }
        start -= 1;
    }
    while let Some(word) = row.get(end / 64) {
        let ones = (word >> (end % 64)).trailing_ones() as usize;
        end += ones;
        if ones == 0 || !end.is_multiple_of(64) {
            break;
        }
    }
    start..end
}

/// Returns the segment in which a triangle crosses a plane, or touches it, given the distances `d` of its vertices.
fn crossing(t: &Triangle, d: [f64; 3]) -> Option<[DVec3; 2]> {
    let mut ends = (0..3).filter(|&i| d[i] == 0.0).map(|i| t[i]);
    let mut ends = [ends.next(), ends.next()];
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        if d[i] * d[j] < 0.0 {
            let cut = t[i] + (t[j] - t[i]) * (d[i] / (d[i] - d[j]));
            let slot = usize::from(ends[0].is_some());
            ends[slot] = Some(cut);
        }
    }
    Some([ends[0]?, ends[1]?])
}

/// Marks the lattice cells along a segment, so that no step between edge neighbors crosses it.
fn draw_segment(blocked: &mut BitVolume, side: [usize; 2], p: [f64; 2], q: [f64; 2]) {
    let length = (q[0] - p[0]).abs().max((q[1] - p[1]).abs());
    let n = (length * 2.0).ceil().max(1.0);
    // Only the steps within the picture, and one more at either end against rounding.
    let (mut first, mut last) = (0.0, 1.0_f64);
    for k in 0..2 {
        let (step, most) = (q[k] - p[k], side[k] as f64);
        if step != 0.0 {
            let ends = [-p[k] / step, (most - p[k]) / step];
            first = ends[0].min(ends[1]).max(first);
            last = ends[0].max(ends[1]).min(last);
        } else if p[k] < 0.0 || p[k] >= most {
            return;
        }
    }
    let (first, last) = ((first * n).floor() - 1.0, (last * n).ceil() + 1.0);
    for k in first.max(0.0) as u64..=last.clamp(0.0, n) as u64 {
        let t = k as f64 / n;
        let (x, y) = (p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t);
        if x >= 0.0 && y >= 0.0 && (x as usize) < side[0] && (y as usize) < side[1] {
            blocked.set(x as usize, y as usize, 0, true);
        }
    }
}

/// Marks the lattice cells whose centers lie in a triangle of the plane.
fn fill_triangle(blocked: &mut BitVolume, side: [usize; 2], t: [[f64; 2]; 3]) {
    let edges = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    for (a, b) in edges {
        draw_segment(blocked, side, a, b);
    }
    let ys = t.map(|p| p[1]);
    let lowest = ys[0].min(ys[1]).min(ys[2]).max(0.0) as usize;
    let highest = ys[0].max(ys[1]).max(ys[2]).max(0.0) as usize;
    for y in lowest..highest.min(side[1]) {
        let at = y as f64 + 0.5;
        let (mut lo, mut hi) = (f64::MAX, f64::MIN);
        for (a, b) in edges {
            if (a[1] <= at) != (b[1] <= at) {
                let x = a[0] + (b[0] - a[0]) * ((at - a[1]) / (b[1] - a[1]));
                (lo, hi) = (lo.min(x), hi.max(x));
            }
        }
        // Cells from the first center at or after `lo` to the last at or before `hi`.
        let from = (lo - 0.5).ceil().max(0.0) as usize;
        let to = ((hi - 0.5).floor() + 1.0).max(0.0) as usize;
        if from < to.min(side[0]) {
            blocked.fill_row(y, from..to.min(side[0]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_triangle_with_an_edge_in_the_plane_touches_it_from_either_side() {
        let [a, b] = [DVec3::ZERO, DVec3::new(0.0, 0.0, 2.0)];
        // Not quite in the plane x = 0: within rounding.
        let off = DVec3::X * 1e-6;
        for side in [-1.0, 1.0] {
            for along in [0.0, 2.0] {
                let t = [a + off, b - off, DVec3::new(side, 0.0, along)];
                let plane = Plane::through(DVec3::ZERO, DVec3::X);
                let picture = Picture::around(&plane, &[a, b], 0.5);
                assert!(
                    picture.blocked(&plane, &[t], 1e-5).count() >= 100,
                    "{side} {along}"
                );
            }
        }
        // With a vertex alone, it does not; across the plane, it crosses it.
        let point = [a, DVec3::new(1.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 0.0)];
        assert_eq!(crossing(&point, [0.0, 1.0, 1.0]), None);
        assert_eq!(crossing(&point, [0.0, -1.0, 1.0]).map(|s| s[0]), Some(a));
    }

    proptest! {
        /// Wide enough for several words a row.
        #[test]
        fn patches_are_the_connected_open_cells_and_grow_along_both_sides(
            nu in 1usize..200, nv in 1usize..8, seed in any::<u64>(), rare in 2u64..9,
            starts in prop::collection::vec(any::<[u16; 2]>(), 1..5), reach in 0usize..4,
        ) {
            let mut s = seed | 1;
            let mut next = || {
                s ^= s << 13;
                s ^= s >> 7;
                s ^= s << 17;
                s >> 33
            };
            let plain: Vec<bool> = (0..nu * nv).map(|_| next().is_multiple_of(rare)).collect();
            let blocked = BitVolume::from_fn([nu, nv, 1], |i| plain[i]);
            let picture = Picture {
                origin: DVec3::ZERO,
                u: DVec3::X,
                v: DVec3::Y,
                step: 1.0,
                side: [nu, nv],
            };
            let starts: Vec<[usize; 2]> =
                starts.iter().map(|s| [usize::from(s[0]) % nu, usize::from(s[1]) % nv]).collect();
            let points: Vec<DVec3> =
                starts.iter().map(|s| DVec3::new(s[0] as f64 + 0.5, s[1] as f64 + 0.5, 0.0)).collect();
            let mut expected: Vec<(Vec<usize>, usize, bool)> = Vec::new();
            for [i, j] in starts {
                let start = i + nu * j;
                if plain[start] {
                    continue;
                }
                if let Some(known) = expected.iter_mut().find(|e| e.0.contains(&start)) {
                    known.1 += 1;
                    continue;
                }
                let mut cells = vec![start];
                let mut at = 0;
                while let Some(&c) = cells.get(at) {
                    at += 1;
                    let (i, j) = (c % nu, c / nu);
                    let beside = [
                        (i > 0, c.wrapping_sub(1)),
                        (i + 1 < nu, c + 1),
                        (j > 0, c.wrapping_sub(nu)),
                        (j + 1 < nv, c + nu),
                    ];
                    for (_, next) in beside.into_iter().filter(|b| b.0) {
                        if !plain[next] && !cells.contains(&next) {
                            cells.push(next);
                        }
                    }
                }
                cells.sort_unstable();
                let is_rim = |c: &usize| {
                    let (i, j) = (c % nu, c / nu);
                    i == 0 || j == 0 || i + 1 == nu || j + 1 == nv
                };
                let meets_border = cells.iter().any(is_rim);
                expected.push((cells, 1, meets_border));
            }
            let found: Vec<(Vec<usize>, usize, bool)> = picture
                .patches(&blocked, &points)
                .into_iter()
                .map(|p| (p.cells.iter_set().collect(), p.n_hits, p.meets_border))
                .collect();
            prop_assert_eq!(found, expected);

            let grown = picture.grown(&blocked, reach);
            for c in 0..nu * nv {
                let (i, j) = (c % nu, c / nu);
                let near = |at: usize, n: usize| at.saturating_sub(reach)..(at + reach + 1).min(n);
                let is_near = near(j, nv).any(|j| near(i, nu).any(|i| plain[i + nu * j]));
                prop_assert_eq!(grown.get_index(c), is_near);
            }
        }
    }
}
