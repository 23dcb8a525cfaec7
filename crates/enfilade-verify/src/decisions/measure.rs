//! Facts behind decisions, measured with code of its own.

use enfilade_cpg::CellId;
use enfilade_geom::{Aabb, Bvh, DVec3, Ray};

use crate::rng::Rng;
use crate::subject::Subject;

/// Height in which somebody stands. [Units: wu]
const STANDING: f64 = 2.0;
/// Side of a square on which somebody stands. [Units: wu]
const STANCE: f64 = 0.5;
/// A builder measures with this many columns along a side at most, two of which are a stance.
const MOST_COLUMNS: f64 = 128.0;
/// Error of a height: cells end within this of a surface. [Units: wu]
const SLACK: f64 = 0.05;
/// Vertical rays along the longer side of a cell.
const COLUMNS: f64 = 48.0;
/// Least distance between two vertical rays. [Units: wu]
const LEAST_STEP: f64 = 0.02;
/// Points of a cell from which rays are shot.
const POINTS: usize = 64;
/// Least number of rays that meet anything.
const LEAST_RAYS: f64 = 200.0;

/// The floor of a cell, and the least and greatest part of it on which somebody can stand.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Floor {
    /// [Units: wu²]
    pub(super) area: f64,
    /// Area of whole squares of somebody who stands. [Units: wu²]
    pub(super) least: f64,
    /// Area with the height for it, however narrow. [Units: wu²]
    pub(super) most: f64,
    /// Area along its sides that columns may miss or count twice. [Units: wu²]
    pub(super) rim: f64,
    /// Vertical rays that passed the cell.
    pub(super) n_columns: usize,
}

impl Floor {
    pub(super) fn and(self, other: &Self) -> Self {
        Self {
            area: self.area + other.area,
            least: self.least + other.least,
            most: self.most + other.most,
            rim: self.rim + other.rim,
            n_columns: self.n_columns + other.n_columns,
        }
    }
}

/// Measures the floor of a cell by vertical rays on the world's triangles, a grid of them.
pub(super) fn floor_of(subject: &Subject, cell: CellId) -> Floor {
    let bounds = &subject.cells[cell.idx()].bounds;
    let size = bounds.size();
    let longer = size.x.max(size.z);
    let step = (longer / COLUMNS).max(LEAST_STEP);
    let [nx, nz] = [size.x, size.z].map(|side| (side / step).ceil().max(1.0) as usize);
    let heights: Vec<f64> = (0..nx * nz)
        .map(|k| {
            // Off the middle, so that a ray runs along no edge of a grid of rooms.
            let [x, z] = [k % nx, k / nx].map(|i| (i as f64 + 0.507) * step);
            headroom(subject, cell, bounds, bounds.min + DVec3::new(x, 0.0, z))
        })
        .collect();
    let spacing = (STANCE / 2.0).max(longer / MOST_COLUMNS);
    let stance = 2.0 * spacing + step;
    let across = (stance / step).ceil().max(1.0) as usize + 1;
    let is_high = |x: usize, z: usize| heights[x + z * nx] >= STANDING + SLACK;
    let mut stands = vec![false; nx * nz];
    for z in 0..(nz + 1).saturating_sub(across) {
        for x in 0..(nx + 1).saturating_sub(across) {
            let square = || (z..z + across).flat_map(|z| (x..x + across).map(move |x| (x, z)));
            if square().all(|(x, z)| is_high(x, z)) {
                square().for_each(|(x, z)| stands[x + z * nx] = true);
            }
        }
    }
    let n_columns = heights.iter().filter(|h| **h > 0.0).count();
    let area = |n: usize| n as f64 * step * step;
    Floor {
        area: area(n_columns),
        least: area(stands.iter().filter(|s| **s).count()),
        most: area(heights.iter().filter(|h| **h >= STANDING - SLACK).count()),
        rim: (spacing + step) * (size.x + size.z),
        n_columns,
    }
}

/// Returns the longest part, between triangles and portals, of a vertical line that lies in a cell. [Units: wu]
fn headroom(subject: &Subject, cell: CellId, bounds: &Aabb, p: DVec3) -> f64 {
    let [low, high] = [bounds.min.y - SLACK, bounds.max.y + SLACK].map(|y| p.with_y(y));
    let ray = Ray::segment(low, high);
    let mut cuts = vec![0.0, 1.0];
    subject.blockers.for_each_hit(&ray, |hit| cuts.push(hit.t));
    let mut crossed = Vec::new();
    subject.crossings(low, high, &mut crossed);
    cuts.extend(crossed.iter().map(|c| c.t));
    cuts.sort_by(f64::total_cmp);
    let is_in = |t: f64| subject.locator.locate(low.lerp(high, t)) == Some(cell);
    let (mut longest, mut run) = (0.0_f64, 0.0);
    for pair in cuts.windows(2) {
        let length = (pair[1] - pair[0]) * (high.y - low.y);
        if length < subject.eps {
            continue;
        }
        // A table within a cell divides no height.
        run = if is_in(0.5 * (pair[0] + pair[1])) {
            run + length
        } else {
            0.0
        };
        longest = longest.max(run);
    }
    longest
}

/// Returns the share of the rays from a cell that meet the back of a triangle first; `None` if few meet anything.
pub(super) fn backs_of(subject: &Subject, own: &Bvh, cell: CellId, seed: u64) -> Option<f64> {
    let mut rng = Rng::new(seed, u64::from(cell.0) | 1 << 59);
    subject.sampled.binary_search(&cell).ok()?;
    let (mut all, mut back) = (0.0, 0.0);
    for _ in 0..POINTS {
        let origin = subject.point_in_cell(&mut rng, cell);
        for _ in 0..14 {
            let ray = Ray {
                origin,
                direction: rng.direction(),
                t_max: f64::INFINITY,
            };
            if let Some(hit) = own.closest_hit(&ray, |_| false) {
                all += 1.0;
                back += f64::from(u8::from(!hit.front));
            }
        }
    }
    (all >= LEAST_RAYS).then(|| back / all)
}
