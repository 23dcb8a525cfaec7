//! Tracking of the cell that holds a moving object.
//!
//! A moving object leaves a cell through a portal (Dirkse 2002, section 5.2). A step reports the portals
//! that it crosses, in order: doors to open, sounds to play, rooms to load. If they lead to another cell
//! than the locator reports, the locator prevails, so a walk through a wall, a teleport or a step within
//! rounding of a portal does no lasting harm.

use enfilade_cpg::{CellId, PortalId};
use glam::DVec3;

use crate::exits::Exit;
use crate::point::point;
use crate::sight::Sight;

/// Maximum number of portals that one step reports; it may cross more.
const MAX_CROSSED: usize = 16;

/// An eye or object tracked from cell to cell.
#[derive(Clone, Debug)]
pub struct Follower {
    at: DVec3,
    cell: Option<CellId>,
    crossed: [PortalId; MAX_CROSSED],
    n_crossed: usize,
}

/// Outcome of a step of a [`Follower`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Still in the same cell.
    Stayed,
    /// Moved through portals: see [`Follower::crossed`].
    Crossed,
    /// The portals on the way do not lead to the new position: located anew.
    Relocated,
    /// In no cell. [`Follower::cell`] still returns the last one.
    Lost,
}

impl Follower {
    /// Places an object at a point, such as a spawn point.
    #[must_use]
    pub fn new(sight: &Sight, at: [f32; 3]) -> Self {
        Self {
            at: point(at),
            cell: sight.locate(at),
            crossed: [PortalId(0); MAX_CROSSED],
            n_crossed: 0,
        }
    }

    /// Returns its cell, or its last cell if it is in solid matter; `None` if it never was in one.
    #[must_use]
    pub fn cell(&self) -> Option<CellId> {
        self.cell
    }

    /// Returns its position. [Units: wu]
    #[must_use]
    pub fn position(&self) -> [f32; 3] {
        self.at.as_vec3().to_array()
    }

    /// Returns the portals that the last step crossed, in order; at most 16.
    #[must_use]
    pub fn crossed(&self) -> &[PortalId] {
        &self.crossed[..self.n_crossed]
    }

    /// Moves it to `to`, regardless of what lies in between.
    pub fn teleport(&mut self, sight: &Sight, to: [f32; 3]) -> Step {
        self.n_crossed = 0;
        self.at = point(to);
        match sight.locate(to) {
            None => Step::Lost,
            found if found == self.cell => Step::Stayed,
            found => {
                self.cell = found;
                Step::Relocated
            }
        }
    }

    /// Moves it in a straight line to `to`. Tests each exit of the cells on the way and queries the locator
    /// once. Allocates nothing.
    pub fn step(&mut self, sight: &Sight, to: [f32; 3]) -> Step {
        let (a, b) = (self.at, point(to));
        self.n_crossed = 0;
        self.at = b;
        let Some(start) = self.cell else {
            return self.teleport(sight, to);
        };
        let mut cell = start.0;
        let mut t = 0.0;
        let mut last = u32::MAX;
        // Terminates: crossings come in order along the segment, each portal once.
        while let Some((at, exit)) = next_crossing(sight, cell, a, b, t, last) {
            if self.n_crossed < MAX_CROSSED {
                self.crossed[self.n_crossed] = PortalId(exit.portal);
                self.n_crossed += 1;
            }
            (t, cell, last) = (at, exit.to, exit.portal);
        }
        let by_portals = CellId(cell);
        match sight.locate(to) {
            Some(found) if found != by_portals && !is_at_portal(sight, b, by_portals, found) => {
                self.n_crossed = 0;
                let is_same = Some(found) == self.cell;
                self.cell = Some(found);
                if is_same {
                    Step::Stayed
                } else {
                    Step::Relocated
                }
            }
            None => {
                self.n_crossed = 0;
                Step::Lost
            }
            Some(_) => {
                self.cell = Some(by_portals);
                if self.n_crossed > 0 {
                    Step::Crossed
                } else {
                    Step::Stayed
                }
            }
        }
    }
}

/// Returns the next exit of `cell` that the segment crosses outwards, at `t` or later.
fn next_crossing(
    sight: &Sight,
    cell: u32,
    a: DVec3,
    b: DVec3,
    t: f64,
    last: u32,
) -> Option<(f64, &Exit)> {
    let mut best: Option<(f64, &Exit)> = None;
    let (low, high) = (a.min(b), a.max(b));
    let mut runs = sight.runs_of(cell);
    let near = || runs.next(|group| group.is_apart_from(low, high));
    for exit in std::iter::from_fn(near).flatten() {
        let normal = point(exit.normal);
        let center = point(exit.center);
        let (da, db) = (normal.dot(a - center), normal.dot(b - center));
        // A step that ends on the plane has not crossed it.
        if exit.special().is_some() || exit.portal == last || da > 0.0 || db <= 0.0 {
            continue;
        }
        let at = da / (da - db);
        let p = a.lerp(b, at);
        let reach = f64::from(exit.radius) + sight.tolerance();
        if at < t || p.distance_squared(center) > reach * reach {
            continue;
        }
        if sight.is_in_outline(exit, p, sight.tolerance()) && best.is_none_or(|(best, _)| at < best)
        {
            best = Some((at, exit));
        }
    }
    best
}

/// Returns `true` if `p` is within tolerance of a portal between two cells, so that either may hold it.
fn is_at_portal(sight: &Sight, p: DVec3, a: CellId, b: CellId) -> bool {
    let near = 4.0 * sight.tolerance();
    let mut runs = sight.runs_of(a.0);
    let near_p = || runs.next(|group| group.is_apart_from(p - near, p + near));
    std::iter::from_fn(near_p).flatten().any(|exit| {
        exit.to == b.0
            && point(exit.normal).dot(p - point(exit.center)).abs() <= near
            && sight.is_in_outline(exit, p, near)
    })
}
