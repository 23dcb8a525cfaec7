//! The exact convex cell complex: the watershed decides where portals are, the complex makes them
//! exact.
//!
//! Structural triangles and *candidate portals* (each a planar convex polygon a bit larger
//! than its opening) cut a box into convex leaves; what is open between two leaves is known
//! exactly. Votes from outside (voxel centers with region labels) then say which leaves belong
//! together, and the openings between leaves of different cells are the portals: the openings
//! under the candidates, and every crack that nobody foresaw.
//!
//! | stage | file | source |
//! | --- | --- | --- |
//! | surfaces share one list of planes, by id | `planes`, `surface` | Lefebvre & Hornus 2003, notes after §3.0.2 |
//! | a tree of planes, leaves convex | `tree` | ibid., §2 step 1, under boxes as the notes suggest |
//! | facets between leaves, minus the triangles in them | `facet`, `graph` | ibid., notes after §3.0.2 |
//! | leaves to cells | `label` | ours; votes take the place of the grouping of §2.1 |
//! | borders without a candidate, made small | `cut` | minimum cuts, Boykov, Veksler & Zabih 2001 |
//! | portals, what each cell sees, the locator | `partition`, `pieces`, `seen`, `tagged` | ours |
//! | later: one cell cut in two by a new portal | `divide` | ours |
//!
//! Where it departs from Lefebvre & Hornus: their cells are grown by choosing among separators that
//! the subdivision happens to make. Ours come from the volume and are only *realized* in the
//! subdivision, so that the quality of a portal does not depend on the order of splits, and
//! completeness of the cut does not depend on having found every opening: whatever is left open
//! between two cells is found by the facets and becomes a portal.
//!
//! **Which way it errs:** openings too narrow to be told from the rounding of `f32` corners (see
//! [`Complex::opening_tolerance`]) are closed; surfaces that are too thin, or too dense to be cut,
//! do not block. The second joins cells or adds portals and keeps every promise; through the first
//! only a sight line within that tolerance of an edge could pass. Slivers away from triangles stay
//! open whatever their width; those of them where cells meet are kept as [`Partition::hairlines`].
//!
//! **Complexity:** `n` surfaces make `O(n)` leaves and facets where surfaces are spread out, and up
//! to `k²` where `k` of them pass through one small box; time `O(n log n)`, about 20 bytes a facet.
//! **What can go wrong:** many crossing surfaces in a knot below 2 cm, and scenes so large that
//! `f32` steps reach the width of real cracks (beyond about 1 km). Moving corners into shared planes
//! opens wedges along shallow creases; seams close them (`surface`), all but a few hair-fine ones.

mod cut;
pub mod divide;
mod facet;
mod flow;
mod graph;
mod label;
mod leaf_cells;
mod partition;
mod pieces;
pub mod planes;
pub mod region;
mod seen;
mod surface;
mod tagged;
mod thin;
mod tree;

use std::collections::BTreeMap;

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Purse, Triangle, Winding};

use facet::Visitor;
use graph::{Clearance, LeafGraph};
use surface::{NO_PLANE, Source, Surface, SurfaceSet, Tolerance};
use tree::Tree;

/// The polygons of the complex.
pub use enfilade_geom::poly;
pub use leaf_cells::LeafCells;
pub use partition::{Leak, Partition, PartitionPortal, Seal};
pub use seen::TriangleCells;

/// Openings narrower than this that no candidate foresaw are cracks. [Units: wu]
pub const CRACK_WIDTH: f64 = 0.05;

/// What the complex is built from.
#[derive(Clone, Copy, Debug)]
pub struct ComplexInput<'a> {
    /// Structural triangles in world space, coordinates representable as `f32`. [Units: wu]
    ///
    /// Triangles with coordinates that are not finite block nothing and are seen by nobody.
    pub triangles: &'a [Triangle],
    /// Candidate portals: planar, convex, a bit larger than their openings.
    pub candidates: &'a [Winding],
    /// Triangles that are missing in the structure: they part cells as candidates do, but what opens there was not meant to.
    pub missing: &'a [Triangle],
    /// What to partition; grown to hold the triangles with a margin.
    pub bounds: Aabb,
    /// Openings through which no ball of this diameter passes are gaps: they join no cells; 0 where there are none.
    /// [Units: wu] [Limit: at least 0]
    pub gap: f64,
    /// Whether gaps are closed by seals. If not, they are portals, and matter behind them belongs to a cell.
    pub has_seals: bool,
}

/// A statement that a point belongs to a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vote {
    /// Where, e.g. the center of a voxel. [Units: wu]
    pub point: DVec3,
    /// The region; `u32::MAX` is no region and does not count.
    pub label: u32,
    /// The volume that it stands for. [Units: wu³]
    pub weight: f32,
}

/// How much two cells are open to each other, but for cracks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// Area on candidates. [Units: wu²]
    pub on_candidates: f64,
    /// Area beside them. [Units: wu²]
    pub beside: f64,
}

/// How leaves are divided among cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LabelSettings {
    /// A smaller part of a region, apart from its main part, joins what it opens to. [Units: wu³]
    pub min_volume: f64,
    /// A smaller region that opens to others beside its candidates, too, is a cavity and joins them.
    /// [Units: wu³]
    pub min_room: f64,
    /// A part of a region that opens nowhere, apart from its main part, is a cell of its own. Otherwise it is solid: where
    /// votes come from air that is connected, they got there through what the complex closes.
    pub keeps_closed: bool,
    /// A label with this share of a component's votes has it alone, unless another is strong there.
    pub dominance: f64,
    /// A label is strong where this share of all its votes is.
    pub strong_share: f64,
}

impl Default for LabelSettings {
    fn default() -> Self {
        Self {
            min_volume: 0.5,
            min_room: 1.5,
            keeps_closed: true,
            dominance: 0.9,
            strong_share: 0.2,
        }
    }
}

/// A convex partition of a box, cut by every surface in it.
pub struct Complex<'a> {
    set: SurfaceSet,
    tree: Tree,
    graph: LeafGraph<'a>,
    tolerance: Tolerance,
    n_triangles: usize,
    /// Those after them stand for triangles that are missing.
    n_candidates: u32,
    bvh: Bvh,
    /// Whether narrow openings are closed by seals.
    has_seals: bool,
}

/// Builds the complex. The order of the triangles has no say in the result.
///
/// Time `O(n log n)` for `n` surfaces spread out in space; uses rayon's current pool, and the
/// result is the same for any number of threads.
#[must_use]
pub fn build_complex(input: &ComplexInput<'_>) -> Complex<'static> {
    build_complex_of(input, Purse::endless())
}

/// [`build_complex`], as far as an allowance goes: once that is over, the complex is not to be used, nor what is made of it.
#[must_use]
pub fn build_complex_within<'a>(input: &ComplexInput<'_>, allowance: &'a Allowance) -> Complex<'a> {
    build_complex_of(input, allowance.into())
}

fn build_complex_of<'a>(input: &ComplexInput<'_>, purse: Purse<'a>) -> Complex<'a> {
    let mut surfaces: Vec<Surface> =
        Vec::with_capacity(input.triangles.len() + input.candidates.len() + input.missing.len());
    let mut add = |source, points: &[DVec3]| {
        if points.iter().all(|p| p.is_finite()) {
            surfaces.push(Surface {
                source,
                plane: NO_PLANE,
                points: points.into(),
            });
        }
    };
    for (i, t) in input.triangles.iter().enumerate() {
        add(Source::Triangle(i as u32), t);
    }
    for (i, w) in input.candidates.iter().enumerate() {
        add(Source::Candidate(i as u32), &w.points);
    }
    let n_candidates = input.candidates.len() as u32;
    for (i, t) in input.missing.iter().enumerate() {
        add(Source::Candidate(n_candidates + i as u32), t);
    }
    let triangles = surfaces
        .iter()
        .filter(|s| matches!(s.source, Source::Triangle(_)));
    let inner = triangles
        .flat_map(|s| &s.points)
        .fold(Aabb::EMPTY, |b, &p| b.including(p));
    let mut bounds = input.bounds;
    if !inner.is_empty() {
        // Something must lie around the outermost wall, so that its outer side is seen.
        bounds = bounds.union(inner.expanded(0.05 + 0.001 * inner.size().max_element()));
    }
    if bounds.is_empty() || !bounds.min.is_finite() || !bounds.max.is_finite() {
        bounds = Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0));
    }
    let tolerance = Tolerance::for_extent(bounds.extent());
    let set = surface::gather(surfaces, &bounds, &tolerance, purse);
    let visitor = |tree| Visitor {
        tree,
        surfaces: &set.surfaces,
        tolerance,
        purse,
    };
    let tree = tree::build(&set, bounds, &tolerance, purse);
    let tree = thin::cut_thin_leaves(&visitor(&tree), input.gap);
    let bvh = Bvh::build(input.triangles);
    let hole = input.gap;
    let clearance = Clearance {
        bvh: &bvh,
        hole,
        purse,
    };
    let graph = LeafGraph::of(&visitor(&tree), &clearance, purse);
    Complex {
        set,
        tree,
        graph,
        tolerance,
        n_triangles: input.triangles.len(),
        n_candidates,
        bvh,
        has_seals: input.has_seals,
    }
}

impl Complex<'_> {
    /// The box that the leaves fill.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds
    }

    /// Number of convex leaves.
    #[must_use]
    pub fn n_leaves(&self) -> usize {
        self.tree.n_leaves as usize
    }

    /// The leaf that holds `p`; `None` outside the box. Points in a plane belong to its front.
    #[must_use]
    pub fn leaf_of(&self, p: DVec3) -> Option<u32> {
        self.tree.bounds.contains(p).then(|| self.tree.leaf_of(p))
    }

    fn clearance(&self) -> Clearance<'_> {
        Clearance {
            bvh: &self.bvh,
            hole: self.graph.hole,
            purse: self.graph.purse,
        }
    }

    /// Openings narrower than this count as closed. [Units: wu]
    #[must_use]
    pub fn opening_tolerance(&self) -> f64 {
        self.tolerance.width
    }

    /// Divides the leaves among cells by votes.
    ///
    /// Time: one look-up a vote, and `O(F log F)` for `F` openings. Deterministic for any number of threads.
    #[must_use]
    pub fn label(&self, votes: &[Vote], settings: &LabelSettings) -> LeafCells {
        let leaf_of = |v: &Vote| self.leaf_of(v.point);
        label::label_leaves(&self.graph, votes, settings, self.has_seals, leaf_of)
    }

    /// The cell at a point; `None` in matter. What is outside the box is outdoors.
    #[must_use]
    pub fn cell_at(&self, cells: &LeafCells, p: DVec3) -> Option<u32> {
        let leaf = self.leaf_of(p).map(|l| cells.cell_of_leaf[l as usize]);
        leaf.map_or(cells.outside, |c| (c != leaf_cells::SOLID).then_some(c))
    }

    /// How much each two cells are open to each other. What is no wider than a crack does not count.
    ///
    /// Time: `O(F log F)` for `F` openings; no polygon is made.
    #[must_use]
    pub fn contacts(&self, cells: &LeafCells) -> BTreeMap<[u32; 2], Contact> {
        let mut contacts: BTreeMap<[u32; 2], Contact> = BTreeMap::new();
        for facet in self.graph.facets.iter().filter(|f| !f.is_narrow) {
            let [a, b] = facet.leaves.map(|l| cells.cell_of_leaf[l as usize]);
            if a != b && ![a, b].contains(&leaf_cells::SOLID) {
                let contact = contacts.entry([a.min(b), a.max(b)]).or_default();
                *match facet.candidate {
                    graph::NO_CANDIDATE => &mut contact.beside,
                    _ => &mut contact.on_candidates,
                } += f64::from(facet.area);
            }
        }
        contacts
    }

    /// Finds the portals between cells, what each triangle is seen from, and the locator.
    ///
    /// Time: a visit of the parts of the tree where cells meet. Deterministic for any number of threads.
    #[must_use]
    pub fn realize(&self, cells: LeafCells) -> Partition {
        partition::realize(self, cells)
    }

    /// Divides the leaves among cells by votes, and realizes them.
    #[must_use]
    pub fn partition(&self, votes: &[Vote], settings: &LabelSettings) -> Partition {
        self.realize(self.label(votes, settings))
    }
}

#[cfg(test)]
mod tests;
