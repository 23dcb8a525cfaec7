//! The size and abilities of a walker, for its paths and for its body.

use enfilade_geom::{DQuat, DVec3};

use super::body::Body;

/// The size and abilities of a walker: paths are planned for it, and its body walks them.
///
/// Both have the same rule: an upright capsule of this radius, from the height of a step above the floor up to the walker's
/// height, touches nothing; for one that is wider than that, such as a robot, a box. What is lower is stepped onto or over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agent {
    /// Half the width: distance kept from walls. [Units: wu] [Limit: above 0.01]
    pub radius: f64,
    /// Room needed above the floor. [Units: wu] [Limit: above step]
    pub height: f64,
    /// Height of the eye above the floor. [Units: wu] [Limit: from step to height]
    pub eye: f64,
    /// The highest step, up or down. [Units: wu] [Limit: at least 0]
    pub step: f64,
    /// The steepest floor. [Units: rad]
    pub slope: f64,
}

impl Default for Agent {
    /// An adult: 0.5 m wide, 1.8 m high with eyes at 1.6 m, steps of 0.3 m, slopes of 45°.
    fn default() -> Self {
        Self {
            radius: 0.25,
            height: 1.8,
            eye: 1.6,
            step: 0.3,
            slope: std::f64::consts::FRAC_PI_4,
        }
    }
}

impl Agent {
    /// Returns its body, and the height of the body's center above the floor. [Units: wu]
    pub(crate) fn body(&self) -> (Body, f64) {
        let (radius, half) = (self.radius, 0.5 * (self.height - self.step).max(0.0));
        let body = if radius <= half {
            Body::upright(2.0 * half, radius)
        } else {
            Body::Box {
                half: DVec3::new(radius, half, radius),
                turn: DQuat::IDENTITY,
            }
        };
        (body, self.step + half)
    }

    /// Returns the foot that finds the floor, and the height of its center above the ground before it is lowered: it is within
    /// the body. [Units: wu]
    ///
    /// On winding stairs, a walker that stood on a point would still be on the tread below with the next two risers in its way.
    pub(crate) fn foot(&self) -> (Body, f64) {
        let radius = 0.5 * self.radius.min((self.height - self.step).max(0.0));
        (Body::Sphere { radius }, self.step + radius)
    }
}
