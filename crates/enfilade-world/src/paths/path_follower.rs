//! A walker that follows a path and opens the doors on it.
//!
//! It steers towards the point of the path a little ahead of the nearest one (Coulter, *Implementation of the Pure Pursuit Path
//! Tracking Algorithm*, 1992), and slides along what it touches on the way. Doors open before it comes; a leaf that still
//! stands in its way is shut, if the path does not need it open.
//!
//! Points of the path are in the parts that it leads through, and the walker is in the frame of the part that it stands on.

use enfilade_cpg::PortalId;
use enfilade_geom::{DVec3, closest_point_on_segment};
use enfilade_runtime::{DetailId, Target};

use crate::bodies::{Agent, Walker};
use crate::paths::{Path, PathPoint, PathPortal};
use crate::space::{PartId, Space};

/// Distance along the path to the point steered for. [Units: wu]
const AHEAD: f64 = 0.3;
/// Distance along the path at which doors begin to open: farther than their leaves reach. [Units: wu]
const DOOR: f64 = 2.0;
/// Time from shut to open. [Units: s]
const SWING: f64 = 0.7;
/// Time without progress after which a walker shuts the leaf in its way. [Units: s]
const SHUT: f64 = 0.5;
/// Time without progress after which it is stuck. [Units: s]
const PATIENCE: f64 = 4.0;
/// Parts have parted if a step between them is longer by this, or higher. [Units: wu]
const PARTED: f64 = 0.05;
/// Least progress that counts. [Units: wu]
const PROGRESS: f64 = 0.05;

/// State of a walk along a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WalkProgress {
    /// It is on its way.
    Walking,
    /// It is within its radius of the end.
    Arrived,
    /// Something that the path does not know of has stopped it for some seconds.
    Stuck,
}

/// Leads a [`Walker`] along a [`Path`], and opens the doors on it.
///
/// ```
/// use enfilade_cpg::{CellId, PortalId};
/// use enfilade_geom::DVec3;
/// use enfilade_testkit::{GridParams, room_grid, with_doors};
/// use enfilade_world::{Agent, PartId, Path, PathFollower, PathSearch, Space, WalkMap, WalkProgress, Walker};
///
/// let world = with_doors(room_grid(&GridParams::two_rooms()), |_| false);
/// let mut space = Space::new(world)?;
/// let agent = Agent::default();
///
/// // From the middle of one room to that of the other, through a door that is shut.
/// let map = WalkMap::new(&space, agent);
/// let layout = space.layout(PartId::ROOT);
/// let ends = [0, 1].map(|cell| (PartId::ROOT, layout.cell(CellId(cell)).bounds.center()));
/// let mut path = Path::default();
/// PathSearch::new().find(&map, &space, ends, |_, _| true, &mut path)?;
///
/// let start = path.points[0];
/// let mut walker = Walker::new(agent, start.part, start.at + DVec3::Y * agent.eye);
/// let mut follower = PathFollower::new(&space, path, 1.4);
/// let mut progress = WalkProgress::Walking;
/// while progress == WalkProgress::Walking {
///     progress = follower.step(&mut walker, &mut space, 1.0 / 60.0);
/// }
/// assert_eq!(progress, WalkProgress::Arrived);
/// assert_eq!(space.state(PartId::ROOT).leaves(PortalId(0)), Some(1.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PathFollower {
    points: Vec<PathPoint>,
    /// Length of the path up to each of its points, in plan.
    lengths: Vec<f64>,
    doors: Vec<DoorAhead>,
    /// All leaves of the parts of the path, each with a portal that it opens.
    leaves: Vec<(PartId, DetailId, PortalId)>,
    speed: f64,
    /// Length passed, and when it last counted as progress.
    passed: f64,
    counted: f64,
    /// Time since then.
    idle: f64,
}

/// A portal of a path.
#[derive(Clone, Copy, Debug)]
struct DoorAhead {
    part: PartId,
    portal: PortalId,
    /// Length of the path after which it is passed.
    at: f64,
    opening: DoorTurn,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DoorTurn {
    Ahead,
    /// Its leaves move.
    Moves,
    Done,
}

impl PathFollower {
    /// Starts at the beginning of a path. [Units: wu/s]
    #[must_use]
    pub fn new(space: &Space, path: Path, speed: f64) -> Self {
        let points = path.points;
        let mut lengths = vec![0.0];
        for w in points.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + in_plan(space, w));
        }
        let mut parts: Vec<PartId> = points.iter().map(|p| p.part).collect();
        parts.sort_unstable();
        parts.dedup();
        let mut leaves = Vec::new();
        for part in parts {
            let sight = space.sight(part);
            for portal in (0..sight.n_portals() as u32).map(PortalId) {
                let own = sight.leaves(portal).iter();
                leaves.extend(own.map(|leaf| (part, leaf.detail, portal)));
            }
        }
        let mut follower = Self {
            points,
            lengths,
            doors: Vec::new(),
            leaves,
            speed,
            passed: 0.0,
            counted: 0.0,
            idle: 0.0,
        };
        let mut from = 0.0;
        for PathPortal { part, exit, at } in path.portals {
            from = follower.nearest(space, part, at, [from, f64::INFINITY]);
            follower.doors.push(DoorAhead {
                part,
                portal: exit.portal,
                at: from,
                opening: DoorTurn::Ahead,
            });
        }
        follower
    }

    /// Returns the length of the path passed, in plan. [Units: wu]
    #[must_use]
    pub fn passed(&self) -> f64 {
        self.passed
    }

    /// Walks on for some seconds, at most a tenth. Moves leaves of doors: those ahead open, and one that is in the way shuts if it
    /// is not needed. Waits where the path leads into a part that has moved away since.
    pub fn step(&mut self, walker: &mut Walker, space: &mut Space, seconds: f64) -> WalkProgress {
        let feet = walker.feet();
        let agent = *walker.agent();
        let frame = walker.frame;
        let joined = self.joined_up_to(space, self.passed + 2.0 * AHEAD, &agent);
        self.passed = self.nearest(space, frame, feet, [self.passed, joined]);
        let end = self.points.len().checked_sub(1);
        let left = end.map_or(DVec3::ZERO, |i| self.point(space, frame, i) - feet);
        if left.with_y(0.0).length() <= agent.radius && left.y.abs() <= agent.step {
            return WalkProgress::Arrived;
        }
        self.open_doors(walker, space, seconds);
        let ahead = joined.min(self.passed + AHEAD);
        let way = (self.at(space, frame, ahead) - feet).with_y(0.0);
        let speed = self.speed.min(way.length() / seconds.max(1e-9));
        // Leaves pass through the walker while they open: where they come to stand, it is not.
        let opens = |part, detail| {
            let mut moving = self.doors.iter().filter(|d| d.opening == DoorTurn::Moves);
            moving.any(|d| self.is_leaf(part, detail, d))
        };
        let wish = way.normalize_or_zero() * speed;
        walker.step_where(space, wish, seconds, |part, detail| !opens(part, detail));
        self.idle += seconds;
        if self.passed >= self.counted + PROGRESS {
            (self.counted, self.idle) = (self.passed, 0.0);
        }
        if let Some((part, Target::Detail { detail, .. })) = walker.obstacle()
            && self.idle > SHUT
        {
            self.shut_leaf(part, detail, walker, space);
        }
        if self.idle > PATIENCE {
            WalkProgress::Stuck
        } else {
            WalkProgress::Walking
        }
    }

    /// Opens the doors ahead a little further, once the walker is clear of where their leaves will stand.
    fn open_doors(&mut self, walker: &mut Walker, space: &mut Space, seconds: f64) {
        for i in 0..self.doors.len() {
            let door = self.doors[i];
            let Some(share) = space.state(door.part).leaves(door.portal) else {
                continue;
            };
            let begins = door.opening == DoorTurn::Ahead
                && (0.0..DOOR).contains(&(door.at - self.passed))
                // One that does not get out of its way is pushed.
                && (self.idle > SHUT || self.is_clear(walker, space,&door, 1.0));
            if begins || door.opening == DoorTurn::Moves {
                let share = share + (seconds / SWING) as f32;
                space.set_leaves(door.part, door.portal, share);
                self.doors[i].opening = if share < 1.0 {
                    DoorTurn::Moves
                } else {
                    DoorTurn::Done
                };
            }
        }
    }

    /// Shuts a leaf unless the path needs it open, or the walker is in its doorway.
    fn shut_leaf(&self, part: PartId, detail: DetailId, walker: &mut Walker, space: &mut Space) {
        let mut ahead = self.doors.iter().filter(|d| d.at > self.passed);
        let known = self.leaves.iter().find(|l| (l.0, l.1) == (part, detail));
        let Some(&(_, _, portal)) = known else { return };
        let door = DoorAhead {
            part,
            portal,
            at: 0.0,
            opening: DoorTurn::Done,
        };
        if ahead.all(|d| !self.is_leaf(part, detail, d)) && self.is_clear(walker, space, &door, 0.0)
        {
            space.set_leaves(part, portal, 0.0);
        }
    }

    /// Returns `true` if a walker touches no leaf of a door at a share of their way.
    fn is_clear(
        &self,
        walker: &mut Walker,
        space: &mut Space,
        door: &DoorAhead,
        share: f32,
    ) -> bool {
        space.with_leaves(door.part, door.portal, share, |space| {
            !walker.touches(space, |part, detail| self.is_leaf(part, detail, door))
        })
    }

    fn is_leaf(&self, part: PartId, detail: DetailId, door: &DoorAhead) -> bool {
        part == door.part && self.leaves.contains(&(part, detail, door.portal))
    }

    /// Returns the length of the path, within a range, after which it is nearest to a point in the frame of a part.
    fn nearest(&self, space: &Space, frame: PartId, p: DVec3, [from, until]: [f64; 2]) -> f64 {
        let (mut least, mut nearest) = (f64::INFINITY, from);
        let first = self.lengths.partition_point(|&l| l < from).max(1) - 1;
        for i in first..self.points.len().saturating_sub(1) {
            let [low, high] = [from.max(self.lengths[i]), until.min(self.lengths[i + 1])];
            if low > high {
                break;
            }
            let [a, b] = [low, high].map(|l| self.at(space, frame, l));
            let q = closest_point_on_segment(p, a, b);
            if q.distance_squared(p) < least {
                let passed = low + (q - a).with_y(0.0).length();
                (least, nearest) = (q.distance_squared(p), passed);
            }
        }
        nearest
    }

    /// Returns the greatest length of the path, up to one, to which it leads from where the walker is, with the parts as they are.
    fn joined_up_to(&self, space: &Space, length: f64, agent: &Agent) -> f64 {
        let first = self.lengths.partition_point(|&l| l < self.passed);
        for i in first..self.points.len().saturating_sub(1) {
            if self.lengths[i] > length + agent.radius {
                break;
            }
            let [a, b] = [self.points[i], self.points[i + 1]];
            let planned = self.lengths[i + 1] - self.lengths[i];
            if a.part != b.part {
                let way = space.between(b.part, a.part).point(b.at) - a.at;
                let off = way.with_y(0.0).length() - planned;
                if off.abs() > PARTED || way.y.abs() > agent.step + PARTED {
                    // Not at the drop.
                    return self.passed.max(self.lengths[i] - agent.radius);
                }
            }
        }
        length
    }

    /// Returns a point of the path in a frame.
    fn point(&self, space: &Space, frame: PartId, i: usize) -> DVec3 {
        let PathPoint { part, at } = self.points[i];
        if part == frame {
            at
        } else {
            space.between(part, frame).point(at)
        }
    }

    /// Returns the point of the path after a length, in a frame.
    fn at(&self, space: &Space, frame: PartId, length: f64) -> DVec3 {
        let i = self.lengths.partition_point(|&l| l < length).max(1);
        let Some(last) = self.points.len().checked_sub(1) else {
            return DVec3::ZERO;
        };
        if i > last {
            return self.point(space, frame, last);
        }
        let leg = self.lengths[i] - self.lengths[i - 1];
        let back = (self.lengths[i] - length) / leg.max(1e-12);
        let [a, b] = [i - 1, i].map(|i| self.point(space, frame, i));
        b.lerp(a, back.clamp(0.0, 1.0))
    }
}

/// Returns the length in plan between two points of a path.
fn in_plan(space: &Space, ends: &[PathPoint]) -> f64 {
    let [a, b] = [ends[0], ends[1]];
    let way = space.between(b.part, a.part).point(b.at) - a.at;
    way.with_y(0.0).length()
}
