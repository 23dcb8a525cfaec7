//! Ways from cell to cell, flat: the boxes of the portals, by the cells that they lead out of.

use enfilade_cpg::{CellId, CellPortalGraph, PortalKind, SpecialShape, Way};

/// Minimum and maximum. [Units: wu]
pub(crate) type Box3 = [[f32; 3]; 2];

/// A way out of a cell, in one direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    /// The cell entered.
    pub(crate) to: u32,
    /// The opening, seen from the cell that it leads out of.
    pub(crate) out: Box3,
    /// The opening, seen from the cell entered: another place if a special portal leads there.
    pub(crate) into: Box3,
}

/// The crossings of a graph and the boxes of its cells.
#[derive(Clone, Debug)]
pub(crate) struct Ways {
    /// Crossings out of cell `c` are `crossings[first[c]..first[c + 1]]`.
    first: Vec<u32>,
    pub(crate) crossings: Vec<Crossing>,
    pub(crate) cells: Vec<Box3>,
    /// True if a special portal leads to another place: straight lines through space then bound nothing.
    pub(crate) has_leads: bool,
}

impl Ways {
    /// Collects the ways of a graph: openings and doors, for eyes that fly windows and cracks too. Special portals are ways in
    /// addition to the doorways that they replace. O(portals).
    pub(crate) fn of(graph: &CellPortalGraph, flies: bool) -> Self {
        let n_cells = graph.cells.len();
        let mut from_to = Vec::new();
        let is_walked = |kind| flies || matches!(kind, PortalKind::Open | PortalKind::Door);
        for portal in graph.portals.iter().filter(|p| is_walked(p.kind)) {
            let opening = box_of(&portal.outline);
            for (from, to) in [(0, 1), (1, 0)] {
                let crossing = Crossing {
                    to: portal.cells[to].0,
                    out: opening,
                    into: opening,
                };
                from_to.push((portal.cells[from], crossing));
            }
        }
        let mut has_leads = false;
        for special in &graph.specials {
            let out = match &special.shape {
                SpecialShape::Portal(id) => graph.portals.get(id.idx()).map(|p| box_of(&p.outline)),
                SpecialShape::Surface { pieces, .. } => Some(box_of(&pieces.concat())),
            };
            for pass in &special.passes {
                if let (Way::Lead { to, map, .. }, Some(out)) = (&pass.way, out) {
                    has_leads = true;
                    let into = box_of(&vertices(&out).map(|p| {
                        map.point(enfilade_geom::DVec3::from_array(p.map(f64::from)))
                            .as_vec3()
                            .to_array()
                    }));
                    let crossing = Crossing {
                        to: to.0,
                        out,
                        into,
                    };
                    from_to.push((special.cell, crossing));
                }
            }
        }
        from_to.retain(|(from, crossing)| from.idx().max(crossing.to as usize) < n_cells);
        from_to.sort_by_key(|(from, _)| *from);
        let mut first = Vec::with_capacity(n_cells + 1);
        let before = |c: u32| from_to.partition_point(|(from, _)| from.0 < c) as u32;
        first.extend((0..=n_cells as u32).map(before));
        Self {
            first,
            crossings: from_to.into_iter().map(|(_, crossing)| crossing).collect(),
            cells: graph.cells.iter().map(|c| c.aabb).collect(),
            has_leads,
        }
    }

    /// Returns the indices of the crossings out of a cell.
    pub(crate) fn out_of(&self, cell: CellId) -> std::ops::Range<usize> {
        self.first[cell.idx()] as usize..self.first[cell.idx() + 1] as usize
    }
}

fn box_of(points: &[[f32; 3]]) -> Box3 {
    let mut b = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for p in points {
        for k in 0..3 {
            b[0][k] = b[0][k].min(p[k]);
            b[1][k] = b[1][k].max(p[k]);
        }
    }
    b
}

fn vertices(b: &Box3) -> [[f32; 3]; 8] {
    std::array::from_fn(|i| std::array::from_fn(|k| b[i >> k & 1][k]))
}

/// Returns the distance between two boxes: 0 if they meet. [Units: wu]
#[inline]
pub(crate) fn gap(a: &Box3, b: &Box3) -> f32 {
    let along = |k: usize| (a[0][k] - b[1][k]).max(b[0][k] - a[1][k]).max(0.0);
    let d = [along(0), along(1), along(2)];
    (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
}
