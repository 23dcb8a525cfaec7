//! Openings to outdoors that look unintended.
//!
//! A graph does not record intentions. This reports openings to outdoors whose shape or place does not fit doors and
//! windows; in doubt, it reports nothing.

use crate::{CellPortalGraph, Portal, PortalId, PortalKind};
use enfilade_geom::{DVec3, is_rather_level};

/// Least width of a window. [Units: wu]
const NARROW: f32 = 0.3;
/// Narrower gaps are those between surfaces that should touch, not holes in one. [Units: wu]
const GAP: f32 = 0.05;
/// Least share of its bounding rectangle that a rectangle, arch or circle (0.785) fills, even behind a cross.
const REGULAR: f32 = 0.6;

/// The reason why an opening may be a hole of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum HoleReason {
    /// It lies in a floor, ceiling or roof, and no pane closes it.
    Overhead,
    /// It is neither a rectangle nor round.
    Irregular,
    /// It is narrower than 0.3 m.
    Narrow,
}

impl std::fmt::Display for HoleReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Overhead => "in a floor or roof, without a pane",
            Self::Irregular => "of no regular shape",
            Self::Narrow => "too narrow for a window",
        })
    }
}

/// An opening to outdoors that may be a hole of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Hole {
    /// The opening.
    pub portal: PortalId,
    /// Middle of its outline. [Units: wu]
    pub position: [f32; 3],
    /// The reason for suspicion.
    pub reason: HoleReason,
}

impl CellPortalGraph {
    /// Returns openings to outdoors that may be holes of the model, the largest first.
    ///
    /// Leaves out cracks up to 0.05 m wide, which are gaps between surfaces, and openings to an outdoors that sees no triangle, where
    /// the air around the scene was divided from the air beyond: those are not in a wall. O(n log n) for n portal
    /// vertices.
    #[must_use]
    pub fn suspected_holes(&self) -> Vec<Hole> {
        let is_outdoor = |p: &Portal| {
            p.cells
                .iter()
                .filter_map(|c| self.cells.get(c.0 as usize))
                .any(|c| c.outdoor && c.n_triangles > 0)
        };
        // Land is meant to be open.
        let is_land = |p: &Portal| p.cells.iter().any(|c| self[*c].is_land);
        let mut holes: Vec<Hole> = (0..)
            .zip(&self.portals)
            .filter(|(_, p)| is_outdoor(p) && !is_land(p))
            .filter_map(|(id, p)| {
                Some(Hole {
                    portal: PortalId(id),
                    position: p.center(),
                    reason: reason(p)?,
                })
            })
            .collect();
        let area = |h: &Hole| self.portals[h.portal.0 as usize].area;
        holes.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a.portal.cmp(&b.portal)));
        holes
    }
}

fn reason(p: &Portal) -> Option<HoleReason> {
    let [width, height] = p.size();
    match p.kind {
        PortalKind::Door => return None,
        PortalKind::Crack => {
            let is_wide = width.min(height) > GAP;
            return is_wide.then_some(HoleReason::Narrow);
        }
        PortalKind::Open | PortalKind::Window => {}
    }
    if p.kind == PortalKind::Open && p.is_level() {
        Some(HoleReason::Overhead)
    } else if width.min(height) < NARROW {
        Some(HoleReason::Narrow)
    } else if p.area < REGULAR * width * height {
        Some(HoleReason::Irregular)
    } else {
        None
    }
}

impl Portal {
    /// Returns the width and height of the outline, seen by someone who stands in front of it; for a hole in a floor,
    /// its size along x and z. [Units: wu]
    #[must_use]
    pub fn size(&self) -> [f32; 2] {
        let vector = |v: &[f32; 3]| DVec3::from(v.map(f64::from));
        let outline = self.outline.iter().map(vector);
        size_across(vector(&self.normal), &outline).map(|v| v as f32)
    }

    /// Returns `true` if it lies in a floor, a ceiling or a roof rather than in a wall.
    #[must_use]
    pub fn is_level(&self) -> bool {
        is_rather_level(DVec3::from(self.normal.map(f64::from)))
    }

    /// Returns the mean of the outline's vertices. [Units: wu]
    #[must_use]
    pub fn center(&self) -> [f32; 3] {
        let sum = self
            .outline
            .iter()
            .fold([0.0; 3], |s, c| [0, 1, 2].map(|k| s[k] + c[k]));
        sum.map(|s| s / self.outline.len() as f32)
    }
}

/// Returns the width and height of points in a plane, as [`Portal::size`]. [Units: wu]
pub(crate) fn size_across(
    normal: DVec3,
    points: &(impl Iterator<Item = DVec3> + Clone),
) -> [f64; 2] {
    let up_hint = if is_rather_level(normal) {
        DVec3::Z
    } else {
        DVec3::Y
    };
    let across = up_hint.cross(normal).normalize_or_zero();
    let up = normal.cross(across);
    [across, up].map(|axis| {
        let along = points.clone().map(|p| axis.dot(p));
        let (least, most) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), d| {
            (lo.min(d), hi.max(d))
        });
        most - least
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cell, CellId};

    /// Returns the area of a convex polygon.
    fn area(outline: &[[f32; 3]]) -> f32 {
        let at = |c: &[f32; 3]| DVec3::from(c.map(f64::from));
        let twice: f64 = outline
            .windows(2)
            .map(|e| {
                let o = at(&outline[0]);
                (at(&e[0]) - o).cross(at(&e[1]) - o).length()
            })
            .sum();
        (0.5 * twice) as f32
    }

    /// Makes a graph of one room and outdoors, joined by these outlines.
    fn graph(portals: Vec<(PortalKind, [f32; 3], Vec<[f32; 3]>)>) -> CellPortalGraph {
        let cell = |outdoor| Cell {
            outdoor,
            n_triangles: 12,
            ..Cell::default()
        };
        CellPortalGraph {
            cells: vec![cell(true), cell(false), cell(false)],
            portals: portals
                .into_iter()
                .map(|(kind, normal, outline)| Portal {
                    cells: [CellId(0), CellId(1)],
                    kind,
                    normal,
                    area: area(&outline),
                    pieces: vec![outline.clone()],
                    outline,
                    fittings: Vec::new(),
                    why: Vec::new(),
                })
                .collect(),
            ..CellPortalGraph::default()
        }
    }

    fn upright(corners: &[[f32; 2]]) -> Vec<[f32; 3]> {
        corners.iter().map(|&[z, y]| [0.0, y, -z]).collect()
    }

    fn reasons(g: &CellPortalGraph) -> Vec<(u32, HoleReason)> {
        let holes = g.suspected_holes();
        holes.iter().map(|h| (h.portal.0, h.reason)).collect()
    }

    const X: [f32; 3] = [1.0, 0.0, 0.0];

    #[test]
    fn an_outdoors_that_sees_nothing_has_no_wall_for_holes() {
        let ragged = upright(&[[0.0, 0.0], [2.0, 0.3], [1.1, 2.0]]);
        let mut g = graph(vec![(PortalKind::Open, X, ragged)]);
        assert_eq!(g.suspected_holes().len(), 1);
        g.cells[0].n_triangles = 0;
        assert_eq!(g.suspected_holes().len(), 0);
    }

    #[test]
    fn doors_windows_arches_and_portholes_are_no_holes() {
        let round: Vec<[f32; 2]> = (0..24)
            .map(|i| (i as f32 * std::f32::consts::TAU / 24.0).sin_cos())
            .map(|(sin, cos)| [0.3 * cos, 1.5 + 0.3 * sin])
            .collect();
        let door = upright(&[[0.0, 0.0], [0.9, 0.0], [0.9, 2.1], [0.0, 2.1]]);
        let g = graph(vec![
            (PortalKind::Open, X, door),
            (PortalKind::Window, X, upright(&round)),
        ]);
        assert_eq!(reasons(&g), []);
    }

    #[test]
    fn holes_are_told_worst_first_with_what_is_wrong() {
        let triangle = upright(&[[0.0, 1.0], [1.0, 1.0], [0.5, 2.0]]);
        let slot = upright(&[[0.0, 0.5], [0.1, 0.5], [0.1, 2.0], [0.0, 2.0]]);
        let hair = upright(&[[0.0, 0.5], [0.03, 0.5], [0.03, 2.0], [0.0, 2.0]]);
        let roof: Vec<[f32; 3]> = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
            .map(|[x, z]| [x, 3.0, z])
            .to_vec();
        let up = [0.0, -1.0, 0.0];
        let mut g = graph(vec![
            (PortalKind::Window, X, slot.clone()),
            (PortalKind::Open, X, triangle.clone()),
            (PortalKind::Open, up, roof.clone()),
            // A skylight has a pane; a gap between surfaces is known as one; a door has a leaf.
            (PortalKind::Window, up, roof),
            (PortalKind::Crack, X, hair),
            (PortalKind::Door, X, triangle),
            (PortalKind::Crack, X, slot),
        ]);
        assert_eq!(
            reasons(&g),
            [
                (2, HoleReason::Overhead),
                (1, HoleReason::Irregular),
                (0, HoleReason::Narrow),
                (6, HoleReason::Narrow)
            ]
        );
        assert_eq!(g.suspected_holes()[0].position, [1.0, 3.0, 1.0]);
        // Between rooms, stairs go through floors.
        g.portals.iter_mut().for_each(|p| p.cells[0] = CellId(2));
        assert_eq!(reasons(&g), []);
    }
}
