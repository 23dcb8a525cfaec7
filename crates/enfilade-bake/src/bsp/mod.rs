//! Binary space partition: convex leaves and the portals between them, separators, cells.
//!
//! After Lefebvre & Hornus 2003, *Automatic Cell-and-portal Decomposition*, §2.1 and the notes after
//! §3.0.2. Surfaces share one list of planes by id; the tree cuts space by them until no leaf holds
//! any; what of a plane lies between two empty leaves is a portal. Portals of one plane that close a
//! path together, their rim all on solid surfaces, are a *separator* ([`separator`](self)), and cells
//! are what separators part.
//!
//! | step of the paper | file |
//! | --- | --- |
//! | 1: the tree, its heuristics, guided beginnings | `tree`, `guide` |
//! | 1: portals of the leaves | `portals` |
//! | 2: separators, valid and invalid | `separator` |
//! | 3: cells, crossing separators | `cells` |
//! | separators that the arrangement would have shown (§3.0.2) | `arrange` |
//! | cells of a guide where there are no walls | `guided` |
//! | rooms: separators that are a pinch, in buildings | `rooms`, `lattice` |
//! | matter, where surfaces are triangles | `inside` |
//! | 4: cells above the bound | [`crate::bound`] |
//! | leaks, as a path | `leak` |
//!
//! Where it departs from the paper: with brushes, the surface of their union is made first and what
//! only the void sees is dropped, so that no leaf lies in it; and the world is not made from these
//! leaves but from [`crate::complex`], which takes the separators as candidates and the cells as votes, so
//! that a separator that rounding spoils costs a room and never a promise.

mod arrange;
mod cells;
mod config;
mod guide;
mod guided;
mod inside;
mod lattice;
mod leak;
mod portals;
mod propose;
mod rooms;
mod separator;
mod shape;
mod surfaces;
mod tree;

use enfilade_geom::{Aabb, BoxTree, ConvexSolid, DVec3, Triangle, Winding, plane_tolerance};

pub use config::{BspConfig, Rooms};
pub use guide::Guide;
pub use leak::{LeakPath, find_leak};
pub(crate) use propose::propose;

use portals::LeafPortal;
use tree::{Content, Tree};

/// How the plane that cuts a region is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Heuristic {
    /// Few cuts and a balanced tree, judged by a sample of surfaces: fewest cuts in all.
    #[default]
    Default,
    /// The plane that cuts fewest surfaces (Lefebvre & Hornus 2003); quadratic.
    MinCut,
    /// The plane with most surface in it.
    MaxArea,
    /// The plane most orthogonal to what it cuts; quadratic.
    MaxOrtho,
}

/// What counts as touching. [Units: wu]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    /// Corners this near to a plane lie in it.
    plane: f64,
    /// The same when portals are cut by planes, which are exact.
    cut: f64,
    /// Portals narrower than this are closed.
    width: f64,
}

impl Tolerance {
    /// For corners that are `f32` numbers of this size.
    fn for_bounds(bounds: &Aabb) -> Self {
        let extent = bounds.extent();
        // Twice the measure of the cell complex, since a brush's exact plane and its rounded corners may stray to
        // either side.
        let plane = 2.0 * plane_tolerance(extent);
        Self {
            plane,
            cut: (1e-9 * extent).max(1e-8),
            width: 4.0 * plane,
        }
    }
}

/// What a tree is built from.
#[derive(Clone, Copy, Debug)]
pub struct BspInput<'a> {
    /// Surfaces where there are no solids: triangles, solid behind, empty before. [Units: wu]
    pub triangles: &'a [Triangle],
    /// The object of each triangle, to tell what is inside one; empty where all are one.
    pub objects: &'a [u32],
    /// Brushes; where there are some, they are the surfaces.
    pub solids: &'a [ConvexSolid],
    /// Points known to be inside, such as those of entities; with solids, what they cannot reach is
    /// dropped unless they reach the border, too.
    pub inside: &'a [DVec3],
}

/// The leaves of a tree and what is open between them.
pub struct Bsp {
    tree: Tree,
    portals: Vec<LeafPortal>,
    tolerance: Tolerance,
    /// Every surface's polygon, as the tree was built from.
    surfaces: Vec<tree::Fragment>,
    /// Planes from this number on are a guide's alone.
    n_own_planes: u32,
    /// Faces of solids, or triangles, that those are of.
    n_faces: usize,
    /// Whether they are triangles, not faces of solids.
    is_of_triangles: bool,
    /// Whether each leaf counts: empty, and reached from inside if that is known.
    is_open: Vec<bool>,
    /// A way from a point inside to the border of everything.
    leak: Option<LeakPath>,
}

/// Numbers of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BspCounts {
    /// Faces of solids, or triangles, that something is seen of: what was modeled.
    pub n_faces: usize,
    /// Polygons that the tree was built from: what is left of faces once all solids are one.
    pub n_polygons: usize,
    /// Triangles that those make: of each polygon, two fewer than it has corners.
    pub n_triangles: usize,
    /// Polygons in the tree.
    pub n_pieces: usize,
    /// How often one was cut in two.
    pub n_splits: usize,
    /// Leaves that are not solid, and reached from inside if that is known.
    pub n_leaves: usize,
    /// Portals between them.
    pub n_portals: usize,
}

/// Numbers of separators and cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grouping {
    /// Valid separators.
    pub n_valid: usize,
    /// Of those, taken away since they crossed others.
    pub n_crossing: usize,
    /// Of those, taken away since one cell lies on both sides.
    pub n_useless: usize,
    /// Separators kept.
    pub n_separators: usize,
    /// Cells.
    pub n_cells: usize,
}

/// How many different numbers there are; equal ones stand side by side.
fn n_distinct(numbers: &[u32]) -> usize {
    numbers.chunk_by(|a, b| a == b).count()
}

impl Bsp {
    /// Builds the tree and its portals.
    ///
    /// With solids and points inside it is built twice: once to find out which surfaces are seen from
    /// inside, and once of those. Time near-linear in surfaces that are spread out; deterministic.
    #[must_use]
    pub fn build(input: &BspInput<'_>, heuristic: Heuristic, guide: &Guide) -> Self {
        Self::build_of(input, heuristic, guide, true)
    }

    /// The same; where triangles bound no matter there is air on both sides of them.
    fn build_of(
        input: &BspInput<'_>,
        heuristic: Heuristic,
        guide: &Guide,
        has_matter: bool,
    ) -> Self {
        let surfaces::Gathered {
            planes,
            fragments,
            faces,
            bounds,
            tolerance,
        } = surfaces::gather(input);
        let boxes: Vec<Aabb> = input.solids.iter().map(ConvexSolid::aabb).collect();
        let solids = BoxTree::new(&boxes);
        let make = |fragments: Vec<tree::Fragment>,
                    heuristic: Heuristic,
                    guide: &Guide,
                    has_void: bool| {
            let mut tree = tree::build(
                planes.clone(),
                fragments.clone(),
                bounds,
                heuristic,
                guide,
                &tolerance,
            );
            if !boxes.is_empty() {
                // A middle on the border of two solids is in matter.
                settle(&mut tree, &tolerance, has_void, &|p| {
                    let mut is_inside = false;
                    solids.for_each_in_box(&Aabb::new(p, p), |i| {
                        is_inside |= input.solids[i as usize].contains(p, -10.0 * tolerance.cut);
                    });
                    is_inside
                });
            } else if !input.triangles.is_empty() {
                let soup = inside::Soup::of(input.triangles, input.objects);
                settle(&mut tree, &tolerance, true, &|p| {
                    has_matter && soup.is_inside(p)
                });
            }
            let mut bsp = Self {
                portals: portals::leaf_portals(&tree, &tolerance),
                tree,
                tolerance,
                surfaces: fragments,
                n_own_planes: planes.len() as u32,
                n_faces: n_distinct(&faces),
                is_of_triangles: boxes.is_empty(),
                is_open: Vec::new(),
                leak: None,
            };
            bsp.resolve_unknown();
            bsp
        };
        let knows_inside = !input.solids.is_empty() && !input.inside.is_empty();
        if !knows_inside {
            return make(fragments, heuristic, guide, true);
        }
        let first = make(fragments, Heuristic::Default, &Guide::default(), true);
        let reached = leak::reach(&first, input.inside);
        if reached.path.is_some() {
            let mut leaky = make(first.surfaces, heuristic, guide, true);
            leaky.leak = reached.path;
            return leaky;
        }
        let (seen, faces_seen): (Vec<tree::Fragment>, Vec<u32>) = first
            .surfaces
            .iter()
            .zip(&faces)
            .filter(|(f, _)| {
                let mut is_seen = false;
                first.tree.leaves_before(f, tolerance.plane, &mut |leaf| {
                    is_seen |= reached.is_reached[leaf as usize];
                });
                is_seen
            })
            .map(|(f, face)| (f.clone(), *face))
            .unzip();
        let mut bsp = make(seen, heuristic, guide, false);
        bsp.n_faces = n_distinct(&faces_seen);
        let reached = leak::reach(&bsp, input.inside);
        // What the points do not reach now is a sliver of the void that rounding left.
        for (open, &reached) in bsp.is_open.iter_mut().zip(&reached.is_reached) {
            *open &= reached;
        }
        bsp.drop_closed_portals();
        bsp
    }

    /// Its numbers.
    #[must_use]
    pub fn counts(&self) -> BspCounts {
        BspCounts {
            n_faces: self.n_faces,
            n_polygons: self.surfaces.len(),
            n_triangles: self.surfaces.iter().map(|s| s.points.len() - 2).sum(),
            n_pieces: self.surfaces.len() + self.tree.n_splits,
            n_splits: self.tree.n_splits,
            n_leaves: self.is_open.iter().filter(|&&o| o).count(),
            n_portals: self.portals.len(),
        }
    }

    /// Finds the separators and the cells that they part, for the numbers only.
    #[must_use]
    pub fn grouping(&self) -> Grouping {
        let found = separator::find(self);
        let n_valid = found.len();
        let cells = cells::part(self, found);
        Grouping {
            n_valid,
            n_crossing: cells.n_crossing,
            n_useless: cells.n_useless,
            n_separators: cells.separators.len(),
            n_cells: cells.n_cells,
        }
    }

    /// The separators that part cells once those that cross others are gone, each as places in
    /// [`Bsp::portals`].
    #[must_use]
    pub fn separators(&self) -> Vec<Vec<usize>> {
        let parted = cells::part(self, separator::find(self));
        let portals = |s: separator::Separator| s.portals.iter().map(|&p| p as usize).collect();
        parted.separators.into_iter().map(portals).collect()
    }

    /// The way out that a point inside has, if there are solids and it has one.
    #[must_use]
    pub fn leak(&self) -> Option<&LeakPath> {
        self.leak.as_ref()
    }

    /// Leaves and polygon of each portal, for tables and pictures.
    pub fn portals(&self) -> impl Iterator<Item = ([u32; 2], Winding)> + '_ {
        self.portals
            .iter()
            .map(|p| (p.leaves, Winding::new(p.points.to_vec())))
    }

    /// Leaves of which no surface says what they are are what most of what opens to them is.
    fn resolve_unknown(&mut self) {
        let contents = &mut self.tree.contents;
        let mut neighbors: Vec<Vec<u32>> = vec![Vec::new(); contents.len()];
        for p in &self.portals {
            for (i, &l) in p.leaves.iter().enumerate() {
                if contents[l as usize] == Content::Unknown {
                    neighbors[l as usize].push(p.leaves[1 - i]);
                }
            }
        }
        // Portals join no solid leaf, so what is open to anything is empty. What is open to nothing
        // but its like has no surface at all: it is the air of an empty scene.
        for (content, n) in contents.iter_mut().zip(&neighbors) {
            if *content == Content::Unknown {
                *content = if n.is_empty() {
                    Content::Solid
                } else {
                    Content::Empty
                };
            }
        }
        self.is_open = self
            .tree
            .contents
            .iter()
            .map(|&c| c == Content::Empty)
            .collect();
        self.drop_closed_portals();
    }

    /// A leaf of the air around everything, in a corner of the box.
    fn outer_leaf(&self) -> u32 {
        let b = &self.tree.bounds;
        self.tree.leaf_of(b.min + b.size() * 1e-4)
    }

    /// Whether each plane may be a wall's: of triangles, it holds two or more. Each triangle of a curved
    /// surface has a plane of its own, which means nothing.
    fn wall_planes(&self) -> Vec<bool> {
        let mut n = vec![0_u32; self.tree.planes.len()];
        for f in &self.surfaces {
            n[f.plane as usize] += 1;
        }
        let least = if self.is_of_triangles { 2 } else { 1 };
        n.into_iter().map(|n| n >= least).collect()
    }

    fn drop_closed_portals(&mut self) {
        let open = &self.is_open;
        self.portals
            .retain(|p| p.leaves.iter().all(|&l| open[l as usize]));
    }
}

/// Says of each leaf whether it is matter by asking the solids about its middle: next to slivers, the
/// surfaces around a leaf can mislead. Without the void's surfaces the void counts as matter, too, and
/// only what is in a solid for sure is corrected.
fn settle(
    tree: &mut Tree,
    tolerance: &Tolerance,
    has_void: bool,
    is_inside: &dyn Fn(DVec3) -> bool,
) {
    for (leaf, shape) in shape::shapes(tree, tolerance).iter().enumerate() {
        let content = &mut tree.contents[leaf];
        match shape {
            // No room for anything.
            None => *content = Content::Solid,
            Some(s) if is_inside(s.middle) => *content = Content::Solid,
            Some(_) if has_void => *content = Content::Empty,
            Some(_) => {}
        }
    }
}

#[cfg(test)]
mod tests;
