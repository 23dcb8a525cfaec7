//! Special portals of a world whose cells and portals are renumbered.

use enfilade_cpg::{CellId, PortalId, SpecialId, SpecialPortal, SpecialShape, Way};

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
pub(crate) fn without(
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
