//! Special portals: mirrors, monitors, tinted panes, teleporters (Dirkse 2002, chapter 6; Gjørup 1999, section 3.4).
//!
//! An ordinary portal looks the same from both its cells. A special portal is *one side* of one: as seen from its cell, it
//! replaces a doorway, or covers a part of a wall. What is seen in it comes in passes: through the doorway as it is, out of
//! another place by a [`Similarity`], back in a mirror, or from a camera.

use enfilade_geom::{DVec3, Similarity, Winding};

use crate::{CellId, CellPortalGraph, PortalId};

/// Index of a special portal in [`CellPortalGraph::specials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SpecialId(pub u32);

impl SpecialId {
    /// Returns its index in [`CellPortalGraph::specials`].
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
    /// What it shows, in order of drawing: the first pass covers what was there before, each further one is blended over it by
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
    /// What is seen.
    pub way: Way,
    /// Factors of red, green and blue, linear; and the share by which a later pass covers earlier ones. The share of the first
    /// pass is 1. [Limit: 0 to 1]
    pub tint: [f32; 4],
}

/// What a pass shows.
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

impl CellPortalGraph {
    /// Returns the ids of all special portals, ascending.
    pub fn special_ids(&self) -> impl ExactSizeIterator<Item = SpecialId> + use<> {
        (0..self.specials.len() as u32).map(SpecialId)
    }

    /// Returns the special portal that is a doorway's side in a cell. O(special portals).
    #[must_use]
    pub fn special_side(&self, portal: PortalId, cell: CellId) -> Option<SpecialId> {
        let is_it = |s: &SpecialPortal| s.cell == cell && s.portal() == Some(portal);
        let at = self.specials.iter().position(is_it)?;
        Some(SpecialId(at as u32))
    }

    /// Returns the unit normal of a special portal, out of its cell, and its convex pieces, counter-clockwise about it. [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such special portal, or it refers to a portal that does not exist.
    #[must_use]
    pub fn special_opening(&self, special: SpecialId) -> (DVec3, Vec<Winding>) {
        let side = &self.specials[special.idx()];
        let point = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
        let (normal, pieces, is_turned) = match &side.shape {
            SpecialShape::Portal(portal) => {
                let portal = &self[*portal];
                (&portal.normal, &portal.pieces, portal.cells[0] != side.cell)
            }
            SpecialShape::Surface { normal, pieces } => (normal, pieces, false),
        };
        let sign = if is_turned { -1.0 } else { 1.0 };
        let pieces = pieces.iter().map(|piece| {
            let mut points: Vec<DVec3> = piece.iter().map(point).collect();
            if is_turned {
                points.reverse();
            }
            Winding::new(points)
        });
        (point(normal).normalize_or_zero() * sign, pieces.collect())
    }

    /// Returns the map of a pass: from the side of those who look to the side that is seen. The identity for the doorway itself,
    /// `None` for a monitor.
    ///
    /// # Panics
    ///
    /// As [`CellPortalGraph::special_opening`], and if there is no such pass.
    #[must_use]
    pub fn map_of_pass(&self, special: SpecialId, pass: usize) -> Option<Similarity> {
        match &self.specials[special.idx()].passes[pass].way {
            Way::Through => Some(Similarity::IDENTITY),
            Way::Lead { map, .. } => Some(*map),
            Way::Mirror => {
                let (normal, pieces) = self.special_opening(special);
                let corners = pieces.iter().flat_map(|p| &p.points);
                let n = corners.clone().count().max(1) as f64;
                Some(Similarity::reflection(corners.sum::<DVec3>() / n, normal))
            }
            Way::Monitor(_) => None,
        }
    }
}
