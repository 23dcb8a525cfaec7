//! Queries of the triangles on a body's way: first impact, contacts, candidates.
//!
//! The flood (`flood.rs`) finds them, the kernel (`kernel.rs`) tests each: O(candidates), and casts shorten the flood at each
//! impact. [`ALONG`] decides nearly tangential cases.

use enfilade_geom::{DVec3, Similarity, Triangle};
use enfilade_runtime::{DetailId, Target};

use super::body::Body;
use super::flood::{BodyFlood, CastCounts};
use super::kernel::{depth, point_of_contact, sweep};
use super::moving::Motion;
use crate::space::{PartId, Place, Space};

/// A body that approaches slower than this fraction of its motion slides along instead of hitting.
const ALONG: f64 = 1e-9;

/// A straight motion of a body, without rotation.
#[derive(Clone, Copy, Debug)]
pub struct Cast<'a> {
    /// Its shape.
    pub body: &'a Body,
    /// The part in whose frame it is given.
    pub frame: PartId,
    /// Initial position of its center. [Units: wu]
    pub from: DVec3,
    /// Displacement. [Units: wu]
    pub by: DVec3,
    /// The place of its center; in solid matter, the last one that it was in.
    pub place: Place,
}

/// First impact of a moving body, in the frame of its cast.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Impact {
    /// Time, as a fraction of the motion, 0 to 1.
    pub t: f64,
    /// Unit normal, from the target to the body.
    pub normal: DVec3,
    /// Position. For a box that hits with a face or an edge, the middle of the contact area. [Units: wu]
    pub point: DVec3,
    /// The target, in the part of `place`.
    pub target: Target,
    /// The place through which it was hit.
    pub place: Place,
    /// Map from the frame of the cast to that of the place's part, through the special portals passed before.
    pub map: Similarity,
}

/// Contact of a resting body, in the frame of the query.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Contact {
    /// Unit vector of the shortest way out.
    pub normal: DVec3,
    /// Penetration depth along it. [Units: wu]
    pub depth: f64,
    /// Position. [Units: wu]
    pub point: DVec3,
    /// The target, in the part of `place`.
    pub target: Target,
    /// The place through which it was found.
    pub place: Place,
    /// Map from the frame of the query to that of the place's part, through the special portals that the body stands in.
    pub map: Similarity,
}

/// Queries contacts of bodies. Holds the buffers of the flood; use one per thread.
///
/// Allocates nothing once the buffers have grown.
///
/// ```
/// use enfilade_cpg::PortalId;
/// use enfilade_geom::DVec3;
/// use enfilade_runtime::Target;
/// use enfilade_testkit::{GridParams, room_grid};
/// use enfilade_world::{Body, Cast, Caster, PartId, Space};
///
/// let mut space = Space::new(room_grid(&GridParams::two_rooms()))?;
/// let mut caster = Caster::new();
///
/// // A ball in front of the doorway rolls through.
/// let body = Body::Sphere { radius: 0.25 };
/// let from = space.layout(PartId::ROOT).opening(PortalId(0)).center() - DVec3::X;
/// let place = space.locate(PartId::ROOT, from).expect("a room");
/// let frame = PartId::ROOT;
/// let cast = Cast { body: &body, frame, from, by: DVec3::X * 2.0, place };
/// assert_eq!(caster.cast(&space, &cast), None);
/// assert_eq!(caster.places().len(), 2);
///
/// // Unless it is shut.
/// space.close(PartId::ROOT, PortalId(0));
/// let impact = caster.cast(&space, &cast).expect("a panel");
/// assert_eq!(impact.target, Target::Portal(PortalId(0)));
/// assert!((impact.t - 0.375).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Caster {
    flood: BodyFlood,
}

impl Default for Caster {
    fn default() -> Self {
        Self::new()
    }
}

impl Caster {
    /// Makes a caster without buffers.
    #[must_use]
    pub fn new() -> Self {
        Self {
            flood: BodyFlood::new(),
        }
    }

    /// Returns the first impact of a moving body: on walls, seals, objects, leaves of doors in their current pose, shut openings,
    /// and on all these of the parts that it reaches.
    ///
    /// Never misses a triangle of a cell that the body reaches by openings, nor stops at one behind a wall that it does not
    /// pass. A triangle touched at the start stops the body unless it moves away or along. Keep a gap, such as a millimeter, to a
    /// surface to slide along, or the seams of a floor stop the body. A body that does not move, or is not finite, hits nothing.
    /// Takes a microsecond or less in rooms; the first query in a part prepares its triangles, O(n log n).
    ///
    /// # Panics
    ///
    /// If there is no such place.
    pub fn cast(&mut self, space: &Space, cast: &Cast<'_>) -> Option<Impact> {
        self.cast_where(space, cast, |_, _| true)
    }

    /// As [`Caster::cast`], ignoring objects for which `counts` returns `false`, such as carried ones or curtains.
    ///
    /// # Panics
    ///
    /// As [`Caster::cast`].
    pub fn cast_where(
        &mut self,
        space: &Space,
        cast: &Cast<'_>,
        counts: impl FnMut(PartId, DetailId) -> bool,
    ) -> Option<Impact> {
        let slowest = -ALONG * cast.by.length();
        let motion = Motion {
            space,
            body: cast.body,
            frame: cast.frame,
            from: cast.from,
            by: cast.by,
            place: cast.place,
        };
        let mut best: Option<Impact> = None;
        self.flood.run(&motion, counts, |it, t_max| {
            let (core, by) = (&it.moving.core, it.moving.by);
            let touch = sweep(core, by, *t_max, it.corners);
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
            // Relative to the body, in the frame of the target.
            best = Some(Impact {
                t,
                normal: touch.normal,
                point: point_of_contact(core, &corners),
                target: it.target,
                place: it.place,
                map: it.moving.map,
            });
        });
        best.map(|impact| {
            let back = impact.map.inverse();
            Impact {
                normal: back.direction(impact.normal),
                point: cast.from + cast.by * impact.t + back.vector(impact.point),
                ..impact
            }
        })
    }

    /// Calls `visit` for all contacts of a body that rests at a point of a part's frame, in arbitrary order; a triangle that two cells see is reported for each
    /// that the body reaches. Nothing for a body that is not finite.
    ///
    /// # Panics
    ///
    /// If there is no such place.
    pub fn for_each_contact(
        &mut self,
        space: &Space,
        body: &Body,
        frame: PartId,
        at: DVec3,
        place: Place,
        mut visit: impl FnMut(&Contact),
    ) {
        let motion = Motion::rest(space, body, frame, at, place);
        let all = |_: PartId, _: DetailId| true;
        self.flood.run(&motion, all, |it, _| {
            let core = &it.moving.core;
            let Some(found) = depth(core, it.corners) else {
                return;
            };
            let back = it.moving.map.inverse();
            visit(&Contact {
                normal: back.direction(found.normal),
                depth: found.depth * back.scale.abs(),
                point: at + back.vector(point_of_contact(core, it.corners)),
                target: it.target,
                place: it.place,
                map: it.moving.map,
            });
        });
    }

    /// Calls `visit` for the triangles that a resting body may touch, for use with another narrow phase: all those of reached
    /// cells whose boxes meet the body's bounding box, with the part of each.
    ///
    /// # Panics
    ///
    /// If there is no such place.
    pub fn for_each_candidate(
        &mut self,
        space: &Space,
        body: &Body,
        frame: PartId,
        at: DVec3,
        place: Place,
        mut visit: impl FnMut(PartId, Target, &Triangle),
    ) {
        let motion = Motion::rest(space, body, frame, at, place);
        let all = |_: PartId, _: DetailId| true;
        self.flood.run(&motion, all, |it, _| {
            let back = it.moving.map.inverse();
            let to_own = |v: DVec3| at + back.vector(v);
            visit(it.place.part, it.target, &it.corners.map(to_own));
        });
    }

    /// Returns the places that the body of the last query reached, before its impact if there was one; its own first. The
    /// outdoor cell of a part stands for its outside.
    #[must_use]
    pub fn places(&self) -> &[Place] {
        self.flood.places()
    }

    /// Returns the cost of the last query.
    #[must_use]
    #[doc(hidden)]
    pub fn counts(&self) -> CastCounts {
        self.flood.counts()
    }
}
