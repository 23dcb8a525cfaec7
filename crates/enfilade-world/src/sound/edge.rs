//! Losses of sound at the edges of one opening.
//!
//! Maekawa ("Noise reduction by screens", 1968) in the closed form of Kurze & Anderson ("Sound attenuation by barriers", 1971), and
//! the share of the first Fresnel zone (Born & Wolf, "Principles of Optics", §8.2). All are continuous in the ends of the string.

use enfilade_geom::DVec3;

use crate::layout::Opening;
use crate::sound::bands::N_BANDS;

/// Angle of a bend from which on it is a source of its own: some 30°, over which the field behind an edge passes from that of the
/// source to that of the edge (Kouyoumjian & Pathak 1974). [Units: rad]
const BEND: f64 = 0.5;
/// Length of string over which directions are averaged: half a wave at 500 Hz. Nearer bends are not heard as places of their
/// own. [Units: wu]
const BLUR: f64 = 0.343;
/// Maximum loss at one edge: what screens reach outdoors, where turbulence fills the shadow (Maekawa 1968). [Units: dB]
const MOST_LOSS: f64 = 24.0;

/// Returns the end of the straight part of a string that begins at `from`, extended straight from there. A slight bend shortens
/// what is behind it in proportion to its angle, so that a portal crossed straight has no influence on the losses at others.
pub(super) fn straight_end(from: DVec3, points: impl Iterator<Item = DVec3>) -> DVec3 {
    let (mut at, mut first, mut last) = (from, DVec3::ZERO, DVec3::ZERO);
    let (mut length, mut share) = (0.0, 1.0);
    for p in points {
        let leg = p.distance(at);
        if leg < 1e-9 {
            continue;
        }
        let toward = (p - at) / leg;
        if first == DVec3::ZERO {
            first = toward;
        } else {
            // The chord stands for the angle: they differ by a percent up to 0.5.
            share *= (1.0 - last.distance(toward) / BEND).max(0.0);
        }
        if share == 0.0 {
            break;
        }
        length += share * leg;
        (at, last) = (p, toward);
    }
    from + first * length
}

/// Returns the mean direction of the first part of a string.
pub(super) fn arrival_direction(points: &[DVec3]) -> DVec3 {
    let Some((&from, rest)) = points.split_first() else {
        return DVec3::ZERO;
    };
    let (mut at, mut left, mut sum) = (from, BLUR, DVec3::ZERO);
    for &p in rest {
        let leg = p.distance(at);
        let share = (left / leg.max(1e-12)).min(1.0);
        let end = at.lerp(p, share);
        // The mean of the points of this leg, by its length.
        sum += (at.midpoint(end) - from) * (share * leg);
        left -= share * leg;
        at = p;
        if left <= 0.0 {
            break;
        }
    }
    sum.normalize_or_zero()
}

/// Returns the share of directions that the wall around an opening takes at a point: 0 in the opening, 1 far from it. As for a disc
/// of equal area on its axis.
pub(super) fn wall_share(opening: &Opening<'_>, rims: &[[DVec3; 2]], p: DVec3) -> f64 {
    let height = opening.height_of(p);
    let foot = p - opening.normal() * height;
    let is_before = |piece: &[DVec3]| {
        let edges = (0..piece.len()).map(|i| (piece[i], piece[(i + 1) % piece.len()]));
        let mut insides = edges.map(|(a, b)| opening.normal().dot((b - a).cross(foot - a)));
        insides.all(|inside| inside >= 0.0)
    };
    let squared = if opening.pieces().any(is_before) {
        height * height
    } else {
        let edges = rims.iter().map(|&[a, b]| {
            let along = (b - a) * ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            (a + along).distance_squared(p)
        });
        edges.fold(f64::INFINITY, f64::min)
    };
    if squared == f64::INFINITY {
        return 1.0;
    }
    let disc = opening.area() / std::f64::consts::PI;
    (squared / (squared + disc).max(1e-12)).sqrt()
}

/// Returns the share of energy that passes an area on the way between two points, relative to a large area, by octave band.
pub(super) fn through_area(
    area: f64,
    longest_wave: f64,
    before: DVec3,
    at: DVec3,
    after: DVec3,
) -> [f64; N_BANDS] {
    if area <= 0.0 {
        return [0.0; N_BANDS];
    }
    let (d1, d2) = (before.distance(at), after.distance(at));
    // Number of first Fresnel zones in the area, times π; the zone vanishes at the opening itself.
    let mut zone = longest_wave * d1 * d2 / (d1 + d2).max(1e-9);
    [0.0; N_BANDS].map(|_| {
        let share = area * area / (area * area + zone * zone).max(1e-24);
        zone *= 0.5;
        share
    })
}

/// Returns the extra length over the nearest edge: above 0 where the string bends about it, below 0 where it passes in the clear,
/// there for small angles, so that it vanishes in the opening itself. [Units: wu]
pub(super) fn detour(rims: &[[DVec3; 2]], before: DVec3, at: DVec3, after: DVec3) -> f64 {
    let straight = before.distance(after);
    let bent = before.distance(at) + at.distance(after) - straight;
    if bent > 1e-9 * (1.0 + straight) {
        return bent;
    }
    let ray = (after - before).normalize_or_zero();
    // Edges as seen along the string.
    let aside = |p: DVec3| (p - at) - ray * ray.dot(p - at);
    let squares = rims.iter().map(|&[a, b]| {
        let (a, b) = (aside(a), aside(b));
        let share = -a.dot(b - a) / (b - a).length_squared().max(1e-18);
        (a + (b - a) * share.clamp(0.0, 1.0)).length_squared()
    });
    let square = squares.fold(f64::INFINITY, f64::min);
    let (d1, d2) = (before.distance(at), after.distance(at));
    if square == f64::INFINITY {
        return f64::NEG_INFINITY;
    }
    -0.5 * square * (d1 + d2) / (d1 * d2).max(1e-12)
}

/// Losses at edges, tabulated.
#[derive(Clone, Debug)]
pub(super) struct EdgeLosses {
    /// Losses by the root of 2 π times the Fresnel number: in the shade, and in the clear.
    tables: [Vec<f64>; 2],
}

/// Number of entries of the tables per unit: linear between these, they are right to 1e-4 dB, and to 0.05 dB at the
/// vertices where losses reach nothing or the most.
const PER_UNIT: f64 = 128.0;

impl EdgeLosses {
    pub(super) fn new() -> Self {
        // In the shade up to the most, in the clear up to nothing.
        let tables = [(1.0, 9.0), (-1.0, 1.25)].map(|(sign, end): (f64, f64)| {
            let xs = (0..=(end * PER_UNIT) as u32).map(|k| f64::from(k) / PER_UNIT);
            xs.map(|x| edge_loss(sign * x * x / std::f64::consts::TAU))
                .collect()
        });
        Self { tables }
    }

    /// Adds the losses at an edge by octave band, times `share()`, which is called if there are any. `fresnel` is the Fresnel
    /// number of the detour for the longest wave. [Units: dB]
    pub(super) fn add(
        &self,
        fresnel: f64,
        share: impl FnOnce() -> f64,
        losses: &mut [f64; N_BANDS],
    ) {
        let table = &self.tables[usize::from(fresnel < 0.0)];
        let mut x = PER_UNIT * (std::f64::consts::TAU * fresnel.abs()).sqrt();
        let last = (table.len() - 1) as f64;
        if x >= last && table[table.len() - 1] == 0.0 {
            return;
        }
        let share = share();
        for loss in losses {
            let here = x.min(last);
            let i = (here as usize).min(table.len() - 2);
            *loss += share * (table[i] + (table[i + 1] - table[i]) * (here - i as f64));
            x *= std::f64::consts::SQRT_2;
        }
    }
}

/// Returns the loss at an edge, by the Fresnel number of the detour over it. [Units: dB]
fn edge_loss(fresnel: f64) -> f64 {
    let x = (std::f64::consts::TAU * fresnel.abs()).sqrt();
    if x < 1e-6 {
        return 5.0;
    }
    if fresnel > 0.0 {
        return (5.0 + 20.0 * (x / x.tanh()).log10()).min(MOST_LOSS);
    }
    // In the clear from about -0.19 on.
    if x > 1.2 {
        return 0.0;
    }
    (5.0 + 20.0 * (x / x.tan()).log10()).max(0.0)
}

/// Returns the loss of a bend around walls within a cell, by the Fresnel number of the detour. [Units: dB]
///
/// As [`edge_loss`] from 0.3 on, to a decibel and a half, and nothing where the string becomes straight: a cell has many edges beside
/// each string, and none of them shades it there as a screen does.
pub(super) fn bend_loss(fresnel: f64) -> f64 {
    (10.0 * (1.0 + 20.0 * fresnel).log10()).min(MOST_LOSS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W11: Maekawa's chart.
    #[test]
    fn edge_losses_equal_maekawas_chart() {
        for (fresnel, decibels) in [
            (0.0, 5.0),
            (1.0, 13.0),
            (10.0, 23.0),
            (100.0, 24.0),
            (-1.0, 0.0),
        ] {
            let loss = edge_loss(fresnel);
            assert!((loss - decibels).abs() < 0.3, "{fresnel}: {loss}");
        }
        for k in -4000..4000 {
            let x = f64::from(k) * 1e-3;
            assert!((edge_loss(x) - edge_loss(x + 1e-3)).abs() < 0.15, "{x}");
        }
    }

    /// W11.
    #[test]
    fn a_small_hole_lets_less_through_but_not_close_by() {
        let (a, x, b) = (DVec3::ZERO, DVec3::X * 3.0, DVec3::X * 6.0);
        assert!(through_area(4.0, 0.686, a, x, b)[0] > 0.9);
        assert!(through_area(0.01, 0.686, a, x, b)[0] < 4e-4);
        assert_eq!(through_area(0.01, 0.686, x, x, b)[0], 1.0);
    }

    /// W11.
    #[test]
    fn tables_of_losses_equal_the_formula() {
        let tables = EdgeLosses::new();
        for k in -20_000..20_000 {
            let fresnel = f64::from(k) * 1e-4;
            let mut losses = [1.0; N_BANDS];
            tables.add(fresnel, || 0.5, &mut losses);
            for (k, loss) in losses.iter().enumerate() {
                let least = 1.0 + 0.5 * edge_loss(fresnel * f64::from(1 << k));
                // Where the curve ends in a vertex it is cut.
                assert!((loss - least).abs() < 0.05, "{fresnel} {k}: {loss} {least}");
            }
        }
    }
}
