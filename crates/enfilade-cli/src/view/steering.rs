//! Turning, going and looking in the open window.

use enfilade::geom::DVec3;
use enfilade::world::PartId;
use enfilade_render::{Camera, FOV};
use winit::keyboard::KeyCode;

use super::open::Open;
use super::walker::RUN;

impl Open {
    pub(super) fn turn(&mut self, by: [f64; 2], speed: f32) {
        self.yaw += by[0] as f32 * speed;
        self.pitch = (self.pitch - by[1] as f32 * speed).clamp(-1.5, 1.5);
    }

    pub(super) fn zoom(&mut self, notches: f32) {
        self.shown.zoom = (self.shown.zoom * 1.25_f32.powf(notches)).clamp(1.0, 40.0);
    }

    pub(super) fn camera(&self) -> Camera {
        let (sin, cos) = self.yaw.sin_cos();
        let level = self.pitch.cos();
        Camera {
            eye: self.walker.eye.as_vec3().to_array(),
            toward: [cos * level, self.pitch.sin(), sin * level],
            fov_y: FOV,
        }
    }

    /// The camera in the coordinates of the world.
    pub(super) fn camera_in_root(&self) -> Camera {
        let to_root = self.lived.space.between(self.walker.frame, PartId::ROOT);
        let camera = self.camera();
        let toward = DVec3::from(camera.toward.map(f64::from));
        Camera {
            eye: to_root.point(self.walker.eye).as_vec3().to_array(),
            toward: to_root.direction(toward).as_vec3().to_array(),
            ..camera
        }
    }

    /// The camera in the coordinates of the world, along the ray through the pointer: in the middle if the mouse is captured.
    pub(super) fn pointer(&self) -> Camera {
        let [w, h] = [self.config.width, self.config.height].map(f64::from);
        let at = if self.is_captured {
            [w * 0.5, h * 0.5]
        } else {
            self.pointer
        };
        let camera = self.camera_in_root();
        let [right, up, forward] = camera.axes();
        let tan = (camera.fov_y * 0.5).tan();
        let x = (at[0] / w * 2.0 - 1.0) as f32 * tan * (w / h) as f32;
        let y = (1.0 - at[1] / h * 2.0) as f32 * tan;
        Camera {
            toward: (forward + right * x + up * y).to_array(),
            ..camera
        }
    }

    /// Puts the eye at a place of the world.
    pub(super) fn go(&mut self, eye: DVec3, toward: DVec3) {
        self.walker.frame = PartId::ROOT;
        self.walker.eye = eye;
        self.walker.flies = true;
        self.yaw = toward.z.atan2(toward.x) as f32;
        self.pitch = toward.y.clamp(-1.0, 1.0).asin() as f32;
    }

    /// The velocity that the pressed keys request. [Units: wu/s]
    pub(super) fn wish(&self) -> DVec3 {
        let [right, _, forward] = self.camera().axes().map(|v| v.as_dvec3());
        let key = |code| f64::from(u8::from(self.keys.contains(&code)));
        let ahead = key(KeyCode::KeyW) - key(KeyCode::KeyS);
        let aside = key(KeyCode::KeyD) - key(KeyCode::KeyA);
        let up = key(KeyCode::KeyE) - key(KeyCode::KeyQ);
        let forward = if self.walker.flies {
            forward
        } else {
            DVec3::new(forward.x, 0.0, forward.z).normalize_or_zero()
        };
        let speed = if self.keys.contains(&KeyCode::ShiftLeft) {
            f64::from(RUN)
        } else {
            1.8
        };
        (forward * ahead + right * aside + DVec3::Y * up).normalize_or_zero() * speed
    }
}
