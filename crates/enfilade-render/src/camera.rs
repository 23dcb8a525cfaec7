//! Cameras and the projections that map world points to the screen.
//!
//! Depth runs from 1 at the near plane to 0 at infinity, in 32-bit floats, so that surfaces a millimeter apart stay
//! apart across a large building and nothing is clipped far away. The camera's position is subtracted from points
//! before any multiplication, so that large coordinates cost no precision.

use enfilade_cpg::MonitorCamera;
use enfilade_geom::{DVec3, Similarity};
use enfilade_runtime::{View, ViewError};
use enfilade_world::Pose;
use glam::{Mat4, Vec3, Vec4};

/// A perspective camera without roll: +Y is up in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position. [Units: wu]
    pub eye: [f32; 3],
    /// View direction, of any length.
    pub toward: [f32; 3],
    /// Vertical angle of view. [Units: rad] [Limit: above 0, below pi]
    pub fov_y: f32,
}

impl Camera {
    /// Distance of the near plane. [Units: wu]
    ///
    /// Depths are floats, finest near zero, which is infinitely far away. So this can be as small as the smallest
    /// distance between an eye and a wall that matters.
    pub const NEAR: f32 = 1e-4;

    /// Returns the distance along the view direction of a depth in an [`IdPicture`](crate::IdPicture). [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn distance_of(depth: f32) -> f32 {
        Self::NEAR / depth
    }

    /// Returns a camera at `eye` that looks at the point `at`, with a vertical angle of view of 60 degrees.
    #[must_use]
    pub fn looking_at(eye: [f32; 3], at: [f32; 3]) -> Self {
        Self {
            eye,
            toward: [0, 1, 2].map(|k| at[k] - eye[k]),
            fov_y: 60_f32.to_radians(),
        }
    }

    /// Returns the run-time's view for a picture `aspect` times as wide as high.
    ///
    /// # Errors
    ///
    /// A camera without a direction, with numbers that are not finite, or with an angle out of range.
    pub fn view(&self, aspect: f32) -> Result<View, ViewError> {
        View::perspective(self.eye, self.toward, [0.0, 1.0, 0.0], self.fov_y, aspect)
    }

    /// Returns the projection to the screen.
    ///
    /// # Errors
    ///
    /// As [`Camera::view`].
    pub fn projection(&self, aspect: f32) -> Result<Projection, ViewError> {
        self.view(aspect)?;
        Ok(Projection::perspective(
            Vec3::from(self.eye),
            self.axes(),
            self.fov_y,
            aspect,
        ))
    }

    /// Returns right, up and forward: orthogonal unit vectors.
    #[must_use]
    #[doc(hidden)]
    pub fn axes(&self) -> [Vec3; 3] {
        let forward = Vec3::from(self.toward).normalize_or(Vec3::NEG_Z);
        // Same as `View::perspective`, so that pictures and queries mean the same view.
        let right = forward.cross(Vec3::Y);
        let right = if right.length() > 1e-6 {
            right.normalize()
        } else {
            forward.as_dvec3().any_orthonormal_vector().as_vec3()
        };
        [right, right.cross(forward), forward]
    }

    /// Returns the four edges of the view pyramid, counter-clockwise from the lower left of the picture.
    #[must_use]
    #[doc(hidden)]
    pub fn corners(&self, aspect: f32) -> [Vec3; 4] {
        let [right, up, forward] = self.axes();
        let tan = (self.fov_y * 0.5).tan();
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| forward + right * (x * tan * aspect) + up * (y * tan))
    }
}

/// A map from world points to the screen.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    /// From points relative to `origin` to clip space.
    pub(crate) clip_from_relative: Mat4,
    pub(crate) origin: Vec3,
    /// Remainder of the origin beyond `f32`, for frames far from it. Added to `origin`.
    pub(crate) origin_low: Vec3,
    /// Origin of the lines of sight; far away for a parallel projection.
    pub(crate) eye: Vec3,
    pub(crate) is_parallel: bool,
}

impl Projection {
    /// Returns the projection of a camera with the given axes: right, up and forward.
    pub(crate) fn perspective(
        eye: Vec3,
        [right, up, forward]: [Vec3; 3],
        fov_y: f32,
        aspect: f32,
    ) -> Self {
        let focal = 1.0 / (fov_y * 0.5).tan();
        let rows = [
            (right * (focal / aspect)).extend(0.0),
            (up * focal).extend(0.0),
            Vec4::new(0.0, 0.0, 0.0, Camera::NEAR),
            forward.extend(0.0),
        ];
        Self {
            clip_from_relative: Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose(),
            origin: eye,
            origin_low: Vec3::ZERO,
            eye,
            is_parallel: false,
        }
    }

    /// Returns the projection of a monitor's camera; `None` if it has no direction.
    pub(crate) fn of_monitor(camera: &MonitorCamera, aspect: f32) -> Option<Self> {
        let toward = Vec3::from(camera.toward).as_dvec3();
        let forward = toward.try_normalize()?;
        let up = Vec3::from(camera.up).as_dvec3().normalize_or_zero();
        // Same as `View::perspective`.
        let right = forward.cross(up);
        let right = right.try_normalize().filter(|_| right.length() > 1e-6);
        let right = right.unwrap_or_else(|| forward.any_orthonormal_vector());
        let axes = [right, right.cross(forward), forward].map(|a| a.as_vec3());
        Some(Self::perspective(
            camera.eye.into(),
            axes,
            camera.fov_y,
            aspect,
        ))
    }

    /// Returns the same projection for points of another frame, which `map` maps to where they appear in this one.
    pub(crate) fn of_appearing(&self, map: &Similarity) -> Self {
        if *map == Similarity::IDENTITY {
            return *self;
        }
        let exact = map.point_back(self.exact_origin());
        let origin = exact.as_vec3();
        Self {
            clip_from_relative: self.clip_from_relative * Mat4::from_mat3(map.linear().as_mat3()),
            origin,
            origin_low: (exact - origin.as_dvec3()).as_vec3(),
            eye: origin,
            is_parallel: self.is_parallel,
        }
    }

    /// Returns a parallel projection along `toward` onto a picture `height` meters high with `center` in its middle. It
    /// contains points up to `depth` meters before and behind that center.
    #[must_use]
    pub fn parallel(
        center: [f32; 3],
        toward: [f32; 3],
        height: f32,
        aspect: f32,
        depth: f32,
    ) -> Self {
        let camera = Camera {
            eye: center,
            toward,
            fov_y: 1.0,
        };
        let [right, up, forward] = camera.axes();
        let half = height * 0.5;
        let rows = [
            (right / (half * aspect)).extend(0.0),
            (up / half).extend(0.0),
            // 1 at the near end, 0 at the far end.
            (forward * (-0.5 / depth)).extend(0.5),
            Vec4::W,
        ];
        let origin = Vec3::from(center);
        Self {
            clip_from_relative: Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose(),
            origin,
            origin_low: Vec3::ZERO,
            eye: origin - forward * depth,
            is_parallel: true,
        }
    }

    /// Returns the vector by which the product with a relative point is its distance ahead, for a perspective.
    pub(crate) fn ahead(&self) -> DVec3 {
        self.clip_from_relative.row(3).truncate().as_dvec3()
    }

    /// Returns the origin in full precision. [Units: wu]
    pub(crate) fn exact_origin(&self) -> DVec3 {
        self.origin.as_dvec3() + self.origin_low.as_dvec3()
    }

    /// Returns the same projection for points of another frame. `motion` maps that frame to this one.
    #[must_use]
    #[doc(hidden)]
    pub fn in_frame(&self, motion: &Pose) -> Self {
        if *motion == Pose::IDENTITY {
            return *self;
        }
        let exact = motion.point_back(self.exact_origin());
        let origin = exact.as_vec3();
        let eye = if self.is_parallel {
            motion.point_back(self.eye.as_dvec3()).as_vec3()
        } else {
            origin
        };
        Self {
            clip_from_relative: self.clip_from_relative
                * Mat4::from_mat3(motion.matrix3().as_mat3()),
            origin,
            origin_low: (exact - origin.as_dvec3()).as_vec3(),
            eye,
            is_parallel: self.is_parallel,
        }
    }

    /// Returns the position of a point in the picture, 0 to 1 from the upper left; `None` behind the eye.
    #[must_use]
    #[doc(hidden)]
    pub fn place(&self, p: [f32; 3]) -> Option<[f32; 2]> {
        let q = self.clip_from_relative * (Vec3::from(p) - self.origin).extend(1.0);
        (q.w > 1e-6).then(|| [0.5 + 0.5 * q.x / q.w, 0.5 - 0.5 * q.y / q.w])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_point_looked_at_is_in_the_middle_and_up_is_up() {
        let camera = Camera::looking_at([1.0, 2.0, 3.0], [4.0, 1.0, -2.0]);
        let p = camera.projection(1.5).unwrap();
        let [x, y] = p.place([4.0, 1.0, -2.0]).unwrap();
        assert!((x - 0.5).abs() < 1e-6 && (y - 0.5).abs() < 1e-6, "{x} {y}");
        let [_, above] = p.place([4.0, 1.5, -2.0]).unwrap();
        assert!(above < y);
        assert_eq!(p.place([0.0, 2.5, 8.0]), None, "behind the eye");
    }

    #[test]
    fn corners_of_the_view_are_corners_of_the_picture() {
        let camera = Camera::looking_at([0.0; 3], [3.0, 4.0, 1.0]);
        let p = camera.projection(2.0).unwrap();
        let at: Vec<[f32; 2]> = camera
            .corners(2.0)
            .iter()
            .map(|c| p.place((*c * 7.0).to_array()).unwrap())
            .collect();
        for (got, want) in at
            .iter()
            .zip([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
        {
            assert!((got[0] - want[0]).abs() < 1e-5 && (got[1] - want[1]).abs() < 1e-5);
        }
    }

    #[test]
    fn a_camera_that_looks_nowhere_is_an_error() {
        for toward in [[0.0; 3], [f32::NAN, 0.0, 0.0]] {
            let camera = Camera {
                eye: [0.0; 3],
                toward,
                fov_y: 1.0,
            };
            assert!(camera.projection(1.0).is_err());
        }
    }
}
