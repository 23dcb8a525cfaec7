//! Paths for walkers: from point to point at any angle, and walking distances.
//!
//! Two levels, as in Botea, Müller & Schaeffer ("Near optimal hierarchical path-finding", 2004), but with cells and portals for
//! clusters and entrances. Lengths between the portals of each cell are found once, over its [floors](Floors), so that paths go
//! around walls within a cell. A query takes the best sequences of portals from the [length search](LengthSearch), finds the
//! path over the floors of their cells only, and pulls it taut: each bend moves straight towards the line between its neighbors
//! as far as the floors allow, until none moves. The shortest of the best few sequences wins.
//!
//! Rooms that move are joined at the query: a map holds the floors of each part in its own frame, and [joints] are the places
//! where a walker steps from one part into another through their doors, found anew for parts that have moved. The search goes from
//! part to part over them; a path is a leg in each part that it passes.
//!
//! The path keeps the walker's radius from walls as [floors](Floors) do, and is never shorter than the shortest such path. It
//! may be longer if it is caught on the other side of a free-standing obstacle in a cell, or if two sequences are nearly equally
//! short. O(floors of the cells passed), at most milliseconds for a storey.

use enfilade_geom::DVec3;

use crate::layout::LayoutExit;
use crate::space::PartId;

pub use blocked::{Blocked, Obstacle};
pub use edges::Corner;
pub(crate) use ends::{End, Limit};
pub use floors::Floors;
pub use geodesics::Geodesics;
pub(crate) use geodesics::{Seen, into_cell};
pub use hops::{Hop, Hops};
pub use kept::{KeptMapError, WalkMapKey};
pub use patches::WalkPatch;
pub use path_follower::{PathFollower, WalkProgress};
pub use path_search::PathSearch;
pub use refusal::{AskedWalk, WalkWords};
pub use sampling::Sampling;
pub use search::{Arrival, LengthSearch, PassedPortal};
pub(crate) use sequences::Sequences;
pub use walk_map::WalkMap;
pub use ways::Ways;

mod all_pairs;
mod blocked;
mod columns;
mod edges;
mod ends;
mod floors;
mod geodesics;
mod grounds;
mod hops;
mod joints;
mod kept;
mod legs;
mod part_hops;
mod patches;
mod path_follower;
mod path_search;
mod pull;
mod refusal;
mod sampling;
mod search;
mod sequences;
mod solid;
mod strides;
mod trees;
mod walk_map;
mod ways;

/// A path found. Reuse it, so that a search need not allocate.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Path {
    /// Points where it bends, in plan or in height: on the floor, from the start to the end. Where it goes from part to part, a
    /// point in each.
    pub points: Vec<PathPoint>,
    /// The portals that it passes.
    pub portals: Vec<PathPortal>,
    /// Length of the line through the points. [Units: wu]
    pub length: f64,
    /// Its length in plan. [Units: wu]
    pub length_in_plan: f64,
}

/// A point of a path, in the frame of the part in which the path is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// The part.
    pub part: PartId,
    /// The point, on the floor. [Units: wu]
    pub at: DVec3,
}

/// A portal of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PathPortal {
    /// The part whose portal it is.
    pub part: PartId,
    /// The portal, and the cell entered.
    pub exit: LayoutExit,
    /// Where the path passes it, on the floor, in the part's frame. [Units: wu]
    pub at: DVec3,
}

impl Path {
    fn clear(&mut self) {
        self.points.clear();
        self.portals.clear();
        (self.length, self.length_in_plan) = (0.0, 0.0);
    }
}

/// Reason why there is no path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoPath {
    /// The walker cannot stand at the start.
    #[error("no floor for a walker within its height and diameter of the start")]
    NoFloorAtStart,
    /// The walker cannot stand at the end.
    #[error("no floor for a walker within its height and diameter of the end")]
    NoFloorAtEnd,
    /// Walls, steps, gaps or closed portals separate them.
    #[error("no way that a walker can go")]
    NoWay,
}
