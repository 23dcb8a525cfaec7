//! A plane's section with triangles, as a picture: the lattice cells that they block, and the connected open ones.
//!
//! The resolution is fixed, so that a section costs no more than a picture and the triangles near it.

use std::ops::Range;

use enfilade_geom::{DVec3, Plane, Triangle};

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

    /// Returns the cells that triangles lie in or cross.
    pub(super) fn blocked(&self, plane: &Plane, around: &[Triangle]) -> Vec<bool> {
        let mut blocked = vec![false; self.side[0] * self.side[1]];
        for t in around {
            let d = t.map(|p| plane.signed_distance(p));
            if d.iter().all(|d| d.abs() < 1e-3) {
                fill_triangle(&mut blocked, self.side, t.map(|p| self.place(p)));
            } else if let Some([p, q]) = crossing(t, d) {
                draw_segment(&mut blocked, self.side, self.place(p), self.place(q));
            }
        }
        blocked
    }

    /// Returns, for each open cell, the number of its piece from 1 on (0 for none), and the pieces. Only pieces that
    /// contain a point count.
    pub(super) fn pieces(&self, blocked: &[bool], points: &[DVec3]) -> (Vec<u32>, Vec<OpenPatch>) {
        let mut piece_of = vec![0_u32; blocked.len()];
        let mut pieces: Vec<OpenPatch> = Vec::new();
        for &p in points {
            let place = self.place(p);
            let [i, j] = [0, 1].map(|k| (place[k].max(0.0) as usize).min(self.side[k] - 1));
            let at = j * self.side[0] + i;
            if blocked[at] {
                continue;
            }
            if piece_of[at] == 0 {
                let id = pieces.len() as u32 + 1;
                pieces.push(self.fill(at, id, blocked, &mut piece_of));
            }
            pieces[piece_of[at] as usize - 1].n_hits += 1;
        }
        (piece_of, pieces)
    }

    /// Returns a set of cells with all cells up to `reach` from it, along both sides.
    pub(super) fn grown(&self, cells: &[bool], reach: usize) -> Vec<bool> {
        if reach == 0 {
            return cells.to_vec();
        }
        let [nu, nv] = self.side;
        let near = |k: usize, n: usize| k.saturating_sub(reach)..(k + reach + 1).min(n);
        // Along rows, then across them.
        let mut wide = vec![false; cells.len()];
        for (row, wide) in cells.chunks_exact(nu).zip(wide.chunks_exact_mut(nu)) {
            let mut done = 0;
            for (i, _) in row.iter().enumerate().filter(|(_, c)| **c) {
                let Range { start, end } = near(i, nu);
                wide[start.max(done)..end].fill(true);
                done = end;
            }
        }
        let mut out = vec![false; cells.len()];
        for (j, out) in out.chunks_exact_mut(nu).enumerate() {
            for row in near(j, nv) {
                for (out, &wide) in out.iter_mut().zip(&wide[row * nu..]) {
                    *out |= wide;
                }
            }
        }
        out
    }

    /// Marks the open cells connected to `start`.
    fn fill(&self, start: usize, id: u32, blocked: &[bool], piece_of: &mut [u32]) -> OpenPatch {
        let side = self.side;
        let mut meets_border = false;
        piece_of[start] = id;
        let mut stack = vec![start];
        while let Some(k) = stack.pop() {
            let (i, j) = (k % side[0], k / side[0]);
            meets_border |= i == 0 || j == 0 || i + 1 == side[0] || j + 1 == side[1];
            let mut visit = |inside: bool, next: usize| {
                if inside && !blocked[next] && piece_of[next] == 0 {
                    piece_of[next] = id;
                    stack.push(next);
                }
            };
            visit(i > 0, k.wrapping_sub(1));
            visit(i + 1 < side[0], k + 1);
            visit(j > 0, k.wrapping_sub(side[0]));
            visit(j + 1 < side[1], k + side[0]);
        }
        OpenPatch {
            n_hits: 0,
            meets_border,
        }
    }
}

/// Returns the segment in which a triangle crosses a plane, given the distances `d` of its vertices.
fn crossing(t: &Triangle, d: [f64; 3]) -> Option<[DVec3; 2]> {
    if !(d.iter().any(|&d| d <= 0.0) && d.iter().any(|&d| d >= 0.0)) {
        return None;
    }
    let mut ends: [Option<DVec3>; 2] = [None, None];
    for i in 0..3 {
        let j = (i + 1) % 3;
        if (d[i] < 0.0) != (d[j] < 0.0) {
            let cut = t[i] + (t[j] - t[i]) * (d[i] / (d[i] - d[j]));
            let slot = usize::from(ends[0].is_some());
            ends[slot] = Some(cut);
        }
    }
    match ends {
        [Some(p), Some(q)] => Some([p, q]),
        _ => None,
    }
}

/// Marks the lattice cells along a segment, so that no step between edge neighbors crosses it.
fn draw_segment(blocked: &mut [bool], side: [usize; 2], p: [f64; 2], q: [f64; 2]) {
    let length = (q[0] - p[0]).abs().max((q[1] - p[1]).abs());
    let n = ((length * 2.0).ceil() as usize).clamp(1, 4 * MAX_SIDE * 8);
    for k in 0..=n {
        let t = k as f64 / n as f64;
        let (x, y) = (p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t);
        if x >= 0.0 && y >= 0.0 && (x as usize) < side[0] && (y as usize) < side[1] {
            blocked[y as usize * side[0] + x as usize] = true;
        }
    }
}

/// Marks the lattice cells whose centers lie in a triangle of the plane.
fn fill_triangle(blocked: &mut [bool], side: [usize; 2], t: [[f64; 2]; 3]) {
    for i in 0..3 {
        draw_segment(blocked, side, t[i], t[(i + 1) % 3]);
    }
    let cross = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let range = |k: usize| {
        let lo = t.iter().map(|p| p[k]).fold(f64::MAX, f64::min).max(0.0);
        let hi = t
            .iter()
            .map(|p| p[k])
            .fold(f64::MIN, f64::max)
            .min(side[k] as f64);
        (lo as usize, hi.max(0.0) as usize)
    };
    let ((x0, x1), (y0, y1)) = (range(0), range(1));
    for y in y0..y1.min(side[1]) {
        for x in x0..x1.min(side[0]) {
            let c = [x as f64 + 0.5, y as f64 + 0.5];
            let s = [
                cross(t[0], t[1], c),
                cross(t[1], t[2], c),
                cross(t[2], t[0], c),
            ];
            if s.iter().all(|&s| s >= 0.0) || s.iter().all(|&s| s <= 0.0) {
                blocked[y * side[0] + x] = true;
            }
        }
    }
}
