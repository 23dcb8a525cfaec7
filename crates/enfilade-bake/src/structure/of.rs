//! The structural triangles of a scene, sorted by purpose.

use enfilade_geom::scene::{Role, Scene, TriangleSource};
use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Triangle, triangle_area_normal};

use super::blockers::{plates, without_open_leaves};
use super::frame::Frame;
use super::misfit::misfit;
use super::rims::Rims;
use super::settle::settle;
use super::site::{Site, is_bare, sites};
use super::slabs::slab_heights;
use super::stairs::find_stairs;
use crate::budget::WORK_A_LOOK;
use crate::{BakeConfig, BakeError, Method, SmallestHole};

/// Label of the space around the building.
pub(crate) const OUTDOORS: u32 = 1;

/// Triangles that lie in the border of a box are in it. [Units: wu]
const ON_BORDER: f64 = 1e-3;

/// The structure of a scene.
///
/// `walls`, `stairs`, `bvh`, `rims` and `missing` are in frame coordinates, all else in scene coordinates.
pub(crate) struct Structure<'a> {
    pub(crate) scene: &'a Scene,
    /// Source of each triangle.
    pub(crate) sources: Vec<TriangleSource>,
    /// All structural triangles that have an area.
    pub(crate) triangles: Vec<Triangle>,
    /// The axes along which most walls run.
    pub(crate) frame: Frame,
    /// Triangles that bound rooms.
    pub(crate) walls: Vec<Triangle>,
    /// Index of each wall in `triangles`.
    pub(crate) wall_numbers: Vec<u32>,
    pub(crate) stairs: Vec<Triangle>,
    /// Indexes all structural triangles.
    pub(crate) bvh: Bvh,
    /// Edges where walls end.
    pub(crate) rims: Rims,
    /// Triangles missing in walls, each as large as an opening of the least width. The hole is not a doorway.
    pub(crate) missing: Vec<Triangle>,
    /// The smallest hole of this model, never [`SmallestHole::Auto`].
    pub(crate) hole: SmallestHole,
    /// Shared budget of all that works on the structure.
    pub(crate) allowance: &'a Allowance,
}

/// The structure of a scene in scene coordinates, from which a proposal is realized.
pub(crate) struct SceneStructure<'a> {
    pub(crate) scene: &'a Scene,
    /// Source of each triangle.
    pub(crate) sources: Vec<TriangleSource>,
    /// All structural triangles that have an area.
    pub(crate) triangles: Vec<Triangle>,
    /// Indexes all structural triangles.
    pub(crate) bvh: Bvh,
    /// Triangles missing in walls.
    pub(crate) missing: Vec<Triangle>,
    /// The smallest hole of this model, never [`SmallestHole::Auto`].
    pub(crate) hole: SmallestHole,
}

impl<'a> Structure<'a> {
    /// Sorts the structure of a scene for a method.
    ///
    /// `O(n log n)` in triangles.
    ///
    /// # Errors
    /// If nothing is structural.
    pub(crate) fn of(
        scene: &'a Scene,
        method: Method,
        config: &BakeConfig,
        allowance: &'a Allowance,
    ) -> Result<Self, BakeError> {
        Self::with_tree(scene, method, config, allowance).map(|(structure, _)| structure)
    }

    /// Does [`Self::of`], and returns a tree over the triangles in scene coordinates, if it is at hand and is not `bvh`.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub(crate) fn with_tree(
        scene: &'a Scene,
        method: Method,
        config: &BakeConfig,
        allowance: &'a Allowance,
    ) -> Result<(Self, Option<Bvh>), BakeError> {
        let (mut sources, mut triangles) = structural_triangles(scene);
        allowance.spend(WORK_A_LOOK * triangles.len() as u64);
        let mut tree = Some(Bvh::build(&triangles));
        let misfit = (tree.as_ref()).map_or(0.0, |tree| misfit(&triangles, tree, allowance));
        let reach = config.smallest_hole.reach(misfit);
        // Brushes are exact.
        if reach > 0.0 && scene.solids.is_empty() {
            tree = None;
            let closes_gaps = config.smallest_hole.has_seals();
            settle(&mut triangles, reach, closes_gaps, allowance);
            (sources, triangles) = std::iter::zip(sources, triangles)
                .filter(|(_, t)| has_area(t))
                .unzip();
        }
        if triangles.is_empty() {
            return Err(BakeError::NothingStructural {
                n_objects: scene.objects.len(),
            });
        }
        let frame = match method {
            // Voxels follow the walls, however the building is turned.
            Method::Watershed => Frame::of(&triangles),
            Method::Bsp if config.bsp.rooms.are_wanted(scene) => Frame::of(&triangles),
            Method::Bsp | Method::Delaunay => Frame::SCENE,
        };
        let framed = frame.triangles_to_grid(&triangles);
        // Stairs stand in rooms and bound none. The class of a brush marks detail, so all other brushes bound rooms.
        let mut is_stair = if method == Method::Bsp && !scene.solids.is_empty() {
            vec![false; framed.len()]
        } else {
            find_stairs(&sources, &framed)
        };
        // If everything is stairs, there are no rooms for them to stand in.
        if is_stair.iter().all(|&s| s) {
            is_stair.fill(false);
        }
        let numbers = |stairs: bool| -> Vec<u32> {
            let all = (0..framed.len() as u32).zip(&is_stair);
            all.filter(|t| *t.1 == stairs).map(|t| t.0).collect()
        };
        let at = |numbers: &[u32]| numbers.iter().map(|&t| framed[t as usize]).collect();
        let wall_numbers = numbers(false);
        let walls: Vec<Triangle> = at(&wall_numbers);
        let bvh = match tree.take_if(|_| frame.is_scene()) {
            Some(tree) => tree,
            None => Bvh::build(&framed),
        };
        let rims = Rims::of(&walls);
        let structure = Self {
            missing: rims.missing_triangles(config.min_opening.powi(2)),
            hole: config.smallest_hole.resolved(misfit),
            rims,
            walls,
            stairs: at(&numbers(true)),
            bvh,
            frame,
            wall_numbers,
            scene,
            sources,
            triangles,
            allowance,
        };
        Ok((structure, tree))
    }

    /// Returns the box around everything structural, in frame coordinates.
    pub(crate) fn bounds(&self) -> Aabb {
        bounds_of(&self.walls).union(bounds_of(&self.stairs))
    }

    /// Returns the parts in which anything can bound rooms, in frame coordinates: without open land.
    pub(crate) fn sites(&self, opening: f64) -> Vec<Site> {
        sites(&self.walls, &self.bounds(), opening, self.allowance)
    }

    /// Returns `true` if there is nothing but open land.
    pub(crate) fn is_bare(&self, opening: f64) -> bool {
        is_bare(&self.walls, &self.bounds(), opening, self.allowance)
    }

    /// Returns the heights at which storeys end in a box, ascending: beside wide land, no slab would be large. [Units: wu]
    pub(crate) fn slabs(&self, within: &Aabb) -> Vec<f64> {
        slabs_of(&self.walls, within)
    }

    /// Calls `take` with the triangles of each detail object that may close an opening, in frame coordinates: shut door
    /// leaves, panes. `surfaces` hold their rims.
    pub(crate) fn for_blockers(&self, surfaces: &Bvh, take: impl FnMut(Vec<Triangle>)) {
        without_open_leaves(&plates(self.scene), self.frame, surfaces).for_each(take);
    }

    /// Drops what only builders need, once their results are back in scene coordinates.
    pub(crate) fn into_scene(self) -> SceneStructure<'a> {
        let to_scene = |p: DVec3| self.frame.to_scene(p);
        let missing = self.missing.iter().map(|t| t.map(to_scene)).collect();
        let bvh = if self.frame.is_scene() {
            self.bvh
        } else {
            drop(self.bvh);
            Bvh::build(&self.triangles)
        };
        SceneStructure {
            scene: self.scene,
            sources: self.sources,
            triangles: self.triangles,
            bvh,
            missing,
            hole: self.hole,
        }
    }
}

/// Returns the heights at which storeys of these walls end in a box; see [`Structure::slabs`].
pub(crate) fn slabs_of(walls: &[Triangle], within: &Aabb) -> Vec<f64> {
    let within = within.expanded(ON_BORDER);
    let is_in = |t: &&Triangle| t.iter().all(|&p| within.contains(p));
    let walls: Vec<Triangle> = walls.iter().filter(is_in).copied().collect();
    slab_heights(&walls)
}

/// Returns the structural triangles that have an area, with their sources.
pub(crate) fn structural_triangles(scene: &Scene) -> (Vec<TriangleSource>, Vec<Triangle>) {
    scene
        .triangle_sources(Role::Structural)
        .map(|s| (s, scene.world_triangle(s)))
        .filter(|(_, t)| t.iter().all(|p| p.is_finite()) && has_area(t))
        .unzip()
}

fn has_area(t: &Triangle) -> bool {
    triangle_area_normal(t).length_squared() > 0.0
}

/// Returns the box around triangles; empty for none.
pub(crate) fn bounds_of(triangles: &[Triangle]) -> Aabb {
    triangles
        .iter()
        .flatten()
        .fold(Aabb::EMPTY, |b, &p| b.including(p))
}

/// Returns the triangles in a canonical order, each starting at its least vertex, for builders whose result
/// would depend on the order in the file.
pub(crate) fn in_own_order(triangles: &[Triangle]) -> Vec<Triangle> {
    let order = |a: &DVec3, b: &DVec3| {
        let by = |k: usize| a[k].total_cmp(&b[k]);
        by(0).then_with(|| by(1)).then_with(|| by(2))
    };
    let mut out: Vec<Triangle> = triangles
        .iter()
        .map(|t| {
            let least = (0..3).min_by(|&i, &j| order(&t[i], &t[j])).unwrap_or(0);
            [t[least], t[(least + 1) % 3], t[(least + 2) % 3]]
        })
        .collect();
    out.sort_unstable_by(|a, b| {
        let by = |k: usize| order(&a[k], &b[k]);
        by(0).then_with(|| by(1)).then_with(|| by(2))
    });
    out
}
