//! What is asked of the triangles on a body's way: what it meets first, what it touches, which may matter.
//!
//! The flood (`flood.rs`) finds them, the kernel (`kernel.rs`) tries each: O(candidates), and casts shorten the flood as they meet
//! something. What is nearly tangential is told by [`ALONG`].

use enfilade_cpg::CellId;
use enfilade_geom::{DVec3, Triangle};
use enfilade_runtime::{DetailId, SightState, Target};

use super::body::Body;
use super::flood::{BodyFlood, CastCounts, Moving, Question};
use super::kernel::{depth, point_of_contact, sweep};
use super::walls::Contacts;

/// What approaches slower than this share of its motion goes no deeper: it passes along.
const ALONG: f64 = 1e-9;

/// A body that moves straight, without turning.
#[derive(Clone, Copy, Debug)]
pub struct Cast<'a> {
    /// Its shape.
    pub body: &'a Body,
    /// Where its center is. [Units: wu]
    pub from: DVec3,
    /// How far it moves. [Units: wu]
    pub by: DVec3,
    /// The cell of its center; where that is matter, the last one that it was in.
    pub cell: CellId,
}

/// What a moving body meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// When, as a share of the motion, 0 to 1.
    pub t: f64,
    /// Of unit length, from what was met to the body.
    pub normal: DVec3,
    /// Where. Of a box that meets with a face or an edge, the middle of what touches. [Units: wu]
    pub point: DVec3,
    /// What was met.
    pub target: Target,
    /// The cell through which it was met.
    pub cell: CellId,
}

/// Something that a resting body touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Of unit length: the shortest way out.
    pub normal: DVec3,
    /// How far that way. [Units: wu]
    pub depth: f64,
    /// Where. [Units: wu]
    pub point: DVec3,
    /// What is touched.
    pub target: Target,
    /// The cell through which it was met.
    pub cell: CellId,
}

/// Asks what bodies touch. Holds the buffers of the flood; one a thread.
///
/// Nothing is allocated once the buffers have grown.
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
/// // A ball before the doorway rolls through.
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
    /// For one world.
    #[must_use]
    pub fn new(contacts: &Contacts) -> Self {
        Self {
            flood: BodyFlood::new(contacts),
        }
    }

    /// What a moving body meets first: walls, seals, objects, leaves of doors as `state` has them, openings that it shuts.
    ///
    /// Never misses a triangle of a cell that the body reaches by openings, nor stops at one behind a wall that it does not
    /// pass: what it touches at its start stops it unless it moves away, or along. Keep a gap, a millimeter say, to
    /// what is slid along, or the seams of a floor stop the body. A body that does not move meets nothing, nor does one whose
    /// numbers are not finite. A microsecond or less in rooms.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    pub fn cast(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        cast: &Cast<'_>,
    ) -> Option<Impact> {
        self.cast_where(contacts, state, cast, |_| true)
    }

    /// The same, passing by objects for which `counts` is false: what the body carries, curtains.
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

    /// Calls `visit` with all that a resting body touches, in no order that means anything; what two cells see is told for each
    /// that the body reaches. Nothing for a body whose numbers are not finite.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
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

    /// Calls `visit` with the triangles that a resting body may touch, for whoever has a narrow phase of his own: all those of
    /// reached cells whose boxes the box around the body touches.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
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

    /// The cells that the body of the last question reached, before its impact if there was one; its own first.
    #[must_use]
    pub fn cells(&self) -> &[CellId] {
        self.flood.cells()
    }

    /// What the last question cost.
    #[must_use]
    pub fn counts(&self) -> CastCounts {
        self.flood.counts()
    }
}
