//! Gaps in the view of a station: glass, black and wet surfaces, the ground below the scanner.
//!
//! The rim of a gap tells how far the surface around it is, and planes through the rim close it: a window through which nothing
//! was seen ends the room. The inverse of the distance of a plane is the product of its normal with the direction, which on the
//! unit sphere solves Δf = -2f; so that is what is solved in the gap, with the rim as given.

use enfilade_geom::Purse;

use super::view::Panorama;

/// Largest gap that its rim may close: a cone of half a right angle around its middle. Larger ones are the sky. [Units: steradian]
const LARGEST: f64 = 1.84;
/// Sweeps in which the values of a gap settle.
const SWEEPS: usize = 200;

impl Panorama {
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

    /// Gives distances to all gaps that their rims may close.
    pub(super) fn close_gaps(&mut self, purse: Purse<'_>) {
        let gaps = self.gaps();
        self.close(&gaps, purse);
    }

    /// Gives values to gaps, until the purse is empty.
    fn close(&mut self, gaps: &[usize], purse: Purse<'_>) {
        let [w, h] = self.size;
        // The first guess grows from the rim.
        let mut left: Vec<usize> = gaps.to_vec();
        while !left.is_empty() && purse.spend(left.len() as u64) {
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
            if !purse.spend(gaps.len() as u64) {
                return;
            }
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
