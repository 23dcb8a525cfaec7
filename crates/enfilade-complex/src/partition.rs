//! The second visit: makes cells, portals and locator from labeled leaves.

use std::ops::Range;

use enfilade_cpg::{Locator, PortalKind};
use enfilade_geom::{Aabb, DVec3, Plane, Winding, poly};
use rayon::prelude::*;

use super::facet::{FacetSink, OpenPieces, RawFacet, Visitor};
use super::graph::{Clearance, LeafGraph};
use super::leaf_cells::{LeafCells, SOLID};
use super::pieces::{self, Opening, Piece, Rules};
use super::seen::{self, TriangleCells};
use super::surface::{NO_PLANE, Source, Surface};
use super::tagged::TaggedTree;
use super::{CRACK_WIDTH, Complex, Label};

/// Exact cells and portals.
#[derive(Clone, Debug)]
pub struct Partition {
    /// The vote label of each cell; several cells may share one.
    pub label_of_cell: Vec<Label>,
    /// Volume of each cell. [Units: wu³]
    pub volumes: Vec<f64>,
    /// Box of each cell.
    pub aabbs: Vec<Aabb>,
    /// The only cell that reaches the border of the box.
    pub outside: Option<u32>,
    /// All openings between different cells.
    pub portals: Vec<PartitionPortal>,
    /// Openings narrower than [`Complex::opening_tolerance`]: slivers between planes that nearly coincide. Following
    /// sight lines to the last bit needs them; an `f32` file cannot hold them.
    pub hairlines: Vec<PartitionPortal>,
    /// Gaps that are closed; a bake adds these polygons to the model's own surfaces.
    pub seals: Vec<Seal>,
    /// The portals that lie on no candidate, where cells leak into each other.
    pub leaks: Vec<Leak>,
    /// The cells that see each triangle.
    pub triangle_cells: TriangleCells,
    /// Finds the cell of a point.
    pub locator: Locator,
}

/// An opening between two cells, in one plane.
#[derive(Clone, Debug, PartialEq)]
pub struct PartitionPortal {
    /// The two cells, ascending; the plane's normal points from the first to the second.
    pub cells: [u32; 2],
    /// Its plane.
    pub plane: Plane,
    /// Convex hull of the pieces, counter-clockwise seen from the second cell.
    pub outline: Winding,
    /// The opening itself: disjoint convex polygons, oriented like the outline.
    pub pieces: Vec<Winding>,
    /// The candidate with the largest part of its area, if any.
    pub candidate: Option<u32>,
    /// Total area of the pieces. [Units: wu²]
    pub area: f64,
    /// Width of the widest piece. [Units: wu]
    pub width: f64,
    /// [`PortalKind::Open`], or [`PortalKind::Crack`] if narrow and on no candidate.
    pub kind: PortalKind,
    /// It lies on no candidate.
    pub is_leak: bool,
}

/// A polygon that closes a gap. No ball of the smallest hole passes through the gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Seal {
    /// The cells on its two sides, ascending; [`u32::MAX`] is solid.
    pub cells: [u32; 2],
    /// Its plane; the normal points from the first side to the second.
    pub plane: Plane,
    /// Convex, counter-clockwise seen from the second side.
    pub outline: Winding,
}

/// A place where two cells meet without a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leak {
    /// Index into [`Partition::portals`].
    pub portal: u32,
    /// The two cells.
    pub cells: [u32; 2],
    /// Centroid of the largest piece. [Units: wu]
    pub position: DVec3,
    /// Width of the widest piece. [Units: wu]
    pub width: f64,
    /// Area of the opening. [Units: wu²]
    pub area: f64,
}

struct PieceSink<'a> {
    tagged: &'a TaggedTree<'a>,
    visitor: &'a Visitor<'a>,
    /// For each candidate, the plane of its surface.
    plane_of_candidate: &'a [u32],
    graph: &'a LeafGraph<'a>,
    clearance: Clearance<'a>,
    wanted: &'a Wanted,
    /// The part of the wanted facets in the plane of the node entered last.
    here: Range<usize>,
    pieces: Vec<Piece>,
}

/// The facets with openings between leaves of different cells. The first visit has found them.
struct Wanted {
    /// The node of each and its leaves, ascending.
    facets: Vec<(i32, [u32; 2])>,
    /// For each node, `true` if some of them are in its plane or below it.
    is_above: Vec<bool>,
}

impl Wanted {
    fn of(complex: &Complex<'_>, tagged: &TaggedTree<'_>) -> Self {
        let is_wanted = |leaves: &[u32; 2]| {
            let cells = leaves.map(|l| tagged.cell_of_leaf[l as usize]);
            cells[0] != cells[1] && (complex.has_seals || !cells.contains(&SOLID))
        };
        let leaves = complex.graph.facets.par_iter().map(|f| f.leaves);
        let mut facets: Vec<_> = leaves
            .filter(is_wanted)
            .map(|leaves| (tagged.node_between(leaves), leaves))
            .collect();
        facets.par_sort_unstable();
        // Openings on several candidates are several entries.
        facets.dedup();
        let nodes = &complex.tree.nodes;
        let mut is_above = vec![false; nodes.len()];
        for &(node, _) in &facets {
            is_above[node as usize] = true;
        }
        for i in (0..nodes.len()).rev() {
            let mut below = nodes[i].children.into_iter().filter(|&c| c >= 0);
            is_above[i] |= below.any(|c| is_above[c as usize]);
        }
        Self { facets, is_above }
    }
}

impl FacetSink for PieceSink<'_> {
    fn wants_subtree(&self, child: i32) -> bool {
        self.wanted.is_above[child as usize]
    }

    fn enter(&mut self, node: i32) -> bool {
        let at = |node: i32| self.wanted.facets.partition_point(|f| f.0 < node);
        self.here = at(node)..at(node + 1);
        !self.here.is_empty()
    }

    fn wants_pair(&self, front: i32, back: i32) -> bool {
        let here = &self.wanted.facets[self.here.clone()];
        let [front, back] = [front, back].map(|c| self.tagged.leaves(c));
        let first = here.partition_point(|f| f.1[0] < *front.start());
        let in_front = here[first..].iter().take_while(|f| front.contains(&f.1[0]));
        in_front.map(|f| f.1[1]).any(|l| back.contains(&l))
    }

    fn take(&mut self, facet: &RawFacet<'_>) {
        let cells = facet.leaves.map(|l| self.tagged.cell_of_leaf[l as usize]);
        let normal = self.visitor.tree.planes[facet.plane as usize].normal;
        let is_flipped = cells[0] < cells[1];
        let cells = [cells[0].min(cells[1]), cells[0].max(cells[1])];
        for (points, candidate) in OpenPieces::of(facet, normal, &self.visitor.tolerance).pieces {
            let is_narrow = self.clearance.is_gap(&points);
            let (width, hole) = (poly::width(&points), self.graph.hole);
            let is_rim = !is_narrow && self.graph.is_rim(facet.leaves, width, hole);
            // Where other surfaces lie within the tolerance, parts of a candidate were moved into their planes; a
            // portal has only one plane.
            let own = candidate.and_then(|s| self.plane_of_candidate.get(s as usize).copied());
            let plane = own.filter(|&p| p != NO_PLANE).unwrap_or(facet.plane);
            let turns = self.visitor.tree.planes[plane as usize].normal.dot(normal) < 0.0;
            self.pieces.push(Piece {
                cells,
                plane,
                is_flipped: is_flipped != turns,
                candidate,
                is_gap: is_narrow || is_rim,
                is_rim,
                points,
            });
        }
    }

    fn fork(&self, _: Range<u32>) -> Self {
        Self {
            tagged: self.tagged,
            visitor: self.visitor,
            plane_of_candidate: self.plane_of_candidate,
            graph: self.graph,
            clearance: self.clearance,
            wanted: self.wanted,
            here: 0..0,
            pieces: Vec::new(),
        }
    }

    fn join(&mut self, front: Self, back: Self) {
        for part in [front, back] {
            self.pieces.extend(part.pieces);
        }
    }
}

/// Makes the partition for a labeling.
pub(super) fn realize(complex: &Complex<'_>, cells: LeafCells) -> Partition {
    let tagged = TaggedTree::new(&complex.tree, &cells.cell_of_leaf);
    let pieces = gather_pieces(complex, &tagged);
    let rules = Rules {
        planes: &complex.tree.planes,
        hole: complex.graph.hole,
        has_seals: complex.has_seals,
        n_candidates: complex.n_candidates,
        purse: complex.graph.purse,
    };
    let (gaps, openings): (Vec<Opening>, Vec<Opening>) = pieces::group(pieces, &rules)
        .into_iter()
        .partition(|o| o.is_seal);
    let least_width = complex.tolerance.width;
    let is_wide = |s: &Seal| poly::width(&s.outline.points) >= least_width;
    let seals = gaps.into_iter().flat_map(seals_of).filter(is_wide);
    let seals = seals.collect();
    let (portals, hairlines): (Vec<_>, Vec<_>) = openings
        .into_iter()
        .map(portal_of)
        .partition(|p| p.width >= least_width);
    let mut aabbs = vec![Aabb::EMPTY; cells.volumes.len()];
    for (&cell, leaf) in cells.cell_of_leaf.iter().zip(&complex.graph.boxes) {
        if let Some(b) = aabbs.get_mut(cell as usize) {
            *b = b.union(*leaf);
        }
    }
    let locator = tagged.locator(cells.outside);
    let triangle_cells = seen::cells_of_triangles(
        &tagged,
        &complex.set,
        &complex.tolerance,
        complex.n_triangles,
        complex.graph.purse,
    );
    Partition {
        label_of_cell: cells.label_of_cell,
        volumes: cells.volumes,
        aabbs,
        outside: cells.outside,
        leaks: leaks_of(&portals),
        portals,
        hairlines,
        seals,
        triangle_cells,
        locator,
    }
}

/// Returns the open pieces between leaves of different cells.
fn gather_pieces(complex: &Complex<'_>, tagged: &TaggedTree<'_>) -> Vec<Piece> {
    let wanted = Wanted::of(complex, tagged);
    let visitor = Visitor {
        tree: &complex.tree,
        surfaces: &complex.set.surfaces,
        tolerance: complex.tolerance,
        purse: complex.graph.purse,
    };
    let plane_of_candidate = planes_of_candidates(&complex.set.surfaces);
    let mut sink = PieceSink {
        tagged,
        visitor: &visitor,
        plane_of_candidate: &plane_of_candidate,
        graph: &complex.graph,
        clearance: complex.clearance(),
        wanted: &wanted,
        here: 0..0,
        pieces: Vec::new(),
    };
    visitor.visit(&mut sink);
    sink.pieces
}

/// Returns for each candidate the plane of its surface.
fn planes_of_candidates(surfaces: &[Surface]) -> Vec<u32> {
    let mut out: Vec<u32> = Vec::new();
    for surface in surfaces {
        if let Source::Candidate(id) = surface.source {
            let n = out.len().max(id as usize + 1);
            out.resize(n, NO_PLANE);
            out[id as usize] = surface.plane;
        }
    }
    out
}

/// Converts an opening, other than a gap, to a portal.
fn portal_of(opening: Opening) -> PartitionPortal {
    let is_leak = opening.candidate.is_none();
    PartitionPortal {
        cells: opening.cells,
        plane: opening.plane,
        outline: opening.outline,
        pieces: opening.pieces,
        candidate: opening.candidate,
        area: opening.area,
        width: opening.width,
        kind: if is_leak && opening.width < CRACK_WIDTH {
            PortalKind::Crack
        } else {
            PortalKind::Open
        },
        is_leak,
    }
}

/// Returns the places of the portals that lie on no candidate.
fn leaks_of(portals: &[PartitionPortal]) -> Vec<Leak> {
    let leaks = (0..).zip(portals).filter(|(_, p)| p.is_leak);
    leaks
        .map(|(portal, p)| Leak {
            portal,
            cells: p.cells,
            // Pieces are sorted, largest first.
            position: p.pieces.first().map_or(DVec3::ZERO, Winding::centroid),
            width: p.width,
            area: p.area,
        })
        .collect()
}

/// Makes a seal for each piece of a gap.
fn seals_of(gap: Opening) -> impl Iterator<Item = Seal> {
    let Opening {
        cells,
        plane,
        pieces,
        ..
    } = gap;
    pieces.into_iter().map(move |outline| Seal {
        cells,
        plane,
        outline,
    })
}
