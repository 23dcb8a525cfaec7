//! WalkerRoom for a walker at a place, among plain triangles: for maps of paths.
//!
//! The rule is that of [`Walker`](crate::Walker): the same capsule, the same foot.

use std::ops::ControlFlow;

use enfilade_geom::{Bvh, DVec3, Ray, Triangle};
use enfilade_runtime::{DetailId, Target};

use super::agent::Agent;
use super::body::BodyCore;
use super::caster::Caster;
use super::kernel::{depth, sweep};
use super::walker::GAP;
use crate::space::{PartId, Space};

/// Obstacles of a walker.
pub(crate) struct WalkerRoom {
    bvh: Bvh,
    agent: Agent,
    body: BodyCore,
    foot: BodyCore,
}

impl WalkerRoom {
    pub(crate) fn new(solid: &[Triangle], agent: &Agent) -> Self {
        // The gap that walkers keep, and as much again for what lies between the middles of squares.
        let body = agent.body().0.grown(2.0 * GAP);
        Self {
            bvh: Bvh::build(solid),
            agent: *agent,
            body: BodyCore::of(&body),
            foot: BodyCore::of(&agent.foot().0),
        }
    }

    /// Returns `true` if a walker with its middle at a point touches nothing.
    pub(crate) fn is_free(&self, middle: DVec3) -> bool {
        let reach = self.body.reach();
        let half = DVec3::Y * (reach.y - self.body.radius);
        let around = self.bvh.for_each_around_segment(
            middle - half,
            middle + half,
            self.body.radius.max(reach.x),
            |_, t| match depth(&self.body, &t.map(|p| p - middle)) {
                Some(_) => ControlFlow::Break(()),
                None => ControlFlow::Continue(()),
            },
        );
        around.is_continue()
    }

    /// Returns the middle of a walker that stands at a point, or up to a step above or below.
    pub(crate) fn standing(&self, p: DVec3) -> DVec3 {
        self.floor(p) + DVec3::Y * self.agent.body().1
    }

    fn floor(&self, p: DVec3) -> DVec3 {
        let from = p + DVec3::Y * self.agent.foot().1;
        let far = 2.0 * self.agent.step;
        let down = Ray {
            origin: from,
            direction: -DVec3::Y,
            t_max: far,
        };
        let mut fall = far;
        self.bvh
            .for_each_swept(&down, self.foot.reach(), |_, t, t_max| {
                let touch = sweep(&self.foot, -DVec3::Y, *t_max, &t.map(|p| p - from));
                if let Some(touch) = touch.filter(|touch| touch.normal.y > 0.0) {
                    (fall, *t_max) = (touch.t, touch.t);
                }
            });
        if fall < far {
            p + DVec3::Y * (self.agent.step - fall)
        } else {
            p
        }
    }
}

/// Returns `true` if a walker touches nothing between two points of floors, given in the frame of a part, where several parts may
/// meet: neither walls nor the objects for which `stops` returns `true`. It opens doors.
pub(crate) fn is_free_between(
    caster: &mut Caster,
    space: &Space,
    agent: &Agent,
    frame: PartId,
    [from, to]: [DVec3; 2],
    stops: impl Fn(PartId, DetailId) -> bool,
) -> bool {
    let (body, up) = agent.body();
    let body = body.grown(2.0 * GAP);
    // Posts are thicker than the difference between a capsule and the hull of its places.
    let n = (from.distance(to) / (0.25 * agent.radius))
        .ceil()
        .clamp(1.0, 64.0) as usize;
    (0..=n).all(|i| {
        let middle = from.lerp(to, i as f64 / n as f64) + DVec3::Y * up;
        let mut is_free = true;
        // In the seam of two parts, it is in neither.
        if let Some(place) = space.locate(frame, middle) {
            caster.for_each_contact(space, &body, frame, middle, place, |contact| {
                is_free &= match contact.target {
                    Target::Wall { .. } => false,
                    Target::Detail { detail, .. } => !stops(contact.place.part, detail),
                    Target::Portal(_) => true,
                };
            });
        }
        is_free
    })
}
