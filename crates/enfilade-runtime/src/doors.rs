//! Leaves of doors: the portals that each shuts, and the space that it sweeps.

use enfilade_cpg::{CellId, FittingPart, Motion, Portal, PortalId, World};
use enfilade_geom::{Aabb, DVec3};

use crate::point::point;
use crate::seen::DetailId;
use crate::sight_error::SightError;

/// Poses between shut and open at which a leaf's sweep is measured.
const POSES: u32 = 16;
/// Strips that a leaf is divided into there, each swept by itself.
const STRIPS: u32 = 4;

/// A leaf of a door: an object and its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Leaf {
    /// The object.
    pub detail: DetailId,
    /// Motion between shut and open.
    pub motion: Motion,
}

/// A moving object.
#[derive(Clone, Debug)]
struct Moving {
    leaf: Leaf,
    /// The portals of which it is a leaf.
    portals: Vec<u32>,
    /// Bounding box of the space that it sweeps. [Units: wu]
    swept: Aabb,
    /// Cells that it sweeps.
    cells: Vec<CellId>,
}

/// All leaves of a world.
#[derive(Clone, Debug, Default)]
pub(crate) struct Doors {
    /// Leaves of portal `p` are `leaves[first[p]..first[p + 1]]`.
    first: Vec<u32>,
    leaves: Vec<Leaf>,
    /// Index of each leaf in `moving`.
    slots: Vec<u32>,
    /// Per portal, `true` if one sees through it when its leaves are shut.
    is_clear: Vec<bool>,
    /// Offset of each portal's shut leaves along its normal, from its plane. [Units: wu]
    depths: Vec<f32>,
    most_depth: f64,
    /// In ascending order of details.
    moving: Vec<Moving>,
}

impl Doors {
    /// Collects the leaves of a world.
    ///
    /// # Errors
    ///
    /// If a fitting of a portal names an object that does not exist.
    pub(crate) fn of(world: &World) -> Result<Self, SightError> {
        let mut out = Self {
            first: vec![0],
            ..Self::default()
        };
        for (p, portal) in (0..).zip(&world.graph.portals) {
            let begin = out.leaves.len();
            for f in portal
                .fittings
                .iter()
                .filter(|f| f.part == FittingPart::Leaf)
            {
                let object = world.details.get(f.detail as usize);
                let mesh = object.and_then(|o| world.detail_meshes.get(o.mesh as usize));
                if mesh.is_none() {
                    let (what, index) = ("portal", p);
                    return Err(SightError::Geometry { what, index });
                }
                if let Some(motion) = f.motion {
                    let detail = DetailId(f.detail);
                    let at = out.moving.partition_point(|m| m.leaf.detail < detail);
                    if out.moving.get(at).is_none_or(|m| m.leaf.detail != detail) {
                        out.moving
                            .insert(at, moving(world, portal, Leaf { detail, motion }));
                    }
                    let known = &mut out.moving[at];
                    known.portals.push(p);
                    out.leaves.push(known.leaf);
                }
            }
            out.first.push(out.leaves.len() as u32);
            let own = &out.leaves[begin..];
            let is_clear = own.is_empty() || own.iter().any(|l| world.is_see_through(l.detail.0));
            out.is_clear.push(is_clear);
            out.depths
                .push(own.first().map_or(0.0, |l| depth(world, portal, l)));
        }
        let depths = out.depths.iter().map(|d| f64::from(d.abs()));
        out.most_depth = depths.fold(0.0, f64::max);
        let slot = |l: &Leaf| out.moving.partition_point(|m| m.leaf.detail < l.detail) as u32;
        out.slots = out.leaves.iter().map(slot).collect();
        Ok(out)
    }

    fn range(&self, portal: PortalId) -> std::ops::Range<usize> {
        let p = portal.0 as usize;
        let end = |i: usize| self.first.get(i).copied().unwrap_or_default() as usize;
        end(p)..end(p + 1).max(end(p))
    }

    /// Returns the leaves of a portal.
    pub(crate) fn leaves(&self, portal: PortalId) -> &[Leaf] {
        &self.leaves[self.range(portal)]
    }

    /// Returns the indices of a portal's leaves among all moving objects.
    pub(crate) fn slots(&self, portal: PortalId) -> &[u32] {
        &self.slots[self.range(portal)]
    }

    /// Returns `true` if one sees through a portal even with its leaves shut.
    pub(crate) fn is_clear(&self, portal: u32) -> bool {
        self.is_clear.get(portal as usize).copied().unwrap_or(true)
    }

    /// Returns the offset of a portal's shut leaves along its normal, from its plane. [Units: wu]
    pub(crate) fn depth(&self, portal: PortalId) -> f32 {
        self.depths
            .get(portal.0 as usize)
            .copied()
            .unwrap_or_default()
    }

    /// Returns the largest absolute offset of any portal's leaves. [Units: wu]
    pub(crate) fn most_depth(&self) -> f64 {
        self.most_depth
    }

    pub(crate) fn n_moving(&self) -> usize {
        self.moving.len()
    }

    pub(crate) fn moving(&self, slot: u32) -> &Leaf {
        &self.moving[slot as usize].leaf
    }

    pub(crate) fn portals(&self, slot: u32) -> &[u32] {
        &self.moving[slot as usize].portals
    }

    /// Returns the index of an object among all moving objects.
    pub(crate) fn slot(&self, detail: DetailId) -> Option<u32> {
        let found = self.moving.binary_search_by_key(&detail, |m| m.leaf.detail);
        found.ok().map(|i| i as u32)
    }

    /// Returns the box and the cells that a moving object sweeps; `None` for an object that does not move.
    pub(crate) fn way(&self, detail: u32) -> Option<(Aabb, &[CellId])> {
        let moving = &self.moving[self.slot(DetailId(detail))? as usize];
        Some((moving.swept, &moving.cells))
    }
}

/// Vertices of an object in the model's pose.
fn corners(world: &World, detail: DetailId) -> impl Iterator<Item = DVec3> {
    let object = &world[detail];
    let transform = object.placement();
    let mesh = &world.detail_meshes[object.mesh as usize];
    let positions = mesh.primitives.iter().flat_map(|p| &p.positions);
    positions.map(move |p| transform.transform_point3(point(*p)))
}

/// The box of a shut leaf in a frame: across the opening, up, and along the portal's normal.
fn shut_box(world: &World, axes: [DVec3; 3], leaf: &Leaf) -> Aabb {
    let shut = leaf.motion.at(0.0);
    let along = |p: DVec3| DVec3::from(axes.map(|a| a.dot(p)));
    let corners = corners(world, leaf.detail).map(|p| along(shut.transform_point3(p)));
    corners.fold(Aabb::EMPTY, Aabb::including)
}

fn axes_of(portal: &Portal) -> [DVec3; 3] {
    let normal = point(portal.normal).try_normalize().unwrap_or(DVec3::Z);
    let across = DVec3::Y.cross(normal).try_normalize().unwrap_or(DVec3::X);
    [across, normal.cross(across), normal]
}

fn depth(world: &World, portal: &Portal, leaf: &Leaf) -> f32 {
    let axes = axes_of(portal);
    let own = shut_box(world, axes, leaf);
    let plane = portal.outline.first().map(|p| axes[2].dot(point(*p)));
    match plane {
        Some(at) if !own.is_empty() => ((own.min.z + own.max.z) * 0.5 - at) as f32,
        _ => 0.0,
    }
}

fn moving(world: &World, portal: &Portal, leaf: Leaf) -> Moving {
    let axes = axes_of(portal);
    let own = shut_box(world, axes, &leaf);
    let back = |p: DVec3| axes[0] * p.x + axes[1] * p.y + axes[2] * p.z;
    // Motions start from the model's pose; these boxes are of the shut one.
    let from_shut = leaf.motion.at(0.0).inverse();
    let mut swept = Aabb::EMPTY;
    let mut cells = Vec::new();
    if own.is_empty() || !own.min.is_finite() || !own.max.is_finite() {
        return Moving {
            leaf,
            portals: Vec::new(),
            swept,
            cells,
        };
    }
    for strip in 0..STRIPS {
        let x = |k: u32| own.min.x + (own.max.x - own.min.x) * f64::from(k) / f64::from(STRIPS);
        let part = Aabb::new(
            DVec3::new(x(strip), own.min.y, own.min.z),
            DVec3::new(x(strip + 1), own.max.y, own.max.z),
        );
        let corners = part.corners().map(back);
        let at = |pose: u32| {
            let by = leaf.motion.at(pose as f32 / POSES as f32) * from_shut;
            corners.map(|p| by.transform_point3(p))
        };
        let mut here = at(0);
        for pose in 1..=POSES {
            let next = at(pose);
            // Between two poses, no point is farther from the first pose than the second pose is.
            let moved = here.iter().zip(&next).map(|(a, b)| a.distance(*b));
            let margin = moved.fold(0.0, f64::max);
            swept = swept.union(Aabb::of_points(&here).expanded(margin));
            world.graph.locator.cells_near(&here, margin, &mut cells);
            here = next;
        }
    }
    let n_cells = world.graph.cells.len();
    cells.retain(|c| (c.0 as usize) < n_cells);
    Moving {
        leaf,
        portals: Vec::new(),
        swept,
        cells,
    }
}
