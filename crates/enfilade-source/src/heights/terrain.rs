//! Few triangles for a lattice of heights.
//!
//! Right triangles are halved at the middle of their longest edge wherever the height there, or at the middle of any triangle in
//! it, is off by more than a bound; a middle is shared by two triangles, and both are halved, so there are no cracks (Evans,
//! Kirkpatrick & Townsend, "Right-triangulated irregular networks", 2001). Where samples are missing, and at the edge of the
//! lattice, triangles are halved down to single squares, and those with a missing vertex left out.
//!
//! Cost: linear in the samples of the next larger square of a power of two.

use enfilade_geom::Purse;

/// Triangles over a lattice.
pub(super) struct Land {
    /// Column and row of each vertex.
    pub(super) vertices: Vec<[u32; 2]>,
    /// Counter-clockwise seen from above, with columns to the east and rows to the south.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Triangle by its two ends of the longest edge and the third vertex, in columns and rows.
type Corners = [[usize; 2]; 3];

/// Makes triangles that pass within `off` of each height; `None` if there are more than `most`, or the purse is empty. NaN stands for a missing one.
pub(super) fn triangulate(
    dims: [usize; 2],
    heights: &[f32],
    off: f32,
    most: usize,
    purse: Purse<'_>,
) -> Option<Land> {
    let side = (dims[0].max(dims[1]) - 1).next_power_of_two();
    let mut mesh = RightTriangles {
        dims,
        heights,
        size: side + 1,
        errors: vec![0.0; (side + 1) * (side + 1)],
        number: vec![u32::MAX; dims[0] * dims[1]],
        land: Land {
            vertices: Vec::new(),
            triangles: Vec::new(),
        },
        most,
        purse,
    };
    let halves = [
        [[0, 0], [side, side], [side, 0]],
        [[side, side], [0, 0], [0, side]],
    ];
    mesh.measure();
    let complete = halves.into_iter().all(|corners| mesh.add(corners, off));
    complete.then_some(mesh.land)
}

struct RightTriangles<'a> {
    dims: [usize; 2],
    heights: &'a [f32],
    /// Points along a side of the square.
    size: usize,
    /// For each middle of a longest edge, the greatest error there and at all middles in the triangles that it makes.
    errors: Vec<f32>,
    /// Vertex of each height in use.
    number: Vec<u32>,
    land: Land,
    most: usize,
    purse: Purse<'a>,
}

fn middle([a, b, _]: &Corners) -> [usize; 2] {
    [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]
}

fn is_smallest([a, _, c]: &Corners) -> bool {
    a[0].abs_diff(c[0]) + a[1].abs_diff(c[1]) <= 1
}

fn halves(corners: &Corners) -> [Corners; 2] {
    let (m, [a, b, c]) = (middle(corners), *corners);
    [[c, a, m], [b, c, m]]
}

impl RightTriangles<'_> {
    fn height(&self, [x, z]: [usize; 2]) -> f32 {
        let is_in = x < self.dims[0] && z < self.dims[1];
        if is_in {
            self.heights[x + self.dims[0] * z]
        } else {
            f32::NAN
        }
    }

    /// Returns `true` if all of a triangle lies beside the lattice.
    fn is_beside(&self, corners: &Corners) -> bool {
        (0..2).any(|k| corners.iter().all(|p| p[k] + 1 >= self.dims[k]))
    }

    fn index(&self, [x, z]: [usize; 2]) -> usize {
        x + self.size * z
    }

    /// Enters the errors of all triangles, the smallest first, so that those within a triangle are complete on both sides of
    /// their middles.
    fn measure(&mut self) {
        let side = self.size - 1;
        let n = 2 * side * side - 2;
        let n_parents = n.saturating_sub(side * side); // none in a single square
        for i in (0..n).rev().take_while(self.purse.each(2)) {
            let corners = numbered(i + 2, side);
            let at = self.index(middle(&corners));
            let mut error = self.errors[at].max(self.own_error(&corners));
            if i < n_parents {
                for half in halves(&corners) {
                    error = error.max(self.errors[self.index(middle(&half))]);
                }
            }
            self.errors[at] = error;
        }
    }

    /// Returns the difference in height at a triangle's middle; infinite if it has to be halved because of missing heights.
    fn own_error(&self, corners: &Corners) -> f32 {
        if self.is_beside(corners) {
            return 0.0;
        }
        let [a, b, c] = corners.map(|p| self.height(p));
        let error = (0.5 * (a + b) - self.height(middle(corners))).abs();
        if (error + c).is_nan() {
            f32::INFINITY
        } else {
            error
        }
    }

    /// Adds a triangle, or its halves; returns `false` if there are too many.
    fn add(&mut self, corners: Corners, off: f32) -> bool {
        // One is replaced by two, and a path to the smallest is short.
        let mut stack = vec![corners];
        while let Some(corners) = stack.pop() {
            if !self.purse.spend(1) {
                return false;
            }
            if !is_smallest(&corners) && self.errors[self.index(middle(&corners))] > off {
                stack.extend(halves(&corners));
            } else if corners.iter().all(|&p| !self.height(p).is_nan()) {
                if self.land.triangles.len() >= self.most {
                    return false;
                }
                let [a, b, c] = corners.map(|p| p.map(|v| v as i64));
                let up = (b[1] - a[1]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[1] - a[1]);
                let [a, b, c] = corners.map(|p| self.vertex(p));
                self.land
                    .triangles
                    .push(if up > 0 { [a, b, c] } else { [a, c, b] });
            }
        }
        true
    }

    fn vertex(&mut self, at: [usize; 2]) -> u32 {
        let number = &mut self.number[at[0] + self.dims[0] * at[1]];
        if *number == u32::MAX {
            *number = self.land.vertices.len() as u32;
            self.land.vertices.push(at.map(|v| v as u32));
        }
        *number
    }
}

/// Returns a triangle by its number: those of a level follow those of all larger ones.
fn numbered(mut id: usize, side: usize) -> Corners {
    let [mut a, mut b, mut c] = if id & 1 == 1 {
        [[0, 0], [side, side], [side, 0]]
    } else {
        [[side, side], [0, 0], [0, side]]
    };
    id >>= 1;
    while id > 1 {
        let m = middle(&[a, b, c]);
        [a, b, c] = if id & 1 == 1 { [c, a, m] } else { [b, c, m] };
        id >>= 1;
    }
    [a, b, c]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Height of the surface above a point between samples.
    fn at(land: &Land, heights: &[f32], nx: usize, p: [f64; 2]) -> Option<f64> {
        land.triangles.iter().find_map(|t| {
            let [a, b, c] = t.map(|v| land.vertices[v as usize].map(f64::from));
            let cross = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
                (q[1] - p[1]) * (r[0] - p[0]) - (q[0] - p[0]) * (r[1] - p[1])
            };
            let shares =
                [cross(p, b, c), cross(a, p, c), cross(a, b, p)].map(|s| s / cross(a, b, c));
            let height = |v: u32| {
                let [x, z] = land.vertices[v as usize];
                f64::from(heights[x as usize + nx * z as usize])
            };
            let is_in = shares.iter().all(|s| *s >= -1e-9);
            is_in.then(|| (0..3).map(|k| shares[k] * height(t[k])).sum())
        })
    }

    #[test]
    fn few_triangles_pass_near_all_heights_and_cover_the_land() {
        for dims in [[33, 33], [20, 7], [2, 2], [50, 34]] {
            let n = dims[0] * dims[1];
            let height = |i: usize| {
                let [x, z] = [i % dims[0], i / dims[0]].map(|v| v as f32);
                if x < 10.0 {
                    0.0
                } else {
                    3.0 * (0.3 * x).sin() * (0.2 * z).cos()
                }
            };
            let heights: Vec<f32> = (0..n).map(height).collect();
            let land = triangulate(dims, &heights, 0.1, usize::MAX, Purse::endless()).unwrap();
            for i in 0..n {
                let p = [i % dims[0], i / dims[0]].map(|v| v as f64);
                let found = at(&land, &heights, dims[0], p).unwrap();
                // Halving bounds the error at each middle; that at a sample is a sum over levels.
                assert!(
                    (found - f64::from(heights[i])).abs() < 0.25,
                    "{dims:?} {p:?}"
                );
            }
            let area: i64 = land
                .triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| land.vertices[v as usize].map(i64::from));
                    (b[1] - a[1]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[1] - a[1])
                })
                .sum();
            assert_eq!(area, 2 * ((dims[0] - 1) * (dims[1] - 1)) as i64, "{dims:?}");
        }
        let flat = triangulate(
            [257, 257],
            &vec![1.0; 257 * 257],
            0.1,
            usize::MAX,
            Purse::endless(),
        )
        .unwrap();
        assert_eq!(flat.triangles.len(), 2);
        assert!(
            triangulate([20, 20], &[f32::NAN; 400], 0.1, 10, Purse::endless())
                .is_some_and(|l| l.triangles.is_empty())
        );
        assert!(triangulate([20, 20], &[1.0; 400], 0.1, 1, Purse::endless()).is_none());
    }
}
