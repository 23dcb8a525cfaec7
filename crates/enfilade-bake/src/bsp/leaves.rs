//! The leaves of a tree, and the portals between them.

use enfilade_geom::{Aabb, DVec3, Purse, Winding};

use super::portals::LeafPortal;
use super::tolerance::Tolerance;
use super::tree::{self, Content, Tree};

/// The leaves of a tree and the portals between them.
pub struct Bsp<'a> {
    pub(super) tree: Tree,
    pub(super) portals: Vec<LeafPortal>,
    pub(super) tolerance: Tolerance,
    /// The polygons of all surfaces from which the tree was built.
    pub(super) surfaces: Vec<tree::Fragment>,
    /// Planes from this number on belong to a guide alone.
    pub(super) n_own_planes: u32,
    /// Number of the faces of solids, or of the triangles, that the polygons come from.
    pub(super) n_faces: usize,
    /// `true` if they are triangles, not faces of solids.
    pub(super) is_of_triangles: bool,
    /// `true` for each leaf that counts: empty, and reached from inside if that is known.
    pub(super) is_open: Vec<bool>,
    /// A path from a point inside to the border of the scene.
    pub(super) leak: Option<LeakPath>,
    /// The purse that pays for work on it.
    pub(super) purse: Purse<'a>,
}

/// A path through open space from a point inside to the void.
#[derive(Clone, Debug, PartialEq)]
pub struct LeakPath {
    /// Index of the point inside where it begins.
    pub from: usize,
    /// Its vertices, from that point to beyond the outermost surface. [Units: wu]
    pub points: Vec<DVec3>,
    /// Share of the floor below the open sky, of what people reach on foot ([`open_floor`](enfilade_geom::open_floor)).
    pub open_floor: f64,
}

/// Counts of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BspCounts {
    /// Faces of solids, or triangles, of which some part is seen: the modeled surfaces.
    pub n_faces: usize,
    /// Polygons from which the tree was built: the rest of the faces once all solids are united.
    pub n_polygons: usize,
    /// Triangles that make up those: for each polygon, two fewer than its vertices.
    pub n_triangles: usize,
    /// Polygons in the tree.
    pub n_pieces: usize,
    /// Number of cuts of a polygon in two.
    pub n_splits: usize,
    /// Leaves that are not solid, and reached from inside if that is known.
    pub n_leaves: usize,
    /// Portals between them.
    pub n_portals: usize,
}

impl Bsp<'_> {
    /// Returns its counts.
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

    /// Returns the way out from a point inside, if there are solids and a leak.
    #[must_use]
    pub fn leak(&self) -> Option<&LeakPath> {
        self.leak.as_ref()
    }

    /// Returns leaves and polygon of each portal, for tables and pictures.
    pub fn portals(&self) -> impl Iterator<Item = ([u32; 2], Winding)> + '_ {
        self.portals
            .iter()
            .map(|p| (p.leaves, Winding::new(p.points.to_vec())))
    }

    /// Classifies leaves that no surface bounds: empty if they have a portal, else solid.
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
        // No portal joins a solid leaf, so a leaf with a portal is empty. Unknown leaves that open only to each other
        // have no surface at all: they are the air of an empty scene.
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

    /// Returns the leaves of the air around everything, at the vertices of the box: the tree leaves space around the
    /// surfaces.
    pub(super) fn outer_leaves(&self) -> [u32; 8] {
        let b = &self.tree.bounds;
        let margin = b.size() * 1e-4;
        let inner = Aabb::new(b.min + margin, b.max - margin);
        inner.corners().map(|p| self.tree.leaf_of(p))
    }

    /// Returns one of them.
    pub(super) fn outer_leaf(&self) -> u32 {
        self.outer_leaves()[0]
    }

    /// Returns, for each plane, `true` if it may be a wall's: with triangles, if it holds two or more. Each triangle
    /// of a curved surface has a plane of its own, which carries no information.
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
