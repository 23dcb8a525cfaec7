//! Points of portals, and lengths between them within each cell.

use std::sync::Arc;

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;

use crate::layout::{Layout, LayoutExit};
use crate::paths::sampling::{Sampling, sample};

/// The graph of a search: crossings, and the lengths between them within each cell. Made once, read by all searches.
#[derive(Clone, Debug)]
pub struct Ways {
    /// Per portal its first point, and the number of all.
    pub(super) first_point: Vec<u32>,
    pub(super) points: Vec<DVec3>,
    /// The portal of each point.
    pub(super) portal: Vec<u32>,
    pub(super) cells: Vec<[CellId; 2]>,
    /// Per cell its first exit, and the number of all.
    pub(super) first_exit: Vec<u32>,
    pub(super) exits: Vec<LayoutExit>,
    /// Per portal, the index of its first point among the points of either of its cells.
    pub(super) place: Vec<[u32; 2]>,
    /// Per cell the number of its points.
    pub(super) n_points: Vec<u32>,
    /// Per cell, lengths between its points; empty if they are straight.
    bent: Vec<Bent>,
}

/// Lengths within a cell, row by row: shared ones between its first points, and those from each of the others to all.
#[derive(Clone, Debug, Default)]
struct Bent {
    n: usize,
    shared: Arc<Vec<f64>>,
    added: Vec<f64>,
}

impl Bent {
    fn is_empty(&self) -> bool {
        self.shared.is_empty() && self.added.is_empty()
    }

    /// Returns the length between two of `n_all` points.
    #[inline]
    fn length(&self, n_all: usize, from: usize, to: usize) -> f64 {
        if from < self.n && to < self.n {
            return self.shared[from * self.n + to];
        }
        let (later, other) = if from < self.n {
            (to, from)
        } else {
            (from, to)
        };
        self.added[(later - self.n) * n_all + other]
    }
}

impl Ways {
    /// Makes it from a layout: points of all openings, straight lines within cells.
    #[must_use]
    pub fn new(layout: &Layout, sampling: Sampling) -> Self {
        Self::with_points(layout, |portal, points| {
            for piece in layout.opening(portal).pieces() {
                sample(piece, sampling, points);
            }
        })
    }

    /// Makes it with the caller's points: `choose` adds those of a portal. A portal without any is never passed.
    #[must_use]
    pub(crate) fn with_points(
        layout: &Layout,
        mut choose: impl FnMut(PortalId, &mut Vec<DVec3>),
    ) -> Self {
        let (mut first_point, mut points, mut portal) = (vec![0], Vec::new(), Vec::new());
        let mut cells = Vec::new();
        for id in (0..layout.n_portals() as u32).map(PortalId) {
            choose(id, &mut points);
            portal.resize(points.len(), id.0);
            first_point.push(points.len() as u32);
            cells.push(layout.opening(id).cells());
        }
        let mut place = vec![[0; 2]; cells.len()];
        let (mut first_exit, mut exits, mut n_points) = (vec![0], Vec::new(), Vec::new());
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            let mut n = 0;
            for exit in layout.exits(cell) {
                let at = exit.portal.idx();
                place[at][side(cells[at], cell)] = n;
                n += first_point[at + 1] - first_point[at];
                exits.push(*exit);
            }
            first_exit.push(exits.len() as u32);
            n_points.push(n);
        }
        Self {
            bent: vec![Bent::default(); n_points.len()],
            first_point,
            points,
            portal,
            cells,
            first_exit,
            exits,
            place,
            n_points,
        }
    }

    /// Sets the lengths within a cell where straight lines are too short. `lengths` has a row for each of its
    /// [points](Self::points_of), with a length to each; infinite if there is no path within the cell. [Units: wu]
    ///
    /// # Panics
    ///
    /// If the number of lengths is not that of pairs of points.
    pub(crate) fn set_lengths(&mut self, cell: CellId, lengths: Vec<f64>) {
        let n = self.n_points[cell.idx()] as usize;
        assert_eq!(lengths.len(), n * n, "a length for each pair of points");
        self.bent[cell.idx()] = Bent {
            n,
            shared: Arc::new(lengths),
            added: Vec::new(),
        };
    }

    /// Sets the lengths within a cell to those of another world's, which has the first of its points; `added` has a row for each
    /// of the others, with a length to each of all. Copies nothing.
    pub(crate) fn share_lengths(&mut self, cell: CellId, of: &Self, own: CellId, added: Vec<f64>) {
        self.bent[cell.idx()] = Bent {
            n: of.n_points[own.idx()] as usize,
            shared: of.bent[own.idx()].shared.clone(),
            added,
        };
    }

    /// Returns the number of a cell's points.
    pub(crate) fn n_points(&self, cell: CellId) -> usize {
        self.n_points[cell.idx()] as usize
    }

    /// Returns the points of a cell's portals, in the order of its exits, each with its portal. [Units: wu]
    #[doc(hidden)]
    pub fn points_of(&self, cell: CellId) -> impl Iterator<Item = (PortalId, DVec3)> + Clone {
        self.exits_of(cell).iter().flat_map(|exit| {
            let points = self.range(exit.portal);
            points.map(|k| (exit.portal, self.points[k as usize]))
        })
    }

    /// Returns the points of a portal. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn points(&self, portal: PortalId) -> &[DVec3] {
        let range = self.range(portal);
        &self.points[range.start as usize..range.end as usize]
    }

    /// Returns the indices of a portal's points among all points.
    pub(crate) fn range(&self, portal: PortalId) -> std::ops::Range<u32> {
        self.first_point[portal.idx()]..self.first_point[portal.idx() + 1]
    }

    /// Returns the indices of a portal's points among the [points of one of its cells](Self::points_of).
    pub(crate) fn places(&self, portal: PortalId, cell: CellId) -> std::ops::Range<usize> {
        let at = portal.idx();
        let first = self.place[at][side(self.cells[at], cell)] as usize;
        first..first + self.range(portal).len()
    }

    pub(crate) fn exits_of(&self, cell: CellId) -> &[LayoutExit] {
        let first = &self.first_exit[cell.idx()..];
        &self.exits[first[0] as usize..first[1] as usize]
    }

    /// Returns the length between two points of a cell, by their indices among [those of the cell](Self::points_of). [Units: wu]
    ///
    /// # Panics
    ///
    /// If the cell has no such points.
    #[must_use]
    #[doc(hidden)]
    pub fn length(&self, cell: CellId, from: usize, to: usize) -> f64 {
        let n = self.n_points[cell.idx()] as usize;
        let point = |k: usize| self.points_of(cell).nth(k).expect("a point of the cell").1;
        let bent = &self.bent[cell.idx()];
        if bent.is_empty() {
            point(from).distance(point(to))
        } else {
            bent.length(n, from, to)
        }
    }

    /// Returns the lengths from one point of a cell to those of one of its portals, in order.
    pub(crate) fn lengths(
        &self,
        cell: CellId,
        from: u32,
        to: PortalId,
    ) -> impl Iterator<Item = f64> + '_ {
        let table = &self.bent[cell.idx()];
        let portal = self.portal[from as usize] as usize;
        let row =
            self.place[portal][side(self.cells[portal], cell)] + from - self.first_point[portal];
        let n = self.n_points[cell.idx()] as usize;
        let first = self.place[to.idx()][side(self.cells[to.idx()], cell)] as usize;
        let (at, is_straight) = (self.points[from as usize], table.is_empty());
        (self.range(to)).enumerate().map(move |(i, k)| {
            if is_straight {
                at.distance(self.points[k as usize])
            } else {
                table.length(n, row as usize, first + i)
            }
        })
    }

    pub(crate) fn node(&self, point: u32, into: CellId) -> u32 {
        let portal = self.portal[point as usize] as usize;
        2 * point + side(self.cells[portal], into) as u32
    }

    pub(super) fn exit_of(&self, node: u32) -> LayoutExit {
        let portal = self.portal[node as usize / 2];
        LayoutExit {
            portal: PortalId(portal),
            to: self.cells[portal as usize][node as usize % 2],
        }
    }
}

pub(super) fn side(cells: [CellId; 2], cell: CellId) -> usize {
    usize::from(cells[1] == cell)
}
