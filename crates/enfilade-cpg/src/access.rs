//! Access to a graph: by id, by name, from cell to cell.

use std::ops::{Index, IndexMut};

use enfilade_geom::{DVec3, closest_point_on_segment};

use crate::{Batch, Cell, CellId, CellPortalGraph, Portal, PortalId, PortalKind, World};

/// A portal seen from one of its cells.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Exit<'a> {
    /// The portal's id.
    pub id: PortalId,
    /// The portal.
    pub portal: &'a Portal,
    /// The cell behind it.
    pub to: CellId,
}

impl Portal {
    /// Returns the cell on the other side of `cell`. O(1).
    ///
    /// `cell` must be one of the portal's two; otherwise a debug build panics, and a release build returns the first
    /// of them.
    #[inline]
    #[must_use]
    pub fn beyond(&self, cell: CellId) -> CellId {
        debug_assert!(self.cells.contains(&cell), "{cell} is not at this portal");
        self.cells[usize::from(self.cells[0] == cell)]
    }

    /// Returns the distance of a point from the outline, infinite if that has no vertices. Linear in its vertices. [Units: wu]
    #[must_use]
    pub fn distance(&self, at: DVec3) -> f64 {
        let point = |p: &[f32; 3]| DVec3::from(p.map(f64::from));
        let outline: Vec<DVec3> = self.outline.iter().map(point).collect();
        let normal = point(&self.normal);
        let edges = || outline.iter().zip(outline.iter().cycle().skip(1));
        let sides = || edges().map(|(a, b)| normal.dot((*b - *a).cross(at - *a)));
        if sides().all(|s| s >= 0.0) || sides().all(|s| s <= 0.0) {
            return outline.first().map_or(f64::INFINITY, |a| {
                normal.dot(at - *a).abs() / normal.length().max(1e-9)
            });
        }
        let to_edge = edges().map(|(&a, &b)| at.distance(closest_point_on_segment(at, a, b)));
        to_edge.fold(f64::INFINITY, f64::min)
    }
}

impl CellPortalGraph {
    /// Returns the ids of all cells, ascending.
    pub fn cell_ids(&self) -> impl ExactSizeIterator<Item = CellId> + use<> {
        (0..self.cells.len() as u32).map(CellId)
    }

    /// Returns the ids of all portals, ascending.
    pub fn portal_ids(&self) -> impl ExactSizeIterator<Item = PortalId> + use<> {
        (0..self.portals.len() as u32).map(PortalId)
    }

    /// Returns the portals of a cell, ascending, each with the cell behind it; none for a cell that does not exist.
    /// Linear in their number.
    pub fn exits(&self, cell: CellId) -> impl Iterator<Item = Exit<'_>> + Clone {
        let ids = self.cells.get(cell.idx()).map_or(&[][..], |c| &c.portals);
        ids.iter().map(move |&id| {
            let portal = &self[id];
            Exit {
                id,
                portal,
                to: portal.beyond(cell),
            }
        })
    }

    /// Returns all cells but the outdoors, rooms, voids and open land, ascending. O(cells).
    pub fn indoor_cells(&self) -> impl Iterator<Item = (CellId, &Cell)> + Clone {
        let numbered = (0..).map(CellId).zip(&self.cells);
        numbered.filter(|(_, cell)| !cell.outdoor)
    }

    /// Returns the rooms: all cells but the outdoors, voids and open land, ascending. O(cells).
    pub fn rooms(&self) -> impl Iterator<Item = (CellId, &Cell)> + Clone {
        self.indoor_cells().filter(|(_, cell)| cell.is_room())
    }

    /// Returns the number of portals of a kind of a cell.
    #[doc(hidden)]
    #[must_use]
    pub fn n_portals(&self, cell: CellId, kind: PortalKind) -> usize {
        // A graph that is not checked yet may list portals that it lacks.
        let portals = (self[cell].portals.iter()).filter_map(|p| self.portals.get(p.idx()));
        portals.filter(|p| p.kind == kind).count()
    }

    /// Returns rooms and open land, all cells that maps show, ascending. O(cells).
    pub fn places(&self) -> impl Iterator<Item = (CellId, &Cell)> + Clone {
        self.indoor_cells().filter(|(_, cell)| cell.is_place())
    }

    /// Returns the outdoors, if there is one. O(cells).
    #[must_use]
    pub fn outdoors(&self) -> Option<CellId> {
        self.cell_ids().find(|&c| self[c].outdoor)
    }

    /// Returns the cell with a name, such as `cell-3` or `outdoors`; the inverse of `graph[cell].name`. O(cells).
    #[must_use]
    pub fn cell_named(&self, name: &str) -> Option<CellId> {
        self.cell_ids().find(|&c| self[c].name == name)
    }

    /// Returns the cell of a point; `None` in solids and for coordinates that are not finite. About 100 ns.
    /// [Units: wu]
    #[must_use]
    pub fn locate(&self, p: [f32; 3]) -> Option<CellId> {
        let is_point = p.iter().all(|x| x.is_finite());
        let p = DVec3::from_array(p.map(f64::from));
        self.locator.locate(p).filter(|_| is_point)
    }

    /// Returns the portals that join two cells, ascending; none if the cells are not neighbors.
    pub fn portals_between(&self, a: CellId, b: CellId) -> impl Iterator<Item = PortalId> {
        self.exits(a).filter(move |e| e.to == b).map(|e| e.id)
    }
}

/// # Panics
///
/// If the graph does not have the cell.
impl Index<CellId> for CellPortalGraph {
    type Output = Cell;

    #[inline]
    fn index(&self, cell: CellId) -> &Cell {
        &self.cells[cell.idx()]
    }
}

/// # Panics
///
/// If the graph does not have the cell.
impl IndexMut<CellId> for CellPortalGraph {
    #[inline]
    fn index_mut(&mut self, cell: CellId) -> &mut Cell {
        &mut self.cells[cell.idx()]
    }
}

/// # Panics
///
/// If the graph does not have the portal.
impl Index<PortalId> for CellPortalGraph {
    type Output = Portal;

    #[inline]
    fn index(&self, portal: PortalId) -> &Portal {
        &self.portals[portal.idx()]
    }
}

/// # Panics
///
/// If the graph does not have the portal.
impl IndexMut<PortalId> for CellPortalGraph {
    #[inline]
    fn index_mut(&mut self, portal: PortalId) -> &mut Portal {
        &mut self.portals[portal.idx()]
    }
}

impl World {
    /// Returns the batches that one cell sees without passing a portal, in the order of the file. O(batches).
    pub fn batches_of(&self, cell: CellId) -> impl Iterator<Item = &Batch> {
        let sees = move |b: &&Batch| b.cells.binary_search(&cell).is_ok();
        self.batches.iter().filter(sees)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{Locator, PortalKind};

    fn three_cells() -> CellPortalGraph {
        let cell = |name: &str, portals: &[u32]| Cell {
            name: name.into(),
            portals: portals.iter().copied().map(PortalId).collect(),
            outdoor: name == "outdoors",
            ..Cell::default()
        };
        let portal = |a, b| Portal {
            cells: [CellId(a), CellId(b)],
            kind: PortalKind::Open,
            normal: [1.0, 0.0, 0.0],
            outline: vec![
                [0.0, 0.0, 0.0],
                [0.0, 2.0, 0.0],
                [0.0, 2.0, 2.0],
                [0.0, 0.0, 2.0],
            ],
            pieces: Vec::new(),
            area: 4.0,
            fittings: Vec::new(),
            why: Vec::new(),
        };
        CellPortalGraph {
            cells: vec![
                cell("cell-0", &[0, 1, 2]),
                cell("outdoors", &[0]),
                cell("cell-2", &[1, 2]),
            ],
            portals: vec![portal(0, 1), portal(2, 0), portal(0, 2)],
            ..CellPortalGraph::default()
        }
    }

    #[test]
    fn exits_lead_to_the_other_side_either_way() {
        let graph = three_cells();
        let to = |c| {
            graph
                .exits(CellId(c))
                .map(|e| (e.id.0, e.to.0))
                .collect::<Vec<_>>()
        };
        assert_eq!(to(0), [(0, 1), (1, 2), (2, 2)]);
        assert_eq!(to(1), [(0, 0)]);
        assert_eq!(to(2), [(1, 0), (2, 0)]);
        assert_eq!(to(3), []);
        let between: Vec<_> = graph.portals_between(CellId(2), CellId(0)).collect();
        assert_eq!(between, [PortalId(1), PortalId(2)]);
        assert_eq!(graph.portals_between(CellId(2), CellId(1)).count(), 0);
    }

    #[test]
    fn names_lead_to_ids_and_back() {
        let mut graph = three_cells();
        for cell in graph.cell_ids() {
            assert_eq!(graph.cell_named(&graph[cell].name), Some(cell));
        }
        assert_eq!(graph.cell_named("cell-1"), None);
        assert_eq!(graph.outdoors(), Some(CellId(1)));
        graph.locator = Arc::new(Locator {
            outside: graph.outdoors(),
            ..Locator::default()
        });
        assert_eq!(graph.locate([1.0, 2.0, 3.0]), Some(CellId(1)));
        assert_eq!(graph.locate([1.0, f32::NAN, 3.0]), None);
        assert_eq!(graph.locate([f32::INFINITY, 2.0, 3.0]), None);
        assert_eq!(graph.cell_named(&CellId(2).to_string()), Some(CellId(2)));
        assert_eq!(PortalId(1).to_string(), "portal-1");
        let indoors: Vec<_> = graph
            .indoor_cells()
            .map(|(id, c)| (id.0, &c.name[..]))
            .collect();
        assert_eq!(indoors, [(0, "cell-0"), (2, "cell-2")]);
        graph[CellId(2)].name = "kitchen".into();
        assert_eq!(graph.cell_named("kitchen"), Some(CellId(2)));
    }

    #[test]
    fn a_cell_draws_the_batches_that_list_it() {
        let batch = |cells: &[u32]| Batch {
            cells: cells.iter().copied().map(CellId).collect(),
            ..Batch::default()
        };
        let world = World {
            batches: vec![batch(&[0]), batch(&[1]), batch(&[0, 1, 2]), batch(&[])],
            ..World::default()
        };
        let n = |c| world.batches_of(CellId(c)).count();
        assert_eq!([n(0), n(1), n(2), n(3)], [2, 2, 1, 0]);
    }
}
