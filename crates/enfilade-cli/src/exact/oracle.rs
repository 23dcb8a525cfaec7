//! What a pixel shows by exact sight lines, to tell what culling lost from what an adapter rounds.
//!
//! Adapters round corners to a grid of 1/256 pixel before they fill triangles. Where two triangles
//! share an edge, or a hidden one ends at it, which of them a pixel on that edge shows is a rounding;
//! and pictures with more triangles have more such edges. So each pixel that differs is asked of a ray
//! in 64-bit arithmetic: it is lost unless the ray, moved by less than a 64th of a pixel, says that
//! what was drawn is right.

use enfilade::cpg::World;
use enfilade::geom::scene::Primitive;
use enfilade::geom::{Bvh, DMat4, DVec3, Ray, Triangle};
use enfilade_render::Camera;

/// How far a sight line is moved, in pixels: a little over what adapters round by.
const NUDGE: f64 = 1.0 / 64.0;

/// The triangles of a world, those that hide and those that do not.
pub(super) struct Oracle {
    solid: Bvh,
    transparent: Bvh,
    tolerance: f64,
}

fn dvec(p: [f32; 3]) -> DVec3 {
    DVec3::new(p[0].into(), p[1].into(), p[2].into())
}

impl Oracle {
    pub(super) fn new(world: &World, tolerance: f64) -> Self {
        let mut triangles: [Vec<Triangle>; 2] = [Vec::new(), Vec::new()];
        let mut add = |primitive: &Primitive, place: &dyn Fn(DVec3) -> DVec3| {
            let material = primitive.material.and_then(|m| world.materials.get(m as usize));
            let to = &mut triangles[usize::from(material.is_some_and(|m| m.transparent))];
            for t in primitive.indices.chunks_exact(3) {
                to.push([0, 1, 2].map(|k| place(dvec(primitive.positions[t[k] as usize]))));
            }
        };
        for batch in &world.batches {
            add(&batch.primitive, &|p| p);
        }
        for detail in &world.details {
            let m = DMat4::from_cols_array(&detail.transform.map(f64::from));
            for primitive in &world.detail_meshes[detail.mesh as usize].primitives {
                add(primitive, &|p| m.transform_point3(p));
            }
        }
        Self {
            solid: Bvh::build(&triangles[0]),
            transparent: Bvh::build(&triangles[1]),
            tolerance,
        }
    }

    /// Whether an eye is so near to a surface that the near plane cuts it.
    pub(super) fn is_at_surface(&self, eye: [f32; 3]) -> bool {
        let near = f64::from(Camera::NEAR) * 8.0;
        [&self.solid, &self.transparent]
            .iter()
            .any(|b| b.nearest(dvec(eye), near).is_some())
    }

    /// Whether what is drawn at a pixel, `found` meters away along the view direction (infinity for
    /// the sky), is right but for less than a 64th of a pixel.
    pub(super) fn is_right(
        &self,
        camera: &Camera,
        at: [u32; 2],
        size: [u32; 2],
        found: f64,
        is_transparent: bool,
    ) -> bool {
        let same = |a: f64, b: f64| {
            (a.is_infinite() && b.is_infinite())
                // Rounding of places, and of depths in 32 bits.
                || (a - b).abs() <= 2.0 * self.tolerance + 4e-6 * a.abs()
        };
        if same(self.distance(camera, at, [0.0; 2], size, is_transparent), found) {
            return true;
        }
        // Nearby: the place where an oblique surface is met moves as well.
        let near = |a: f64, b: f64| same(a, b) || (a - b).abs() <= 0.02 * a.min(b);
        (0..16).any(|i| {
            let angle = f64::from(i) * std::f64::consts::FRAC_PI_8;
            let nudge = [angle.cos() * NUDGE, angle.sin() * NUDGE];
            near(self.distance(camera, at, nudge, size, is_transparent), found)
        })
    }

    /// Whether an exact ray through the middle of the pixel meets first what is `shown` that many
    /// meters away.
    ///
    /// More is allowed for than in [`Oracle::is_right`]: 0.1 % of the distance, which is what a 256th of a
    /// pixel is on a floor seen at 1 degree. Cracks lead centimeters behind a wall.
    pub(super) fn is_met(
        &self,
        camera: &Camera,
        at: [u32; 2],
        size: [u32; 2],
        shown: f64,
        is_transparent: bool,
    ) -> bool {
        let met = self.distance(camera, at, [0.0; 2], size, is_transparent);
        (met.is_infinite() && shown.is_infinite())
            || (met - shown).abs() <= 2.0 * self.tolerance + 1e-3 * met.abs()
    }

    /// How far away along the view direction the first surface is. [Units: wu]
    fn distance(
        &self,
        camera: &Camera,
        at: [u32; 2],
        nudge: [f64; 2],
        size: [u32; 2],
        is_transparent: bool,
    ) -> f64 {
        let [right, up, forward] = camera.axes().map(|v| dvec(v.to_array()));
        let tan = f64::from(camera.fov_y * 0.5).tan();
        let [w, h] = size.map(f64::from);
        let x = (f64::from(at[0]) + 0.5 + nudge[0]) / w * 2.0 - 1.0;
        let y = 1.0 - (f64::from(at[1]) + 0.5 + nudge[1]) / h * 2.0;
        let direction = forward + right * (x * tan * w / h) + up * (y * tan);
        let ray = Ray {
            origin: dvec(camera.eye) + direction * f64::from(Camera::NEAR),
            direction,
            t_max: f64::INFINITY,
        };
        let first = |bvh: &Bvh| bvh.closest_hit(&ray, |_| false).map_or(f64::INFINITY, |h| h.t);
        let solid = first(&self.solid);
        let t = if is_transparent {
            let t = first(&self.transparent);
            if t < solid { t } else { f64::INFINITY }
        } else {
            solid
        };
        t + f64::from(Camera::NEAR)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::cpg::Batch;

    /// A wall 5 m ahead, from x = 0 on to the right.
    fn wall() -> World {
        let primitive = Primitive {
            positions: vec![[0.0, -9.0, -5.0], [9.0, -9.0, -5.0], [9.0, 9.0, -5.0], [0.0, 9.0, -5.0]],
            indices: vec![0, 1, 2, 0, 2, 3],
            ..Primitive::default()
        };
        World {
            batches: vec![Batch { cells: Vec::new(), primitive }],
            ..World::default()
        }
    }

    #[test]
    fn only_what_an_exact_ray_shows_is_right() {
        let oracle = Oracle::new(&wall(), 1e-4);
        // 4 pixels wide: the wall's edge is between the second and the third.
        let camera = Camera::looking_at([0.0; 3], [0.0, 0.0, -1.0]);
        let right = |x, d| oracle.is_right(&camera, [x, 2], [4, 4], d, false);
        assert!(right(2, 5.0) && !right(2, f64::INFINITY) && !right(2, 4.0));
        assert!(right(1, f64::INFINITY) && !right(1, 5.0));
    }

    #[test]
    fn on_an_edge_both_sides_are_right() {
        let oracle = Oracle::new(&wall(), 1e-4);
        let camera = Camera::looking_at([0.0; 3], [0.0, 0.0, -1.0]);
        // 5 pixels: the middle of the third is on the edge.
        for d in [5.0, f64::INFINITY] {
            assert!(oracle.is_right(&camera, [2, 2], [5, 5], d, false));
        }
        assert!(!oracle.is_right(&camera, [2, 2], [5, 5], 7.0, false));
    }

    #[test]
    fn what_is_behind_a_wall_is_not_met() {
        let oracle = Oracle::new(&wall(), 1e-4);
        let camera = Camera::looking_at([0.0; 3], [0.0, 0.0, -1.0]);
        let met = |d| oracle.is_met(&camera, [2, 2], [4, 4], d, false);
        assert!(met(5.0) && !met(5.02) && !met(f64::INFINITY));
    }

    #[test]
    fn an_eye_at_a_wall_is_known() {
        let oracle = Oracle::new(&wall(), 1e-4);
        assert!(oracle.is_at_surface([1.0, 0.0, -4.99999]));
        assert!(!oracle.is_at_surface([1.0, 0.0, -4.9]));
    }
}
