//! Stairs: structure that bounds no room.
//!
//! A flight of stairs stands in a room like furniture, but is as large as a wall: treads without
//! risers fence off the space below them, and a winding flight pinches its room. So the flood ignores
//! stairs (Haumont et al. 2003, §6.1 leave out furniture for the same reason). Everything exact, above all
//! the cell complex, still includes them.

use enfilade_geom::scene::TriangleSource;
use enfilade_geom::{Aabb, MOST_FLIGHT_PLAN, Triangle, are_treads, is_flight, shells};

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
        // A whole building may be one object.
        let mut groups = vec![members];
        if size.x * size.z > MOST_FLIGHT_PLAN {
            let own: Vec<Triangle> = groups[0].iter().map(|&t| triangles[t]).collect();
            let (shell_of, n) = shells(&own);
            let all = std::mem::replace(&mut groups, vec![Vec::new(); n]);
            for (t, shell) in all.into_iter().flatten().zip(shell_of) {
                groups[shell as usize].push(t);
            }
        }
        let parts: Vec<Vec<Triangle>> = groups
            .iter()
            .map(|group| group.iter().map(|&t| triangles[t]).collect())
            .collect();
        let are_treads = are_treads(&parts);
        for ((group, part), is_tread) in groups.iter().zip(&parts).zip(are_treads) {
            if is_tread || is_flight(part) {
                group.iter().for_each(|&t| is_stair[t] = true);
            }
        }
    }
    is_stair
}

fn bounds(triangles: &[Triangle], members: &[usize]) -> Aabb {
    Aabb::of_points(members.iter().flat_map(|&t| &triangles[t]))
}

#[cfg(test)]
mod tests {
    use enfilade_geom::DVec3;

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

    /// Boards without anything between them, and a floor of 10 m.
    fn loose_treads(n: usize) -> Vec<Triangle> {
        let mut out = Vec::new();
        for i in 0..n {
            let low = DVec3::new(i as f64 * 0.28, i as f64 * 0.18, 0.0);
            let high = low + DVec3::Y * 0.04;
            let (x, z, up) = (DVec3::X * 0.28, DVec3::Z, high - low);
            quad(&mut out, high, z, x);
            quad(&mut out, low, x, z);
            for (at, along) in [(low, x), (low + z, x), (low, z), (low + x, z)] {
                quad(&mut out, at, along, up);
            }
        }
        let floor = DVec3::new(0.0, -1.0, 0.0);
        quad(&mut out, floor, DVec3::Z * 10.0, DVec3::X * 10.0);
        out
    }

    #[test]
    fn treads_without_stringers_in_one_large_mesh_are_a_flight() {
        let building = loose_treads(8);
        let found = find_stairs(&sources(98), &building);
        assert!(found[..96].iter().all(|&s| s));
        assert_eq!(found[96..], [false, false]);
        let two_steps = find_stairs(&sources(38), &loose_treads(3));
        assert!(!two_steps.contains(&true));
        // Level triangles of terrain.
        let mut hill = treads(8, 0.5);
        hill.extend(&building[96..]);
        assert!(!find_stairs(&sources(18), &hill).contains(&true));
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
