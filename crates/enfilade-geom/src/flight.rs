//! Flights of stairs: chains of level surfaces, each a riser above the previous one and a step aside.
//!
//! Shelves and louvers are not: they lie straight above each other.

use crate::{Aabb, Attitude, DVec3, Triangle, is_rather_level, triangle_area_normal};

/// Rise from one step to the next: of stairs to climb up to that of space-saving stairs and tiers of seats. [Units: wu]
const RISE: std::ops::RangeInclusive<f64> = 0.10..=0.40;
/// Horizontal distance between the middles of one step and the next. [Units: wu]
const GOING: std::ops::RangeInclusive<f64> = 0.12..=1.2;
/// Area of a step. [Units: wu²]
const STEP_AREA: std::ops::RangeInclusive<f64> = 0.03..=4.0;
/// Least share of treads in the area that faces up.
const MIN_LEVEL_SHARE: f64 = 0.5;
/// … and in the whole area. In a narrow flight that is massive down to the ground, an eighth is treads;
/// in a wall whose arched top runs in level strips, a thirtieth.
const MIN_TREAD_SHARE: f64 = 0.1;
/// Least number of steps in a row.
const MIN_STEPS: usize = 4;
/// Least number of triangles of a board, those of a prism: the triangles of terrain are not treads.
const BOARD: usize = 8;
/// Parts that could be treads are none if they are more: comparing them takes time.
const MOST_TREADS: usize = 20_000;

/// Largest plan of a flight. [Units: wu²]
pub const MOST_FLIGHT_PLAN: f64 = 40.0;

/// Returns `true` if triangles contain a flight, and their plan is not larger than one's. Time: O(n log n) and the square of
/// the number of levels at one height.
#[must_use]
pub fn is_flight(triangles: &[Triangle]) -> bool {
    if triangles.len() < 2 * MIN_STEPS {
        return false;
    }
    let size = Aabb::of_points(triangles.as_flattened()).size();
    if size.x * size.z > MOST_FLIGHT_PLAN {
        return false;
    }
    // Treads face up, or down in a model turned inside out.
    [1.0, -1.0].iter().any(|&side| {
        let levels = levels(triangles, side);
        in_flights(&levels).contains(&true)
    })
}

/// Returns `true` for each part that is a tread of a flight: parts of a flight without stringers are not connected.
#[must_use]
pub fn are_treads(parts: &[Vec<Triangle>]) -> Vec<bool> {
    let mut are = vec![false; parts.len()];
    for side in [1.0, -1.0] {
        let mut treads: Vec<(usize, Level)> = Vec::new();
        for (i, part) in parts.iter().enumerate() {
            let size = Aabb::of_points(part.as_flattened()).size();
            let is_board = part.len() >= BOARD && size.y <= *RISE.end();
            if !is_board || size.x * size.z > *STEP_AREA.end() {
                continue;
            }
            let mut own = levels(part, side);
            if own.len() == 1 {
                treads.extend(own.pop().map(|level| (i, level)));
            }
        }
        if treads.len() > MOST_TREADS {
            continue;
        }
        treads.sort_by(|a, b| a.1.middle.y.total_cmp(&b.1.middle.y));
        let (of, levels): (Vec<usize>, Vec<Level>) = treads.into_iter().unzip();
        for (i, _) in of.iter().zip(in_flights(&levels)).filter(|t| t.1) {
            are[*i] = true;
        }
    }
    are
}

/// A level surface: its middle and area. Triangles at one height and close in plan form one.
struct Level {
    middle: DVec3,
    area: f64,
}

fn levels(triangles: &[Triangle], side: f64) -> Vec<Level> {
    let (mut upward, mut total) = (0.0, 0.0);
    let mut flat: Vec<(f64, DVec3, f64)> = triangles
        .iter()
        .filter_map(|t| {
            let n = triangle_area_normal(t);
            let area = n.length() * 0.5;
            let is_ahead = n.y * side > 0.0;
            total += area;
            if is_ahead && is_rather_level(n) {
                upward += area;
            }
            let is_level = is_ahead && Attitude::of(n) == Attitude::Level;
            (is_level && area > 1e-6).then(|| {
                let middle = (t[0] + t[1] + t[2]) / 3.0;
                (middle.y, middle, area)
            })
        })
        .collect();
    // Anything round has level spots at all heights; of stairs, treads are most of the area that faces up.
    let level = flat.iter().map(|f| f.2).sum::<f64>();
    if level < MIN_LEVEL_SHARE * upward || level < MIN_TREAD_SHARE * total {
        return Vec::new();
    }
    flat.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<Level> = Vec::new();
    for (y, middle, area) in flat {
        // A step is small: a surface further off at the same height is a step of another flight.
        let home = out
            .iter_mut()
            .rev()
            .take_while(|l| y - l.middle.y < 0.02)
            .find(|l| {
                let d = l.middle - middle;
                DVec3::new(d.x, 0.0, d.z).length() < 1.2
            });
        match home {
            Some(l) => {
                l.middle = (l.middle * l.area + middle * area) / (l.area + area);
                l.area += area;
            }
            None => out.push(Level { middle, area }),
        }
    }
    out.retain(|l| STEP_AREA.contains(&l.area));
    out
}

/// Returns `true` for each level, sorted by height, in a chain of enough steps.
fn in_flights(levels: &[Level]) -> Vec<bool> {
    let is_step = |low: &Level, high: &Level| {
        let d = high.middle - low.middle;
        RISE.contains(&d.y) && GOING.contains(&DVec3::new(d.x, 0.0, d.z).length())
    };
    // A chain only looks at levels less than a rise away.
    let is_near = |low: &Level, high: &Level| high.middle.y - low.middle.y <= *RISE.end();
    let n = levels.len();
    let (mut below, mut above) = (vec![0_usize; n], vec![0_usize; n]);
    for i in 0..n {
        let near = (0..i)
            .rev()
            .take_while(|&j| is_near(&levels[j], &levels[i]));
        let steps = near.filter(|&j| is_step(&levels[j], &levels[i]));
        below[i] = steps.map(|j| below[j] + 1).max().unwrap_or(0);
    }
    for i in (0..n).rev() {
        let near = (i + 1..n).take_while(|&j| is_near(&levels[i], &levels[j]));
        let steps = near.filter(|&j| is_step(&levels[i], &levels[j]));
        above[i] = steps.map(|j| above[j] + 1).max().unwrap_or(0);
    }
    let chains = below.iter().zip(above);
    chains.map(|(b, a)| b + a + 1 >= MIN_STEPS).collect()
}
