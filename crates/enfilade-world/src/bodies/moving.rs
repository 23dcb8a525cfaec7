//! A moving body, and the same in the frames of the parts that it reaches.

use enfilade_geom::{DVec3, Ray, Similarity};

use super::body::{Body, BodyCore};
use crate::space::{PartId, Place, Space};

/// A motion of a body in the frame of a part.
pub(super) struct Motion<'a> {
    pub(super) space: &'a Space,
    pub(super) body: &'a Body,
    pub(super) frame: PartId,
    pub(super) from: DVec3,
    pub(super) by: DVec3,
    pub(super) place: Place,
}

/// A body in the frame of a part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moving {
    pub(super) body: Body,
    pub(super) core: BodyCore,
    pub(super) reach: DVec3,
    /// The same, grown by the tolerance of openings.
    pub(super) grown: BodyCore,
    pub(super) grown_reach: DVec3,
    pub(super) from: DVec3,
    pub(super) by: DVec3,
    /// Map from the frame of the motion to that of the part.
    pub(super) map: Similarity,
}

impl<'a> Motion<'a> {
    /// Makes a body at rest.
    pub(super) fn rest(
        space: &'a Space,
        body: &'a Body,
        frame: PartId,
        at: DVec3,
        place: Place,
    ) -> Self {
        Self {
            space,
            body,
            frame,
            from: at,
            by: DVec3::ZERO,
            place,
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.body.is_finite() && self.from.is_finite() && self.by.is_finite()
    }
}

impl Moving {
    pub(super) fn new(motion: &Motion<'_>, part: PartId, map: Similarity) -> Self {
        let (mut body, mut from, mut by) = (*motion.body, motion.from, motion.by);
        if map != Similarity::IDENTITY {
            (body, from, by) = (body.mapped(&map), map.point(from), map.vector(by));
        }
        let core = BodyCore::of(&body);
        let tolerance = motion.space.layout(part).tolerance();
        let grown = BodyCore::of(&body.grown(tolerance));
        Self {
            body,
            core,
            reach: core.reach(),
            grown,
            grown_reach: grown.reach(),
            from,
            by,
            map,
        }
    }

    pub(super) fn ray(&self, start: DVec3, t_max: f64) -> Ray {
        Ray {
            origin: start,
            direction: self.by,
            t_max,
        }
    }
}
