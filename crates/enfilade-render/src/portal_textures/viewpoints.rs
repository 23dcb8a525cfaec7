//! The viewpoints of textures for an eye before a doorway.

use enfilade_cpg::{CellId, PortalId};
use glam::DVec2;

use super::doorway::{Doorway, DoorwayPlace};
use crate::portal_texture_options::Viewpoints;

/// Index of a viewpoint of one doorway.
///
/// The last two are the fineness and the anchor of the lattice.
pub(crate) type ViewpointIndex = [i32; 5];

/// A portal with the cell behind it.
pub(crate) type DoorwayId = (PortalId, CellId);

/// A texture's doorway and viewpoint; `None` for the one of a transition.
pub(crate) type TextureKey = (DoorwayId, Option<ViewpointIndex>);

/// Viewpoints from which a view is composed, with weights that sum to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Composed {
    pub(crate) of: [(ViewpointIndex, f64); 4],
    pub(crate) n: usize,
}

impl Composed {
    fn one(index: ViewpointIndex) -> Self {
        let mut of = [([0; 5], 0.0); 4];
        of[0] = (index, 1.0);
        Self { of, n: 1 }
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = (ViewpointIndex, f64)> + '_ {
        let heavy = |(_, weight): &(ViewpointIndex, f64)| *weight > LIGHTEST;
        self.of[..self.n].iter().copied().filter(heavy)
    }
}

/// Least weight that shows: the step of 8 bits is twice as large.
const LIGHTEST: f64 = 2e-3;

/// Ratio of the distances of neighbors along the normal, in units of their spacing beside each other: textures depend less
/// on the distance than on the direction.
const LONGER: f64 = 2.0;

impl Viewpoints {
    /// Returns the viewpoints for an eye at a place; `None` if it is not before the doorway, or out of the angles that have any.
    ///
    /// `anchor` is the height of a walking eye, along the second axis of the plane: viewpoints lie there, so that three instead of four
    /// do, and no view is composed from above and below. [Units: mm]
    pub(crate) fn of(&self, doorway: &Doorway, eye: DoorwayPlace, anchor: i32) -> Option<Composed> {
        if eye.height <= 1e-3 {
            return None;
        }
        let beside = eye.at - doorway.middle();
        match self {
            Self::Warped { spacing } => {
                let level = level(doorway, eye.height, *spacing);
                let spacing = spacing * f64::from(-level).exp2();
                let beside = DVec2::new(beside.x, eye.at.y - f64::from(anchor) * 1e-3);
                let flat = beside / (eye.height * spacing);
                let along = eye.height.ln() / (spacing * LONGER);
                Some(simplex([flat.x, flat.y, along], [level, anchor]))
            }
            Self::Semicircle { step, spans, .. } => {
                let angle = eye.height.atan2(beside.x).to_degrees();
                let nearest = |[from, to]: &[f64; 2]| {
                    let n = ((to - from) / step).floor();
                    let i = ((angle - from) / step).round().clamp(0.0, n);
                    (from + i * step, i as i32)
                };
                let each = spans.iter().enumerate().map(|(k, span)| (k, nearest(span)));
                let best = each.min_by(|a, b| {
                    let off = |x: &(usize, (f64, i32))| (x.1.0 - angle).abs();
                    off(a).total_cmp(&off(b))
                })?;
                let (k, (at, i)) = best;
                ((at - angle).abs() <= 0.5 * step + 1e-9)
                    .then(|| Composed::one([i, k as i32, 0, 0, 0]))
            }
            Self::Grid { spacing } => {
                let at = [beside.x, beside.y, eye.height].map(|x| (x / spacing).round() as i32);
                Some(Composed::one([at[0], at[1], at[2].max(1), 0, 0]))
            }
            Self::Single { .. } => Some(Composed::one([0; 5])),
        }
    }

    /// Returns the place of a viewpoint.
    pub(crate) fn place(&self, doorway: &Doorway, index: ViewpointIndex) -> DoorwayPlace {
        let middle = doorway.middle();
        let [x, y, z, level, anchor] = index.map(f64::from);
        match self {
            Self::Warped { spacing } => {
                let spacing = spacing * (-level).exp2();
                let height = (z * spacing * LONGER).exp();
                DoorwayPlace {
                    at: DVec2::new(middle.x, anchor * 1e-3) + DVec2::new(x, y) * (height * spacing),
                    height,
                }
            }
            Self::Semicircle {
                radius,
                height,
                step,
                spans,
            } => {
                let from = spans.get(index[1] as usize).map_or(90.0, |s| s[0]);
                let angle = (from + x * step).to_radians();
                DoorwayPlace {
                    at: DVec2::new(middle.x + radius * angle.cos(), doorway.low.y + height),
                    height: (radius * angle.sin()).max(1e-2),
                }
            }
            Self::Grid { spacing } => DoorwayPlace {
                at: middle + DVec2::new(x, y) * *spacing,
                height: z * spacing,
            },
            Self::Single { radius, height } => DoorwayPlace {
                at: DVec2::new(middle.x, doorway.low.y + height),
                height: *radius,
            },
        }
    }
}

/// Returns how often the spacing is halved, so that neighbors are not farther from each other than the doorway is wide: an
/// eye between two would see past its edges what neither saw.
fn level(doorway: &Doorway, height: f64, spacing: f64) -> i32 {
    let narrow = (doorway.high - doorway.low).min_element();
    let level = (height * spacing / narrow).log2().ceil();
    // Finer ones would differ by less than a pixel.
    level.clamp(0.0, 4.0) as i32
}

/// Returns the vertices of the tetrahedron around a point of the lattice of integers that is divided after Kuhn ("Some
/// combinatorial lemmas in topology", 1960), with the point's barycentric coordinates, which are continuous everywhere.
fn simplex(p: [f64; 3], [level, anchor]: [i32; 2]) -> Composed {
    let low = p.map(f64::floor);
    let share = [0, 1, 2].map(|k| p[k] - low[k]);
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| share[*b].total_cmp(&share[*a]));
    let [x, y, z] = low.map(|x| x as i32);
    let mut at = [x, y, z, level, anchor];
    let mut of = [(at, 1.0 - share[order[0]]), (at, 0.0), (at, 0.0), (at, 0.0)];
    for (i, &axis) in order.iter().enumerate() {
        at[axis] += 1;
        let next = order.get(i + 1).map_or(0.0, |next| share[*next]);
        of[i + 1] = (at, share[axis] - next);
    }
    Composed { of, n: 4 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_reproduce_the_point_and_are_continuous() {
        let mut last: Option<Composed> = None;
        for i in 0..2_000 {
            let t = f64::from(i) * 1e-3;
            let p = [0.3 + t, -1.7 + 0.61 * t, 2.2 - 0.37 * t];
            let own = simplex(p, [0, 0]);
            let sum: f64 = own.of.iter().map(|(_, w)| w).sum();
            assert!((sum - 1.0).abs() < 1e-12);
            for k in 0..3 {
                let mean: f64 = own.of.iter().map(|(at, w)| f64::from(at[k]) * w).sum();
                assert!((mean - p[k]).abs() < 1e-12);
            }
            if let Some(last) = last {
                let weight = |of: &Composed, at| -> f64 {
                    let same = of.of.iter().filter(|(a, _)| *a == at);
                    same.map(|(_, w)| w).sum()
                };
                for (at, _) in own.of.iter().copied().chain(last.of) {
                    let change = (weight(&own, at) - weight(&last, at)).abs();
                    assert!(change < 4e-3, "{change} at {t}");
                }
            }
            last = Some(own);
        }
    }
}
