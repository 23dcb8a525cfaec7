//! The leak doctor: the widest path to the outdoors from air that should be a room.
//!
//! Level compilers report a leak as a trail of points (Quake's `qbsp` wrote `.pts` files). Any way out will do there,
//! since a sealed map has none. A building has doors, so the choice matters here: of all paths to the outdoors, the one
//! through which the largest ball passes ([`widest_path`]), and the shortest among those. Its narrowest place is the
//! first that a wall, a door leaf or a smaller hole would have to close.
//!
//! Works on its own voxel grid, equal to the watershed's, so that it works with any builder.
//! Holes narrower than about two voxels count as closed.

use enfilade_geom::scene::Scene;
use enfilade_geom::{Bvh, DVec3};

use crate::rooms::FLOODED;
use crate::structure::{Frame, bounds_of, plates, structural_triangles};
use crate::voxel::{
    ENCLOSED, Grid, WidestPath, ascend, deepest_enclosed, distance_squared, enclosure, voxelize,
    widest_path,
};

use crate::budget::n_structural;
use crate::{BakeConfig, BakeContext, BakeError, Stage};

/// The widest path to the outdoors from air that should be a room.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LeakTrail {
    /// Vertices of the path, from the middle of the room to the edge of the air around the scene. It touches no
    /// structure, door leaf or pane. [Units: wu]
    pub points: Vec<DVec3>,
    /// The narrowest place of the path, one of its vertices; the outer end of a long narrow stretch. [Units: wu]
    pub narrowest: DVec3,
    /// Diameter of the largest ball that passes there; at worst two voxels too small. [Units: wu]
    pub width: f64,
    /// The point where the path leaves the last air that is enclosed like a room, one of its vertices. The narrowest
    /// place is never beyond it. [Units: wu]
    pub exit: DVec3,
    /// Diameter of the largest ball around its first point. [Units: wu]
    pub room_width: f64,
}

impl LeakTrail {
    /// Returns the length of the path. [Units: wu]
    #[must_use]
    pub fn length(&self) -> f64 {
        self.points.windows(2).map(|p| p[0].distance(p[1])).sum()
    }

    /// Returns `true` if the path is nowhere much narrower than its room: a wall, floor or roof is missing.
    #[must_use]
    pub fn is_wide_open(&self) -> bool {
        self.width >= WIDE_OPEN * self.room_width
    }
}

/// Share of a room's width from which on an opening counts as wide as the room. It allows for voxel rounding.
const WIDE_OPEN: f64 = 0.85;
/// A point inside matter moves to the nearest free voxel within this distance. [Units: vx]
const NUDGE: usize = 3;

/// The reason why there is no trail.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoTrail {
    /// Nothing structural, invalid settings, or too many voxels.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// The point lies outside the voxel grid.
    #[error(
        "the point {:.2} {:.2} {:.2} lies outside the scene; give a point in the room, in meters and with y up, as in \
         the world", .point.x, .point.y, .point.z
    )]
    Outside {
        /// The point. [Units: wu]
        point: DVec3,
    },
    /// There is no air at the point.
    #[error(
        "the point {:.2} {:.2} {:.2} lies in a wall or in air too narrow for voxels of {voxel:.2} m; give a point in \
         the middle of the room", .point.x, .point.y, .point.z
    )]
    InMatter {
        /// The point. [Units: wu]
        point: DVec3,
        /// Edge of a voxel. [Units: wu]
        voxel: f64,
    },
    /// Nothing leaks.
    #[error(
        "nothing leaks: the air around {:.2} {:.2} {:.2} is closed on all sides, except for holes narrower \
         than {hole:.2} m; door leaves and panes count as closed", .from.x, .from.y, .from.z
    )]
    Closed {
        /// The start of the search. [Units: wu]
        from: DVec3,
        /// Width below which holes are closed in the grid. [Units: wu]
        hole: f64,
    },
    /// No air is enclosed like a room.
    #[error(
        "no air that is open to outdoors and as wide as a room has walls, floor or ceiling on four of its six sides"
    )]
    NothingEnclosed,
}

/// Finds the widest path to the outdoors from `from`. [Units: wu] Without `from`, starts in the middle of the largest
/// air that is enclosed on at least four sides, open to the outdoors, and as wide as a room
/// ([`MergeSettings::min_radius`](crate::MergeSettings)).
/// First moves the start to the middle of its surroundings, so that it is not itself the narrowest place.
///
/// Deterministic. Linear in voxels and about linear in triangles; takes up to 5 bytes a voxel, and 16 for each voxel of
/// a front. Uses the voxel size of a watershed bake with the same settings.
///
/// # Errors
/// If there is no trail, or the budget is spent: see [`NoTrail`].
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
    let grid = config.grid(
        &bounds_of(&frame.triangles_to_grid(&matter)),
        matter.len(),
        FLOODED,
    )?;
    // Includes leaves that stand open: a room ends at its doorways.
    for plate in plates(scene) {
        matter.extend_from_slice(&plate.triangles());
    }
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

/// Returns the free voxel nearest to a point of the grid; ties go to the lower index.
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

/// Returns the index of the path's last voxel in air enclosed like a room, or of the narrowest if that is later.
fn exit_of(path: &WidestPath, enclosure: &[u8]) -> usize {
    // In front of a window even the middle of a room is open on one side.
    let of_room = enclosure[path.voxels[0]].clamp(*ENCLOSED.start(), ENCLOSED.end() - 1);
    let last = path
        .voxels
        .iter()
        .rposition(|&v| enclosure[v] >= of_room)
        .unwrap_or(0);
    last.max(path.narrowest)
}

/// Returns the diameter of the largest ball around voxel `i` of the path. Its center may move across the path by up to
/// a voxel, but not beyond the air around it. [Units: wu]
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

/// Positions tried on each side within a voxel.
const STEPS: i32 = 4;
