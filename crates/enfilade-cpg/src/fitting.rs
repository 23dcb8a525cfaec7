//! Objects that fill an opening: the leaf of a door, its frame, a pane; and the motion of a leaf.

use enfilade_geom::{DMat4, DQuat, DVec3};

/// A detail object that stands in a portal's opening.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitting {
    /// The object. Index into [`World::details`](crate::World::details).
    pub detail: u32,
    /// Its role in the opening.
    pub part: FittingPart,
    /// Its motion between open and shut; only leaves move.
    pub motion: Option<Motion>,
}

/// The role of an object in the opening where it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FittingPart {
    /// Shuts the opening, and moves to open it.
    Leaf,
    /// Runs around the opening, and does not move.
    Frame,
    /// Fills the opening and does not move: glass, a panel.
    Pane,
}

/// The motion of a leaf between shut and open, relative to its pose in the model.
///
/// Amounts are in radians for a turn and in world units for a slide; 0 is the pose of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Path of the motion.
    pub kind: MotionKind,
    /// Amount at which it shuts the opening. [Units: rad or wu]
    pub shut: f32,
    /// Amount at which it is fully open. [Units: rad or wu]
    pub open: f32,
}

/// The path along which a leaf moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionKind {
    /// Around a hinge.
    Turn {
        /// A point of the hinge's axis. [Units: wu]
        through: [f32; 3],
        /// Its direction, of unit length; turns are counter-clockwise around it.
        axis: [f32; 3],
    },
    /// Along a straight line.
    Slide {
        /// Direction, of unit length.
        along: [f32; 3],
    },
}

impl Motion {
    /// Returns the share of the way from shut (0) to open (1) that is the pose of the model.
    #[must_use]
    #[doc(hidden)]
    pub fn share_of_model(&self) -> f32 {
        let way = self.open - self.shut;
        if way == 0.0 || self.shut == 0.0 {
            0.0
        } else {
            -self.shut / way
        }
    }

    /// Returns the transform, in world space, from the model's pose to a share of the way from shut (0) to open (1).
    #[must_use]
    pub fn at(&self, share: f32) -> DMat4 {
        let share = f64::from(share);
        let (shut, open) = (f64::from(self.shut), f64::from(self.open));
        // Exactly 0 at the model's pose, regardless of how the share was rounded.
        let amount = if share == f64::from(self.share_of_model()) {
            0.0
        } else {
            shut + (open - shut) * share
        };
        match self.kind {
            MotionKind::Turn { through, axis } => {
                let (through, axis) = (vector(through), vector(axis));
                DMat4::from_translation(through)
                    * DMat4::from_quat(DQuat::from_axis_angle(axis, amount))
                    * DMat4::from_translation(-through)
            }
            MotionKind::Slide { along } => DMat4::from_translation(vector(along) * amount),
        }
    }

    /// Returns a problem of the motion, if any.
    pub(crate) fn problem(&self) -> Option<&'static str> {
        let direction = match self.kind {
            MotionKind::Turn { through, axis } => {
                if !vector(through).is_finite() {
                    return Some("its hinge is not finite");
                }
                axis
            }
            MotionKind::Slide { along } => along,
        };
        // Allows for rounding to `f32`, as for normals of portals.
        if (vector(direction).length() - 1.0).abs() > 1e-3 || !vector(direction).is_finite() {
            return Some("its direction is not of unit length");
        }
        let is_turn = matches!(self.kind, MotionKind::Turn { .. });
        let most = if is_turn {
            std::f32::consts::TAU
        } else {
            f32::MAX
        };
        let is_amount = |x: f32| x.is_finite() && x.abs() <= most;
        if !is_amount(self.shut) || !is_amount(self.open) {
            return Some("its amounts must be finite, and turns at most a full circle");
        }
        None
    }
}

pub(crate) fn vector(p: [f32; 3]) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    fn door(shut: f32, open: f32) -> Motion {
        let (through, axis) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        Motion {
            kind: MotionKind::Turn { through, axis },
            shut,
            open,
        }
    }

    #[test]
    fn a_leaf_turns_around_its_hinge_from_where_the_model_has_it() {
        // Modeled 30 degrees ajar.
        let ajar = door(-FRAC_PI_2 / 3.0, FRAC_PI_2 * 2.0 / 3.0);
        assert!((ajar.share_of_model() - 1.0 / 3.0).abs() < 1e-6);
        assert_eq!(ajar.at(ajar.share_of_model()), DMat4::IDENTITY);
        let shut = door(0.0, FRAC_PI_2);
        let tip = shut.at(1.0).transform_point3(DVec3::new(2.0, 0.5, 0.0));
        assert!(tip.distance(DVec3::new(1.0, 0.5, -1.0)) < 1e-6, "{tip}");
        let slide = Motion {
            kind: MotionKind::Slide {
                along: [0.0, 0.0, 1.0],
            },
            shut: 0.0,
            open: 0.8,
        };
        let moved = slide.at(0.5).transform_point3(DVec3::ZERO);
        assert!(moved.distance(DVec3::Z * 0.4) < 1e-6, "{moved}");
    }

    #[test]
    fn what_is_no_motion_is_found() {
        assert_eq!(door(0.0, FRAC_PI_2).problem(), None);
        assert!(door(f32::NAN, 1.0).problem().is_some());
        assert!(door(0.0, 100.0).problem().is_some());
        let long = MotionKind::Slide {
            along: [2.0, 0.0, 0.0],
        };
        let (shut, open) = (0.0, 1.0);
        let kind = long;
        assert!(Motion { kind, shut, open }.problem().is_some());
    }
}
