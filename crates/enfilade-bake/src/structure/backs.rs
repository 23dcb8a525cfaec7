//! Back faces: what one sees of surfaces from inside matter.

use enfilade_geom::{Allowance, Bvh, DVec3, Ray};

/// Spaces in which no ball of this radius fits are matter when most rays see back faces. [Units: wu]
const NARROW: f64 = 0.5;
/// From inside matter more than this share of the rays that meet anything meet a back face first.
pub(crate) const BACKS: f64 = 0.6;

/// Whether a space that nothing can get into is too narrow for a room: `widest` is the radius of the largest ball that
/// fits, `min_radius` that of the least room, `backs` the share of back faces that one sees from it.
pub(crate) fn is_crevice(widest: f64, min_radius: f64, backs: f64) -> bool {
    widest < min_radius || (backs > BACKS && widest < NARROW)
}

/// Along the axes and the diagonals, off them a little, so that rays do not run along edges.
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

/// Rays along the axes and the diagonals of each point.
pub(crate) fn rays_from(points: &[DVec3]) -> impl Iterator<Item = Ray> {
    let rays = |&origin: &DVec3| directions().map(move |direction| ray(origin, direction));
    points.iter().flat_map(rays)
}

/// Whether one sees back faces along all axes, both ways.
pub(crate) fn is_inside(surfaces: &Bvh, p: DVec3) -> bool {
    // Along an axis one coordinate is near 1, along a diagonal three are.
    let axes = directions().filter(|d| d.length_squared() < 2.0);
    surfaces.bounds().contains(p)
        && axes.into_iter().all(|direction| {
            let hit = surfaces.closest_hit(&ray(p, direction), |_| false);
            hit.is_some_and(|hit| !hit.front)
        })
}

/// What a ray costs, in units of [`Allowance`].
pub(crate) const WORK_A_RAY: u64 = 10;

/// Rays that meet a back, and rays that meet anything.
pub(crate) fn count_backs(bvh: &Bvh, points: &[DVec3], allowance: &Allowance) -> (f64, f64) {
    let (mut back, mut all) = (0.0, 0.0);
    for ray in rays_from(points).take_while(allowance.each(WORK_A_RAY)) {
        if let Some(hit) = bvh.closest_hit(&ray, |_| false) {
            all += 1.0;
            back += f64::from(u8::from(!hit.front));
        }
    }
    (back, all)
}
