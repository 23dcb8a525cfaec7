//! Access to special portals: by doorway and cell, their polygons and maps.

use enfilade_geom::{DVec3, Similarity, Winding};

use crate::{CellId, CellPortalGraph, PortalId, SpecialId, SpecialPortal, SpecialShape, Way};

impl CellPortalGraph {
    /// Returns the ids of all special portals, ascending.
    pub fn special_ids(&self) -> impl ExactSizeIterator<Item = SpecialId> + use<> {
        (0..self.specials.len() as u32).map(SpecialId)
    }

    /// Returns the special portal that is a doorway's side in a cell. O(special portals).
    #[must_use]
    #[doc(hidden)]
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
    #[doc(hidden)]
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
    #[doc(hidden)]
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
