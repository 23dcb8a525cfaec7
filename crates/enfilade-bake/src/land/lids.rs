//! The sky limit of each area of land: the plane that ends its cell above.
//!
//! Above the roofs and ridges around it, an area is one space with all others, and whoever is there sees all of them: cells that
//! reach so high hide nothing from each other. So a cell ends below what encloses it, at the height that nine tenths of its
//! border exceed, and no higher over its ground than nine tenths of all borders are: whoever is higher in one street than the
//! roofs of another looks into it from above. It ends over the heads of those who stand in it, wherever that is. The plane is tilted as
//! the ground: streets go uphill, valleys fall.

use super::areas::Areas;
use super::relief::Relief;
use crate::void::STANDING;

/// Share of the enclosing border that may lie lower than the plane.
const LOWER: f64 = 0.1;
/// Distance of planes from what they end below, and of their heights: those of areas around one square are one. [Units: wu]
const STEP: f64 = 0.1;
/// Ground that rises less over a whole area is level. [Units: wu]
const LEVEL: f64 = 0.5;

/// A plane above an area.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lid {
    /// Rise along x and z.
    slope: [f64; 2],
    /// Height at the origin. [Units: wu]
    at: f64,
}

impl Lid {
    /// Returns the height at an x and z. [Units: wu]
    pub(super) fn height(&self, [x, z]: [f64; 2]) -> f64 {
        self.at + self.slope[0] * x + self.slope[1] * z
    }
}

/// Returns the lid of each area, from area 1 on at index 0. Linear in squares.
pub(super) fn lids(relief: &Relief, areas: &Areas, is_low: &[bool]) -> Vec<Lid> {
    let mut grounds: Vec<Vec<usize>> = vec![Vec::new(); areas.n];
    let mut rims: Vec<Vec<usize>> = vec![Vec::new(); areas.n];
    for (i, &area) in areas.of_square.iter().enumerate() {
        let Some(k) = (area as usize).checked_sub(1) else {
            continue;
        };
        if is_low[i] {
            grounds[k].push(i);
        } else if relief.beside(i).any(|j| areas.of_square[j] != area) {
            rims[k].push(i);
        }
    }
    let shape = |(ground, rim): (&Vec<usize>, &Vec<usize>)| {
        let ground = if ground.is_empty() { rim } else { ground };
        Shape::of(relief, ground, rim)
    };
    let shapes: Vec<Shape> = grounds.iter().zip(&rims).map(shape).collect();
    let mut all: Vec<f64> = shapes.iter().flat_map(Shape::rims_over_ground).collect();
    let common = lower(&mut all);
    shapes.into_iter().map(|s| s.lid(common)).collect()
}

/// Ground and border of an area, in heights over the plane of its slope through the origin.
struct Shape {
    slope: [f64; 2],
    /// Mean and highest height of the ground. [Units: wu]
    ground: [f64; 2],
    rim: Vec<f64>,
}

impl Shape {
    fn of(relief: &Relief, ground: &[usize], rim: &[usize]) -> Self {
        let slope = slope_of(relief, ground);
        let over = |&i: &usize| {
            let [x, z] = relief.middle(relief.at(i));
            f64::from(relief.top[i]) - slope[0] * x - slope[1] * z
        };
        let mean = ground.iter().map(over).sum::<f64>() / ground.len().max(1) as f64;
        Self {
            slope,
            ground: [mean, ground.iter().map(over).fold(f64::MIN, f64::max)],
            rim: rim.iter().map(over).collect(),
        }
    }

    fn rims_over_ground(&self) -> impl Iterator<Item = f64> {
        self.rim.iter().map(|height| height - self.ground[0])
    }

    /// Returns the lid below the area's own border, and at most at the `common` height over its ground.
    fn lid(mut self, common: Option<f64>) -> Lid {
        let over_heads = ((self.ground[1] + STANDING) / STEP).ceil() * STEP;
        let own = lower(&mut self.rim).unwrap_or(f64::MIN);
        let most = common.map_or(f64::MIN, |c| c + self.ground[0]);
        let below = (own.min(most) / STEP - 1.0).floor() * STEP;
        Lid {
            slope: self.slope,
            at: over_heads.max(below),
        }
    }
}

/// Returns the height that most of these exceed.
fn lower(heights: &mut [f64]) -> Option<f64> {
    heights.sort_by(f64::total_cmp);
    let at = (heights.len() as f64 * LOWER) as usize;
    heights.get(at).copied()
}

/// Returns the rise along x and z of the plane of least squares through the ground.
fn slope_of(relief: &Relief, ground: &[usize]) -> [f64; 2] {
    let n = ground.len().max(1) as f64;
    let point = |&i: &usize| {
        let [x, z] = relief.middle(relief.at(i));
        [x, f64::from(relief.top[i]), z]
    };
    let (mut mean, mut low, mut high) = ([0.0; 3], [f64::MAX; 3], [f64::MIN; 3]);
    for p in ground.iter().map(point) {
        for k in 0..3 {
            mean[k] += p[k] / n;
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let [mut xx, mut xz, mut zz, mut xy, mut zy] = [0.0; 5];
    for p in ground.iter().map(point) {
        let [x, y, z] = [0, 1, 2].map(|k| p[k] - mean[k]);
        xx += x * x;
        xz += x * z;
        zz += z * z;
        xy += x * y;
        zy += z * y;
    }
    let det = xx * zz - xz * xz;
    if det <= 1e-9 * (xx + zz).powi(2) {
        return [0.0; 2];
    }
    let slope = [(xy * zz - zy * xz) / det, (zy * xx - xy * xz) / det];
    let rise = slope[0].abs() * (high[0] - low[0]) + slope[1].abs() * (high[2] - low[2]);
    if rise < LEVEL { [0.0; 2] } else { slope }
}
