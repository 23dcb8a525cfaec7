//! Adds a portal to a finished world: divides the cell in which the portal lies.
//!
//! Everything happens within that one cell. The exact complex is rebuilt from the cell's own triangles, its portals and
//! the new polygon ([`crate::complex`]); the polygon divides it into the new cells. Only the parts of the world that
//! refer to the cell change: its part of the locator, its lists of triangles and details, and those of its portals that
//! the polygon crosses, which are cut in two. [`crate::simplify::delete_portal`] removes a portal.
//!
//! **Which way it errs:** a triangle that neither part is found to see is listed in both.

mod carried;
pub mod special;
mod splice;

use std::collections::BTreeMap;

use enfilade_cpg::{
    Cell, CellId, FittingPart, Portal, PortalId, Reason, SourceRuns, SpecialId, Why, World,
};
use enfilade_geom::{DVec3, Plane, Triangle, Winding};

use crate::assemble::rounded_portal;
use crate::complex::divide::{BACK, Cutter, FRONT, Undivided};
use crate::complex::{ComplexInput, Partition, build_complex};
use crate::simplify::Batches;
use crate::subset::subset_of;

use splice::{SideTree, spliced};

/// Greatest distance of a vertex from the plane through them all; vertices are moved into it. [Units: wu]
///
/// People type coordinates with two or three digits.
const FLAT: f64 = 0.005;

/// Greatest distance by which a vertex may bend inwards from the line between its neighbors: rounding. [Units: wu]
const BEND: f64 = 1e-3;

/// A world with one more portal.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Added {
    /// The world.
    pub world: World,
    /// The cell that was cut; its larger part, or the one outdoors, keeps its number.
    pub cell: CellId,
    /// The other part, the last of the cells.
    pub new_cell: CellId,
    /// The new portals between the two, the largest first.
    pub portals: Vec<PortalId>,
    /// Portals of the cell that the polygon crosses, each with the number of its second half.
    pub halved: Vec<(PortalId, PortalId)>,
}

/// The reason why a portal could not be added.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AddPortalError {
    /// Fewer than three vertices.
    #[error("a portal needs at least 3 vertices, not {n}")]
    TooFewCorners {
        /// Number of vertices.
        n: usize,
    },
    /// A coordinate is not finite.
    #[error("vertex {corner} of the portal is not finite")]
    NotFinite {
        /// Index of the vertex.
        corner: usize,
    },
    /// No polygon: all vertices on one line.
    #[error("the portal's vertices lie on one line")]
    NoArea,
    /// Not planar.
    #[error(
        "vertex {corner} of the portal, {}, is {off:.3} m off the plane of the others; at most {FLAT} m \
         counts as rounding",
        place(*.at)
    )]
    NotPlanar {
        /// Index of the vertex.
        corner: usize,
        /// Position of the vertex. [Units: wu]
        at: DVec3,
        /// Its distance from the plane. [Units: wu]
        off: f64,
    },
    /// Not convex.
    #[error(
        "the portal is not convex at vertex {corner}, {}: give its vertices in order around a convex outline",
        place(*.at)
    )]
    NotConvex {
        /// Index of the vertex.
        corner: usize,
        /// Position of the vertex. [Units: wu]
        at: DVec3,
    },
    /// The middle is not in a cell.
    #[error("the portal's middle, {}, lies in solid matter, not in a cell", place(*.at))]
    InSolid {
        /// The middle. [Units: wu]
        at: DVec3,
    },
    /// The cell does not lie on both sides.
    #[error(
        "the portal at {} has cell {} on one side only: it lies in a wall or on an existing portal",
        place(*.at), .cell.0
    )]
    Aside {
        /// Its middle. [Units: wu]
        at: DVec3,
        /// The cell.
        cell: CellId,
    },
    /// A way leads around it.
    #[error(
        "the portal does not divide cell {}: a way leads around it at {}; it must span from wall to wall (it may \
         reach into them)",
        .cell.0, place(*.at)
    )]
    DoesNotPart {
        /// The cell.
        cell: CellId,
        /// A point beside the portal where its plane is open. [Units: wu]
        at: DVec3,
    },
    /// Both parts would be outdoors.
    #[error(
        "the portal at {} divides the outdoors, cell {}, into two parts that join again beyond the scene",
        place(*.at), .cell.0
    )]
    Endless {
        /// Its middle. [Units: wu]
        at: DVec3,
        /// The cell.
        cell: CellId,
    },
    /// A special portal would be cut.
    #[error(
        "the portal at {} cuts {special}, or what it leads to, in two; make it plain first, or cut elsewhere",
        place(*.at)
    )]
    CutsSpecial {
        /// Its middle. [Units: wu]
        at: DVec3,
        /// The special portal.
        special: SpecialId,
    },
    /// It would vanish by rounding.
    #[error("the opening of the portal at {} is narrower than the rounding of coordinates", place(*.at))]
    TooNarrow {
        /// Its middle. [Units: wu]
        at: DVec3,
    },
}

/// Formats a point as the command takes it.
fn place(p: DVec3) -> String {
    format!("{:.2},{:.2},{:.2}", p.x, p.y, p.z)
}

/// Divides the cell that contains the middle of a polygon by that polygon.
///
/// `corners` are the vertices of a convex planar polygon, in order, either way around; parts of it in walls or other
/// cells are ignored. The result keeps both promises if `world` does; cells and portals keep their numbers, new ones
/// come last. Time: that of a bake for the triangles of the one cell.
///
/// # Errors
/// If the vertices are not a convex planar polygon, or it does not divide a cell; `world` is unchanged.
pub fn add_portal(world: &World, corners: &[DVec3]) -> Result<Added, AddPortalError> {
    let (plane, candidate) = checked(corners)?;
    let at = candidate.centroid();
    let old = &world.graph;
    let cell = old
        .locator
        .locate(at)
        .ok_or(AddPortalError::InSolid { at })?;

    let distance = |p: DVec3| plane.signed_distance(p);
    let cut = cut_cell(world, cell, vec![candidate], &distance);
    let mut added = cut.map_err(|why| match why {
        Uncut::Undivided(Undivided::Aside) => AddPortalError::Aside { at, cell },
        Uncut::Undivided(Undivided::Around(at)) => AddPortalError::DoesNotPart { cell, at },
        Uncut::Undivided(Undivided::Endless) => AddPortalError::Endless { at, cell },
        Uncut::TooNarrow => AddPortalError::TooNarrow { at },
        Uncut::Special(special) => AddPortalError::CutsSpecial { at, special },
    })?;
    // The count shows readers of the file that no rule placed its portals.
    let counts = &mut added.world.graph.statistics.counts;
    *counts.entry("edits".to_owned()).or_default() += 1.0;
    Ok(added)
}

/// The reason why a cell could not be cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Uncut {
    /// The candidates divide nothing.
    Undivided(Undivided),
    /// The portals would vanish by rounding.
    TooNarrow,
    /// A special portal would be cut.
    Special(SpecialId),
}

/// Cuts a cell in two by candidates; `distance` returns how far in front of all of them a point lies.
pub(crate) fn cut_cell(
    world: &World,
    cell: CellId,
    mut candidates: Vec<Winding>,
    distance: &dyn Fn(DVec3) -> f64,
) -> Result<Added, Uncut> {
    let old = &world.graph;
    let cutter = Cutter {
        n_candidates: candidates.len() as u32,
        distance,
    };

    // 1. The complex of this cell alone.
    let listed = triangles_of(world, cell);
    let triangles: Vec<Triangle> = listed.iter().map(|t| t.2).collect();
    let of_cell = &old.cells[cell.0 as usize];
    let pieces = of_cell
        .portals
        .iter()
        .flat_map(|p| &old.portals[p.0 as usize].pieces);
    candidates.extend(pieces.map(|piece| winding(piece)));
    let complex = build_complex(&ComplexInput {
        triangles: &triangles,
        candidates: &candidates,
        missing: &[],
        // The whole box of the scene, so that tolerances are those of the bake.
        bounds: old.locator.bounds,
        gap: 0.0,
        has_seals: false,
    });

    // 2. Its two parts.
    let partition = complex
        .divided(&cutter, |p| old.locator.locate(p) == Some(cell))
        .map_err(Uncut::Undivided)?;
    let parts = Parts::new(cell, old.cells.len(), &partition);

    // 3. Everything that refers to the cell.
    let mut out = world.clone();
    out.pvs = None;
    out.room_facts = None;
    out.graph.locator = spliced(&old.locator, cell, &parts.sides, parts.ids).into();
    let halved = parts.hand_out_portals(&mut out, complex.opening_tolerance());
    parts
        .hand_out_specials(&mut out, &halved, complex.opening_tolerance())
        .map_err(Uncut::Special)?;
    let mut new_portals: Vec<Portal> = Vec::new();
    for p in &partition.portals {
        let rounded = rounded_portal(&p.plane, &p.outline, &p.pieces, complex.opening_tolerance());
        new_portals.extend(rounded.map(|portal| Portal {
            cells: p.cells.map(|side| parts.id(side)),
            kind: p.kind,
            why: vec![Why::given(Reason::Asked)],
            ..portal
        }));
    }
    if new_portals.is_empty() {
        return Err(Uncut::TooNarrow);
    }
    new_portals.sort_by(|a, b| b.area.total_cmp(&a.area));
    let first = out.graph.portals.len() as u32;
    let portals = (first..first + new_portals.len() as u32)
        .map(PortalId)
        .collect();
    out.graph.portals.extend(new_portals);
    parts.hand_out_triangles(&mut out, &listed, &partition);
    parts.hand_out_details(&mut out);
    parts.measure_cells(&mut out, &partition);
    Ok(Added {
        world: out,
        cell,
        new_cell: parts.new_cell(),
        portals,
        halved,
    })
}

/// Returns the plane of a polygon, and the polygon in it, counter-clockwise.
pub(crate) fn checked(corners: &[DVec3]) -> Result<(Plane, Winding), AddPortalError> {
    let n = corners.len();
    if n < 3 {
        return Err(AddPortalError::TooFewCorners { n });
    }
    if let Some(corner) = corners.iter().position(|p| !p.is_finite()) {
        return Err(AddPortalError::NotFinite { corner });
    }
    let given = Winding::new(corners.to_vec());
    let size = given.aabb().size().max_element();
    let normal = given
        .area_normal()
        .try_normalize()
        .filter(|_| given.area() > FLAT * size)
        .ok_or(AddPortalError::NoArea)?;
    let plane = Plane::through(given.mean(), normal);
    let off = |i: &usize| plane.signed_distance(corners[*i]).abs();
    if let Some(corner) = (0..n)
        .max_by(|a, b| off(a).total_cmp(&off(b)))
        .filter(|i| off(i) > FLAT)
    {
        return Err(AddPortalError::NotPlanar {
            corner,
            at: corners[corner],
            off: off(&corner),
        });
    }
    let flat: Vec<DVec3> = corners.iter().map(|&p| plane.project(p)).collect();
    for (i, &p) in flat.iter().enumerate() {
        let (a, b) = (flat[(i + n - 1) % n], flat[(i + 1) % n]);
        let bend = (p - a).cross(b - p).dot(normal);
        if bend < -BEND * (b - a).length() {
            return Err(AddPortalError::NotConvex {
                corner: i,
                at: corners[i],
            });
        }
    }
    let hull = Winding::hull_in_plane(&plane, &flat);
    // A star turns the same way at every vertex, too, but does not fill its hull.
    let rounding = BEND * n as f64 * size;
    if (Winding::new(flat).area() - hull.area()).abs() > rounding {
        return Err(AddPortalError::NotConvex {
            corner: 0,
            at: corners[0],
        });
    }
    Ok((plane, hull))
}

fn winding(points: &[[f32; 3]]) -> Winding {
    Winding::new(
        points
            .iter()
            .map(|p| DVec3::from(p.map(f64::from)))
            .collect(),
    )
}

/// Returns the structural triangles that a cell sees: batch, place in the batch, vertices.
pub(crate) fn triangles_of(world: &World, cell: CellId) -> Vec<(u32, u32, Triangle)> {
    let mut out = Vec::new();
    for (b, batch) in world.batches.iter().enumerate() {
        if batch.cells.binary_search(&cell).is_ok() {
            let triangles = (0..).zip(batch.primitive.triangles());
            out.extend(triangles.map(|(t, triangle)| (b as u32, t, triangle)));
        }
    }
    out
}

/// The two parts of a cell, with their numbers.
struct Parts {
    cell: CellId,
    /// For each side, [`FRONT`] and [`BACK`], its cell.
    ids: [CellId; 2],
    /// The locator that separates the two parts, for points of the cell; its leaves are sides.
    sides: SideTree,
}

impl Parts {
    fn new(cell: CellId, n_cells: usize, partition: &Partition) -> Self {
        let [f, b] = [FRONT, BACK].map(|s| partition.volumes[s as usize]);
        let front_keeps = partition.outside.map_or(f >= b, |s| s == FRONT);
        let new = CellId(n_cells as u32);
        Self {
            cell,
            ids: if front_keeps {
                [cell, new]
            } else {
                [new, cell]
            },
            sides: SideTree::of(&partition.locator),
        }
    }

    fn id(&self, side: u32) -> CellId {
        self.ids[side as usize]
    }

    fn new_cell(&self) -> CellId {
        self.ids[usize::from(self.ids[0] == self.cell)]
    }

    /// Gives portals of the old cell to one part; divides those that border on both, and returns them with their second
    /// halves.
    fn hand_out_portals(&self, out: &mut World, outward: f64) -> Vec<(PortalId, PortalId)> {
        let mut halved = Vec::new();
        for id in out.graph[self.cell].portals.clone() {
            let p = &out.graph[id];
            let end = usize::from(p.cells[1] == self.cell);
            let normal = DVec3::from(p.normal.map(f64::from)).normalize_or_zero();
            // From the portal into the cell.
            let inward = if end == 1 { normal } else { -normal };
            let mut by_side: [Vec<Winding>; 2] = [Vec::new(), Vec::new()];
            for piece in &p.pieces {
                let whole = winding(piece);
                let mut fragments: [Vec<Winding>; 2] = [Vec::new(), Vec::new()];
                self.sides
                    .divide(&whole.points, inward, outward, &mut |side, part| {
                        fragments[side as usize].push(Winding::new(part.to_vec()));
                    });
                match fragments {
                    [f, b] if b.is_empty() || f.is_empty() => {
                        by_side[usize::from(f.is_empty())].push(whole);
                    }
                    [f, b] => {
                        by_side[0].extend(f);
                        by_side[1].extend(b);
                    }
                }
            }
            let anchor = p.pieces.first().map_or(DVec3::ZERO, |w| winding(w).mean());
            let plane = Plane::through(anchor, normal);
            let mut halves: Vec<(u32, Portal)> = Vec::new();
            for side in [FRONT, BACK] {
                let pieces = &by_side[side as usize];
                let corners: Vec<DVec3> = pieces.iter().flat_map(|w| w.points.clone()).collect();
                let outline = Winding::hull_in_plane(&plane, &corners);
                if let Some(half) = (outline.points.len() >= 3)
                    .then(|| rounded_portal(&plane, &outline, pieces, outward))
                    .flatten()
                {
                    halves.push((side, half));
                }
            }
            halves.sort_by(|a, b| b.1.area.total_cmp(&a.1.area));
            let (mut kept, base) = (p.clone(), p.clone());
            // A leaf belongs to the half in which its middle is; a frame runs around neither.
            let fits = |part: FittingPart, is_larger: bool| match part {
                FittingPart::Leaf => is_larger,
                FittingPart::Frame => false,
                FittingPart::Pane => true,
            };
            let renamed = |side: u32, mut portal: Portal, is_larger: bool| {
                portal.cells = base.cells;
                portal.cells[end] = self.id(side);
                portal.kind = base.kind;
                portal.normal = base.normal;
                portal.why.clone_from(&base.why);
                let fittings = base.fittings.iter();
                portal.fittings = fittings
                    .filter(|f| fits(f.part, is_larger))
                    .cloned()
                    .collect();
                portal
            };
            match &halves[..] {
                [(a, big), (b, small)] => {
                    let second = PortalId(out.graph.portals.len() as u32);
                    let small = renamed(*b, small.clone(), false);
                    let beyond = base.cells[1 - end].0 as usize;
                    out.graph.cells[beyond].portals.push(second);
                    out.graph[id] = renamed(*a, big.clone(), true);
                    out.graph.portals.push(small);
                    halved.push((id, second));
                }
                rest => {
                    // Unchanged, except for the cell's number.
                    let side = rest.first().map_or(FRONT, |(side, _)| *side);
                    kept.cells[end] = self.id(side);
                    out.graph[id] = kept;
                }
            }
        }
        halved
    }

    /// Returns `cells` with the old cell replaced by the parts that `sees` marks; by both if it marks none.
    fn relisted(&self, cells: &[CellId], sees: [bool; 2]) -> Vec<CellId> {
        let mut list: Vec<CellId> = cells.iter().copied().filter(|&c| c != self.cell).collect();
        for (side, &id) in self.ids.iter().enumerate() {
            if sees[side] || sees == [false; 2] {
                list.push(id);
            }
        }
        list.sort_unstable();
        list
    }

    fn hand_out_triangles(
        &self,
        out: &mut World,
        listed: &[(u32, u32, Triangle)],
        partition: &Partition,
    ) {
        let mut sees_of: BTreeMap<(u32, u32), [bool; 2]> = BTreeMap::new();
        for (i, &(batch, t, _)) in listed.iter().enumerate() {
            let seen = partition.triangle_cells.both(i);
            sees_of.insert((batch, t), [FRONT, BACK].map(|s| seen.contains(&s)));
        }
        let mut batches = Batches::default();
        for (b, batch) in out.batches.iter().enumerate() {
            let p = &batch.primitive;
            if batch.cells.binary_search(&self.cell).is_err() {
                batches.add(batch.cells.clone(), p, &batch.sources, batch.is_seal);
                continue;
            }
            let mut by_list: BTreeMap<Vec<CellId>, (Vec<u32>, SourceRuns)> = BTreeMap::new();
            let mut sources = batch.sources.of_triangles();
            for (t, corners) in p.triples().iter().enumerate() {
                let sees = sees_of.get(&(b as u32, t as u32));
                let list = self.relisted(&batch.cells, sees.copied().unwrap_or_default());
                let (indices, runs) = by_list.entry(list).or_default();
                indices.extend(corners);
                if let Some(source) = sources.next() {
                    runs.push(source, 1);
                }
            }
            for (list, (indices, sources)) in by_list {
                batches.add(list, &subset_of(p, &indices), &sources, batch.is_seal);
            }
        }
        out.batches = batches.finish();
    }

    fn hand_out_details(&self, out: &mut World) {
        for d in &mut out.details {
            if d.cells.binary_search(&self.cell).is_err() {
                continue;
            }
            let transform = d.placement();
            let mut touched = Vec::new();
            for p in &out.detail_meshes[d.mesh as usize].primitives {
                for triangle in p.placed_triangles(transform) {
                    out.graph.locator.cells_touching(&triangle, &mut touched);
                }
            }
            let sees = self.ids.map(|id| touched.binary_search(&id).is_ok());
            d.cells = self.relisted(&d.cells, sees);
        }
    }

    fn measure_cells(&self, out: &mut World, partition: &Partition) {
        let old = out.graph[self.cell].clone();
        let taken = |name: &str| out.graph.cells.iter().any(|c| c.name == name);
        let new_name = (out.graph.cells.len()..)
            .map(|i| format!("cell-{i}"))
            .find(|name| !taken(name))
            .unwrap_or_default();
        let why = if old.outdoor {
            vec![Why::given(Reason::Asked)]
        } else {
            old.why.clone()
        };
        out.graph.cells.push(Cell {
            name: new_name,
            outdoor: false,
            why,
            ..old
        });
        for side in [FRONT, BACK] {
            let id = self.id(side);
            let mut triangles = 0;
            for b in out.batches.iter().filter(|b| !b.is_seal) {
                if b.cells.binary_search(&id).is_ok() {
                    triangles += b.primitive.indices.len() / 3;
                }
            }
            let mut detail_triangles = 0;
            for d in &out.details {
                if d.cells.binary_search(&id).is_ok() {
                    let mesh = &out.detail_meshes[d.mesh as usize];
                    detail_triangles += mesh
                        .primitives
                        .iter()
                        .map(|p| p.indices.len() / 3)
                        .sum::<usize>();
                }
            }
            let portals = out.graph.portals.iter().enumerate();
            let portals = portals
                .filter(|(_, p)| p.cells.contains(&id))
                .map(|(i, _)| PortalId(i as u32))
                .collect();
            let b = partition.aabbs[side as usize];
            let cell = &mut out.graph[id];
            cell.n_triangles = triangles as u32;
            cell.n_detail_triangles = detail_triangles as u32;
            cell.portals = portals;
            cell.volume = partition.volumes[side as usize] as f32;
            // Outdoors keeps the box of the scene.
            if !cell.outdoor && !b.is_empty() {
                cell.aabb = [b.min.as_vec3().to_array(), b.max.as_vec3().to_array()];
            }
        }
    }
}
