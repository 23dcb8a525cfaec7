//! Parts of the screen, passed from one world to another.

use enfilade_cpg::{CellId, PortalId, SpecialId};
use enfilade_geom::Similarity;
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

    /// Returns the window of a view [in another frame](crate::View::in_frame); `map` maps that frame to this one.
    #[must_use]
    pub fn in_frame(&self, map: &Similarity) -> Self {
        let back = map.inverse();
        let size = back.scale.abs();
        Self {
            entry: (self.entry).map(|(n, h)| (back.direction(n), h * size)),
            near: self.near * size,
            ..*self
        }
    }

    /// Returns the share of the screen that it may cover, by its rectangle.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.region.share()
    }

    /// Returns the plane beyond which the view begins: its normal, away from the eye, and its distance from the eye. `None` if
    /// the eye may be on it. [Units: wu]
    #[must_use]
    pub fn plane(&self) -> Option<(DVec3, f64)> {
        self.entry
    }

    /// Returns the rectangle around it: `[left, bottom, right, top]`, -1 to 1.
    #[must_use]
    pub fn rectangle(&self) -> [f64; 4] {
        let (min, max) = (self.region.min, self.region.max);
        [min.x, min.y, max.x, max.y]
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

/// A part of the screen in which a special portal is seen.
#[derive(Clone, Copy, Debug)]
pub struct SpecialView {
    /// The special portal.
    pub special: SpecialId,
    /// The part of the screen. The whole of it where the eye may be in the special portal's opening.
    pub window: Window,
    /// True if the eye may be in the opening.
    pub is_at_eye: bool,
}

/// The special portal through which a view comes. Nothing before it is there, so nothing before it hides anything.
#[derive(Clone, Copy, Debug)]
pub struct Gate {
    /// The special portal by which one would go back: a straight line does not.
    pub back: Option<SpecialId>,
    /// The plane beyond which the view begins, as [`Window::plane`].
    pub plane: Option<(DVec3, f64)>,
}

/// State of a stepped query.
#[derive(Default)]
pub(super) struct Stepping {
    pub(super) is_on: bool,
    pub(super) border: Option<u32>,
    pub(super) is_watched: Vec<bool>,
    pub(super) gate: Option<Gate>,
    pub(super) crossings: Vec<Crossing>,
    pub(super) specials: Vec<SpecialView>,
}

impl Stepping {
    /// Returns the plane beyond which everything lies.
    #[inline]
    pub(super) fn entry(&self) -> Option<(DVec3, f64)> {
        self.gate.and_then(|gate| gate.plane)
    }

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
