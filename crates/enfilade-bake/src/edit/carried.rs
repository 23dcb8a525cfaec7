//! Special portals of a world whose cells and portals are renumbered or cut.

use enfilade_cpg::{CellId, PortalId, SpecialId, SpecialPortal, SpecialShape, Way, World};
use enfilade_geom::{DVec3, Winding};

use super::Parts;

/// Returns special portals with new numbers of cells and portals. Those of portals that are gone are left out, and who came back by
/// one of them no longer does.
pub(crate) fn renumbered(
    specials: &[SpecialPortal],
    cell_of: impl Fn(CellId) -> CellId,
    portal_of: impl Fn(PortalId) -> Option<PortalId>,
) -> Vec<SpecialPortal> {
    let stays = |s: &SpecialPortal| s.portal().is_none_or(|p| portal_of(p).is_some());
    without(specials, |_, s| !stays(s))
        .into_iter()
        .map(|mut special| {
            special.cell = cell_of(special.cell);
            if let SpecialShape::Portal(portal) = &mut special.shape {
                *portal = portal_of(*portal).unwrap_or(*portal);
            }
            for pass in &mut special.passes {
                if let Way::Lead { to, .. } = &mut pass.way {
                    *to = cell_of(*to);
                }
            }
            special
        })
        .collect()
}

/// Returns the special portals but those that are `gone`; who came back by one of these no longer does.
pub(super) fn without(
    specials: &[SpecialPortal],
    gone: impl Fn(SpecialId, &SpecialPortal) -> bool,
) -> Vec<SpecialPortal> {
    let mut n = 0;
    let number = (0..).map(SpecialId).zip(specials).map(|(id, s)| {
        let number = (!gone(id, s)).then_some(SpecialId(n));
        n += u32::from(number.is_some());
        number
    });
    let number: Vec<Option<SpecialId>> = number.collect();
    let mut kept: Vec<SpecialPortal> = (specials.iter().zip(&number))
        .filter(|(_, number)| number.is_some())
        .map(|(s, _)| s.clone())
        .collect();
    for pass in kept.iter_mut().flat_map(|s| &mut s.passes) {
        if let Way::Lead { back, .. } = &mut pass.way {
            *back = back.and_then(|b| number.get(b.idx()).copied().flatten());
        }
    }
    kept
}

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
