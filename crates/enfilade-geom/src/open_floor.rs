//! The share of a level's floor that lies below the open sky: what tells a world whose engine draws the sky from a sealed one
//! with a hole.
//!
//! People walk from known places over the tops of solids, up and down steps. In a world without a lid the streets are most of
//! what they reach; behind a hole in a sealed one, the void has no floor, and the roofs beside it lie more than a step away.
//!
//! Cost: a column every 25 cm in plan, and for each solid the columns above it.

use std::collections::VecDeque;

use crate::{Aabb, ConvexSolid, DVec3, Purse};

/// Least share of the floor below the open sky in a world that is open: more of it than below ceilings. A street has 0.95, a house in a
/// small garden 0.52; a brush of sky that is missing from a level opens 0.29 of it (lq_e4m4), the ceiling of one of two rooms 0.49.
pub const OPEN_WORLD: f64 = 0.5;

/// Distance between columns: two in the narrowest corridor. [Units: wu]
const SPACING: f64 = 0.25;
/// Most columns along a side; larger levels have wider spacing.
const MAX_COLUMNS: f64 = 1024.0;
/// Greatest step: 18 units of Quake, the rise of which is climbed without a jump. [Units: wu]
const STEP: f64 = 0.6;
/// Least height to walk through, bent over. [Units: wu]
const HEADROOM: f64 = 1.2;

/// A floor in a column and the end of the air above it, infinite below the open sky. [Units: wu]
#[derive(Clone, Copy)]
struct Floor {
    low: f64,
    high: f64,
}

/// Returns the share of the floor that people reach on foot from places `inside` and that has nothing above; 0 if they reach
/// none, or the purse is empty before the end.
#[must_use]
pub fn open_floor(solids: &[ConvexSolid], inside: &[DVec3], purse: Purse<'_>) -> f64 {
    let level = Columns::of(solids, purse);
    let reached = level.reached(inside, purse);
    let n_open = reached
        .iter()
        .filter(|floor| floor.high.is_infinite())
        .count();
    if reached.is_empty() || !purse.spend(1) {
        return 0.0;
    }
    n_open as f64 / reached.len() as f64
}

/// The floors of a level by column, `x + nx * z`, each from below.
struct Columns {
    bounds: Aabb,
    spacing: f64,
    dims: [usize; 2],
    floors: Vec<Vec<Floor>>,
}

impl Columns {
    fn of(solids: &[ConvexSolid], purse: Purse<'_>) -> Self {
        let bounds = solids
            .iter()
            .fold(Aabb::EMPTY, |all, s| all.union(s.aabb()));
        let size = bounds.size();
        let spacing = SPACING.max(size.x.max(size.z) / MAX_COLUMNS);
        let dims = [size.x, size.z].map(|side| (side / spacing).max(0.0) as usize + 1);
        let mut level = Self {
            bounds,
            spacing,
            dims,
            floors: Vec::new(),
        };
        let mut spans: Vec<Vec<[f64; 2]>> = vec![Vec::new(); dims[0] * dims[1]];
        for solid in solids {
            let own = solid.aabb();
            let [first, last] = [own.min, own.max].map(|p| level.column(p));
            if !purse.spend(((last[0] - first[0] + 1) * (last[1] - first[1] + 1)) as u64) {
                break;
            }
            for z in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    spans[x + dims[0] * z].extend(level.stretch(solid, [x, z]));
                }
            }
        }
        level.floors = spans.into_iter().map(floors_of).collect();
        level
    }

    /// Returns the column of a point, the nearest for one outside.
    fn column(&self, p: DVec3) -> [usize; 2] {
        let at = |t: f64, n: usize| ((t / self.spacing).max(0.0) as usize).min(n - 1);
        let from = p - self.bounds.min;
        [at(from.x, self.dims[0]), at(from.z, self.dims[1])]
    }

    /// Returns the heights between which a column is in a solid.
    fn stretch(&self, solid: &ConvexSolid, [x, z]: [usize; 2]) -> Option<[f64; 2]> {
        let middle = |k: usize| (k as f64 + 0.5) * self.spacing;
        let p = self.bounds.min + DVec3::new(middle(x), 0.0, middle(z));
        let [mut low, mut high] = [f64::NEG_INFINITY, f64::INFINITY];
        for plane in &solid.planes {
            let level = plane.normal.x * p.x + plane.normal.z * p.z + plane.d;
            if plane.normal.y.abs() < 1e-9 {
                high = if level > 0.0 { f64::NEG_INFINITY } else { high };
            } else if plane.normal.y > 0.0 {
                high = high.min(-level / plane.normal.y);
            } else {
                low = low.max(-level / plane.normal.y);
            }
        }
        (low < high).then_some([low, high])
    }

    /// Returns the floors that people reach on foot from the floors below the given places.
    fn reached(&self, inside: &[DVec3], purse: Purse<'_>) -> Vec<Floor> {
        let mut is_reached: Vec<Vec<bool>> = self
            .floors
            .iter()
            .map(|floors| vec![false; floors.len()])
            .collect();
        let mut queue = VecDeque::new();
        for &p in inside.iter().filter(|&&p| self.bounds.contains(p)) {
            let [x, z] = self.column(p);
            let at = x + self.dims[0] * z;
            let below = |floor: &Floor| floor.low <= p.y + STEP && p.y < floor.high;
            if let Some(k) = self.floors[at].iter().rposition(below) {
                queue.push_back((at, k));
            }
        }
        let mut reached = Vec::new();
        while let Some((at, k)) = queue.pop_front() {
            if std::mem::replace(&mut is_reached[at][k], true) {
                continue;
            }
            if !purse.spend(1) {
                break;
            }
            let floor = self.floors[at][k];
            reached.push(floor);
            let [x, z] = [at % self.dims[0], at / self.dims[0]];
            for (dx, dz) in [(0, 1), (2, 1), (1, 0), (1, 2)] {
                let (x, z) = (x + dx, z + dz);
                if x == 0 || z == 0 || x > self.dims[0] || z > self.dims[1] {
                    continue;
                }
                let next = x - 1 + self.dims[0] * (z - 1);
                for (j, to) in self.floors[next].iter().enumerate() {
                    let clear = floor.high.min(to.high) - floor.low.max(to.low);
                    if clear >= HEADROOM && (floor.low - to.low).abs() <= STEP {
                        queue.push_back((next, j));
                    }
                }
            }
        }
        reached
    }
}

/// Returns the floors of a column that is in solids between these heights.
fn floors_of(mut spans: Vec<[f64; 2]>) -> Vec<Floor> {
    spans.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut floors = Vec::new();
    let mut top = f64::INFINITY;
    for [low, high] in spans {
        if low - top >= HEADROOM {
            floors.push(Floor {
                low: top,
                high: low,
            });
        }
        top = if top.is_finite() { top.max(high) } else { high };
    }
    if top.is_finite() {
        floors.push(Floor {
            low: top,
            high: f64::INFINITY,
        });
    }
    floors
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plane;

    fn boxed([min, max]: [[f64; 3]; 2]) -> ConvexSolid {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let side = |k: usize| Plane::through(DVec3::from(max), axes[k]);
        let other = |k: usize| Plane::through(DVec3::from(min), -axes[k]);
        let planes: Vec<Plane> = (0..3).flat_map(|k| [side(k), other(k)]).collect();
        ConvexSolid::from_planes(&planes, 1e4, 1e-6).unwrap()
    }

    /// Returns the boxes of a house 8 m by 6 m at a place, with a doorway 1 m wide in the middle of its first side.
    fn house(x: f64, z: f64) -> Vec<[[f64; 3]; 2]> {
        let at = |[[a, b, c], [d, e, f]]: [[f64; 3]; 2]| [[a + x, b, c + z], [d + x, e, f + z]];
        [
            [[0.0, 2.5, 0.0], [8.0, 2.8, 6.0]],
            [[0.0, 0.0, 0.0], [3.5, 2.5, 0.3]],
            [[4.5, 0.0, 0.0], [8.0, 2.5, 0.3]],
            [[0.0, 0.0, 5.7], [8.0, 2.5, 6.0]],
            [[0.0, 0.0, 0.3], [0.3, 2.5, 5.7]],
            [[7.7, 0.0, 0.3], [8.0, 2.5, 5.7]],
        ]
        .map(at)
        .to_vec()
    }

    fn share(boxes: &[[[f64; 3]; 2]], inside: [f64; 3]) -> f64 {
        let solids: Vec<ConvexSolid> = boxes.iter().copied().map(boxed).collect();
        open_floor(&solids, &[DVec3::from(inside)], Purse::endless())
    }

    #[test]
    fn a_street_is_most_of_the_floor_from_within_a_house_too() {
        let mut street = [house(0.0, 0.0), house(10.0, 0.0)].concat();
        street.push([[-5.0, -0.5, -10.0], [25.0, 0.0, 10.0]]);
        for inside in [[4.0, 1.0, 3.0], [4.0, 1.0, -5.0]] {
            assert!(share(&street, inside) > 0.8);
        }
    }

    #[test]
    fn a_missing_wall_opens_no_floor_and_a_missing_ceiling_one_of_many() {
        // Five rooms in a row, each with a wall toward the next but for a doorway.
        let mut level: Vec<[[f64; 3]; 2]> = vec![
            [[-0.3, -0.3, -0.3], [30.3, 0.0, 5.3]],
            [[-0.3, 0.0, -0.3], [30.3, 3.0, 0.0]],
            [[-0.3, 0.0, 5.0], [30.3, 3.0, 5.3]],
            [[-0.3, 0.0, 0.0], [0.0, 3.0, 5.0]],
            [[30.0, 0.0, 0.0], [30.3, 3.0, 5.0]],
        ];
        for k in 0..5 {
            let x = 6.0 * f64::from(k);
            level.push([[x - 0.3, 3.0, -0.3], [x + 6.3, 3.3, 5.3]]);
        }
        for k in 1..5 {
            let x = 6.0 * f64::from(k);
            level.push([[x - 0.1, 0.0, 0.0], [x + 0.1, 3.0, 2.0]]);
            level.push([[x - 0.1, 0.0, 3.0], [x + 0.1, 3.0, 5.0]]);
        }
        let inside = [3.0, 1.0, 2.5];
        assert_eq!(share(&level, inside), 0.0);
        let without = |k: usize| share(&[&level[..k], &level[k + 1..]].concat(), inside);
        for wall in [1, 2, 3, 4] {
            assert!(without(wall) < 0.1, "{wall}: {}", without(wall));
        }
        for ceiling in 5..10 {
            let share = without(ceiling);
            assert!(share > 0.1 && share < OPEN_WORLD, "{ceiling}: {share}");
        }
        // Without any ceiling.
        assert!(share(&[&level[..5], &level[10..]].concat(), inside) > 0.9);
    }

    #[test]
    fn roofs_are_no_step_away_and_stairs_are() {
        let mut one = house(0.0, 0.0);
        one.push([[0.0, -0.5, 0.0], [8.0, 0.0, 6.0]]);
        assert!(share(&one, [4.0, 1.0, 3.0]) < 0.1);
        // Steps of half a meter from the door to a yard below.
        for k in 0..4 {
            let (z, top) = (-f64::from(k), -0.5 * f64::from(k + 1));
            one.push([[3.0, top - 0.5, z - 1.0], [5.0, top, z]]);
        }
        one.push([[-20.0, -2.5, -30.0], [20.0, -2.0, -4.0]]);
        assert!(share(&one, [4.0, 1.0, 3.0]) > 0.8);
    }

    #[test]
    fn nothing_is_known_without_places_or_work() {
        let one = house(0.0, 0.0);
        assert_eq!(share(&one, [100.0, 0.0, 0.0]), 0.0);
        let solids: Vec<ConvexSolid> = one.into_iter().map(boxed).collect();
        let little = crate::Allowance::new(10, None);
        assert_eq!(
            open_floor(&solids, &[DVec3::new(4.0, 3.0, 3.0)], (&little).into()),
            0.0
        );
    }
}
