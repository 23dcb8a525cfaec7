//! Queries of the triangles on a body's way: first impact, contacts, candidates.
//!
//! The flood (`flood.rs`) finds them, the kernel (`kernel.rs`) tests each: O(candidates), and casts shorten the flood at each
//! impact. [`ALONG`] decides nearly tangential cases.

use enfilade_cpg::CellId;
use enfilade_geom::{DVec3, Triangle};
use enfilade_runtime::{DetailId, SightState, Target};

use super::body::Body;
use super::flood::{BodyFlood, CastCounts, Moving, Question};
use super::kernel::{depth, point_of_contact, sweep};
use super::walls::Contacts;

/// A body that approaches slower than this fraction of its motion slides along instead of hitting.
const ALONG: f64 = 1e-9;

/// A straight motion of a body, without rotation.
#[derive(Clone, Copy, Debug)]
pub struct Cast<'a> {
    /// Its shape.
    pub body: &'a Body,
    /// Initial position of its center. [Units: wu]
    pub from: DVec3,
    /// Displacement. [Units: wu]
    pub by: DVec3,
    /// The cell of its center; in solid matter, the last one that it was in.
    pub cell: CellId,
}

/// First impact of a moving body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// Time, as a fraction of the motion, 0 to 1.
    pub t: f64,
    /// Unit normal, from the target to the body.
    pub normal: DVec3,
    /// Position. For a box that hits with a face or an edge, the middle of the contact area. [Units: wu]
    pub point: DVec3,
    /// The target.
    pub target: Target,
    /// The cell through which it was hit.
    pub cell: CellId,
}

/// Contact of a resting body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Unit vector of the shortest way out.
    pub normal: DVec3,
    /// Penetration depth along it. [Units: wu]
    pub depth: f64,
    /// Position. [Units: wu]
    pub point: DVec3,
    /// The target.
    pub target: Target,
    /// The cell through which it was found.
    pub cell: CellId,
}

/// Queries contacts of bodies. Holds the buffers of the flood; use one per thread.
///
/// Allocates nothing once the buffers have grown.
///
/// ```
/// use enfilade_cpg::PortalId;
/// use enfilade_geom::DVec3;
/// use enfilade_runtime::{Sight, SightState, Target};
/// use enfilade_testkit::{GridParams, room_grid};
/// use enfilade_world::{Body, Cast, Caster, Contacts, Layout};
///
/// let world = room_grid(&GridParams::two_rooms());
/// let sight = Sight::build(&world)?;
/// let mut state = SightState::new(&sight);
/// let layout = Layout::new(&world);
/// let contacts = Contacts::new(&world, &sight, &layout);
/// let mut caster = Caster::new(&contacts);
///
/// // A ball in front of the doorway rolls through.
/// let body = Body::Sphere { radius: 0.25 };
/// let from = layout.opening(PortalId(0)).center() - DVec3::X;
/// let cell = layout.locate(from).expect("a room");
/// let cast = Cast { body: &body, from, by: DVec3::X * 2.0, cell };
/// assert_eq!(caster.cast(&contacts, &state, &cast), None);
/// assert_eq!(caster.cells().len(), 2);
///
/// // Unless it is shut.
/// state.close(PortalId(0));
/// let impact = caster.cast(&contacts, &state, &cast).expect("a panel");
/// assert_eq!(impact.target, Target::Portal(PortalId(0)));
/// assert!((impact.t - 0.375).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Caster {
    flood: BodyFlood,
}

impl Caster {
    /// Makes a caster for one world.
    #[must_use]
    pub fn new(contacts: &Contacts) -> Self {
        Self {
            flood: BodyFlood::new(contacts),
        }
    }

    /// Returns the first impact of a moving body: on walls, seals, objects, leaves of doors where `state` puts them, and
    /// openings that `state` shuts.
    ///
    /// Never misses a triangle of a cell that the body reaches by openings, nor stops at one behind a wall that it does not
    /// pass. A triangle touched at the start stops the body unless it moves away or along. Keep a gap, such as a millimeter, to a
    /// surface to slide along, or the seams of a floor stop the body. A body that does not move, or is not finite, hits nothing.
    /// Takes a microsecond or less in rooms.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn cast(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        cast: &Cast<'_>,
    ) -> Option<Impact> {
        self.cast_where(contacts, state, cast, |_| true)
    }

    /// As [`Caster::cast`], ignoring objects for which `counts` returns `false`, such as carried ones or curtains.
    ///
    /// # Panics
    ///
    /// As [`Caster::cast`].
    pub fn cast_where(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        cast: &Cast<'_>,
        counts: impl FnMut(DetailId) -> bool,
    ) -> Option<Impact> {
        let moving = Moving::new(contacts, cast.body, cast.from, cast.by)?;
        let slowest = -ALONG * cast.by.length();
        let mut best: Option<Impact> = None;
        let by = cast.by;
        let question = Question::new(contacts, state, &moving);
        self.flood.run(&question, cast.cell, counts, |it, t_max| {
            let touch = sweep(&moving.core, by, *t_max, it.corners);
            let Some(touch) = touch.filter(|touch| touch.normal.dot(by) < slowest) else {
                return;
            };
            let t = it.since + touch.t;
            if best.is_some_and(|b| t >= b.t) {
                return;
            }
            *t_max = touch.t;
            let passed = by * touch.t;
            let corners = it.corners.map(|p| p - passed);
            best = Some(Impact {
                t,
                normal: touch.normal,
                point: cast.from + by * t + point_of_contact(&moving.core, &corners),
                target: it.target,
                cell: it.cell,
            });
        });
        best
    }

    /// Calls `visit` for all contacts of a resting body, in arbitrary order; a triangle that two cells see is reported for each
    /// that the body reaches. Nothing for a body that is not finite.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn for_each_contact(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        body: &Body,
        at: DVec3,
        cell: CellId,
        mut visit: impl FnMut(&Contact),
    ) {
        let Some(resting) = Moving::new(contacts, body, at, DVec3::ZERO) else {
            return;
        };
        let question = Question::new(contacts, state, &resting);
        self.flood.run(
            &question,
            cell,
            |_| true,
            |it, _| {
                let Some(found) = depth(&resting.core, it.corners) else {
                    return;
                };
                visit(&Contact {
                    normal: found.normal,
                    depth: found.depth,
                    point: at + point_of_contact(&resting.core, it.corners),
                    target: it.target,
                    cell: it.cell,
                });
            },
        );
    }

    /// Calls `visit` for the triangles that a resting body may touch, for use with another narrow phase: all those of reached
    /// cells whose boxes meet the body's bounding box.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn for_each_candidate(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        body: &Body,
        at: DVec3,
        cell: CellId,
        mut visit: impl FnMut(Target, &Triangle),
    ) {
        if let Some(resting) = Moving::new(contacts, body, at, DVec3::ZERO) {
            let all = |_: DetailId| true;
            let question = Question::new(contacts, state, &resting);
            self.flood.run(&question, cell, all, |it, _| {
                visit(it.target, &it.corners.map(|p| p + at));
            });
        }
    }

    /// Returns the cells that the body of the last query reached, before its impact if there was one; its own first.
    #[must_use]
    pub fn cells(&self) -> &[CellId] {
        self.flood.cells()
    }

    /// Returns the cost of the last query.
    #[must_use]
    pub fn counts(&self) -> CastCounts {
        self.flood.counts()
    }
}
