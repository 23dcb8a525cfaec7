//! Special portals: mirrors, monitors, tinted panes, teleporters (Dirkse 2002, chapter 6; Gjørup 1999, section 3.4).
//!
//! An ordinary portal looks the same from both its cells. A special portal is *one side* of one: as seen from its cell, it
//! replaces a doorway, or covers a part of a wall. What is seen in it comes in passes: through the doorway as it is, out of
//! another place by a [`Similarity`], back in a mirror, or from a camera.

use enfilade_geom::Similarity;

use crate::{CellId, PortalId};

/// Index of a special portal in [`CellPortalGraph::specials`](crate::CellPortalGraph::specials).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SpecialId(pub u32);

impl SpecialId {
    /// Returns its index in [`CellPortalGraph::specials`](crate::CellPortalGraph::specials).
    #[inline]
    #[must_use]
    pub fn idx(self) -> usize {
        self.0 as usize
    }
}

/// `special-3`: its name in commands.
impl std::fmt::Display for SpecialId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "special-{}", self.0)
    }
}

/// One side of a portal that shows something other than the cell behind it.
///
/// A doorway has at most one special portal for each of its cells. A cell that sees a doorway's special side no longer sees, hears
/// or passes the doorway itself, unless one of its passes is [`Way::Through`].
#[derive(Clone, Debug, PartialEq)]
pub struct SpecialPortal {
    /// Name for people; may be empty.
    pub name: String,
    /// The cell that it is seen from.
    pub cell: CellId,
    /// Its polygon.
    pub shape: SpecialShape,
    /// The layers that it shows, in order of drawing: the first pass covers what was there before, each further one is blended over it by
    /// the share of its tint. At least one.
    pub passes: Vec<Pass>,
}

/// Polygon of a special portal.
#[derive(Clone, Debug, PartialEq)]
pub enum SpecialShape {
    /// A doorway of its cell.
    Portal(PortalId),
    /// A part of a wall.
    Surface {
        /// Unit normal, out of the cell: away from those who look at it.
        normal: [f32; 3],
        /// Convex polygons of one plane, counter-clockwise about the normal. [Units: wu]
        pieces: Vec<Vec<[f32; 3]>>,
    },
}

/// One pass of a special portal.
#[derive(Clone, Debug, PartialEq)]
pub struct Pass {
    /// The place that is seen.
    pub way: Way,
    /// Factors of red, green and blue, linear; and the share by which a later pass covers earlier ones. The share of the first
    /// pass is 1. [Limit: 0 to 1]
    pub tint: [f32; 4],
}

/// The place that a pass shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Way {
    /// The cell behind the doorway.
    Through,
    /// The cell itself, in a mirror.
    Mirror,
    /// Another place. Whoever passes goes there.
    Lead {
        /// The cell entered.
        to: CellId,
        /// Map from this side of the special portal to the other: a point of its polygon is a point of the opening entered by.
        map: Similarity,
        /// The special portal by which one comes back: it leads to `cell` by the inverse map.
        back: Option<SpecialId>,
    },
    /// The picture of a camera.
    Monitor(MonitorCamera),
}

/// A camera of a monitor. Its picture fills the rectangle around the monitor's polygon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorCamera {
    /// Position. [Units: wu]
    pub eye: [f32; 3],
    /// Direction of view, of any length but 0.
    pub toward: [f32; 3],
    /// Upward direction, not along `toward`.
    pub up: [f32; 3],
    /// Vertical field of view. [Units: rad] [Limit: above 0, below π]
    pub fov_y: f32,
}

impl Pass {
    /// The tint that changes nothing.
    pub const CLEAR: [f32; 4] = [1.0; 4];

    /// Makes an untinted pass.
    #[must_use]
    pub fn new(way: Way) -> Self {
        let tint = Self::CLEAR;
        Self { way, tint }
    }
}

impl SpecialPortal {
    /// Returns the doorway of which it is a side.
    #[must_use]
    pub fn portal(&self) -> Option<PortalId> {
        match self.shape {
            SpecialShape::Portal(portal) => Some(portal),
            SpecialShape::Surface { .. } => None,
        }
    }

    /// Returns `true` if the cell behind the doorway is seen, and the way there is open.
    #[must_use]
    pub fn is_through(&self) -> bool {
        self.passes.iter().any(|p| p.way == Way::Through)
    }

    /// Returns where a body that passes it comes out: the cell, and the map from here to there.
    #[must_use]
    pub fn leads_to(&self) -> Option<(CellId, &Similarity)> {
        self.passes.iter().find_map(|pass| match &pass.way {
            Way::Lead { to, map, .. } => Some((*to, map)),
            _ => None,
        })
    }
}
