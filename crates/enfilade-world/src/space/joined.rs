//! The layouts of all parts of a space as one, in the frame of the root, as they stand: for what crosses parts by length, such
//! as sound.
//!
//! A door to the surroundings leads to one place only: behind the door of another part that it meets, through a *seam*, a cell
//! of its own between the two; otherwise to the cell of its host before its middle. The outdoor cells of parts other than the
//! root have no portals left: they are not places.
//!
//! Cells and portals of a part follow each other, so those of the root keep their numbers. In a cell of a host, the doors of the
//! parts that stand there come after its own.

use enfilade_cpg::{CellId, Locator, PortalId};
use enfilade_geom::Aabb;

use super::{PartId, Place, Space};
use crate::layout::{CellShape, Layout, LayoutExit, OpeningShape};

/// One layout of all parts.
#[derive(Clone, Debug)]
pub(crate) struct Joined {
    pub(crate) layout: Layout,
    /// Per part its first cell and portal, and the numbers of all.
    first: Vec<[u32; 2]>,
    /// Per portal, the one that it meets.
    pub(crate) docked: Vec<Option<PortalId>>,
    /// Doors of parts that lead to a cell of their host, ascending, with the cell, and how far before the door its air begins.
    pub(crate) hosted: Vec<(PortalId, CellId, f64)>,
}

impl Joined {
    /// Joins the first `n_parts` parts of a space. O(cells + vertices of portals).
    pub(crate) fn new(space: &Space, n_parts: usize) -> Self {
        let mut first = vec![[0; 2]];
        for part in &space.parts[..n_parts] {
            let [cells, portals] = first[first.len() - 1];
            let (n, m) = (part.layout.n_cells(), part.layout.n_portals());
            first.push([cells + n as u32, portals + m as u32]);
        }
        let [n_cells, n_portals] = first[n_parts].map(|n| n as usize);
        let mut joined = Self {
            layout: Layout {
                cells: Vec::with_capacity(n_cells),
                first_exit: Vec::new(),
                exits: Vec::new(),
                exit_bounds: Vec::new(),
                openings: Vec::with_capacity(n_portals),
                specials: Vec::new(),
                specials_by_cell: Vec::new(),
                first_corner: vec![0],
                corners: Vec::new(),
                locator: Locator::default().into(),
                tolerance: 0.0,
            },
            docked: vec![None; n_portals],
            hosted: Vec::new(),
            first,
        };
        let mut exits: Vec<Vec<LayoutExit>> = Vec::with_capacity(n_cells);
        for part in (0..n_parts as u32).map(PartId) {
            joined.add_part(space, part, &mut exits);
        }
        for part in (1..n_parts as u32).map(PartId) {
            joined.add_doors(space, part, &mut exits);
        }
        let layout = &mut joined.layout;
        layout.first_exit.push(0);
        for own in &exits {
            layout.exits.extend_from_slice(own);
            layout.first_exit.push(layout.exits.len() as u32);
        }
        joined
    }

    /// Returns a cell by its number among all parts.
    pub(crate) fn cell(&self, place: Place) -> CellId {
        CellId(self.first[place.part.idx()][0] + place.cell.0)
    }

    /// Returns a portal by its number among all parts.
    pub(crate) fn portal(&self, part: PartId, portal: PortalId) -> PortalId {
        PortalId(self.first[part.idx()][1] + portal.0)
    }

    /// Returns the place of a cell; `None` for a seam.
    pub(crate) fn place(&self, cell: CellId) -> Option<Place> {
        let part = self.first.partition_point(|f| f[0] <= cell.0) - 1;
        let cell = CellId(cell.0 - self.first[part][0]);
        let part = PartId(part as u32);
        (part.idx() < self.n_parts()).then_some(Place { part, cell })
    }

    /// Returns the part of a portal, and its number there.
    pub(crate) fn of_portal(&self, portal: PortalId) -> (PartId, PortalId) {
        let part = self.first.partition_point(|f| f[1] <= portal.0) - 1;
        (
            PartId(part as u32),
            PortalId(portal.0 - self.first[part][1]),
        )
    }

    pub(crate) fn n_parts(&self) -> usize {
        self.first.len() - 1
    }

    /// Returns the cell behind a portal, or behind the one that it meets.
    pub(crate) fn behind(&self, portal: PortalId, cell: CellId) -> CellId {
        let beyond = |portal: PortalId, cell| {
            let cells = self.layout.openings[portal.idx()].cells;
            cells[usize::from(cells[0] == cell)]
        };
        let to = beyond(portal, cell);
        match self.docked[portal.idx()] {
            Some(other) if self.place(to).is_none() => beyond(other, to),
            _ => to,
        }
    }

    fn add_part(&mut self, space: &Space, id: PartId, exits: &mut Vec<Vec<LayoutExit>>) {
        let part = &space.parts[id.idx()];
        let (own, pose) = (&part.layout, &part.pose);
        let is_root = id == PartId::ROOT;
        let [first_cell, first_portal] = self.first[id.idx()];
        let layout = &mut self.layout;
        layout.tolerance = layout.tolerance.max(own.tolerance);
        let moved = |bounds: &Aabb| {
            if is_root || bounds.is_empty() {
                *bounds
            } else {
                Aabb::of_points(&bounds.corners().map(|p| pose.point(p)))
            }
        };
        for cell in (0..own.n_cells() as u32).map(CellId) {
            let shape = own.cell(cell);
            layout.cells.push(CellShape {
                bounds: moved(&shape.bounds),
                ..*shape
            });
            let is_place = part.border != Some(cell);
            let own = own.exits(cell).iter().filter(|_| is_place);
            let own = own.map(|e| LayoutExit {
                portal: PortalId(e.portal.0 + first_portal),
                to: CellId(e.to.0 + first_cell),
            });
            exits.push(own.collect());
        }
        for shape in &own.openings {
            let (first_piece, first) = (layout.first_corner.len() - 1, layout.corners.len());
            for piece in shape.pieces[0] as usize..shape.pieces[1] as usize {
                let at = own.first_corner[piece] as usize..own.first_corner[piece + 1] as usize;
                let corners = own.corners[at].iter();
                layout
                    .corners
                    .extend(corners.map(|p| if is_root { *p } else { pose.point(*p) }));
                layout.first_corner.push(layout.corners.len() as u32);
            }
            let corners = &layout.corners[first..];
            let bounds = Aabb::of_points(corners);
            layout.openings.push(OpeningShape {
                cells: shape.cells.map(|c| CellId(c.0 + first_cell)),
                normal: if is_root {
                    shape.normal
                } else {
                    pose.direction(shape.normal)
                },
                center: if is_root || corners.is_empty() {
                    shape.center
                } else {
                    bounds.center()
                },
                bounds,
                pieces: [first_piece as u32, layout.first_corner.len() as u32 - 1],
                ..*shape
            });
        }
    }

    /// Leads the doors of a part to what is behind them.
    fn add_doors(&mut self, space: &Space, id: PartId, exits: &mut Vec<Vec<LayoutExit>>) {
        let part = &space.parts[id.idx()];
        for door in &part.doors {
            let portal = self.portal(id, door.portal);
            let inner = self.cell(Place {
                part: id,
                cell: door.inner,
            });
            if self.docked[portal.idx()].is_some() {
                continue;
            }
            let is_free = |m: &&(PartId, PortalId)| {
                m.0.idx() < self.n_parts() && self.docked[self.portal(m.0, m.1).idx()].is_none()
            };
            let met = door.meets.iter().find(is_free);
            if let Some(&(other, its)) = met
                && let Some(beyond) = space.parts[other.idx()]
                    .doors
                    .iter()
                    .find(|d| d.portal == its)
            {
                let cell = beyond.inner;
                let ends = [
                    (portal, inner),
                    (
                        self.portal(other, its),
                        self.cell(Place { part: other, cell }),
                    ),
                ];
                self.dock(ends, exits);
                continue;
            }
            // A door may be pushed into what is before it, as far as docking takes for no distance.
            let offs = [0.0, space.docking.gap];
            let before = |off| Some((place_before(space, id, door.portal, off)?, off));
            let before = offs.into_iter().find_map(before);
            if let Some((to, off)) = before.filter(|b| b.0.part.idx() < self.n_parts()) {
                let to = self.cell(to);
                self.lead(portal, inner, to, exits);
                exits[to.idx()].push(LayoutExit { portal, to: inner });
                self.hosted.push((portal, to, off));
            }
        }
    }

    /// Joins two doors by a seam.
    fn dock(&mut self, ends: [(PortalId, CellId); 2], exits: &mut Vec<Vec<LayoutExit>>) {
        let seam = CellId(self.layout.cells.len() as u32);
        self.layout.cells.push(CellShape {
            bounds: Aabb::EMPTY,
            volume: 0.0,
            is_outdoor: false,
            is_void: false,
        });
        exits.push(Vec::new());
        for (k, (portal, inner)) in ends.into_iter().enumerate() {
            self.lead(portal, inner, seam, exits);
            exits[seam.idx()].push(LayoutExit { portal, to: inner });
            self.docked[portal.idx()] = Some(ends[1 - k].0);
        }
    }

    /// Replaces the cell behind a door.
    fn lead(&mut self, portal: PortalId, inner: CellId, to: CellId, exits: &mut [Vec<LayoutExit>]) {
        let cells = &mut self.layout.openings[portal.idx()].cells;
        cells[usize::from(cells[0] == inner)] = to;
        let exit = exits[inner.idx()].iter_mut().find(|e| e.portal == portal);
        if let Some(exit) = exit {
            exit.to = to;
        }
    }
}

/// Returns the place around a part before the middle of one of its doors, at a distance.
fn place_before(space: &Space, id: PartId, portal: PortalId, off: f64) -> Option<Place> {
    let part = &space.parts[id.idx()];
    let opening = part.layout.opening(portal);
    let out = if part.border == Some(opening.cells()[1]) {
        1.0
    } else {
        -1.0
    };
    let middle = opening.pieces().next().map_or(opening.center(), |piece| {
        piece.iter().sum::<enfilade_geom::DVec3>() / piece.len() as f64
    });
    let off = off + 2.0 * part.layout.tolerance();
    let p = part.local.point(middle + opening.normal() * (out * off));
    let (mut host, mut p) = (part.host, p);
    loop {
        let around = &space.parts[host.idx()];
        let cell = around.layout.locate(p)?;
        if around.border != Some(cell) {
            return Some(Place { part: host, cell });
        }
        p = around.local.point(p);
        host = around.host;
    }
}
