//! Acoustic data of one part.

use enfilade_cpg::PortalId;
use enfilade_geom::{DVec3, Winding};

use crate::layout::Layout;
use crate::paths::{Geodesics, Sampling, Ways};
use crate::space::{PartId, Space};

/// Acoustic data of a part, in its frame.
#[derive(Clone, Debug)]
pub(super) struct PartSound {
    pub(super) ways: Ways,
    pub(super) geodesics: Geodesics,
    /// Per portal, edges with wall beside them, and the number of all.
    pub(super) first_rim: Vec<u32>,
    pub(super) rims: Vec<[DVec3; 2]>,
}

impl PartSound {
    pub(super) fn new(space: &Space, part: PartId) -> Self {
        let layout = space.layout(part);
        let mut ways = Ways::new(layout, Sampling::default());
        let geodesics = Geodesics::new(space, part, &mut ways);
        let (mut first_rim, mut rims) = (vec![0], Vec::new());
        for portal in (0..layout.n_portals() as u32).map(PortalId) {
            add_rims(layout, portal, &mut rims);
            first_rim.push(rims.len() as u32);
        }
        Self {
            ways,
            geodesics,
            first_rim,
            rims,
        }
    }

    pub(super) fn rims(&self, portal: PortalId) -> &[[DVec3; 2]] {
        let first = &self.first_rim[portal.idx()..];
        &self.rims[first[0] as usize..first[1] as usize]
    }
}

/// Adds the edges of an opening's pieces with no other piece behind them.
fn add_rims(layout: &Layout, portal: PortalId, rims: &mut Vec<[DVec3; 2]>) {
    let opening = layout.opening(portal);
    let hulls: Vec<Winding> = opening.pieces().map(|p| Winding::new(p.to_vec())).collect();
    for (i, piece) in opening.pieces().enumerate() {
        for (k, &a) in piece.iter().enumerate() {
            let b = piece[(k + 1) % piece.len()];
            let out = (b - a).cross(opening.normal()).normalize_or_zero();
            let beside = a.midpoint(b) + out * 1e-3;
            let mut others = hulls.iter().enumerate().filter(|(j, _)| *j != i);
            if !others.any(|(_, hull)| hull.contains_in_plane(beside, 0.0)) {
                rims.push([a, b]);
            }
        }
    }
}
