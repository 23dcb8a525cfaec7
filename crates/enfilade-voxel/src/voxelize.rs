//! Conservative surface voxelization.
//!
//! A closed triangle touches a closed cube if none of 13 axes separates them: the cube's three face
//! normals, the triangle's normal, and the nine cross products of their edges (Akenine-Möller, "Fast 3D
//! Triangle-Box Overlap Testing", 2001). As Schwarz and Seidel ("Fast Parallel Surface and Solid
//! Voxelization on GPUs", 2010, §3) note, for cubes of one size each test is linear in the cube's
//! position. So we do not test single cubes: for a layer z the axes along x give an interval of rows, and
//! for a row the others give an interval of x, whose bits are set at once.
//!
//! **Errs to marking too much:** every test is loosened by a bound on its rounding ([`SLACK`]), so a
//! touched cube is never missed; a cube is marked wrongly only if the triangle passes within that slack of
//! it.

use enfilade_geom::{Allowance, DVec3, Triangle};
use rayon::prelude::*;

use super::grid::{BitVolume, Grid, set_bits};

/// Rounding allowance, relative to the greatest voxel coordinate that enters a test.
///
/// A test is a few products and sums of coordinates below that magnitude, each rounded by
/// 2⁻⁵³ ≈ 1.1e-16 of it; conversion to voxel coordinates adds as much again. 1e-13 is over a
/// hundred times their sum; at 10,000 voxels it is a billionth of a voxel.
const SLACK: f64 = 1e-13;

/// Layers per task.
const SLAB: usize = 8;

/// Marks every voxel of `grid` whose closed cube a triangle touches.
///
/// Ignores triangles with a vertex that is not finite, and everything outside the grid; degenerate triangles
/// mark the voxels that their segment or point touches. Linear in triangles plus rows of voxels touched.
/// Takes one bit per voxel, and 8 bytes per triangle and slab of 8 layers that it enters.
///
/// # Panics
/// If there are 2³² triangles or more.
#[must_use]
pub fn voxelize(grid: &Grid, triangles: &[Triangle], allowance: &Allowance) -> BitVolume {
    let mut out = BitVolume::new(grid.dims);
    add_voxels(&mut out, grid, triangles, allowance);
    out
}

/// Sets what [`voxelize`] marks in a volume.
///
/// # Panics
/// If the volume is not of the grid's size, or there are 2³² triangles or more.
pub fn add_voxels(out: &mut BitVolume, grid: &Grid, triangles: &[Triangle], allowance: &Allowance) {
    assert_eq!(out.dims(), grid.dims, "boxes of one size");
    let [nx, ny, nz] = grid.dims;
    if out.words().is_empty() || triangles.is_empty() {
        return;
    }
    assert!(
        u32::try_from(triangles.len()).is_ok(),
        "fewer than 2^32 triangles"
    );
    // Triangles by slab of layers, in order.
    let layers = |t: &Triangle| -> Option<(usize, usize)> {
        let s = Setup::bounds(grid, t)?;
        Some((s.0[2] / SLAB, s.1[2] / SLAB))
    };
    let spans: Vec<Option<(usize, usize)>> = triangles.par_iter().map(layers).collect();
    let mut starts = vec![0usize; nz.div_ceil(SLAB) + 1];
    for &(a, b) in spans.iter().flatten() {
        for slab in a..=b {
            starts[slab + 1] += 1;
        }
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut next = starts.clone();
    let mut entries = vec![0u32; starts[starts.len() - 1]];
    for (t, span) in spans.iter().enumerate() {
        if let Some((a, b)) = *span {
            for at in &mut next[a..=b] {
                entries[*at] = t as u32;
                *at += 1;
            }
        }
    }
    drop(spans);
    let row_words = nx.div_ceil(64);
    out.words_mut()
        .par_chunks_mut(row_words * ny * SLAB)
        .enumerate()
        .for_each(|(slab, words)| {
            let first = slab * SLAB;
            let layers = words.len() / (row_words * ny);
            for &t in &entries[starts[slab]..starts[slab + 1]] {
                let mut n_rows = 0;
                if let Some(setup) = Setup::new(grid, &triangles[t as usize]) {
                    setup.mark(first, first + layers - 1, |x0, x1, y, z| {
                        n_rows += 1;
                        let row = (y + ny * (z - first)) * row_words;
                        set_bits(&mut words[row..row + row_words], x0, x1 + 1);
                    });
                }
                if !allowance.spend(2 + n_rows / 2) {
                    return;
                }
            }
        });
}

/// The test `low <= along * t + across · (others) <= high` for the cube's minimum.
#[derive(Clone, Copy, Default)]
struct Band {
    /// Factors of x, y and z.
    normal: [f64; 3],
    low: f64,
    high: f64,
}

/// The tests of one triangle, in voxel coordinates of the cube's minimum.
struct Setup {
    min: [usize; 3],
    max: [usize; 3],
    /// Axes along x: factors of y and z only.
    rows: [Band; 3],
    /// The normal, then the axes along y and z.
    cubes: [Band; 7],
}

impl Setup {
    /// Returns the least and greatest voxel that the triangle's box touches; `None` outside the grid.
    fn bounds(grid: &Grid, t: &Triangle) -> Option<([usize; 3], [usize; 3])> {
        let p = t.map(|p| grid.to_voxel(p));
        if !p.iter().all(|p| p.is_finite()) {
            return None;
        }
        let (low, high) = (p[0].min(p[1]).min(p[2]), p[0].max(p[1]).max(p[2]));
        let slack = magnitude(&p) * SLACK;
        let mut min = [0; 3];
        let mut max = [0; 3];
        for a in 0..3 {
            // Closed cubes: a vertex on a face touches the cubes of both sides.
            let first = (low[a] - slack).ceil() - 1.0;
            let last = (high[a] + slack).floor();
            if last < 0.0 || first >= grid.dims[a] as f64 {
                return None;
            }
            min[a] = first.max(0.0) as usize;
            max[a] = last.min(grid.dims[a] as f64 - 1.0) as usize;
        }
        Some((min, max))
    }

    fn new(grid: &Grid, t: &Triangle) -> Option<Self> {
        let (min, max) = Self::bounds(grid, t)?;
        let p = t.map(|p| grid.to_voxel(p));
        let slack = (magnitude(&p) + grid.dims.iter().copied().max().unwrap_or(0) as f64) * SLACK;
        let edges = [p[1] - p[0], p[2] - p[1], p[0] - p[2]];
        let band = |axis: DVec3| -> Band {
            // Scaled to greatest component 1, so that the slack means the same for every axis.
            let scale = axis.abs().max_element();
            // A null axis separates nothing, nor does one that overflowed: that errs to marking.
            if scale == 0.0 || !axis.is_finite() {
                return Band {
                    normal: [0.0; 3],
                    low: -1.0,
                    high: 1.0,
                };
            }
            let n = axis / scale;
            let d = p.map(|p| n.dot(p));
            let (low, high) = (d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2]));
            // The cube spans `n · corner + negative` to `n · corner + positive`.
            let positive: f64 = n.max(DVec3::ZERO).element_sum();
            let negative: f64 = n.min(DVec3::ZERO).element_sum();
            Band {
                normal: n.to_array(),
                low: low - positive - slack,
                high: high - negative + slack,
            }
        };
        Some(Self {
            min,
            max,
            rows: edges.map(|e| band(DVec3::new(0.0, -e.z, e.y))),
            cubes: [
                band(edges[0].cross(edges[1])),
                band(DVec3::new(edges[0].z, 0.0, -edges[0].x)),
                band(DVec3::new(edges[1].z, 0.0, -edges[1].x)),
                band(DVec3::new(edges[2].z, 0.0, -edges[2].x)),
                band(DVec3::new(-edges[0].y, edges[0].x, 0.0)),
                band(DVec3::new(-edges[1].y, edges[1].x, 0.0)),
                band(DVec3::new(-edges[2].y, edges[2].x, 0.0)),
            ],
        })
    }

    /// Calls `run(x0, x1, y, z)` for the touched voxels `x0..=x1` of each row in layers `from..=to`.
    fn mark(&self, from: usize, to: usize, mut run: impl FnMut(usize, usize, usize, usize)) {
        for z in self.min[2].max(from)..=self.max[2].min(to) {
            let fixed = |b: &Band| b.normal[2] * z as f64;
            let y = narrowed(self.min[1], self.max[1], &self.rows, 1, fixed);
            let Some((y0, y1)) = y else { continue };
            for y in y0..=y1 {
                let fixed = |b: &Band| b.normal[1] * y as f64 + b.normal[2] * z as f64;
                if let Some((x0, x1)) = narrowed(self.min[0], self.max[0], &self.cubes, 0, fixed) {
                    run(x0, x1, y, z);
                }
            }
        }
    }
}

/// Returns the integers of `first..=last` that pass every band along `axis`.
fn narrowed(
    first: usize,
    last: usize,
    bands: &[Band],
    axis: usize,
    fixed: impl Fn(&Band) -> f64,
) -> Option<(usize, usize)> {
    let (mut low, mut high) = (first as f64, last as f64);
    for band in bands {
        let (f, n) = (fixed(band), band.normal[axis]);
        let (a, b) = (band.low - f, band.high - f);
        if n > 0.0 {
            low = low.max(a / n);
            high = high.min(b / n);
        } else if n < 0.0 {
            low = low.max(b / n);
            high = high.min(a / n);
        } else if a > 0.0 || b < 0.0 {
            return None;
        }
    }
    let (low, high) = (low.ceil(), high.floor());
    (low <= high).then_some((low as usize, high as usize))
}

fn magnitude(p: &Triangle) -> f64 {
    p.iter().map(|p| p.abs().max_element()).fold(1.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Returns the part of a polygon on the side `sign * p[axis] <= sign * at`.
    fn cut(polygon: &[DVec3], axis: usize, at: f64, sign: f64) -> Vec<DVec3> {
        let depth = |p: DVec3| sign * (at - p[axis]);
        let mut out = Vec::new();
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let (a, b) = (depth(p), depth(q));
            if a >= 0.0 {
                out.push(p);
            }
            if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
                out.push(p + (q - p) * (a / (a - b)));
            }
        }
        out
    }

    /// Clips the triangle to a cube grown by `margin`.
    fn touches(t: &Triangle, cube: [usize; 3], margin: f64) -> bool {
        let mut polygon = t.to_vec();
        for (axis, &c) in cube.iter().enumerate() {
            polygon = cut(&polygon, axis, c as f64 + 1.0 + margin, 1.0);
            polygon = cut(&polygon, axis, c as f64 - margin, -1.0);
        }
        !polygon.is_empty()
    }

    fn unit_grid(dims: [usize; 3]) -> Grid {
        Grid {
            origin: DVec3::ZERO,
            voxel: 1.0,
            dims,
        }
    }

    /// Voxelizes and compares with clipping: cubes touched after shrinking must be marked, cubes missed after
    /// growing must not.
    fn check(dims: [usize; 3], t: &Triangle) {
        // Clipping rounds, too, by about 1e-15 of coordinates below 100 and a few steps.
        let margin = 1e-9;
        let bits = voxelize(
            &unit_grid(dims),
            std::slice::from_ref(t),
            &Allowance::default(),
        );
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    let marked = bits.get(x, y, z);
                    if touches(t, [x, y, z], -margin) {
                        assert!(marked, "missed ({x}, {y}, {z}) of {t:?}");
                    }
                    if !touches(t, [x, y, z], margin) {
                        assert!(!marked, "wrongly marked ({x}, {y}, {z}) of {t:?}");
                    }
                }
            }
        }
    }

    /// Any point, or one on the lattice, where the degenerate cases are.
    fn corner() -> impl Strategy<Value = DVec3> {
        let any = prop::array::uniform3(-4.0..16.0).prop_map(DVec3::from_array);
        let lattice =
            prop::array::uniform3(-1i32..12).prop_map(|p| DVec3::from_array(p.map(f64::from)));
        let half =
            prop::array::uniform3(0i32..24).prop_map(|p| DVec3::from_array(p.map(f64::from)) * 0.5);
        prop_oneof![any, lattice, half]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1500))]
        #[test]
        fn marked_voxels_equal_those_found_by_clipping(t in prop::array::uniform3(corner())) {
            check([11, 10, 12], &t);
        }
    }

    #[test]
    fn contact_counts_on_faces_edges_and_vertices() {
        // A point at a lattice vertex touches eight cubes, one in a face two.
        let at = |x, y, z| {
            voxelize(
                &unit_grid([4; 3]),
                &[[DVec3::new(x, y, z); 3]],
                &Allowance::default(),
            )
            .count()
        };
        assert_eq!(at(2.0, 2.0, 2.0), 8);
        assert_eq!(at(2.0, 2.0, 1.5), 4);
        assert_eq!(at(2.0, 1.5, 1.5), 2);
        assert_eq!(at(1.5, 1.5, 1.5), 1);
        assert_eq!(at(0.0, 0.0, 0.0), 1);
        assert_eq!(at(-0.1, 1.0, 1.0), 0);
        // A square in a lattice plane marks both sides of it.
        let c = |x: f64, y: f64| DVec3::new(x, y, 2.0);
        let square = [
            [c(0.5, 0.5), c(3.5, 0.5), c(3.5, 3.5)],
            [c(0.5, 0.5), c(3.5, 3.5), c(0.5, 3.5)],
        ];
        assert_eq!(
            voxelize(&unit_grid([4; 3]), &square, &Allowance::default()).count(),
            32
        );
    }

    #[test]
    fn hostile_triangles_neither_panic_nor_mark_without_cause() {
        let grid = unit_grid([9, 9, 9]);
        let p = DVec3::splat(4.5);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for axis in 0..3 {
                let mut q = p;
                q[axis] = bad;
                assert_eq!(
                    voxelize(&grid, &[[p, q, DVec3::ZERO]], &Allowance::default()).count(),
                    0
                );
            }
        }
        // Overflowing products may mark too much, never too little.
        let huge = [p, DVec3::new(1e300, 4.5, 4.5), DVec3::new(1e300, 5.5, 4.5)];
        let bits = voxelize(&grid, &[huge], &Allowance::default());
        assert!((4..9).all(|x| bits.get(x, 4, 4)));
        assert_eq!(
            voxelize(&unit_grid([0, 5, 5]), &[huge], &Allowance::default()).count(),
            0
        );
        assert_eq!(voxelize(&grid, &[], &Allowance::default()).count(), 0);
    }

    #[test]
    fn order_and_threads_change_nothing() {
        let grid = Grid {
            origin: DVec3::splat(-3.0),
            voxel: 0.17,
            dims: [40, 50, 60],
        };
        let mut s = 1u32;
        let mut next = || {
            s = s.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(s >> 8) / f64::from(1 << 24) * 12.0 - 4.0
        };
        let mut soup: Vec<Triangle> = (0..300)
            .map(|_| [(); 3].map(|()| DVec3::new(next(), next(), next())))
            .collect();
        let pool = |n| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(n)
                .build()
                .unwrap()
        };
        let one = pool(1).install(|| voxelize(&grid, &soup, &Allowance::default()));
        soup.reverse();
        assert_eq!(
            one,
            pool(4).install(|| voxelize(&grid, &soup, &Allowance::default()))
        );
        assert!(one.count() > 1000);
    }
}
