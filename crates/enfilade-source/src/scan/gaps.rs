//! Gaps in the view of a station: glass, black and wet surfaces, the ground below the scanner.
//!
//! The rim of a gap tells how far the surface around it is, and planes through the rim close it: a window through which nothing
//! was seen ends the room. The inverse of the distance of a plane is the product of its normal with the direction, which on the
//! unit sphere solves Δf = -2f; so that is what is solved in the gap, with the rim as given.

use enfilade_geom::DVec3;

use super::Scan;

/// Points in a pixel of a view: fewer, and what lies between two points would be a gap.
const POINTS_OF_PIXEL: usize = 4;
/// Most pixels of a view along the horizon; at 6 m, one is half a voxel of 5 cm wide.
const MOST_PIXELS: usize = 1440;
/// Largest gap that its rim may close: a cone of half a right angle around its middle. Larger ones are the sky. [Units: steradian]
const LARGEST: f64 = 1.84;
/// Sweeps in which the values of a gap settle.
const SWEEPS: usize = 200;

/// The surroundings of a station: rows from pole to pole, each all around.
struct Panorama {
    size: [usize; 2],
    /// Inverse of the least distance in each pixel; 0 where nothing was seen.
    inverse: Vec<f32>,
}

impl Panorama {
    fn new(n_points: usize) -> Self {
        let n = n_points / POINTS_OF_PIXEL;
        let width = ((2 * n) as f64).sqrt() as usize;
        let height = (width / 2).clamp(1, MOST_PIXELS / 2);
        Self {
            size: [2 * height, height],
            inverse: vec![0.0; 2 * height * height],
        }
    }

    /// Returns the angle from the first pole of the middle of a row.
    fn polar(&self, row: usize) -> f64 {
        std::f64::consts::PI * (row as f64 + 0.5) / self.size[1] as f64
    }

    fn pixel(&self, direction: DVec3) -> usize {
        let [w, h] = self.size;
        let d = direction.normalize_or_zero();
        let turn = d.z.atan2(d.x) / std::f64::consts::TAU;
        let column = ((turn.rem_euclid(1.0) * w as f64) as usize).min(w - 1);
        let row = (d.y.clamp(-1.0, 1.0).acos() / std::f64::consts::PI * h as f64) as usize;
        column + w * row.min(h - 1)
    }

    fn direction(&self, pixel: usize) -> DVec3 {
        let [w, _] = self.size;
        let turn = std::f64::consts::TAU * ((pixel % w) as f64 + 0.5) / w as f64;
        let (sin, cos) = self.polar(pixel / w).sin_cos();
        DVec3::new(sin * turn.cos(), cos, sin * turn.sin())
    }

    /// Returns the pixels to both sides, and those above and below; across a pole, that on its other side.
    fn neighbors(&self, pixel: usize) -> [usize; 4] {
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

    /// Returns the pixels of all gaps that their rims may close.
    fn gaps(&self) -> Vec<usize> {
        let [w, h] = self.size;
        let area = |p: usize| {
            let rows = std::f64::consts::PI / h as f64;
            self.polar(p / w).sin() * rows * std::f64::consts::TAU / w as f64
        };
        let mut is_known: Vec<bool> = self.inverse.iter().map(|f| *f > 0.0).collect();
        let mut all = Vec::new();
        for start in 0..is_known.len() {
            if is_known[start] {
                continue;
            }
            is_known[start] = true;
            let mut gap = vec![start];
            let (mut next, mut sum) = (0, 0.0);
            while let Some(&p) = gap.get(next) {
                next += 1;
                sum += area(p);
                for q in self.neighbors(p) {
                    if !is_known[q] {
                        is_known[q] = true;
                        gap.push(q);
                    }
                }
            }
            if sum <= LARGEST {
                all.extend(gap);
            }
        }
        all.sort_unstable();
        all
    }

    /// Gives values to gaps.
    fn close(&mut self, gaps: &[usize]) {
        let [w, h] = self.size;
        // The first guess grows from the rim.
        let mut left: Vec<usize> = gaps.to_vec();
        while !left.is_empty() {
            let mean = |p: &usize| {
                let seen = self.neighbors(*p).map(|q| self.inverse[q]);
                let n = seen.iter().filter(|f| **f > 0.0).count();
                (n > 0).then(|| seen.iter().sum::<f32>() / n as f32)
            };
            let grown: Vec<Option<f32>> = left.iter().map(mean).collect();
            if grown.iter().all(Option::is_none) {
                return;
            }
            for (&p, f) in left.iter().zip(&grown) {
                self.inverse[p] = f.unwrap_or(0.0);
            }
            left = (left.iter().zip(&grown))
                .filter(|(_, f)| f.is_none())
                .map(|(p, _)| *p)
                .collect();
        }
        let step = std::f64::consts::PI / h as f64;
        for sweep in 0..SWEEPS {
            // To and fro, so that values spread both ways.
            for k in 0..gaps.len() {
                let p = gaps[if sweep % 2 == 0 {
                    k
                } else {
                    gaps.len() - 1 - k
                }];
                let sin = self.polar(p / w).sin();
                let cos_by_sin = self.polar(p / w).cos() / sin;
                let around = 1.0 / (sin * sin);
                let [above, below] = [1.0 - 0.5 * step * cos_by_sin, 1.0 + 0.5 * step * cos_by_sin];
                let weights = [around, around, above.max(0.0), below.max(0.0)];
                let total: f64 = weights.iter().sum::<f64>() - 2.0 * step * step;
                let sum: f64 = (self.neighbors(p).into_iter().zip(weights))
                    .map(|(q, w)| f64::from(self.inverse[q]) * w)
                    .sum();
                self.inverse[p] = (sum / total) as f32;
            }
        }
    }
}

/// Returns where ways from stations through the gaps of their views end, and the station of each.
pub(super) fn ends(scan: &Scan) -> Vec<(u16, DVec3)> {
    let mut n_points = vec![0_usize; scan.stations.len()];
    scan.station_of
        .iter()
        .for_each(|s| n_points[usize::from(*s)] += 1);
    let mut views: Vec<Panorama> = n_points.into_iter().map(Panorama::new).collect();
    for (p, s) in scan.points.iter().zip(&scan.station_of) {
        let way = *p - scan.stations[usize::from(*s)];
        let view = &mut views[usize::from(*s)];
        let pixel = view.pixel(way);
        let inverse = (1.0 / way.length()) as f32;
        if inverse.is_finite() {
            view.inverse[pixel] = view.inverse[pixel].max(inverse);
        }
    }
    let mut all = Vec::new();
    for (s, mut view) in views.into_iter().enumerate() {
        let gaps = view.gaps();
        view.close(&gaps);
        for p in gaps.into_iter().filter(|p| view.inverse[*p] > 0.0) {
            let end = scan.stations[s] + view.direction(p) / f64::from(view.inverse[p]);
            all.push((s as u16, end));
        }
    }
    all
}
