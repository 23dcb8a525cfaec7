//! The leak doctor: the way from air that should be a room to the outdoors, where it is widest.
//!
//! Compilers of levels end with a trail of points when a map leaks (`qbsp` of Quake wrote `.pts` files): any way out will do, since
//! a sealed map has none. A model of a building has doors, so that here the way matters: of all ways out the one through
//! which the largest ball passes ([`widest_path`]), the shortest among those. Its narrowest place is what a wall, a
//! door leaf or a smaller hole would have to close first.
//!
//! Works on a grid of voxels of its own, the same that the watershed has, so that it is there for any builder.
//! Holes narrower than about two voxels are closed in it.

use enfilade_geom::scene::Scene;
use enfilade_geom::{Bvh, DVec3};

use crate::structure::{Frame, bounds_of, plates, structural_triangles};
use crate::voxel::{
    ENCLOSED, Grid, WidestPath, ascend, deepest_enclosed, distance_squared, enclosure, voxelize,
    widest_path,
};

use crate::budget::n_structural;
use crate::{BakeConfig, BakeContext, BakeError, Stage};

/// A way from air that should be a room to the outdoors, as wide as can be.
#[derive(Clone, Debug, PartialEq)]
pub struct LeakTrail {
    /// Corners of the way, from the middle of the room to the edge of the air around the scene. It touches no
    /// structure, door leaf or pane. [Units: wu]
    pub points: Vec<DVec3>,
    /// Where it is narrowest, one of its corners; of a long narrow stretch the outer end. [Units: wu]
    pub narrowest: DVec3,
    /// Diameter of the largest ball that passes there, two voxels less at worst. [Units: wu]
    pub width: f64,
    /// Where it comes out of the last air that is enclosed like a room, one of its corners. The narrowest place
    /// is not beyond. [Units: wu]
    pub exit: DVec3,
    /// Diameter of the largest ball around its first point. [Units: wu]
    pub room_width: f64,
}

impl LeakTrail {
    /// How long the way is. [Units: wu]
    #[must_use]
    pub fn length(&self) -> f64 {
        self.points.windows(2).map(|p| p[0].distance(p[1])).sum()
    }

    /// Whether the way is nowhere much narrower than the room that it begins in, so that it passes no hole but a wall, floor
    /// or roof that is not there.
    #[must_use]
    pub fn is_wide_open(&self) -> bool {
        self.width >= WIDE_OPEN * self.room_width
    }
}

/// Share of a room's width from which on an opening is as wide as the room; what voxels round away is below it.
const WIDE_OPEN: f64 = 0.85;
/// A point in matter is taken for the free voxel nearest to it within so many. [Units: vx]
const NUDGE: usize = 3;

/// Why there is no trail.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoTrail {
    /// Nothing structural, settings out of limits, or too many voxels.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// The point is not among the voxels.
    #[error(
        "the point {:.2} {:.2} {:.2} lies beyond the scene; give one in the room, in meters and with y up, as the world \
         has it", .point.x, .point.y, .point.z
    )]
    Outside {
        /// The point. [Units: wu]
        point: DVec3,
    },
    /// There is no air where the point is.
    #[error(
        "the point {:.2} {:.2} {:.2} lies in a wall or narrower air than the voxels of {voxel:.2} m show; give one in the \
         middle of the room", .point.x, .point.y, .point.z
    )]
    InMatter {
        /// The point. [Units: wu]
        point: DVec3,
        /// Edge of a voxel. [Units: wu]
        voxel: f64,
    },
    /// Nothing leaks.
    #[error(
        "nothing leaks: the air around {:.2} {:.2} {:.2} is closed on all sides, but for holes narrower than {hole:.2} m; \
         door leaves and panes count as closed", .from.x, .from.y, .from.z
    )]
    Closed {
        /// Where a way was looked for. [Units: wu]
        from: DVec3,
        /// Narrower holes are not in the grid. [Units: wu]
        hole: f64,
    },
    /// No air is there that anybody would call a room.
    #[error(
        "no air as wide as a room that is open to outdoors has walls, a floor or a ceiling on four of its six sides"
    )]
    NothingEnclosed,
}

/// Finds the widest way to the outdoors from `from`, or else from the middle of the largest air that is enclosed on four
/// sides or more, open to outdoors, and as wide as a room ([`MergeSettings::min_radius`](crate::MergeSettings)).
/// A point is moved to the middle of its surroundings first, lest its own distance to a wall be the narrowest.
/// [Units: wu]
///
/// Deterministic. Linear in voxels, in triangles about; takes up to 5 bytes a voxel while it runs, and 16 for each voxel of a
/// front. Uses the voxel size of a bake by watershed with the same settings.
///
/// # Errors
/// When there is nothing to tell, or the budget is spent: see [`NoTrail`].
pub fn find_leak_trail(
    scene: &Scene,
    config: &BakeConfig,
    from: Option<DVec3>,
    context: &BakeContext<'_>,
) -> Result<LeakTrail, NoTrail> {
    let context = &context.within(&config.budget, n_structural(scene));
    context.begin(Stage::WayOut)?;
    let allowance = context.allowance();
    let (_, mut matter) = structural_triangles(scene);
    if matter.is_empty() {
        return Err(NoTrail::Bake(BakeError::NothingStructural {
            n_objects: scene.objects.len(),
        }));
    }
    let frame = Frame::of(&matter);
    let grid = config.grid(&bounds_of(&frame.triangles_to_grid(&matter)), matter.len())?;
    // Leaves that stand open, too: a room ends at its doorways.
    matter.extend(plates(scene).concat());
    let matter = frame.triangles_to_grid(&matter);
    context.grant_voxels(grid.n_voxels() as u64);
    let distances = distance_squared(&voxelize(&grid, &matter, allowance), allowance);
    let enclosure = enclosure(grid.dims, &distances, allowance);
    context.check()?;
    let start = match from {
        Some(point) => {
            let near = free_voxel(&grid, &distances, frame.to_grid(point), point)?;
            ascend(grid.dims, &distances, &enclosure, near, allowance)
        }
        None => {
            // A voxel next to a wall is one voxel away from it already.
            let radius = config.merge.min_radius / grid.voxel + 0.5;
            let depth = (radius * radius).ceil() as u16;
            let deepest = deepest_enclosed(grid.dims, &distances, &enclosure, depth, allowance);
            context.check()?;
            deepest.ok_or(NoTrail::NothingEnclosed)?
        }
    };
    let scene_point = |i: usize| {
        let [x, y, z] = grid.coords(i);
        frame.to_scene(grid.center(x, y, z))
    };
    let path = widest_path(grid.dims, &distances, start, allowance);
    context.check()?;
    let path = path.ok_or_else(|| NoTrail::Closed {
        from: scene_point(start),
        hole: 2.0 * grid.voxel,
    })?;
    let exit = exit_of(&path, &enclosure);
    let corners = path.corners(grid.dims, &distances, &[path.narrowest, exit]);
    let bvh = Bvh::build(&matter);
    Ok(LeakTrail {
        points: corners.into_iter().map(scene_point).collect(),
        narrowest: scene_point(path.voxels[path.narrowest]),
        width: width_at(&grid, &bvh, &path, path.narrowest),
        exit: scene_point(path.voxels[exit]),
        room_width: width_at(&grid, &bvh, &path, 0),
    })
}

/// The free voxel nearest to a point of the grid, ties by index.
fn free_voxel(grid: &Grid, distances: &[u16], at: DVec3, point: DVec3) -> Result<usize, NoTrail> {
    let here = grid.voxel_at(at).ok_or(NoTrail::Outside { point })?;
    let around = |k: usize| here[k].saturating_sub(NUDGE)..(here[k] + NUDGE + 1).min(grid.dims[k]);
    let mut best: Option<(f64, usize)> = None;
    for z in around(2) {
        for y in around(1) {
            for x in around(0) {
                let i = grid.index(x, y, z);
                let off = if [x, y, z] == here {
                    0.0
                } else {
                    grid.center(x, y, z).distance(at)
                };
                if distances[i] > 0 && best.is_none_or(|(least, _)| off < least) {
                    best = Some((off, i));
                }
            }
        }
    }
    best.map(|(_, i)| i).ok_or(NoTrail::InMatter {
        point,
        voxel: grid.voxel,
    })
}

/// The last voxel of the path in air that is enclosed like a room; the narrowest where that comes later.
fn exit_of(path: &WidestPath, enclosure: &[u8]) -> usize {
    // Before a window even the middle of a room is open on one side.
    let of_room = enclosure[path.voxels[0]].clamp(*ENCLOSED.start(), ENCLOSED.end() - 1);
    let last = path
        .voxels
        .iter()
        .rposition(|&v| enclosure[v] >= of_room)
        .unwrap_or(0);
    last.max(path.narrowest)
}

/// Diameter of the largest ball about voxel `i` of the path, its middle moved straight across the path by up to a voxel, and
/// no farther than there is air around. [Units: wu]
fn width_at(grid: &Grid, bvh: &Bvh, path: &WidestPath, i: usize) -> f64 {
    let center = |i: usize| {
        let [x, y, z] = grid.coords(path.voxels[i]);
        grid.center(x, y, z)
    };
    let radius = |p: DVec3| bvh.nearest(p, f64::INFINITY).map_or(0.0, |n| n.distance);
    let next = (i + 1).min(path.voxels.len() - 1);
    let along = (center(next) - center(i.saturating_sub(1))).normalize_or(DVec3::X);
    let (u, v) = along.any_orthonormal_pair();
    let mut widest = radius(center(i));
    let step = grid.voxel.min(widest) / f64::from(STEPS);
    for (a, b) in (-STEPS..=STEPS).flat_map(|a| (-STEPS..=STEPS).map(move |b| (a, b))) {
        if a * a + b * b <= STEPS * STEPS {
            let across = u * f64::from(a) + v * f64::from(b);
            widest = widest.max(radius(center(i) + across * step));
        }
    }
    2.0 * widest
}

/// Places on each side that are tried within a voxel.
const STEPS: i32 = 4;
