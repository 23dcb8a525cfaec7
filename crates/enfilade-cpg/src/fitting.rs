//! What fills an opening: the leaf of a door, its frame, a pane; and how a leaf moves.

use enfilade_geom::{DMat4, DQuat, DVec3};

/// A detail object that stands in a portal's opening.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitting {
    /// The object. Index into [`World::details`](crate::World::details).
    pub detail: u32,
    /// What it is to the opening.
    pub part: FittingPart,
    /// How it opens and shuts; only leaves move.
    pub motion: Option<Motion>,
}

/// What an object is to the opening that it stands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FittingPart {
    /// What shuts the opening, and moves to open it.
    Leaf,
    /// What runs around the opening, and stays.
    Frame,
    /// What fills the opening and stays: glass, a panel.
    Pane,
}

/// How a leaf moves between shut and open, from where the model has it.
///
/// Amounts are in radians of a turn and in world units of a slide, 0 being the pose of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Along which way.
    pub kind: MotionKind,
    /// How far to where it shuts the opening. [Units: rad or wu]
    pub shut: f32,
    /// How far to where it is fully open. [Units: rad or wu]
    pub open: f32,
}

/// The way along which a leaf moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionKind {
    /// Around a hinge.
    Turn {
        /// A point of the hinge's axis. [Units: wu]
        through: [f32; 3],
        /// Its direction, of unit length; turns are counter-clockwise around it.
        axis: [f32; 3],
    },
    /// Straight on.
    Slide {
        /// Where to, of unit length.
        along: [f32; 3],
    },
}

impl Motion {
    /// The share of the way from shut (0) to open (1) at which the model has it.
    #[must_use]
    pub fn share_of_model(&self) -> f32 {
        let way = self.open - self.shut;
        if way == 0.0 || self.shut == 0.0 {
            0.0
        } else {
            -self.shut / way
        }
    }

    /// What moves the leaf from the model's pose to a share of the way from shut (0) to open (1), in world space.
    #[must_use]
    pub fn at(&self, share: f32) -> DMat4 {
        let share = f64::from(share);
        let (shut, open) = (f64::from(self.shut), f64::from(self.open));
        // Exactly 0 where the model has it, whatever rounding makes of the share.
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

    /// What is wrong with it, if anything.
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
        // What rounding to `f32` leaves, as for normals of portals.
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
            return Some("it moves by no number, or around more than once");
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
        // Modeled ajar by 30 degrees.
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
