//! A walker that follows a path and opens the doors on it.
//!
//! It steers towards the point of the path a little ahead of the nearest one (Coulter, *Implementation of the Pure Pursuit Path
//! Tracking Algorithm*, 1992), and slides along what it touches on the way. Doors open before it comes; a leaf that still
//! stands in its way is shut, if the path does not need it open.

use enfilade_cpg::PortalId;
use enfilade_geom::{DVec3, closest_point_on_segment};
use enfilade_runtime::{DetailId, Sight, SightState, Target};

use crate::bodies::{Contacts, Site, Walker};
use crate::layout::Layout;
use crate::paths::Path;

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
type Around<'a> = (&'a Contacts, &'a Layout);

/// Least progress that counts. [Units: wu]
const PROGRESS: f64 = 0.05;

/// State of a walk along a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
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
/// use enfilade_geom::DVec3;
/// use enfilade_runtime::{Sight, SightState};
/// use enfilade_testkit::{GridParams, room_grid, with_doors};
/// use enfilade_world::{Agent, Contacts, Layout, Path, PathFollower, PathSearch, Progress, WalkMap, Walker};
///
/// let world = with_doors(room_grid(&GridParams::two_rooms()), |_| false);
/// let (sight, layout) = (Sight::build(&world)?, Layout::new(&world));
/// let contacts = Contacts::new(&world, &sight, &layout);
/// let mut state = SightState::new(&sight);
/// let agent = Agent::default();
///
/// // From the middle of one room to that of the other, through a door that is shut.
/// let map = WalkMap::new(&layout, &world, agent);
/// let ends = [0, 1].map(|cell| layout.cell(enfilade_cpg::CellId(cell)).bounds.center());
/// let mut path = Path::default();
/// PathSearch::new().find(&map, &layout, ends, |_| true, &mut path)?;
///
/// let mut walker = Walker::new(&contacts, agent, path.points[0] + DVec3::Y * agent.eye);
/// let mut follower = PathFollower::new(&sight, path, 1.4);
/// let mut progress = Progress::Walking;
/// while progress == Progress::Walking {
///     progress = follower.step(&mut walker, &contacts, &layout, &mut state, 1.0 / 60.0);
/// }
/// assert_eq!(progress, Progress::Arrived);
/// assert_eq!(state.leaves(enfilade_cpg::PortalId(0)), Some(1.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PathFollower {
    points: Vec<DVec3>,
    /// Length of the path up to each of its points, in plan.
    lengths: Vec<f64>,
    doors: Vec<DoorAhead>,
    /// All leaves of the world, each with a portal that it opens.
    leaves: Vec<(DetailId, PortalId)>,
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
    portal: PortalId,
    /// Length of the path after which it is passed.
    at: f64,
    opening: Swing,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Swing {
    Ahead,
    /// Its leaves move.
    Moves,
    Done,
}

impl PathFollower {
    /// Starts at the beginning of a path. [Units: wu/s]
    #[must_use]
    pub fn new(sight: &Sight, path: Path, speed: f64) -> Self {
        let points = path.points;
        let mut lengths = vec![0.0];
        for w in points.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + in_plan(w[0], w[1]));
        }
        let all = (0..sight.n_portals() as u32).map(PortalId);
        let leaves = all.flat_map(|p| sight.leaves(p).iter().map(move |l| (l.detail, p)));
        let mut follower = Self {
            points,
            lengths,
            doors: Vec::new(),
            leaves: leaves.collect(),
            speed,
            passed: 0.0,
            counted: 0.0,
            idle: 0.0,
        };
        let mut from = 0.0;
        for (exit, at) in path.portals.iter().zip(path.passages) {
            from = follower.nearest(at, [from, f64::INFINITY]);
            follower.doors.push(DoorAhead {
                portal: exit.portal,
                at: from,
                opening: Swing::Ahead,
            });
        }
        follower
    }

    /// Returns the length of the path passed, in plan. [Units: wu]
    #[must_use]
    pub fn passed(&self) -> f64 {
        self.passed
    }

    /// Walks on for some seconds, at most a tenth. Moves leaves of doors in `state`: those ahead open, and one that is in the
    /// way shuts if it is not needed.
    ///
    /// # Panics
    ///
    /// If `contacts` and `layout` are not of one world.
    pub fn step(
        &mut self,
        walker: &mut Walker,
        contacts: &Contacts,
        layout: &Layout,
        state: &mut SightState,
        seconds: f64,
    ) -> Progress {
        let feet = walker.feet();
        let agent = *walker.agent();
        self.passed = self.nearest(feet, [self.passed, self.passed + 2.0 * AHEAD]);
        let end = self.points.last().copied().unwrap_or(feet);
        if in_plan(feet, end) <= agent.radius && (feet.y - end.y).abs() <= agent.step {
            return Progress::Arrived;
        }
        self.open_doors(walker, (contacts, layout), state, seconds);
        let way = (self.at(self.passed + AHEAD) - feet).with_y(0.0);
        let speed = self.speed.min(way.length() / seconds.max(1e-9));
        let site = Site {
            contacts,
            layout,
            state,
        };
        // Leaves pass through the walker while they open: where they come to stand, it is not.
        let opens = |detail| {
            let mut moving = self.doors.iter().filter(|d| d.opening == Swing::Moves);
            moving.any(|d| self.is_leaf(detail, d.portal))
        };
        let wish = way.normalize_or_zero() * speed;
        walker.step_where(&site, wish, seconds, |detail| !opens(detail));
        self.idle += seconds;
        if self.passed >= self.counted + PROGRESS {
            (self.counted, self.idle) = (self.passed, 0.0);
        }
        if let Some(Target::Detail { detail, .. }) = walker.obstacle()
            && self.idle > SHUT
        {
            self.shut_leaf(detail, walker, (contacts, layout), state);
        }
        if self.idle > PATIENCE {
            Progress::Stuck
        } else {
            Progress::Walking
        }
    }

    /// Opens the doors ahead a little further, once the walker is clear of where their leaves will stand.
    fn open_doors(
        &mut self,
        walker: &mut Walker,
        site: Around<'_>,
        state: &mut SightState,
        seconds: f64,
    ) {
        for i in 0..self.doors.len() {
            let door = self.doors[i];
            let Some(share) = state.leaves(door.portal) else {
                continue;
            };
            let begins = door.opening == Swing::Ahead
                && (0.0..DOOR).contains(&(door.at - self.passed))
                // One that does not get out of its way is pushed.
                && (self.idle > SHUT || self.is_clear(walker, site, state, (door.portal, 1.0)));
            if begins || door.opening == Swing::Moves {
                let share = share + (seconds / SWING) as f32;
                state.set_leaves(door.portal, share);
                self.doors[i].opening = if share < 1.0 {
                    Swing::Moves
                } else {
                    Swing::Done
                };
            }
        }
    }

    /// Shuts a leaf unless the path needs it open, or the walker is in its doorway.
    fn shut_leaf(
        &self,
        detail: DetailId,
        walker: &mut Walker,
        site: Around<'_>,
        state: &mut SightState,
    ) {
        let mut ahead = self.doors.iter().filter(|d| d.at > self.passed);
        let known = self.leaves.iter().find(|l| l.0 == detail);
        if let Some(&(_, portal)) = known
            && ahead.all(|d| !self.is_leaf(detail, d.portal))
            && self.is_clear(walker, site, state, (portal, 0.0))
        {
            state.set_leaves(portal, 0.0);
        }
    }

    /// Returns `true` if a walker touches no leaf of a portal at a share of their way.
    fn is_clear(
        &self,
        walker: &mut Walker,
        (contacts, layout): Around<'_>,
        state: &mut SightState,
        (portal, share): (PortalId, f32),
    ) -> bool {
        let Some(before) = state.leaves(portal) else {
            return true;
        };
        state.set_leaves(portal, share);
        let site = Site {
            contacts,
            layout,
            state,
        };
        let is_touched = walker.touches(&site, |detail| self.is_leaf(detail, portal));
        state.set_leaves(portal, before);
        !is_touched
    }

    fn is_leaf(&self, detail: DetailId, portal: PortalId) -> bool {
        self.leaves.contains(&(detail, portal))
    }

    /// Returns the length of the path, within a range, after which it is nearest to a point in space.
    fn nearest(&self, p: DVec3, [from, until]: [f64; 2]) -> f64 {
        let (mut least, mut nearest) = (f64::INFINITY, from);
        let first = self.lengths.partition_point(|&l| l < from).max(1) - 1;
        for i in first..self.points.len().saturating_sub(1) {
            let [low, high] = [from.max(self.lengths[i]), until.min(self.lengths[i + 1])];
            if low > high {
                break;
            }
            let [a, b] = [low, high].map(|l| self.at(l));
            let q = closest_point_on_segment(p, a, b);
            if q.distance_squared(p) < least {
                (least, nearest) = (q.distance_squared(p), low + in_plan(a, q));
            }
        }
        nearest
    }

    /// Returns the point of the path after a length.
    fn at(&self, length: f64) -> DVec3 {
        let i = self.lengths.partition_point(|&l| l < length).max(1);
        let Some(&b) = self.points.get(i) else {
            return self.points.last().copied().unwrap_or_default();
        };
        let leg = self.lengths[i] - self.lengths[i - 1];
        let back = (self.lengths[i] - length) / leg.max(1e-12);
        b.lerp(self.points[i - 1], back.clamp(0.0, 1.0))
    }
}

fn in_plan(a: DVec3, b: DVec3) -> f64 {
    (a - b).with_y(0.0).length()
}
