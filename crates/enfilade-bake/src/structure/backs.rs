//! Back faces: evidence that a point lies inside matter.

use enfilade_geom::{Allowance, Bvh, DVec3, Ray};

use crate::budget::WORK_A_LOOK;

/// Sample points in a space, from which rays tell if it is a room.
pub(crate) const POINTS: usize = 32;
/// Returns directions along the axes and diagonals, slightly off, so that rays do not run along edges.
fn directions() -> impl Iterator<Item = DVec3> {
    let steps = || (-1..=1).map(f64::from);
    steps()
        .flat_map(move |x| steps().flat_map(move |y| steps().map(move |z| DVec3::new(x, y, z))))
        .filter(|d| d.length_squared() == 1.0 || d.length_squared() == 3.0)
        .map(|d| d + DVec3::new(0.013, 0.007, -0.011))
}

fn ray(origin: DVec3, direction: DVec3) -> Ray {
    Ray {
        origin,
        direction,
        t_max: f64::INFINITY,
    }
}

/// Returns rays from each point along the axes and the diagonals.
pub(crate) fn rays_from(points: &[DVec3]) -> impl Iterator<Item = Ray> {
    let rays = |&origin: &DVec3| directions().map(move |direction| ray(origin, direction));
    points.iter().flat_map(rays)
}

/// Returns `true` if rays from `p` along all axes, both ways, hit back faces.
pub(crate) fn is_inside(surfaces: &Bvh, p: DVec3) -> bool {
    // Along an axis one coordinate is near 1, along a diagonal three are.
    let axes = directions().filter(|d| d.length_squared() < 2.0);
    surfaces.bounds().contains(p)
        && axes.into_iter().all(|direction| {
            let hit = surfaces.closest_hit(&ray(p, direction), |_| false);
            hit.is_some_and(|hit| !hit.front)
        })
}

/// Returns the number of rays that hit a back face, and of rays that hit anything.
pub(crate) fn count_backs(bvh: &Bvh, points: &[DVec3], allowance: &Allowance) -> (f64, f64) {
    let (mut back, mut all) = (0.0, 0.0);
    for ray in rays_from(points).take_while(allowance.each(WORK_A_LOOK)) {
        if let Some(hit) = bvh.closest_hit(&ray, |_| false) {
            all += 1.0;
            back += f64::from(u8::from(!hit.front));
        }
    }
    (back, all)
}
