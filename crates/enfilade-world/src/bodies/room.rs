//! Room for a walker at a place, among plain triangles: for maps of paths.
//!
//! The rule is that of [`Walker`](crate::Walker): the same capsule, the same foot.

use std::ops::ControlFlow;

use enfilade_geom::{Bvh, DVec3, Ray, Triangle};

use super::body::BodyCore;
use super::kernel::{depth, sweep};
use super::walker::{GAP, body_of, foot_of};
use crate::agent::Agent;

/// Obstacles of a walker.
pub(crate) struct StandingRoom {
    bvh: Bvh,
    agent: Agent,
    body: BodyCore,
    foot: BodyCore,
}

impl StandingRoom {
    pub(crate) fn new(solid: &[Triangle], agent: &Agent) -> Self {
        // The gap that walkers keep, and as much again for what lies between the middles of squares.
        let body = body_of(agent).0.grown(2.0 * GAP);
        Self {
            bvh: Bvh::build(solid),
            agent: *agent,
            body: BodyCore::of(&body),
            foot: BodyCore::of(&foot_of(agent).0),
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
        self.floor(p) + DVec3::Y * body_of(&self.agent).1
    }

    fn floor(&self, p: DVec3) -> DVec3 {
        let from = p + DVec3::Y * foot_of(&self.agent).1;
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
