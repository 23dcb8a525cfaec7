//! The leaves of a tree, and what is open between them.

use enfilade_geom::{Purse, Winding};

use super::leak_path::LeakPath;
use super::portals::LeafPortal;
use super::tolerance::Tolerance;
use super::tree::{self, Content, Tree};

/// The leaves of a tree and what is open between them.
pub struct Bsp<'a> {
    pub(super) tree: Tree,
    pub(super) portals: Vec<LeafPortal>,
    pub(super) tolerance: Tolerance,
    /// Every surface's polygon, as the tree was built from.
    pub(super) surfaces: Vec<tree::Fragment>,
    /// Planes from this number on are a guide's alone.
    pub(super) n_own_planes: u32,
    /// Faces of solids, or triangles, that those are of.
    pub(super) n_faces: usize,
    /// Whether they are triangles, not faces of solids.
    pub(super) is_of_triangles: bool,
    /// Whether each leaf counts: empty, and reached from inside if that is known.
    pub(super) is_open: Vec<bool>,
    /// A way from a point inside to the border of everything.
    pub(super) leak: Option<LeakPath>,
    /// What those who go through it spend from.
    pub(super) purse: Purse<'a>,
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

impl Bsp<'_> {
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
    pub(super) fn resolve_unknown(&mut self) {
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
    pub(super) fn outer_leaf(&self) -> u32 {
        let b = &self.tree.bounds;
        self.tree.leaf_of(b.min + b.size() * 1e-4)
    }

    /// Whether each plane may be a wall's: of triangles, it holds two or more. Each triangle of a curved
    /// surface has a plane of its own, which means nothing.
    pub(super) fn wall_planes(&self) -> Vec<bool> {
        let mut n = vec![0_u32; self.tree.planes.len()];
        for f in &self.surfaces {
            n[f.plane as usize] += 1;
        }
        let least = if self.is_of_triangles { 2 } else { 1 };
        n.into_iter().map(|n| n >= least).collect()
    }

    pub(super) fn drop_closed_portals(&mut self) {
        let open = &self.is_open;
        self.portals
            .retain(|p| p.leaves.iter().all(|&l| open[l as usize]));
    }
}
