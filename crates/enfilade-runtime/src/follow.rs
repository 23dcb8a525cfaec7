//! Following: which cell something is in, from step to step.
//!
//! What moves leaves a cell through a portal (Dirkse 2002, section 5.2). The portals that a step
//! crosses say which ones, in order: doors to open, sounds to play, rooms to load. The locator has the
//! last word wherever they lead elsewhere, so that a walk through a wall, a teleport or a step within
//! a rounding of a portal does no lasting harm.

use enfilade_cpg::{CellId, PortalId};
use glam::DVec3;

use crate::exits::Exit;
use crate::point::point;
use crate::sight::Sight;

/// Portals that one step reports, at most; it may cross more.
const MAX_CROSSED: usize = 16;

/// An eye or object followed from cell to cell.
#[derive(Clone, Debug)]
pub struct Follower {
    at: DVec3,
    cell: Option<CellId>,
    crossed: [PortalId; MAX_CROSSED],
    n_crossed: usize,
}

/// How the cell of a [`Follower`] was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// It is in the cell it was in.
    Stayed,
    /// It went through portals: [`Follower::crossed`].
    Crossed,
    /// The portals on its way do not lead to where it is: located anew.
    Relocated,
    /// It is in no cell. [`Follower::cell`] still tells the last one.
    Lost,
}

impl Follower {
    /// Something that appears at a point: a spawn point, or where a teleport leads.
    #[must_use]
    pub fn new(sight: &Sight, at: [f32; 3]) -> Self {
        Self {
            at: point(at),
            cell: sight.locate(at),
            crossed: [PortalId(0); MAX_CROSSED],
            n_crossed: 0,
        }
    }

    /// The cell it is in, or was in before it came into matter; `None` when it never was in one.
    #[must_use]
    pub fn cell(&self) -> Option<CellId> {
        self.cell
    }

    /// Where it is. [Units: wu]
    #[must_use]
    pub fn position(&self) -> [f32; 3] {
        self.at.as_vec3().to_array()
    }

    /// The portals that the last step crossed, in order; the first 16.
    #[must_use]
    pub fn crossed(&self) -> &[PortalId] {
        &self.crossed[..self.n_crossed]
    }

    /// Puts it elsewhere, whatever is in between.
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

    /// Moves it in a straight line. Costs a test of each exit of the cells on the way, and one
    /// question to the locator. Allocates nothing.
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
        // Crossings come in order along the segment, each portal once: it ends.
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

/// The next exit of `cell` that the segment crosses outwards, at `t` or later.
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
        // From this side to the other; a step that ends on the plane has not crossed it.
        if exit.portal == last || da > 0.0 || db <= 0.0 {
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

/// Whether `p` is so near to a portal between two cells that it may be said to be in either.
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
