//! Parts of the screen, passed from one world to another.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DMat3;
use glam::DVec3;

use crate::region::Region;

/// Stands for no portal, and no visit.
pub(super) const NONE: u32 = u32::MAX;

/// A part of the screen through which something is seen.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    pub(super) region: Region,
    /// Normal of the plane beyond which the view begins, and that plane's distance from the eye.
    pub(super) entry: Option<(DVec3, f64)>,
    pub(super) near: f64,
}

impl Window {
    /// Returns the whole screen.
    #[must_use]
    pub fn screen() -> Self {
        Self {
            region: Region::screen(),
            entry: None,
            near: 0.0,
        }
    }

    /// Returns the window of a view that begins nearer to the eye by a distance. [Units: wu]
    #[must_use]
    pub fn earlier(&self, by: f64) -> Self {
        Self {
            // A plane at the eye bounds nothing.
            entry: self.entry.map(|(n, h)| (n, h - by)).filter(|e| e.1 > 0.0),
            near: (self.near - by).max(0.0),
            ..*self
        }
    }

    /// Returns the window of a view [in another frame](crate::View::in_frame); `turn` maps directions of that frame to this one.
    #[must_use]
    pub fn in_frame(&self, turn: &DMat3) -> Self {
        let turned = |(n, h): (DVec3, f64)| (turn.transpose() * n, h);
        Self {
            entry: self.entry.map(turned),
            ..*self
        }
    }
}

/// A place where a view left a world or reached a watched cell.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// The watched cell, or the border of the world.
    pub cell: CellId,
    /// The portal entered by; `None` for the eye's own cell, or if unknown.
    pub via: Option<PortalId>,
    /// The part of the screen.
    pub window: Window,
}

/// State of a stepped query.
#[derive(Default)]
pub(super) struct Stepping {
    pub(super) is_on: bool,
    pub(super) border: Option<u32>,
    pub(super) is_watched: Vec<bool>,
    pub(super) crossings: Vec<Crossing>,
}

impl Stepping {
    #[inline]
    pub(super) fn is_border(&self, cell: u32) -> bool {
        self.is_on && self.border == Some(cell)
    }

    #[inline]
    pub(super) fn is_watched(&self, cell: u32) -> bool {
        self.is_on && self.is_watched.get(cell as usize) == Some(&true)
    }

    pub(super) fn note(&mut self, cell: u32, via: u32, window: Window) {
        self.crossings.push(Crossing {
            cell: CellId(cell),
            via: (via != NONE).then_some(PortalId(via)),
            window,
        });
    }
}
