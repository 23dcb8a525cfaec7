//! Furniture among objects that no rule decides, even where it touches walls and other things.
//!
//! Furniture stands on a floor or hangs on a wall, one sees over it, and the bounds of the room continue around
//! and above it. A parapet does all that, too; so objects with air before and behind them that end in other
//! things, as walls do, stay.

use super::units::Unit;
use super::{GOES_ON, INTO, NEAR, SMALL, n_goes_on};
use enfilade_geom::{Aabb, DVec3};

/// Longest furniture; a longer object is not a worktop or a sofa but a parapet or a stage. [Units: wu]
pub(super) const LONG: f64 = 5.0;
/// The same as a share of the scene's diagonal: a bed may be as long as its room is wide.
const ROOM_SHARE: f64 = 0.5;
/// An object with two thinner edges is a skirting, a sill or a mullion. [Units: wu]
pub(super) const BAR: f64 = 0.2;
/// Height of the air above it: an object that reaches the ceiling may carry it. [Units: wu]
const HEAD: f64 = 0.3;
/// A side is free or backed if this share of it is.
const MOST_OF: f64 = 0.7;
/// Hanging furniture has its back, not its rim, at the wall: no side is more than twice as large.
const BACK: f64 = 0.5;
/// Rays along each edge of a side.
const GRID: usize = 5;
/// Directions, of eight, in which walls must rise higher than it.
const AROUND: usize = 5;

/// Returns `true` if other objects lie between two points.
type Meets<'m> = dyn Fn(DVec3, DVec3) -> bool + 'm;

/// Returns the reason why an object, taken as one thing, is furniture; `None` if it is not.
pub(super) fn reason(
    whole: &Unit,
    bounds: &Aabb,
    diagonal: f64,
    meets: &Meets<'_>,
    touches: &dyn Fn(&Aabb) -> bool,
) -> Option<String> {
    // The box is upright.
    let [a, b, up] = [0, 1, 2];
    let half = whole.half;
    let n_thin = half.to_array().iter().filter(|&&h| 2.0 * h < BAR).count();
    let is_bar = n_thin > 1;
    // An object this flat on the floor bounds nothing that the floor does not.
    if is_bar
        || 2.0 * half[up] < NEAR
        || 2.0 * half[up] > SMALL
        || 2.0 * half[a].max(half[b]) > LONG.min(ROOM_SHARE * diagonal)
    {
        return None;
    }
    let box_ = Whole { whole, meets };
    if box_.met(up, 1.0, HEAD) > 1.0 - MOST_OF {
        return None;
    }
    let touched = |k: usize, sign: f64| box_.met(k, sign, NEAR);
    // The floor below it continues beyond it; the next piece of a wall does not. The wall behind it does so on
    // all sides; the next piece of a floor does not.
    let n_on = |k: usize, sign: f64| {
        let out = whole.axes[k] * sign;
        let axis = out.abs().max_position();
        n_goes_on(bounds, axis, out[axis] > 0.0, touches)
    };
    let area = |k: usize| half[(k + 1) % 3] * half[(k + 2) % 3];
    let largest = area(a).max(area(b)).max(area(up));
    let hangs = || {
        [a, b].iter().any(|&k| {
            area(k) >= BACK * largest
                && [-1.0, 1.0]
                    .iter()
                    .any(|&s| touched(k, s) >= MOST_OF && n_on(k, s) == 4)
        })
    };
    // Legs and feet may stand partly over an edge.
    let how = if touched(up, -1.0) > 1.0 - MOST_OF && n_on(up, -1.0) >= GOES_ON {
        "stands on others"
    } else if hangs() {
        "hangs at others"
    } else {
        return None;
    };
    // A low wall has air before and behind it, and ends in other objects.
    let is_end = |k: usize, sign: f64| touched(k, sign) > 1.0 - MOST_OF;
    let is_low_wall = |across: usize, along: usize| {
        half[across] < half[along]
            && !is_end(across, -1.0)
            && !is_end(across, 1.0)
            && is_end(along, -1.0)
            && is_end(along, 1.0)
    };
    if is_low_wall(a, b) || is_low_wall(b, a) || box_.n_higher(up, diagonal) < AROUND {
        return None;
    }
    Some(format!(
        "furniture: {:.1} x {:.1} x {:.1} m, {how}, air above and walls higher around it",
        2.0 * half[a],
        2.0 * half[up],
        2.0 * half[b]
    ))
}

struct Whole<'a> {
    whole: &'a Unit,
    meets: &'a Meets<'a>,
}

impl Whole<'_> {
    /// Returns the share of a side that has other objects before it, nearer than `far`.
    fn met(&self, k: usize, sign: f64, far: f64) -> f64 {
        let (u, v) = ((k + 1) % 3, (k + 2) % 3);
        let Unit {
            center, axes, half, ..
        } = self.whole;
        let out = axes[k] * sign;
        let into = INTO.min(0.5 * half[k]);
        let n = (0..GRID * GRID)
            .filter(|i| {
                let at = |i: usize| (i as f64 + 0.5) / GRID as f64 * 2.0 - 1.0;
                let p = *center
                    + axes[u] * (at(i % GRID) * half[u])
                    + axes[v] * (at(i / GRID) * half[v])
                    + out * half[k];
                (self.meets)(p - out * into, p + out * far)
            })
            .count();
        n as f64 / (GRID * GRID) as f64
    }

    /// Returns the number of directions, of eight, in which other objects rise above it.
    fn n_higher(&self, up: usize, diagonal: f64) -> usize {
        let Unit {
            center, axes, half, ..
        } = self.whole;
        let eye = *center + axes[up] * (half[up] + HEAD);
        let [a, b] = [axes[(up + 1) % 3], axes[(up + 2) % 3]];
        (0..8)
            .filter(|&i| {
                let (sin, cos) = (f64::from(i) * std::f64::consts::FRAC_PI_4).sin_cos();
                (self.meets)(eye, eye + (a * cos + b * sin) * diagonal)
            })
            .count()
    }
}
