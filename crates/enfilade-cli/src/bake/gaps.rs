//! Gaps of the model that became portals.

use std::io::{self, Write};

use enfilade::bake::{BakeOutput, Leak};
use enfilade::cpg::Portal;
use enfilade::geom::{Aabb, DVec3};

/// A gap lies in a portal if it is this near to the portal's outline. [Units: wu]
const NEAR: f64 = 1e-3;

/// Lists up to `most` gaps, the largest first. Leaves out those that are listed as openings that may be holes of the model.
pub(super) fn write_gaps(out: &mut impl Write, baked: &BakeOutput, most: usize) -> io::Result<()> {
    let graph = &baked.world.graph;
    let holes = graph.suspected_holes();
    let holes: Vec<&Portal> = holes.iter().map(|h| &graph[h.portal]).collect();
    let mut leaks = baked.leaks.clone();
    leaks.retain(|l| !holes.iter().any(|p| is_in(l, p)));
    if leaks.is_empty() {
        return Ok(());
    }
    leaks.sort_by(|a, b| b.area.total_cmp(&a.area));
    writeln!(
        out,
        "{} gaps in the model let light through; they became portals:",
        leaks.len()
    )?;
    for l in leaks.iter().take(most) {
        writeln!(
            out,
            "  at {:.2} {:.2} {:.2}: {:.0} mm wide, {:.3} m², between cells {} and {}",
            l.position.x,
            l.position.y,
            l.position.z,
            l.width * 1000.0,
            l.area,
            l.cells[0],
            l.cells[1]
        )?;
    }
    if leaks.len() > most {
        writeln!(out, "  and {} more", leaks.len() - most)?;
    }
    Ok(())
}

/// Returns `true` if a gap became part of a portal.
fn is_in(gap: &Leak, portal: &Portal) -> bool {
    let [a, b] = portal.cells.map(|c| c.0);
    let corners = portal.outline.iter().map(|p| DVec3::from(p.map(f64::from)));
    let bounds = corners.fold(Aabb::EMPTY, Aabb::including);
    (gap.cells == [a, b] || gap.cells == [b, a]) && bounds.expanded(NEAR).contains(gap.position)
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::cpg::{CellId, PortalKind};

    #[test]
    fn a_gap_is_in_a_portal_of_its_cells_around_it() {
        let portal = Portal {
            cells: [CellId(0), CellId(2)],
            kind: PortalKind::Crack,
            normal: [1.0, 0.0, 0.0],
            outline: vec![[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.1]],
            pieces: Vec::new(),
            area: 0.05,
            fittings: Vec::new(),
            why: Vec::new(),
        };
        let gap = |cells, y: f64| Leak {
            portal: 0,
            cells,
            position: DVec3::new(0.0, y, 0.05),
            width: 0.1,
            area: 0.05,
        };
        assert!(is_in(&gap([2, 0], 0.5), &portal));
        assert!(!is_in(&gap([1, 0], 0.5), &portal));
        assert!(!is_in(&gap([2, 0], 1.5), &portal));
    }
}
