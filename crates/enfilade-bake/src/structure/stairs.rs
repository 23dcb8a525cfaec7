//! Stairs: structure that bounds no room.
//!
//! A flight of stairs stands in a room like furniture, but is as large as a wall: treads without
//! risers fence off the space below them, and a winding flight pinches its room. So the flood ignores
//! stairs (Haumont et al. 2003, §6.1 leave out furniture for the same reason). Everything exact, above all
//! the cell complex, still includes them.
//!
//! A group of triangles is a flight if it contains a chain of level surfaces, each a riser above the
//! previous one and a step aside. Shelves and louvers are not: they lie straight above each other.

use std::collections::HashMap;

use enfilade_geom::scene::TriangleSource;
use enfilade_geom::{Aabb, DVec3, Sets, Triangle, triangle_area_normal};

/// Rise from one step to the next: of stairs to climb up to that of space-saving stairs and tiers of seats. [Units: wu]
const RISE: std::ops::RangeInclusive<f64> = 0.10..=0.40;
/// Horizontal distance between the middles of one step and the next. [Units: wu]
const GOING: std::ops::RangeInclusive<f64> = 0.12..=1.2;
/// Area of a step. [Units: wu²]
const STEP_AREA: std::ops::RangeInclusive<f64> = 0.03..=4.0;
/// Cosine of the largest tilt of a tread.
const LEVEL: f64 = 0.99;
/// Least share of treads in the area that faces up.
const MIN_LEVEL_SHARE: f64 = 0.5;
/// … and in the whole area. In a narrow flight that is massive down to the ground, an eighth is treads;
/// in a wall whose arched top runs in level strips, a thirtieth.
const MIN_TREAD_SHARE: f64 = 0.1;
/// Least number of steps in a row.
const MIN_STEPS: usize = 4;
/// Objects with a larger plan are examined shell by shell: a whole building may be one object. [Units: wu²]
const MAX_PLAN: f64 = 40.0;

/// Returns `true` for each triangle that belongs to stairs.
#[must_use]
pub(crate) fn find_stairs(sources: &[TriangleSource], triangles: &[Triangle]) -> Vec<bool> {
    let mut is_stair = vec![false; triangles.len()];
    let mut start = 0;
    while start < sources.len() {
        let object = sources[start].object;
        let len = sources[start..]
            .iter()
            .take_while(|s| s.object == object)
            .count();
        let members: Vec<usize> = (start..start + len).collect();
        start += len;
        let size = bounds(triangles, &members).size();
        let groups = if size.x * size.z <= MAX_PLAN {
            vec![members]
        } else {
            shells(triangles, &members)
        };
        for group in groups {
            if is_flight(triangles, &group) {
                group.iter().for_each(|&t| is_stair[t] = true);
            }
        }
    }
    is_stair
}

fn bounds(triangles: &[Triangle], members: &[usize]) -> Aabb {
    Aabb::of_points(members.iter().flat_map(|&t| &triangles[t]))
}

/// Returns groups of triangles connected by equal vertices, in order of their first triangle.
fn shells(triangles: &[Triangle], members: &[usize]) -> Vec<Vec<usize>> {
    let mut sets = Sets::new(members.len());
    let mut first_at: HashMap<[u64; 3], u32> = HashMap::new();
    for (i, &t) in members.iter().enumerate() {
        for p in triangles[t] {
            // Adding zero makes -0 and 0 one key.
            let key = (p + DVec3::ZERO).to_array().map(f64::to_bits);
            let other = *first_at.entry(key).or_insert(i as u32);
            sets.join(i as u32, other);
        }
    }
    let mut index: HashMap<u32, usize> = HashMap::new();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, &t) in members.iter().enumerate() {
        let r = sets.find(i as u32);
        let at = *index.entry(r).or_insert_with(|| {
            groups.push(Vec::new());
            groups.len() - 1
        });
        groups[at].push(t);
    }
    groups
}

fn is_flight(triangles: &[Triangle], members: &[usize]) -> bool {
    if members.len() < 2 * MIN_STEPS {
        return false;
    }
    let size = bounds(triangles, members).size();
    if size.x * size.z > MAX_PLAN {
        return false;
    }
    // Treads face up, or down in a model turned inside out.
    [1.0, -1.0]
        .iter()
        .any(|&side| longest_flight(&levels(triangles, members, side)) >= MIN_STEPS)
}

/// A level surface: its middle and area. Triangles at one height and close in plan form one.
struct Level {
    middle: DVec3,
    area: f64,
}

fn levels(triangles: &[Triangle], members: &[usize], side: f64) -> Vec<Level> {
    let (mut upward, mut total) = (0.0, 0.0);
    let mut flat: Vec<(f64, DVec3, f64)> = members
        .iter()
        .filter_map(|&t| {
            let n = triangle_area_normal(&triangles[t]);
            let area = n.length() * 0.5;
            let slope = n.y * side;
            total += area;
            if slope > 0.5 * n.length() {
                upward += area;
            }
            (slope > LEVEL * n.length() && area > 1e-6).then(|| {
                let middle = (triangles[t][0] + triangles[t][1] + triangles[t][2]) / 3.0;
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

/// Returns the length of the longest chain in which each step is a rise above and a going aside from the previous.
fn longest_flight(levels: &[Level]) -> usize {
    // Levels ascend, so that a chain only looks back.
    let mut longest = vec![1_usize; levels.len()];
    for i in 0..levels.len() {
        for j in (0..i).rev() {
            let d = levels[i].middle - levels[j].middle;
            if d.y > *RISE.end() + 0.05 {
                break;
            }
            let going = DVec3::new(d.x, 0.0, d.z).length();
            if RISE.contains(&d.y) && GOING.contains(&going) {
                longest[i] = longest[i].max(longest[j] + 1);
            }
        }
    }
    longest.into_iter().max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quad(out: &mut Vec<Triangle>, a: DVec3, u: DVec3, v: DVec3) {
        out.push([a, a + u, a + u + v]);
        out.push([a, a + u + v, a + v]);
    }

    /// `n` treads, each `going` further along x and 0.18 m higher.
    fn treads(n: usize, going: f64) -> Vec<Triangle> {
        steep_treads(n, going, 0.18)
    }

    fn steep_treads(n: usize, going: f64, rise: f64) -> Vec<Triangle> {
        let mut out = Vec::new();
        for i in 0..n {
            let at = DVec3::new(i as f64 * going, i as f64 * rise, 0.0);
            quad(&mut out, at, DVec3::Z, DVec3::X * 0.28);
        }
        out
    }

    fn sources(n: usize) -> Vec<TriangleSource> {
        (0..n)
            .map(|i| TriangleSource {
                object: 0,
                primitive: 0,
                triangle: i as u32,
            })
            .collect()
    }

    #[test]
    fn a_flight_is_found_and_a_shelf_is_not() {
        let flight = treads(8, 0.28);
        assert!(find_stairs(&sources(16), &flight).iter().all(|&s| s));
        let shelf = treads(8, 0.0);
        assert!(!find_stairs(&sources(16), &shelf).iter().any(|&s| s));
        let two_steps = treads(3, 0.28);
        assert!(!find_stairs(&sources(6), &two_steps).iter().any(|&s| s));
    }

    #[test]
    fn a_steep_flight_is_found_up_to_what_somebody_climbs() {
        for (rise, is_climbed) in [(0.345, true), (0.395, true), (0.45, false)] {
            let flight = steep_treads(8, 0.25, rise);
            let found = find_stairs(&sources(16), &flight);
            assert!(found.iter().all(|&s| s == is_climbed), "{rise}");
        }
    }

    #[test]
    fn a_wall_whose_top_runs_in_level_strips_is_no_flight() {
        // Half a meter thick, both faces, as cut by an arched roof: the strips step down by 0.18 m.
        let mut wall = Vec::new();
        for i in 0..8 {
            let at = DVec3::new(f64::from(i) * 0.5, 0.0, 0.0);
            let up = DVec3::Y * (5.0 - f64::from(i) * 0.1875);
            quad(&mut wall, at + up, DVec3::Z * 0.5, DVec3::X * 0.5);
            quad(&mut wall, at, DVec3::X * 0.5, up);
            quad(&mut wall, at + DVec3::Z * 0.5, up, DVec3::X * 0.5);
        }
        assert!(!find_stairs(&sources(48), &wall).iter().any(|&s| s));
        // A narrow flight, massive down to the ground, has the largest share of wall that a flight can have.
        let mut massive = Vec::new();
        for i in 0..16 {
            let at = DVec3::new(f64::from(i) * 0.28, 0.0, 0.0);
            let up = DVec3::Y * (f64::from(i + 1) * 0.18);
            quad(&mut massive, at + up, DVec3::Z * 0.7, DVec3::X * 0.28);
            quad(&mut massive, at, DVec3::X * 0.28, up);
            quad(&mut massive, at + DVec3::Z * 0.7, up, DVec3::X * 0.28);
        }
        assert!(find_stairs(&sources(96), &massive).iter().all(|&s| s));
    }

    #[test]
    fn a_flight_inside_one_large_mesh_is_found_by_its_shell() {
        let mut all = Vec::new();
        for i in 0..8 {
            // Multiples of a power of two: vertices of neighbors are equal to the bit.
            let at = DVec3::new(f64::from(i) * 0.25, f64::from(i) * 0.1875, 0.0);
            quad(&mut all, at, DVec3::Z, DVec3::X * 0.25);
            quad(&mut all, at + DVec3::X * 0.25, DVec3::Z, DVec3::Y * 0.1875);
        }
        let n = all.len();
        quad(
            &mut all,
            DVec3::new(-20.0, -1.0, -20.0),
            DVec3::Z * 40.0,
            DVec3::X * 40.0,
        );
        let found = find_stairs(&sources(n + 2), &all);
        assert!(found[..n].iter().all(|&s| s));
        assert!(!found[n..].iter().any(|&s| s));
    }
}
