//! The built-up parts of a site: the boxes outside of which there is nothing but open land.
//!
//! A house on a square kilometer of terrain takes a millionth of the site's volume, but voxels small enough for its doors
//! would have to fill all of it. Open land bounds no rooms, and shows it in plan: it is one surface, with nothing above it, and
//! not steep. So the plan is divided into squares; those with a wall, or with space between two surfaces in which something
//! could be, are built up. Built-up squares with nothing but land between them are buildings of their own.
//!
//! Cost: linear in the squares that triangles touch, at most [`MOST`], and quadratic in the buildings, at most
//! [`MOST_BUILDINGS`]; scenes with more are not divided. Errs towards too much: cliffs, bridges and caves count as built up.

use std::collections::BTreeMap;

use enfilade_geom::{Aabb, Allowance, Attitude, DVec3, Sets, Triangle, triangle_area_normal};

/// Edge of a square. [Units: wu]
const SQUARE: f64 = 2.0;
/// Most squares along one side of the plan.
const MOST_ALONG: f64 = 2048.0;
/// Most squares of all triangles together: a few hundred megabytes.
const MOST: usize = 1 << 24;
/// Land around what is built: as far as measures of openings reach, and a wide yard. [Units: wu]
const MARGIN: f64 = 8.0;
/// Upright triangles are walls if they are as high as this within a square. [Units: wu]
const WALL: f64 = 1.0;
/// Most buildings of a site.
const MOST_BUILDINGS: usize = 1 << 12;
/// Parts must be smaller than the whole by this factor, in volume: otherwise nothing is gained.
const GAIN: f64 = 4.0;

/// A built-up part of a site.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Site {
    /// All that is built; the whole box if nothing is told apart.
    pub(crate) core: Aabb,
    /// The core with the land around it, as high as all that is in its plan.
    pub(crate) bounds: Aabb,
}

impl Site {
    /// Returns the box around two sites and what is between them.
    pub(crate) fn union(self, other: Self) -> Self {
        Self {
            core: self.core.union(other.core),
            bounds: self.bounds.union(other.bounds),
        }
    }

    fn whole(bounds: &Aabb) -> Self {
        let bounds = *bounds;
        let core = bounds;
        Self { core, bounds }
    }
}

/// A triangle in a square of the plan.
struct Patch {
    square: u32,
    /// Heights between which it is there. [Units: wu]
    low: f32,
    high: f32,
    is_wall: bool,
}

/// Returns the buildings within `bounds`: all of it if nothing is built, or if they are not much smaller; one for all if
/// that is hardly larger. Space between two surfaces counts if it is higher than `opening`.
///
/// The boxes do not overlap in plan.
pub(crate) fn sites(
    triangles: &[Triangle],
    bounds: &Aabb,
    opening: f64,
    allowance: &Allowance,
) -> Vec<Site> {
    let (square, n) = plan_of(bounds);
    let whole = vec![Site::whole(bounds)];
    let Some(mut patches) = patches_of(triangles, bounds, square, n, allowance) else {
        return whole;
    };
    let built = built_squares(&mut patches, opening);
    let corner = |at: u32| {
        let [x, z] = [at as usize % n[0], at as usize / n[0]].map(|k| k as f64 * square);
        bounds.min + DVec3::new(x, 0.0, z)
    };
    let cores = connected(&built, n[0]).into_iter().map(|squares| {
        squares.iter().fold(Aabb::EMPTY, |b, &at| {
            b.including(corner(at))
                .including(corner(at) + DVec3::new(square, 0.0, square))
        })
    });
    let Some(cores) = apart(cores.collect(), allowance) else {
        return whole;
    };
    let site = |core: &Aabb| {
        let wide = core.expanded(MARGIN);
        let (mut low, mut high) = (f64::MAX, f64::MIN);
        for patch in &patches {
            let middle = corner(patch.square) + 0.5 * square;
            if (wide.min.x..=wide.max.x).contains(&middle.x)
                && (wide.min.z..=wide.max.z).contains(&middle.z)
            {
                low = low.min(patch.low.into());
                high = high.max(patch.high.into());
            }
        }
        let part = |b: &Aabb| {
            Aabb::new(
                DVec3::new(b.min.x, low, b.min.z).max(bounds.min),
                DVec3::new(b.max.x, high, b.max.z).min(bounds.max),
            )
        };
        Site {
            core: part(core),
            bounds: part(&wide),
        }
    };
    let volume = |sites: &[Site]| -> f64 {
        let volume = |s: &Site| (s.bounds.size() + 2.0 * MARGIN).element_product();
        sites.iter().map(volume).sum()
    };
    let all = cores.iter().fold(Aabb::EMPTY, |b, core| b.union(*core));
    let together = vec![site(&all)];
    let each: Vec<Site> = if cores.len() > 1 {
        cores.iter().map(site).collect()
    } else {
        together.clone()
    };
    let sites = if GAIN * volume(&each) <= volume(&together) {
        each
    } else {
        together
    };
    if GAIN * volume(&sites) <= volume(&whole) {
        sites
    } else {
        whole
    }
}

/// Returns the edge of a square, and the number of squares along x and z.
fn plan_of(bounds: &Aabb) -> (f64, [usize; 2]) {
    let size = bounds.size();
    let square = SQUARE.max(size.x.max(size.z) / MOST_ALONG);
    let n = [size.x, size.z].map(|s| (s / square).ceil().max(1.0) as usize);
    (square, n)
}

/// Returns `true` if triangles are open land and nothing else.
pub(crate) fn is_bare(
    triangles: &[Triangle],
    bounds: &Aabb,
    opening: f64,
    allowance: &Allowance,
) -> bool {
    let (square, n) = plan_of(bounds);
    let patches = patches_of(triangles, bounds, square, n, allowance);
    patches.is_some_and(|mut patches| built_squares(&mut patches, opening).is_empty())
}

/// Returns the squares that are built up, ascending, and sorts the patches by square.
fn built_squares(patches: &mut [Patch], opening: f64) -> Vec<u32> {
    patches.sort_unstable_by(|a, b| a.square.cmp(&b.square).then(a.low.total_cmp(&b.low)));
    let built = patches
        .chunk_by(|a, b| a.square == b.square)
        .filter(|here| is_built(here, opening))
        .map(|here| here[0].square);
    built.collect()
}

/// Returns `true` if there is a wall in a square, or space between two surfaces, given what is there from below.
fn is_built(here: &[Patch], opening: f64) -> bool {
    let mut top = here[0].high;
    let is_covered = here.iter().any(|patch| {
        let is_above = f64::from(patch.low - top) > opening;
        top = top.max(patch.high);
        is_above
    });
    is_covered || here.iter().any(|patch| patch.is_wall)
}

/// Returns the sets of squares, ascending, that share edges or vertices, in a plan of `nx` columns.
fn connected(squares: &[u32], nx: usize) -> Vec<Vec<u32>> {
    let nx = nx as u32;
    let mut sets = Sets::new(squares.len());
    for (i, &at) in squares.iter().enumerate() {
        let before = [
            (at % nx > 0).then(|| at.wrapping_sub(1)),
            at.checked_sub(nx + 1).filter(|_| at % nx > 0),
            at.checked_sub(nx),
            at.checked_sub(nx - 1).filter(|_| at % nx + 1 < nx),
        ];
        for next in before.into_iter().flatten() {
            if let Ok(j) = squares.binary_search(&next) {
                sets.join(i as u32, j as u32);
            }
        }
    }
    let mut of: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (&at, set) in squares.iter().zip(sets.into_least()) {
        of.entry(set).or_default().push(at);
    }
    of.into_values().collect()
}

/// Unites boxes whose margins overlap in plan, until none do; `None` if there are none, or too many.
fn apart(mut cores: Vec<Aabb>, allowance: &Allowance) -> Option<Vec<Aabb>> {
    let meet = |a: &Aabb, b: &Aabb| {
        let [a, b] = [a, b].map(|c| c.expanded(MARGIN));
        a.min.x <= b.max.x && b.min.x <= a.max.x && a.min.z <= b.max.z && b.min.z <= a.max.z
    };
    // Fence posts and trees would be thousands of buildings, most of them near others.
    let mut apart: Vec<Aabb> = Vec::new();
    while let Some(mut core) = cores.pop() {
        if apart.len() > MOST_BUILDINGS || !allowance.spend(1 + apart.len() as u64 / 16) {
            return None;
        }
        let n = apart.len();
        apart.retain(|other| {
            let is_met = meet(&core, other);
            if is_met {
                core = core.union(*other);
            }
            !is_met
        });
        if apart.len() < n {
            cores.push(core); // it has grown, and may meet others
        } else {
            apart.push(core);
        }
    }
    apart.sort_by(|a, b| {
        a.min
            .z
            .total_cmp(&b.min.z)
            .then(a.min.x.total_cmp(&b.min.x))
    });
    (!apart.is_empty()).then_some(apart)
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
        let is_steep = Attitude::of(normal) == Attitude::Upright;
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

    fn sites_of(triangles: &[Triangle]) -> (Aabb, Vec<Site>) {
        let bounds = Aabb::of_points(triangles.as_flattened());
        let sites = sites(triangles, &bounds, 0.6, &Allowance::default());
        (bounds, sites)
    }

    fn part_of(triangles: &[Triangle]) -> (Aabb, Aabb) {
        let (bounds, sites) = sites_of(triangles);
        assert_eq!(sites.len(), 1);
        (bounds, sites[0].bounds)
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
        let mut pit = land;
        let hall = Aabb::new(DVec3::splat(-280.0), DVec3::splat(280.0));
        pit.extend(hall.triangles());
        let (bounds, part) = part_of(&pit);
        assert_eq!(part, bounds);
    }

    #[test]
    fn houses_far_apart_are_sites_of_their_own_and_those_close_by_are_one() {
        let mut town = hills(60);
        let house = |x: f64| Aabb::new(DVec3::new(x, -2.0, -x), DVec3::new(x + 9.0, 7.0, 9.0 - x));
        for x in [-250.0, 0.0, 250.0] {
            // A shed 5 m beside each.
            let main = house(x);
            let shed = Aabb::new(main.min + DVec3::X * 14.0, main.max + DVec3::X * 14.0);
            town.extend([main, shed].iter().flat_map(Aabb::triangles));
        }
        let (bounds, sites) = sites_of(&town);
        assert_eq!(sites.len(), 3, "{sites:?}");
        for (site, x) in sites.iter().zip([250.0, 0.0, -250.0]) {
            let is_in = |b: &Aabb, p: DVec3| b.contains(p) && bounds.contains(p);
            let (first, last) = (house(x).min, house(x).max + DVec3::X * 14.0);
            assert!(is_in(&site.core, first) && is_in(&site.core, last));
            assert!(is_in(&site.bounds, site.core.min) && is_in(&site.bounds, site.core.max));
            assert!(site.bounds.size().x < 23.0 + 2.0 * (MARGIN + SQUARE) + 1.0);
        }
        // Two of three houses next to each other: one grid for all would not be much larger.
        let mut pair = hills(60);
        pair.extend(house(0.0).triangles());
        pair.extend(house(40.0).triangles());
        assert_eq!(sites_of(&pair).1.len(), 1);
    }
}
