//! A walker that follows a path and opens the doors on it.
//!
//! It steers towards the point of the path a little ahead of the one nearest to it ("carrot"; Coulter, *Implementation of the
//! Pure Pursuit Path Tracking Algorithm*, 1992), and slides along what it touches on the way.

use enfilade_cpg::PortalId;
use enfilade_geom::{DVec3, closest_point_on_segment};
use enfilade_runtime::SightState;

use crate::bodies::{Contacts, Walker};
use crate::layout::Layout;
use crate::paths::Path;

/// Distance along the path to the point steered for. [Units: wu]
const AHEAD: f64 = 0.3;
/// Distance at which doors are opened. [Units: wu]
const DOOR: f64 = 1.2;
/// Time without progress after which a walker is stuck. [Units: s]
const PATIENCE: f64 = 3.0;

/// What became of a step along a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// It is on its way.
    Walking,
    /// It stands at the end.
    Arrived,
    /// Something that the path does not know of has stopped it for some seconds.
    Stuck,
}

/// Leads a [`Walker`] along a [`Path`], and opens the doors on it.
#[derive(Clone, Debug)]
pub struct PathFollower {
    path: Path,
    /// Length of the path up to each of its points.
    lengths: Vec<f64>,
    /// Length passed.
    passed: f64,
    /// Time since it last came nearer to the end.
    idle: f64,
    /// Length passed when it last did.
    best: f64,
    speed: f64,
}

impl PathFollower {
    /// Starts at the beginning of a path. [Units: wu/s]
    #[must_use]
    pub fn new(path: Path, speed: f64) -> Self {
        let mut lengths = vec![0.0];
        for w in path.points.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + plan(w[0], w[1]));
        }
        Self {
            path,
            lengths,
            passed: 0.0,
            idle: 0.0,
            best: 0.0,
            speed,
        }
    }

    /// Returns the length passed, in plan. [Units: wu]
    #[must_use]
    pub fn passed(&self) -> f64 {
        self.passed
    }

    /// Walks on for some seconds, at most a tenth.
    pub fn step(
        &mut self,
        walker: &mut Walker,
        contacts: &Contacts,
        layout: &Layout,
        state: &mut SightState,
        seconds: f64,
    ) -> Progress {
        let feet = walker.feet();
        self.advance(feet);
        for exit in &self.path.portals {
            let opening = layout.opening(exit.portal);
            let is_near = opening.bounds().distance_squared(feet) < DOOR * DOOR;
            if is_near && state.leaves(exit.portal).is_some() {
                open(state, exit.portal);
            }
        }
        let Some(&end) = self.path.points.last() else {
            return Progress::Arrived;
        };
        if plan(feet, end) < walker.agent().radius
            && (feet.y - end.y).abs() <= walker.agent().step
        {
            return Progress::Arrived;
        }
        let to = self.at(self.passed + AHEAD);
        let way = (to - feet).with_y(0.0);
        let wish = way.normalize_or_zero() * self.speed.min(way.length() / seconds.max(1e-9));
        walker.step(contacts, layout, state, wish, seconds);
        self.idle += seconds;
        if self.passed > self.best + 0.05 {
            (self.best, self.idle) = (self.passed, 0.0);
        }
        if self.idle > PATIENCE {
            Progress::Stuck
        } else {
            Progress::Walking
        }
    }

    /// Moves on to the point of the path nearest to the feet, not far ahead.
    fn advance(&mut self, feet: DVec3) {
        let mut least = f64::INFINITY;
        let (from, until) = (self.passed, self.passed + 2.0 * AHEAD);
        for i in 0..self.path.points.len().saturating_sub(1) {
            let [a, b] = [self.lengths[i], self.lengths[i + 1]];
            if b < from || a > until {
                continue;
            }
            let [low, high] = [from.max(a), until.min(b)].map(|s| self.at(s));
            let near = closest_point_on_segment(feet, low, high);
            let apart = near.distance_squared(feet);
            if apart < least {
                least = apart;
                self.passed = from.max(a) + plan(low, near);
            }
        }
    }

    /// Returns the point of the path after a length of it.
    fn at(&self, length: f64) -> DVec3 {
        let i = self.lengths.partition_point(|&l| l < length).max(1);
        let points = &self.path.points;
        let Some(&b) = points.get(i) else {
            return points.last().copied().unwrap_or_default();
        };
        let leg = self.lengths[i] - self.lengths[i - 1];
        let back = (self.lengths[i] - length) / leg.max(1e-12);
        b.lerp(points[i - 1], back.clamp(0.0, 1.0))
    }
}

fn plan(a: DVec3, b: DVec3) -> f64 {
    (a - b).with_y(0.0).length()
}

fn open(state: &mut SightState, portal: PortalId) {
    state.set_leaves(portal, 1.0);
}
