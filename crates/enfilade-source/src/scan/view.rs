//! The view of a station: the distance of what it saw in each direction.

use enfilade_geom::DVec3;

/// Points in a pixel of a view: fewer, and what lies between two points would be a gap.
const POINTS_OF_PIXEL: usize = 4;
/// Points of a pixel are of one surface if the ratio of their distances is above this.
const SURFACE: f32 = 0.8;
/// Most pixels of a view from pole to pole; at 6 m, one is half a voxel of 5 cm wide.
const MOST_ROWS: usize = 720;

/// The surroundings of a station: rows from pole to pole, each all around.
pub(super) struct Panorama {
    pub(super) size: [usize; 2],
    /// Inverse of the least distance in each pixel; 0 where nothing was seen.
    pub(super) inverse: Vec<f32>,
}

impl Panorama {
    /// Takes the view of points, given the ways to them.
    ///
    /// The inverse of the distance of a plane is linear across a pixel, so its mean is that of the middle. Where one surface is behind
    /// another, the nearer one counts.
    pub(super) fn of(ways: &[DVec3]) -> Self {
        let n = ways.len() / POINTS_OF_PIXEL;
        let width = ((2 * n) as f64).sqrt() as usize;
        let height = (width / 2).clamp(1, MOST_ROWS);
        let mut view = Self {
            size: [2 * height, height],
            inverse: vec![0.0; 2 * height * height],
        };
        let seen = |view: &Self, way: &DVec3| {
            let inverse = (1.0 / way.length()) as f32;
            (
                view.pixel(*way),
                if inverse.is_finite() { inverse } else { 0.0 },
            )
        };
        for way in ways {
            let (pixel, inverse) = seen(&view, way);
            view.inverse[pixel] = view.inverse[pixel].max(inverse);
        }
        let mut sums = vec![(0.0_f32, 0.0_f32); view.inverse.len()];
        for way in ways {
            let (pixel, inverse) = seen(&view, way);
            if inverse >= SURFACE * view.inverse[pixel] {
                sums[pixel].0 += inverse;
                sums[pixel].1 += 1.0;
            }
        }
        for (inverse, (sum, n)) in view.inverse.iter_mut().zip(sums) {
            *inverse = if n > 0.0 { sum / n } else { 0.0 };
        }
        view
    }

    /// Returns the angle from the first pole of the middle of a row.
    pub(super) fn polar(&self, row: usize) -> f64 {
        std::f64::consts::PI * (row as f64 + 0.5) / self.size[1] as f64
    }

    /// Returns column and row of a direction; pixel 0 is from 0 to 1.
    fn place(&self, direction: DVec3) -> [f64; 2] {
        let [w, h] = self.size.map(|n| n as f64);
        let d = direction.normalize_or_zero();
        let turn = d.z.atan2(d.x) / std::f64::consts::TAU;
        let polar = d.y.clamp(-1.0, 1.0).acos() / std::f64::consts::PI;
        [turn.rem_euclid(1.0) * w, polar * h]
    }

    fn pixel(&self, direction: DVec3) -> usize {
        let [w, h] = self.size;
        let [column, row] = self.place(direction).map(|c| c as usize);
        column.min(w - 1) + w * row.min(h - 1)
    }

    /// Returns the pixels to both sides, and those above and below; across a pole, that on its other side.
    pub(super) fn neighbors(&self, pixel: usize) -> [usize; 4] {
        let [w, h] = self.size;
        let (column, row) = (pixel % w, pixel / w);
        let across = (column + w / 2) % w;
        let above = if row == 0 { across } else { pixel - w };
        let below = if row + 1 == h {
            across + w * row
        } else {
            pixel + w
        };
        [
            (column + w - 1) % w + w * row,
            (column + 1) % w + w * row,
            above,
            below,
        ]
    }

    /// Returns the distance in a direction; `None` where nothing is known.
    ///
    /// Between the middles of pixels that see one surface, inverses are blended; elsewhere the pixel's own counts.
    pub(super) fn depth(&self, direction: DVec3) -> Option<f64> {
        let [w, h] = self.size;
        let [column, row] = self.place(direction);
        let own = (column as usize).min(w - 1) + w * (row as usize).min(h - 1);
        let own = self.inverse[own];
        let (column, row) = (
            column + w as f64 - 0.5,
            (row - 0.5).clamp(0.0, h as f64 - 1.0),
        );
        let (i, j) = (column as usize, row as usize);
        let at = |i: usize, j: usize| self.inverse[i % w + w * j.min(h - 1)];
        let corners = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
        let is_one = |c: &f32| *c >= SURFACE * own && *c * SURFACE <= own;
        let inverse = if corners.iter().all(is_one) {
            let (u, v) = (column.fract() as f32, row.fract() as f32);
            let along = |a: f32, b: f32, by: f32| a + (b - a) * by;
            along(
                along(corners[0], corners[1], u),
                along(corners[2], corners[3], u),
                v,
            )
        } else {
            own
        };
        (own > 0.0).then(|| 1.0 / f64::from(inverse))
    }

    /// Returns the greatest distance in any direction; 0 if nothing was seen.
    pub(super) fn reach(&self) -> f64 {
        let seen = self.inverse.iter().filter(|f| **f > 0.0);
        seen.fold(0.0, |most, f| most.max(1.0 / f64::from(*f)))
    }
}
