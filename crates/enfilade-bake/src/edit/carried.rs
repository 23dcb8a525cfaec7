//! Special portals of a world of which a cell is cut.

use enfilade_cpg::{CellId, PortalId, SpecialId, SpecialShape, Way, World};
use enfilade_geom::{DVec3, Winding};

use super::Parts;

impl Parts {
    /// Gives special portals of the old cell, and ways into it, to one part.
    ///
    /// # Errors
    ///
    /// The first special portal that is at both parts, or at a portal that was cut in two.
    pub(super) fn hand_out_specials(
        &self,
        out: &mut World,
        halved: &[(PortalId, PortalId)],
        eps: f64,
    ) -> Result<(), SpecialId> {
        let mut specials = std::mem::take(&mut out.graph.specials);
        let is_halved = |portal| halved.iter().any(|(kept, _)| *kept == portal);
        for (id, special) in (0..).map(SpecialId).zip(&mut specials) {
            match &special.shape {
                SpecialShape::Portal(portal) => {
                    if is_halved(*portal) {
                        return Err(id);
                    }
                    if special.cell == self.cell {
                        let cells = out.graph[*portal].cells;
                        let part = cells.into_iter().find(|c| self.ids.contains(c));
                        special.cell = part.ok_or(id)?;
                    }
                }
                SpecialShape::Surface { normal, pieces } if special.cell == self.cell => {
                    let inward = -DVec3::from(normal.map(f64::from));
                    let pieces = pieces.iter().map(|piece| super::winding(piece));
                    special.cell = self.part_at(pieces, inward, eps).ok_or(id)?;
                }
                SpecialShape::Surface { .. } => {}
            }
        }
        let cells: Vec<CellId> = specials.iter().map(|s| s.cell).collect();
        out.graph.specials = specials;
        for id in out.graph.special_ids() {
            for pass in 0..out.graph.specials[id.idx()].passes.len() {
                let Way::Lead { to, map, back } = &out.graph.specials[id.idx()].passes[pass].way
                else {
                    continue;
                };
                if *to != self.cell {
                    continue;
                }
                let part = match back {
                    Some(back) => cells[back.idx()],
                    None => {
                        let (normal, pieces) = out.graph.special_opening(id);
                        let mapped = |p: &Winding| p.points.iter().map(|p| map.point(*p)).collect();
                        let mapped = pieces.iter().map(|p| Winding::new(mapped(p)));
                        self.part_at(mapped, map.direction(normal), eps).ok_or(id)?
                    }
                };
                if let Way::Lead { to, .. } = &mut out.graph.specials[id.idx()].passes[pass].way {
                    *to = part;
                }
            }
        }
        Ok(())
    }

    /// Returns the part that polygons border on; `None` if they border on both. `inward` leads into the cell.
    fn part_at(
        &self,
        pieces: impl Iterator<Item = Winding>,
        inward: DVec3,
        eps: f64,
    ) -> Option<CellId> {
        let mut areas = [0.0; 2];
        for piece in pieces {
            self.sides
                .divide(&piece.points, inward, eps, &mut |side, part| {
                    areas[side as usize] += Winding::new(part.to_vec()).area();
                });
        }
        let [f, b] = areas;
        // Slivers are rounding.
        if f.min(b) > 1e-3 * f.max(b) {
            return None;
        }
        Some(self.ids[usize::from(b > f)])
    }
}
