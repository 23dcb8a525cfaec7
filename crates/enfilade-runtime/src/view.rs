//! The eye: its position, direction and field of view.
//!
//! A view is a map from world to clip space with the eye at the origin: `q = F · (p - eye)` gives
//! `q = (x, y, w)`, and the visible part has `|x| <= w` and `|y| <= w`. Depth is `w`, in meters along
//! the view direction. No division takes place here: points beside and behind the eye (`w <= 0`) are
//! ordinary points, and clipping deals with them.
//!
//! A view of 180 degrees or more has no such map. It is replaced by the six faces of a cube, which hold
//! all directions: a superset.

use glam::{DMat3, DVec3};

use enfilade_geom::{DMat4, Similarity};

/// Widest angle between opposite sides of a view with one face; wider views look all around.
/// [Units: rad]
///
/// At 170 degrees the screen is 11 times as wide as it is far; beyond, its middle is so small that a
/// cube of six faces narrows better.
const MAX_FOV: f64 = 170.0 / 180.0 * std::f64::consts::PI;

/// Reason why a view is invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// Eye, direction or matrix holds a number that is not finite.
    #[error("the view's {what} is not finite")]
    NotFinite {
        /// Its name.
        what: &'static str,
    },
    /// The view direction is zero.
    #[error("the view has no direction: the point looked at must differ from the eye")]
    NoDirection,
    /// An angle or aspect ratio is not positive.
    #[error("the view's {what} is {value}; it must be greater than 0")]
    NotPositive {
        /// Its name.
        what: &'static str,
        /// Its value.
        value: f32,
    },
    /// The matrix is not a perspective projection, or has another eye.
    #[error("the matrix is not a perspective projection with the given eye")]
    NotPerspective,
}

/// One face of a view: a map from world to clip space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face {
    /// `q = map · (p - eye)`; the third row, which gives `w`, has unit length.
    pub(crate) map: DMat3,
    /// Maps normals of world planes to clip space: the inverse transpose of `map`.
    pub(crate) normals: DMat3,
    /// Largest change of `a x + b y + c w` for a step of one meter in the world, where `(a, b)` has
    /// unit length and `|c|` is at most that of a line that meets the screen.
    pub(crate) stretch: f64,
}

impl Face {
    fn new(map: DMat3) -> Option<Self> {
        let rows = map.transpose();
        let scale = 1.0 / rows.z_axis.length();
        let map = map * scale;
        let inverse = map.inverse();
        if !(scale.is_finite() && map.is_finite() && inverse.is_finite()) {
            return None;
        }
        let rows = map.transpose();
        // |a r0 + b r1| <= hypot(|r0|, |r1|); a line that meets [-1, 1]² has |c| <= sqrt 2.
        let stretch = rows.x_axis.length().hypot(rows.y_axis.length()) + std::f64::consts::SQRT_2;
        Some(Self {
            map,
            normals: inverse.transpose(),
            stretch,
        })
    }
}

/// Position, direction and field of view of an eye.
#[derive(Clone, Debug)]
pub struct View {
    pub(crate) eye: DVec3,
    pub(crate) faces: [Face; 6],
    pub(crate) n_faces: usize,
    /// Nothing farther along the view direction is seen; infinite for no limit.
    pub(crate) far: f64,
}

fn finite(v: [f32; 3], what: &'static str) -> Result<DVec3, ViewError> {
    let v = DVec3::new(v[0].into(), v[1].into(), v[2].into());
    if v.is_finite() {
        Ok(v)
    } else {
        Err(ViewError::NotFinite { what })
    }
}

impl View {
    /// Makes a camera at `eye` that looks along `toward` (any length), with `up` upwards.
    ///
    /// `fov_y` is the vertical field of view [Units: rad] [Limit: above 0], `aspect` the width of the picture
    /// divided by its height [Limit: above 0]. A view wider or higher than 170 degrees looks
    /// [all around](View::around), which contains it.
    ///
    /// If `up` is zero or parallel to `toward`, another direction replaces it.
    ///
    /// # Errors
    ///
    /// If a value is not finite, `toward` is zero, or `fov_y` or `aspect` is not positive.
    pub fn perspective(
        eye: [f32; 3],
        toward: [f32; 3],
        up: [f32; 3],
        fov_y: f32,
        aspect: f32,
    ) -> Result<Self, ViewError> {
        let at = finite(eye, "eye")?;
        let forward = finite(toward, "direction")?;
        let up = finite(up, "up direction")?;
        for (what, value) in [("angle", fov_y), ("aspect", aspect)] {
            if value.is_nan() || value <= 0.0 {
                return Err(ViewError::NotPositive { what, value });
            }
        }
        let forward = forward.try_normalize().ok_or(ViewError::NoDirection)?;
        let tan_y = (f64::from(fov_y) * 0.5).tan();
        let tan_x = tan_y * f64::from(aspect);
        let limit = (MAX_FOV * 0.5).tan();
        // A tangent beyond 90 degrees is negative.
        if f64::from(fov_y) > MAX_FOV || tan_x.is_nan() || tan_x > limit {
            return Self::around(eye);
        }
        let right = forward
            .cross(up.normalize_or_zero())
            .try_normalize()
            .filter(|r| r.is_finite() && forward.cross(up.normalize_or_zero()).length() > 1e-6)
            .unwrap_or_else(|| forward.any_orthonormal_vector());
        let up = right.cross(forward);
        let rows = DMat3::from_cols(right / tan_x, up / tan_y, forward);
        Self::of_face(at, rows.transpose()).ok_or(ViewError::NotPerspective)
    }

    /// Makes the camera of an engine from its `view_projection` matrix (column-major, world to clip, either
    /// direction of depth, with or without a far plane) and its `eye`.
    ///
    /// Only the rows of `x`, `y` and `w` are used; near and far planes are not. The eye is a parameter because
    /// it can be recovered from a matrix in `f32` only to about a millimeter.
    ///
    /// # Errors
    ///
    /// If a value is not finite, or the matrix is orthographic, singular, or has another eye.
    pub fn from_view_projection(
        eye: [f32; 3],
        view_projection: [[f32; 4]; 4],
    ) -> Result<Self, ViewError> {
        let at = finite(eye, "eye")?;
        let m = DMat4::from_cols_array_2d(&view_projection.map(|c| c.map(f64::from)));
        if !m.is_finite() {
            return Err(ViewError::NotFinite { what: "matrix" });
        }
        let row = |i: usize| m.row(i);
        let rows = [row(0), row(1), row(3)];
        let map = DMat3::from_cols(rows[0].truncate(), rows[1].truncate(), rows[2].truncate())
            .transpose();
        // At the eye, x, y and w vanish up to the rounding of the matrix.
        for r in rows {
            let (direction, offset) = (r.truncate(), r.w);
            let size = direction.length() * (1.0 + at.length()) + offset.abs();
            if (direction.dot(at) + offset).abs() > 1e-3 * size {
                return Err(ViewError::NotPerspective);
            }
        }
        Self::of_face(at, map).ok_or(ViewError::NotPerspective)
    }

    /// Looks in every direction from `eye`: for shadows, sound, or everything that can be seen from a point.
    ///
    /// # Errors
    ///
    /// If `eye` is not finite.
    pub fn around(eye: [f32; 3]) -> Result<Self, ViewError> {
        let at = finite(eye, "eye")?;
        let face = |x: DVec3, y: DVec3, w: DVec3| Face::new(DMat3::from_cols(x, y, w).transpose());
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let faces = [
            face(y, z, x),
            face(y, z, -x),
            face(z, x, y),
            face(z, x, -y),
            face(x, y, z),
            face(x, y, -z),
        ];
        let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] = faces else {
            return Err(ViewError::NotPerspective);
        };
        Ok(Self {
            eye: at,
            faces: [a, b, c, d, e, f],
            n_faces: 6,
            far: f64::INFINITY,
        })
    }

    /// Returns the view cut off `far` meters along the view direction; in a view all around, each face is cut by
    /// its own plane. [Units: wu] [Limit: above 0]
    ///
    /// # Errors
    ///
    /// If `far` is not greater than 0: nothing could be seen.
    pub fn with_far(mut self, far: f32) -> Result<Self, ViewError> {
        if far.is_nan() || far <= 0.0 {
            return Err(ViewError::NotPositive {
                what: "far plane",
                value: far,
            });
        }
        self.far = far.into();
        Ok(self)
    }

    /// Returns the position of the eye. [Units: wu]
    #[must_use]
    pub fn eye(&self) -> [f32; 3] {
        self.eye.as_vec3().to_array()
    }

    /// Returns the position of the eye, which a view in another frame has in `f64`. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn exact_eye(&self) -> DVec3 {
        self.eye
    }

    /// Returns the view in another frame: `map` maps that frame to this one. Seen by a reflection, left and right are exchanged
    /// in the frame, not on the screen.
    #[must_use]
    #[doc(hidden)]
    pub fn in_frame(&self, map: &Similarity) -> Self {
        let mut view = self.clone();
        view.eye = map.point_back(self.eye);
        view.far = self.far / map.scale.abs();
        // Depth is a distance in the frame, so the scale has no part in it.
        let turn = DMat3::from_quat(map.turn) * map.scale.signum();
        for face in &mut view.faces {
            face.map *= turn;
            face.normals *= turn;
        }
        view
    }

    /// Returns the largest number of pixels per meter anywhere in a sphere in view, in a picture of `size`: for levels of
    /// detail. First order in displacements, which are small where it matters.
    ///
    /// Infinite if the sphere reaches behind the eye, and for views all around, which are not pictures.
    #[must_use]
    #[doc(hidden)]
    pub fn pixels_per_meter(&self, center: [f32; 3], radius: f32, size: [u32; 2]) -> f32 {
        let center = DVec3::from_array(center.map(f64::from));
        let rows = self.faces[0].map.transpose();
        let depth = rows.z_axis.dot(center - self.eye) - f64::from(radius);
        if self.n_faces > 1 || depth.is_nan() || depth <= 0.0 {
            return f32::INFINITY;
        }
        // A step e moves x / w by (row x - x / w row w) e / w, with |x / w| <= 1, and row w of unit length.
        let per_axis = [(rows.x_axis, size[0]), (rows.y_axis, size[1])].map(|(row, n)| {
            let across = row - row.dot(rows.z_axis) * rows.z_axis;
            let along = row.dot(rows.z_axis).abs() + 1.0;
            across.length().hypot(along) * f64::from(n) / 2.0
        });
        (per_axis[0].hypot(per_axis[1]) / depth) as f32
    }

    /// Returns the number of faces: 1, or 6 if it looks all around.
    #[must_use]
    #[doc(hidden)]
    pub fn n_faces(&self) -> usize {
        self.n_faces
    }

    fn of_face(eye: DVec3, map: DMat3) -> Option<Self> {
        let face = Face::new(map)?;
        Some(Self {
            eye,
            faces: [face; 6],
            n_faces: 1,
            far: f64::INFINITY,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const EYE: [f32; 3] = [1.0, 2.0, 3.0];
    const UP: [f32; 3] = [0.0, 1.0, 0.0];

    #[test]
    fn vertices_of_the_picture_map_to_those_of_the_screen() {
        let view = View::perspective(EYE, [0.0, 0.0, -2.0], UP, 1.0, 2.0).unwrap();
        let t = f64::from(0.5_f32).tan();
        let p = view.eye + 3.0 * DVec3::new(2.0 * t, t, -1.0);
        let q = view.faces[0].map * (p - view.eye);
        assert!((q - DVec3::splat(3.0)).length() < 1e-6, "{q}");
    }

    #[test]
    fn a_matrix_gives_the_view_that_it_was_made_for() {
        let a = View::perspective(EYE, [1.0, 0.3, -2.0], UP, 1.0, 2.0).unwrap();
        let f = (0.5f64).tan().recip();
        let look = DMat4::look_to_rh(a.eye, DVec3::new(1.0, 0.3, -2.0).normalize(), DVec3::Y);
        let projection = DMat4::from_cols_array_2d(&[
            [f / 2.0, 0.0, 0.0, 0.0],
            [0.0, f, 0.0, 0.0],
            [0.0, 0.0, -1.0, -1.0],
            [0.0, 0.0, -0.1, 0.0],
        ]);
        let m = (projection * look).as_mat4().to_cols_array_2d();
        let b = View::from_view_projection(EYE, m).unwrap();
        let (p, q) = (a.faces[0].map, b.faces[0].map);
        assert!(p.abs_diff_eq(q, 1e-6), "{p} {q}");
        assert_eq!(
            View::from_view_projection([9.0, 9.0, 9.0], m).unwrap_err(),
            ViewError::NotPerspective
        );
        let flat = DMat4::orthographic_rh(-1.0, 1.0, -1.0, 1.0, 0.1, 9.0);
        let flat = flat.as_mat4().to_cols_array_2d();
        assert_eq!(
            View::from_view_projection(EYE, flat).unwrap_err(),
            ViewError::NotPerspective
        );
    }

    proptest! {
        #[test]
        fn a_small_step_in_view_covers_no_more_pixels_than_it_may(
            toward in prop::array::uniform3(-1_f32..1.0), fov in 0.2_f32..2.6, aspect in 0.3_f32..3.0,
            place in prop::array::uniform3(-1.0..1.0), far in 1.0..50.0, step in prop::array::uniform3(-1.0..1.0),
        ) {
            let Ok(view) = View::perspective(EYE, toward, UP, fov, aspect) else { return Ok(()) };
            prop_assume!(view.n_faces() == 1);
            let size = [1000.0, f64::from(1000.0 / aspect).round()];
            // A point in view.
            let map = view.faces[0].map;
            let [x, y, _] = place;
            let p = view.eye + map.inverse() * (far * DVec3::new(x, y, 1.0));
            let on_picture = |p: DVec3| {
                let q = map * (p - view.eye);
                [0, 1].map(|k| q[k] / q.z * size[k] / 2.0)
            };
            let step = 1e-6 * DVec3::from_array(step);
            let [a, b] = [on_picture(p), on_picture(p + step)];
            let pixels = (a[0] - b[0]).hypot(a[1] - b[1]);
            let most = view.pixels_per_meter(p.as_vec3().to_array(), 0.01, size.map(|n| n as u32));
            // Rounding error of a millionth of a meter.
            prop_assert!(pixels <= f64::from(most) * step.length() * 1.001 + 1e-9, "{pixels} {most}");
        }
    }

    #[test]
    fn how_large_a_meter_is_follows_the_distance() {
        let view = View::perspective(EYE, [0.0, 0.0, -1.0], UP, 1.0, 1.0).unwrap();
        let at = |d: f32, r| view.pixels_per_meter([EYE[0], EYE[1], EYE[2] - d], r, [100, 100]);
        assert!((at(20.0, 0.0) * 2.0 - at(10.0, 0.0)).abs() < 1e-3);
        assert_eq!(at(20.0, 10.0), at(10.0, 0.0));
        assert_eq!(at(1.0, 2.0), f32::INFINITY);
        assert_eq!(at(-1.0, 0.5), f32::INFINITY);
        assert_eq!(at(f32::NAN, 0.5), f32::INFINITY);
        // At most twice the exact number: straight ahead it is 100 / 2 / tan 0.5 at a distance of one meter.
        assert!(at(1.0, 0.0) < 2.0 * 50.0 / 0.5_f32.tan());
        assert_eq!(
            View::around(EYE)
                .unwrap()
                .pixels_per_meter([0.0; 3], 0.0, [9, 9]),
            f32::INFINITY
        );
    }

    #[test]
    fn hostile_views_are_errors_or_look_all_around() {
        let view = |eye, toward, fov, aspect| View::perspective(eye, toward, UP, fov, aspect);
        let ahead = [0.0, 0.0, -1.0];
        assert_eq!(view(EYE, ahead, 3.2, 1.0).unwrap().n_faces(), 6);
        assert_eq!(view(EYE, ahead, 9.0, 1.0).unwrap().n_faces(), 6);
        assert_eq!(view(EYE, ahead, f32::INFINITY, 1.0).unwrap().n_faces(), 6);
        assert_eq!(view(EYE, ahead, 1.0, f32::INFINITY).unwrap().n_faces(), 6);
        assert_eq!(view(EYE, UP, 1.0, 1.0).unwrap().n_faces(), 1, "along up");
        assert_eq!(
            view(EYE, [0.0; 3], 1.0, 1.0).unwrap_err(),
            ViewError::NoDirection
        );
        let broken = [f32::NAN, 0.0, 0.0];
        assert!(view(broken, ahead, 1.0, 1.0).is_err());
        assert!(view(EYE, broken, 1.0, 1.0).is_err());
        for bad in [0.0, -1.0, f32::NAN] {
            assert!(view(EYE, ahead, bad, 1.0).is_err());
            assert!(view(EYE, ahead, 1.0, bad).is_err());
            assert!(View::around(EYE).unwrap().with_far(bad).is_err());
        }
    }
}
