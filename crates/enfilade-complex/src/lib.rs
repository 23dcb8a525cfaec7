//! The exact convex cell complex. The watershed decides where portals are; the complex makes them exact.
//!
//! Structural triangles and *candidate portals* (each a planar convex polygon slightly larger than its opening) cut a
//! box into convex leaves, so that the open part between two leaves is known exactly. Votes of the caller (voxel
//! centers with region labels) decide which leaves belong together. The openings between leaves of different cells
//! are the portals: the openings under the candidates, and all cracks that no candidate covers.
//!
//! | stage | file | source |
//! | --- | --- | --- |
//! | surfaces share one list of planes, by id | `planes`, `surface` | Lefebvre & Hornus 2003, notes after §3.0.2 |
//! | a tree of planes, leaves convex | `tree` | ibid., §2 step 1, under boxes as the notes suggest |
//! | facets between leaves, minus the triangles in them | `facet`, `graph` | ibid., notes after §3.0.2 |
//! | leaves to cells | `label` | ours; votes take the place of the grouping of §2.1 |
//! | borders without a candidate, made small | `cut` | minimum cuts, Boykov, Veksler & Zabih 2001 |
//! | portals, the cells that see each triangle, the locator | `partition`, `pieces`, `seen`, `tagged` | ours |
//! | later: one cell divided by a new portal | `divide` | ours |
//!
//! Departs from Lefebvre & Hornus, who grow cells by choosing among separators that the subdivision happens to
//! make. Our separators come from the volume and are only *realized* in the subdivision. So the quality of a portal
//! does not depend on the order of splits, and the cut is complete even if some openings have no candidate: the
//! facets find everything left open between two cells, and it becomes a portal.
//!
//! **Which way it errs:** openings too narrow to be told from the rounding of `f32` vertices (see
//! [`Complex::opening_tolerance`]) are closed; surfaces that are too thin, or too dense to be cut, do not block. The
//! latter joins cells or adds portals and keeps every promise; the former loses only sight lines within that
//! tolerance of an edge. Slivers away from triangles stay open whatever their width; those where cells meet are kept
//! as [`Partition::hairlines`].
//!
//! **Complexity:** `n` surfaces make `O(n)` leaves and facets where surfaces are spread out, and up to `k²` where `k`
//! of them pass through one small box; time `O(n log n)`, about 20 bytes per facet. **What can go wrong:** many
//! crossing surfaces in a knot below 2 cm, and scenes so large that `f32` steps reach the width of real cracks
//! (beyond about 1 km). Moving vertices into shared planes opens wedges along shallow creases; seams close all but a
//! few hair-fine ones (`surface`).

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
mod unparted;

use std::fmt;

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Purse, Triangle, Winding};

use facet::Visitor;
use graph::{Clearance, LeafGraph};
use surface::{NO_PLANE, Source, Surface, SurfaceSet, Tolerance};
use tree::Tree;

/// Polygon functions used by the complex.
pub use enfilade_geom::poly;
pub use leaf_cells::LeafCells;
pub use partition::{Leak, Partition, PartitionPortal, Seal};
pub use seen::TriangleCells;

/// Openings narrower than this are cracks, unless they lie on a candidate. [Units: wu]
pub const CRACK_WIDTH: f64 = 0.05;

/// Input of [`build_complex`].
#[derive(Clone, Copy, Debug)]
pub struct ComplexInput<'a> {
    /// Structural triangles in world space, coordinates representable as `f32`. [Units: wu]
    ///
    /// Triangles with coordinates that are not finite block nothing, and no cell sees them.
    pub triangles: &'a [Triangle],
    /// Candidate portals: planar, convex, a bit larger than their openings.
    pub candidates: &'a [Winding],
    /// Triangles missing from the structure. They separate cells as candidates do, but their openings are unintended.
    pub missing: &'a [Triangle],
    /// The box to partition; grown to hold the triangles with a margin.
    pub bounds: Aabb,
    /// Diameter of the smallest hole. Openings through which no such ball passes are gaps and join no cells; with 0,
    /// there are no gaps. [Units: wu] [Limit: at least 0]
    pub gap: f64,
    /// Close gaps with seals. Otherwise they are portals, and the space behind them belongs to a cell.
    pub has_seals: bool,
}

/// The space that a vote or a cell belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Label {
    /// A region of the caller's.
    Region(u32),
    /// The space beyond that which is divided.
    Beyond,
    /// A void of that region, which no opening connects with the rest of it, or in which nobody can stand.
    Void(u32),
    /// No space. Votes with it do not count.
    Solid,
}

impl Label {
    /// Returns the region, also that of a void.
    #[must_use]
    pub fn region(self) -> Option<u32> {
        match self {
            Self::Region(region) | Self::Void(region) => Some(region),
            Self::Beyond | Self::Solid => None,
        }
    }
}

/// A statement that a point belongs to a space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vote {
    /// A position, e.g. the center of a voxel. [Units: wu]
    pub point: DVec3,
    /// The space.
    pub label: Label,
    /// The volume that it stands for. [Units: wu³]
    pub weight: f32,
}

/// Statements by which leaves are grouped into cells.
#[derive(Clone, Copy)]
pub struct LabelInput<'a> {
    /// Points of spaces.
    pub votes: &'a [Vote],
    /// Points of air that no opening connects to its region, and that region: what no vote reaches is a void there. [Units: wu]
    pub voids: &'a [(DVec3, u32)],
    /// Returns `false` for regions that stay apart even where no plane separates them from others.
    pub may_join: &'a (dyn Fn(u32) -> bool + Sync),
    /// Bounds.
    pub settings: LabelSettings,
}

impl fmt::Debug for LabelInput<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [n_votes, n_voids] = [self.votes.len(), self.voids.len()];
        let mut out = f.debug_struct("LabelInput");
        out.field("n_votes", &n_votes).field("n_voids", &n_voids);
        out.field("settings", &self.settings)
            .finish_non_exhaustive()
    }
}

impl<'a> From<&'a [Vote]> for LabelInput<'a> {
    /// Votes alone: regions stay apart, and nothing is a void.
    fn from(votes: &'a [Vote]) -> Self {
        Self {
            votes,
            voids: &[],
            may_join: &|_| false,
            settings: LabelSettings::default(),
        }
    }
}

/// Settings for grouping leaves into cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LabelSettings {
    /// A smaller part of a region, apart from its main part, joins the neighbor it opens to most. [Units: wu³]
    pub min_volume: f64,
    /// A smaller region that also opens to others beside its candidates is a cavity and joins them. [Units: wu³]
    pub min_room: f64,
    /// Make a part of a region that opens nowhere, apart from its main part, a cell of its own. Otherwise it is
    /// solid: if votes come from connected air, they got there through openings that the complex closes.
    pub keeps_closed: bool,
    /// A label with this share of a component's votes owns it, unless another label is strong there.
    pub dominance: f64,
    /// A label is strong in a component with this share of all its votes.
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
    /// Number of candidates before those that stand for missing triangles.
    n_candidates: u32,
    bvh: Bvh,
    /// `true` if seals close narrow openings.
    has_seals: bool,
}

/// Builds the complex. The result does not depend on the order of the triangles.
///
/// Time: `O(n log n)` for `n` surfaces spread out in space. Uses rayon's current pool; the result is the same for any
/// number of threads.
#[must_use]
pub fn build_complex(input: &ComplexInput<'_>) -> Complex<'static> {
    build_complex_of(input, Purse::endless())
}

/// Does [`build_complex`] within an allowance. Once that is used up, neither the complex nor its results are valid.
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
        // Leave space around the outermost wall, so that its outer side is seen.
        bounds = bounds.union(inner.expanded(0.05 + 0.001 * inner.size().max_element()));
    }
    if bounds.is_empty() || !bounds.min.is_finite() || !bounds.max.is_finite() {
        bounds = Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0));
    }
    let tolerance = Tolerance::for_extent(bounds.extent());
    let (bvh, mut set) = rayon::join(
        || Bvh::build(input.triangles),
        || surface::gather(surfaces, bounds.center(), &tolerance, purse),
    );
    surface::add_seams(&mut set, &bvh, &tolerance, purse);
    let visitor = |tree| Visitor {
        tree,
        surfaces: &set.surfaces,
        tolerance,
        purse,
    };
    let tree = tree::build(&set, bounds, &tolerance, purse);
    let tree = thin::cut_thin_leaves(&visitor(&tree), input.gap);
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
    /// Returns the box that the leaves fill.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds
    }

    /// Returns the number of convex leaves.
    #[must_use]
    pub fn n_leaves(&self) -> usize {
        self.tree.n_leaves as usize
    }

    /// Returns the leaf that holds `p`; `None` outside the box. Points in a plane belong to its front.
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

    /// Returns the width below which openings count as closed. [Units: wu]
    #[must_use]
    pub fn opening_tolerance(&self) -> f64 {
        self.tolerance.width
    }

    /// Divides the leaves among cells by votes.
    ///
    /// Time: one look-up per vote, and `O(F log F)` for `F` openings. Deterministic for any number of threads.
    #[must_use]
    pub fn label(&self, input: &LabelInput<'_>) -> LeafCells {
        let leaf_of = |p| self.leaf_of(p);
        label::label_leaves(&self.graph, input, self.has_seals, leaf_of)
    }

    /// Finds the portals between cells, the cells that see each triangle, and the locator.
    ///
    /// Time: a visit of the parts of the tree where cells meet. Deterministic for any number of threads.
    #[must_use]
    pub fn realize(&self, cells: LeafCells) -> Partition {
        partition::realize(self, cells)
    }

    /// Divides the leaves among cells by votes, and realizes the result.
    #[must_use]
    pub fn partition(&self, votes: &[Vote], settings: &LabelSettings) -> Partition {
        self.realize(self.label(&LabelInput {
            settings: *settings,
            ..votes.into()
        }))
    }
}

#[cfg(test)]
mod tests;
