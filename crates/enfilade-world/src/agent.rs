//! The size and abilities of a walker, for its paths and for its body.

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
