//! The built-up part of a site: the box outside of which there is nothing but open land.
//!
//! A house on a square kilometer of terrain takes a millionth of the site's volume, but voxels small enough for its doors
//! would have to fill all of it. Open land bounds no rooms, and shows it in plan: it is one surface, with nothing above it, and
//! not steep. So the plan is divided into squares; those with a wall, or with space between two surfaces in which something
//! could be, are built up.
//!
//! Cost: linear in the squares that triangles touch, at most [`MOST`]; scenes with more are not searched. Errs towards
//! too much: cliffs, bridges and caves count as built up.

use enfilade_geom::{Aabb, Allowance, DVec3, Triangle, triangle_area_normal};

/// Edge of a square. [Units: wu]
const SQUARE: f64 = 2.0;
/// Most squares along one side of the plan.
const MOST_ALONG: f64 = 2048.0;
/// Most squares of all triangles together: a few hundred megabytes.
const MOST: usize = 1 << 24;
/// Land around what is built: as far as measures of openings reach, and a wide yard. [Units: wu]
const MARGIN: f64 = 8.0;
/// Triangles steeper than this are walls: the vertical part of their normals is smaller.
const STEEP: f64 = 0.25;
/// … if they are as high as this within a square. [Units: wu]
const WALL: f64 = 1.0;
/// The built-up part must be smaller than the whole by this factor, in volume: otherwise nothing is gained.
const GAIN: f64 = 4.0;

/// A triangle in a square of the plan.
struct Patch {
    square: u32,
    /// Heights between which it is there. [Units: wu]
    low: f32,
    high: f32,
    is_wall: bool,
}

/// Returns the part of `bounds` that is built up: all of it if nothing is, or if that is not much smaller. Space between two
/// surfaces counts if it is higher than `opening`. The box is as high as all that is in its plan.
pub(crate) fn built_up(
    triangles: &[Triangle],
    bounds: &Aabb,
    opening: f64,
    allowance: &Allowance,
) -> Aabb {
    let size = bounds.size();
    let square = SQUARE.max(size.x.max(size.z) / MOST_ALONG);
    let n = [size.x, size.z].map(|s| (s / square).ceil().max(1.0) as usize);
    let Some(mut patches) = patches_of(triangles, bounds, square, n, allowance) else {
        return *bounds;
    };
    patches.sort_unstable_by(|a, b| a.square.cmp(&b.square).then(a.low.total_cmp(&b.low)));
    let mut built = Aabb::EMPTY;
    for here in patches.chunk_by(|a, b| a.square == b.square) {
        let mut top = here[0].high;
        let is_covered = here.iter().any(|patch| {
            let is_above = f64::from(patch.low - top) > opening;
            top = top.max(patch.high);
            is_above
        });
        if is_covered || here.iter().any(|patch| patch.is_wall) {
            let at = here[0].square as usize;
            let [x, z] = [at % n[0], at / n[0]].map(|k| k as f64 * square);
            let corner = bounds.min + DVec3::new(x, 0.0, z);
            built = built.including(corner);
            built = built.including(corner + DVec3::new(square, 0.0, square));
        }
    }
    if built.is_empty() {
        return *bounds;
    }
    let wide = built.expanded(MARGIN);
    let is_in = |patch: &Patch| {
        let at = patch.square as usize;
        let [x, z] = [at % n[0], at / n[0]].map(|k| (k as f64 + 0.5) * square);
        let middle = bounds.min + DVec3::new(x, 0.0, z);
        (wide.min.x..=wide.max.x).contains(&middle.x)
            && (wide.min.z..=wide.max.z).contains(&middle.z)
    };
    let (mut low, mut high) = (f64::MAX, f64::MIN);
    for patch in patches.iter().filter(|p| is_in(p)) {
        low = low.min(patch.low.into());
        high = high.max(patch.high.into());
    }
    let part = Aabb::new(
        DVec3::new(wide.min.x, low, wide.min.z).max(bounds.min),
        DVec3::new(wide.max.x, high, wide.max.z).min(bounds.max),
    );
    let volume = |b: &Aabb| (b.size() + 2.0 * MARGIN).element_product();
    if GAIN * volume(&part) <= volume(bounds) {
        part
    } else {
        *bounds
    }
}

/// Returns the squares that each triangle touches in plan; `None` if they are too many.
fn patches_of(
    triangles: &[Triangle],
    bounds: &Aabb,
    square: f64,
    n: [usize; 2],
    allowance: &Allowance,
) -> Option<Vec<Patch>> {
    let mut patches = Vec::new();
    for t in triangles.iter().filter(|t| t.iter().all(|p| p.is_finite())) {
        let of = Aabb::of_points(t);
        let place = |p: DVec3| {
            let p = (p - bounds.min) / square;
            [(p.x as usize).min(n[0] - 1), (p.z as usize).min(n[1] - 1)]
        };
        let ([x0, z0], [x1, z1]) = (place(of.min), place(of.max));
        if patches.len() + (x1 + 1 - x0) * (z1 + 1 - z0) > MOST {
            return None;
        }
        let normal = triangle_area_normal(t);
        let is_steep = normal.y.abs() <= STEEP * normal.length();
        // Height above a point of the plane's plan; steep triangles are everywhere as high as a whole.
        let height = |x: f64, z: f64| {
            t[0].y - (normal.x * (x - t[0].x) + normal.z * (z - t[0].z)) / normal.y
        };
        for z in z0..=z1 {
            for x in x0..=x1 {
                let from = bounds.min + DVec3::new(x as f64, 0.0, z as f64) * square;
                if !touches_in_plan(t, from, square) {
                    continue;
                }
                let (mut low, mut high) = (of.min.y, of.max.y);
                if !is_steep {
                    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
                        .map(|[u, v]| height(from.x + u * square, from.z + v * square));
                    let [least, most] = [f64::min, f64::max].map(|f| corners.into_iter().reduce(f));
                    (low, high) = (
                        low.max(least.unwrap_or(low)),
                        high.min(most.unwrap_or(high)),
                    );
                }
                if low <= high {
                    patches.push(Patch {
                        square: (x + n[0] * z) as u32,
                        low: low as f32,
                        high: high as f32,
                        is_wall: is_steep && high - low >= WALL,
                    });
                }
            }
        }
        if !allowance.spend(1) {
            return None;
        }
    }
    (!patches.is_empty()).then_some(patches)
}

/// Returns `true` if a triangle and a square meet in plan: no edge of the triangle separates them. Boxes are known to meet.
fn touches_in_plan(t: &Triangle, from: DVec3, square: f64) -> bool {
    (0..3).all(|i| {
        let [a, b, c] = [0, 1, 2].map(|k| t[(i + k) % 3]);
        // Positive on the side of the third vertex.
        let across = DVec3::new(a.z - b.z, 0.0, b.x - a.x);
        let across = across * across.dot(c - a).signum();
        let farthest = DVec3::new(
            if across.x > 0.0 { square } else { 0.0 },
            0.0,
            if across.z > 0.0 { square } else { 0.0 },
        );
        let reach = across.dot(from + farthest - a);
        reach >= -1e-9 * (1.0 + square) * across.length()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hills of `n` × `n` squares of 10 m, around the origin.
    fn hills(n: i32) -> Vec<Triangle> {
        let at = |i: i32, k: i32| {
            let [x, z] = [i, k].map(|v| 10.0 * f64::from(v - n / 2));
            DVec3::new(x, 4.0 * (x / 30.0).sin() * (z / 40.0).cos(), z)
        };
        let mut land = Vec::new();
        for i in 0..n {
            for k in 0..n {
                let [a, b, c, d] = [at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)];
                land.extend([[a, b, c], [a, c, d]]);
            }
        }
        land
    }

    fn part_of(triangles: &[Triangle]) -> (Aabb, Aabb) {
        let bounds = Aabb::of_points(triangles.as_flattened());
        let part = built_up(triangles, &bounds, 0.6, &Allowance::default());
        (bounds, part)
    }

    #[test]
    fn a_house_on_wide_land_is_the_built_up_part() {
        let house = Aabb::new(DVec3::new(-6.0, -1.0, 20.0), DVec3::new(4.0, 8.0, 28.0));
        let mut scene = hills(60);
        scene.extend(house.triangles());
        let (bounds, part) = part_of(&scene);
        assert!(part.min.cmple(house.min - 4.0).all() || part.min.y < house.min.y);
        assert!(part.min.x <= house.min.x - MARGIN && part.max.x >= house.max.x + MARGIN);
        assert!(part.min.z <= house.min.z - MARGIN && part.max.z >= house.max.z + MARGIN);
        assert!(part.size().x < house.size().x + 2.0 * (MARGIN + SQUARE) + 1.0);
        assert!(part.max.y >= house.max.y && part.min.y <= house.min.y);
        assert!(bounds.contains(part.min) && bounds.contains(part.max));
    }

    #[test]
    fn walls_without_a_roof_and_roofs_without_walls_are_built_up() {
        let wall = |x: f64| {
            let at = |y: f64, z: f64| DVec3::new(x, y, z);
            [at(-5.0, 0.0), at(-5.0, 6.0), at(6.0, 3.0)]
        };
        let roof = [
            DVec3::new(100.0, 9.0, 100.0),
            DVec3::new(100.0, 9.0, 106.0),
            DVec3::new(106.0, 9.0, 100.0),
        ];
        for (built, at) in [(wall(-80.0), -80.0), (roof, 103.0)] {
            let mut scene = hills(60);
            scene.push(built);
            let (bounds, part) = part_of(&scene);
            assert!(part.size().x < 0.2 * bounds.size().x, "{part:?}");
            assert!((part.min.x..part.max.x).contains(&at), "{part:?}");
        }
    }

    #[test]
    fn land_alone_and_a_site_full_of_houses_are_left_whole() {
        let land = hills(60);
        let (bounds, part) = part_of(&land);
        assert_eq!(part, bounds);
        let mut town = land;
        for x in [-250.0, 0.0, 250.0] {
            let house = Aabb::new(DVec3::new(x, -2.0, -x), DVec3::new(x + 9.0, 7.0, 9.0 - x));
            town.extend(house.triangles());
        }
        let (bounds, part) = part_of(&town);
        assert_eq!(part, bounds);
    }
}
