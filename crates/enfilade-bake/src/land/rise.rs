//! Which squares of a height map are low ground, in which one moves and is hidden, and which are what parts it: the tops of
//! houses, and ridges.
//!
//! **The quantity:** how much more rises around a place than falls off around it, seen from above the place: the mean, over eight
//! directions, of the steepest line to anything higher less the steepest line to anything lower (the positive and the negative
//! openness of Yokoyama, Shirasawa & Pike, "Visualizing topography by openness", 2002). In streets, courtyards and on the
//! floors of valleys more rises; on roofs, crests and domes more falls off; half way up a slope, as much. It has neither a
//! radius nor a scale, so it is the same for a lane and for a valley. What is lower than somebody who stands hides nobody,
//! and does not count.
//!
//! A roof among towers has much above it. But no way leads from a roof to the ground: areas that end in drops rather than
//! walls, all around, are tops of something.
//!
//! Cost: eight sweeps over the map, each with a convex hull as a stack (Timonen & Westerholm, "Scalable height field
//! self-shadowing", 2010): `n log n` at worst. Heights are `f32` to the millimeter for land up to 8 km high; slopes are computed in `f64`.

use enfilade_geom::{Allowance, Sets};
use rayon::prelude::*;

use super::relief::{NOTHING, Relief};
use crate::void::{STANDING, STEP};

/// Steepest way that somebody walks up: 45 degrees.
const CLIMB: f64 = 1.0;
/// Cost of a square in a sweep, in units of [`Allowance`]: so many of them are one.
const SQUARES_A_WORK: u64 = 2;

/// Returns the squares that are low ground.
pub(super) fn low_ground(relief: &Relief, allowance: &Allowance) -> Vec<bool> {
    let rise = rise(relief, allowance);
    let is_top = tops(relief);
    let is_low = |i: usize| relief.top[i] != NOTHING && rise[i] >= 0.0 && !is_top[i];
    (0..relief.len()).map(is_low).collect()
}

/// Returns for each square how much more rises around it than falls off. [Units: eight times radians]
fn rise(relief: &Relief, allowance: &Allowance) -> Vec<f32> {
    let mut all = vec![0.0; relief.len()];
    for step in [[1, 0], [0, 1], [1, 1], [1, -1]] {
        if !allowance.spend(1 + relief.len() as u64 / SQUARES_A_WORK) {
            break;
        }
        let lines = lines(relief.dims, step);
        let length = relief.square * f64::from(step[0].abs() + step[1].abs()).sqrt();
        let found: Vec<Vec<f32>> = lines
            .par_iter()
            .map(|line| {
                let heights: Vec<f32> = line.iter().map(|&i| relief.top[i]).collect();
                rise_along(&heights, length)
            })
            .collect();
        for (line, found) in lines.iter().zip(found) {
            for (&i, rise) in line.iter().zip(found) {
                all[i] += rise;
            }
        }
    }
    all
}

/// Returns the lines of squares in a direction that cover a plan.
fn lines([nx, nz]: [usize; 2], [dx, dz]: [i32; 2]) -> Vec<Vec<usize>> {
    let mut starts: Vec<[i64; 2]> = Vec::new();
    let (wide, deep) = (nx as i64, nz as i64);
    if dx > 0 {
        starts.extend((0..deep).map(|z| [0, z]));
    }
    if dz != 0 {
        let z = if dz > 0 { 0 } else { deep - 1 };
        starts.extend((i64::from(dx > 0)..wide).map(|x| [x, z]));
    }
    let line = |[x, z]: [i64; 2]| {
        let at = (0..).map(|k| [x + k * i64::from(dx), z + k * i64::from(dz)]);
        let is_in = |p: &[i64; 2]| p[0] < wide && (0..deep).contains(&p[1]);
        at.take_while(is_in)
            .map(|[x, z]| (x + wide * z) as usize)
            .collect()
    };
    starts.into_iter().map(line).collect()
}

/// Does [`rise`] along a line of heights, both ways.
fn rise_along(heights: &[f32], length: f64) -> Vec<f32> {
    let turned: Vec<f32> = heights.iter().rev().copied().collect();
    let ahead = steepest(&turned, length);
    let behind = steepest(heights, length);
    behind
        .into_iter()
        .zip(ahead.into_iter().rev())
        .map(|(a, b)| a + b)
        .collect()
}

/// Returns for each height the angle up to the steepest of those before it, less that down to them. [Units: rad]
fn steepest(heights: &[f32], length: f64) -> Vec<f32> {
    let (mut above, mut below) = (Hull::default(), Hull::default());
    let of = |(i, &height): (usize, &f32)| {
        if height == NOTHING {
            return 0.0;
        }
        let (x, y) = (i as f64 * length, f64::from(height));
        let up = above.slope_from(x, y + STANDING).max(0.0);
        let down = below.slope_from(x, -y + STANDING).max(0.0);
        above.push(x, y);
        below.push(x, -y);
        (up.atan() - down.atan()) as f32
    };
    heights.iter().enumerate().map(of).collect()
}

/// The upper hull of points with rising x.
#[derive(Default)]
struct Hull(Vec<[f64; 2]>);

impl Hull {
    fn push(&mut self, x: f64, y: f64) {
        while let [.., a, b] = self.0[..] {
            let turn = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
            if turn < 0.0 {
                break;
            }
            self.0.pop();
        }
        self.0.push([x, y]);
    }

    /// Returns the greatest slope up to a point of the hull, from one that is farther along x.
    fn slope_from(&self, x: f64, y: f64) -> f64 {
        let slope = |p: &[f64; 2]| (p[1] - y) / (x - p[0]);
        // Along the hull the slope rises up to the point where a line touches it.
        let rises = |k: usize| k > 0 && slope(&self.0[k]) > slope(&self.0[k - 1]);
        let (mut from, mut to) = (0, self.0.len());
        while from + 1 < to {
            let middle = usize::midpoint(from, to);
            if rises(middle) {
                from = middle;
            } else {
                to = middle;
            }
        }
        self.0.get(from).map_or(0.0, slope)
    }
}

/// Returns the squares of areas that end in drops more than in walls. The largest area is the ground, on whatever it stands.
fn tops(relief: &Relief) -> Vec<bool> {
    let climb = STEP.max(CLIMB * relief.square) as f32;
    let n = relief.len();
    let mut sets = Sets::new(n);
    let nx = relief.dims[0];
    let pairs = || {
        let ahead = move |i: usize| {
            let [x, z] = relief.at(i);
            [(x + 1 < nx, i + 1), (z + 1 < relief.dims[1], i + nx)]
        };
        let all = (0..n).flat_map(move |i| ahead(i).map(|(is_in, j)| (is_in, i, j)));
        all.filter(|&(is_in, i, j)| is_in && relief.top[i] != NOTHING && relief.top[j] != NOTHING)
    };
    for (_, i, j) in pairs() {
        if (relief.top[i] - relief.top[j]).abs() <= climb {
            sets.join(i as u32, j as u32);
        }
    }
    let area = sets.into_least();
    // Edges where each area meets something higher, less those where it meets something lower; and squares.
    let (mut walled, mut size) = (vec![0_i64; n], vec![0_u32; n]);
    for (_, i, j) in pairs() {
        if (relief.top[i] - relief.top[j]).abs() > climb {
            let [low, high] = if relief.top[i] < relief.top[j] {
                [i, j]
            } else {
                [j, i]
            };
            walled[area[low] as usize] += 1;
            walled[area[high] as usize] -= 1;
        }
    }
    area.iter().for_each(|&a| size[a as usize] += 1);
    let largest = (0..n)
        .filter(|&i| relief.top[i] != NOTHING)
        .max_by_key(|&i| (size[i], std::cmp::Reverse(i)));
    let is_top = |&a: &u32| walled[a as usize] < 0 && Some(a as usize) != largest;
    area.iter().map(is_top).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plan of squares of a meter with these heights.
    fn relief(dims: [usize; 2], height: impl Fn(usize, usize) -> f64) -> Relief {
        let n = dims[0] * dims[1];
        let top: Vec<f32> = (0..n)
            .map(|i| height(i % dims[0], i / dims[0]) as f32)
            .collect();
        Relief {
            origin: [0.0; 2],
            square: 1.0,
            dims,
            ground: top.clone(),
            top,
        }
    }

    // Covers V11.
    #[test]
    fn streets_and_valleys_are_low_and_roofs_and_ridges_are_not() {
        // Blocks of 30 m, 9 m high, and streets of 10 m.
        let city = relief([120, 80], |x, z| {
            if x % 40 >= 10 && z % 40 >= 10 {
                9.0
            } else {
                0.0
            }
        });
        let low = low_ground(&city, &Allowance::default());
        for (i, &is_low) in low.iter().enumerate() {
            assert_eq!(is_low, city.top[i] == 0.0, "{:?}", city.at(i));
        }
        // Valleys 100 m wide, 25 m deep, that fall along the other axis.
        let hills = relief([300, 100], |x, z| {
            let across = (x as f64 / 50.0 * std::f64::consts::PI).cos();
            12.5 * across - 0.05 * z as f64
        });
        let low = low_ground(&hills, &Allowance::default());
        for z in [20, 50, 80] {
            for (x, expected) in [(50, true), (150, true), (100, false), (200, false)] {
                assert_eq!(low[x + 300 * z], expected, "{x} {z}");
            }
        }
    }

    #[test]
    fn a_roof_among_towers_is_a_top() {
        // A roof of 40 m, 9 m high, with towers all around it across lanes.
        let towers = relief([120, 120], |x, z| {
            let in_roof = |v: usize| (40..80).contains(&v);
            let in_lane = |v: usize| (35..85).contains(&v);
            match (in_roof(x) && in_roof(z), in_lane(x) && in_lane(z)) {
                (true, _) => 9.0,
                (_, true) => 0.0,
                _ => 60.0,
            }
        });
        let low = low_ground(&towers, &Allowance::default());
        assert!(!low[60 + 120 * 60] && low[37 + 120 * 60]);
    }

    #[test]
    fn the_steepest_line_is_found_among_all_points() {
        let mut rng = enfilade_testkit::Rng::new(5);
        let heights: Vec<f32> = (0..200).map(|_| (rng.unit() * 40.0) as f32).collect();
        for (i, found) in steepest(&heights, 1.0).into_iter().enumerate() {
            let to = |sign: f64| {
                let slope = |j: usize| {
                    let rise = sign * f64::from(heights[j] - heights[i]) - STANDING;
                    rise / (i - j) as f64
                };
                (0..i).map(slope).fold(0.0, f64::max).atan()
            };
            assert!((f64::from(found) - to(1.0) + to(-1.0)).abs() < 1e-5, "{i}");
        }
    }
}
