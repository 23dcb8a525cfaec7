//! First hit on a segment: a wall, a detail object, or a portal that is shut there.
//!
//! Exact up to the rounding of `f64`: no box and no tolerance decides. A portal is shut where it is closed, or beyond a plane
//! that narrows it ([`SightState::narrow`]).

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::{DVec3, Ray, Triangle};

use crate::point::point;
use crate::seen::DetailId;
use crate::sightline::Sightlines;
use crate::state::SightState;

/// Distance in front of a picked surface at which its cell is located. [Units: wu]
///
/// Larger than any rounding of a wall, and smaller than the thickness of any leaf.
const BEFORE: f64 = 1e-3;

/// The first thing that a segment meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// A structural triangle, or one of a seal.
    Wall {
        /// Index into `World::batches`.
        batch: u32,
        /// Index of the triangle in its batch.
        triangle: u32,
    },
    /// A triangle of a detail object.
    Detail {
        /// The object.
        detail: DetailId,
        /// Index of the primitive in its mesh.
        primitive: u32,
        /// Index of the triangle in its primitive.
        triangle: u32,
    },
    /// A portal that is closed, or narrowed so that it is shut there.
    Portal(PortalId),
}

impl Target {
    /// Returns the input object that was hit, as an index into `World::sources`, for its name and `extras`. `None` for seals,
    /// portals, and objects that the world does not name. O(objects of the batch).
    ///
    /// # Panics
    ///
    /// If the target is not of this world.
    #[must_use]
    pub fn source(&self, world: &World) -> Option<u32> {
        match *self {
            Self::Wall { batch, triangle } => world.batches[batch as usize].sources.of(triangle),
            Self::Detail { detail, .. } => world.details[detail.0 as usize].source,
            Self::Portal(_) => None,
        }
    }
}

/// The end of a picked segment, and the target there.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Hit {
    /// Parameter along the segment, 0 to 1.
    pub t: f64,
    /// Position. [Units: wu]
    pub position: [f32; 3],
    /// Unit normal of the target, on the side of the segment's start.
    pub normal: [f32; 3],
    /// True if the segment hit the front of a triangle, from which its vertices run counter-clockwise; for a portal, if it
    /// came from the portal's second cell.
    pub front: bool,
    /// The target.
    pub target: Target,
    /// The cell from which the segment hit; `None` in solid matter.
    pub cell: Option<CellId>,
}

/// Error: an end of a segment is not finite.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the segment from {from:?} to {to:?} has a coordinate that is not finite")]
pub struct NotFinite {
    /// Start of the segment.
    pub from: [f32; 3],
    /// End of the segment.
    pub to: [f32; 3],
}

impl Sightlines {
    /// Returns the first hit on the closed segment from `a` to `b`, if any: for picking, bullets, hands. [Units: wu]
    ///
    /// Tests walls and seals, all detail objects, leaves of doors where `state` puts them, and portals that `state` shuts where
    /// the segment crosses them. Locked cells stop nothing. Descends three trees, in about a microsecond; allocates nothing.
    ///
    /// # Errors
    ///
    /// If a coordinate is not finite.
    pub fn pick(
        &self,
        state: &SightState,
        a: [f32; 3],
        b: [f32; 3],
    ) -> Result<Option<Hit>, NotFinite> {
        self.pick_where(state, a, b, |_| true)
    }

    /// As [`Sightlines::pick`], but ignores detail objects for which `counts` returns `false`, such as glass or removed objects.
    ///
    /// # Errors
    ///
    /// If a coordinate is not finite.
    pub fn pick_where(
        &self,
        state: &SightState,
        a: [f32; 3],
        b: [f32; 3],
        counts: impl FnMut(DetailId) -> bool,
    ) -> Result<Option<Hit>, NotFinite> {
        if !is_finite(a, b) {
            return Err(NotFinite { from: a, to: b });
        }
        let mut ray = Ray::segment(point(a), point(b));
        if ray.direction == DVec3::ZERO {
            return Ok(None);
        }
        let mut first = None;
        if let Some(hit) = self.whole.closest_hit(&ray, |_| false) {
            let (batch, triangle) = self.source[hit.triangle as usize];
            let corners = &self.triangles[hit.triangle as usize];
            let target = Target::Wall { batch, triangle };
            first = Some(self.hit(&ray, hit.t, corners, hit.front, target));
            ray.t_max = hit.t;
        }
        // At equal distance, a portal or an object lies on the wall and wins.
        let object = self.details.first_hit(state, &ray, counts);
        if let Some(hit) = &object {
            let target = Target::Detail {
                detail: hit.detail,
                primitive: hit.primitive,
                triangle: hit.triangle,
            };
            first = Some(self.hit(&ray, hit.t, &hit.corners, hit.front, target));
            ray.t_max = hit.t;
        }
        // A leaf that shuts the portal is hit itself, instead of the portal's plane in front of it.
        let is_own_leaf = |portal| {
            let leaf = object.as_ref().map(|hit| hit.detail);
            leaf.is_some_and(|l| state.is_leaf_of(l, portal))
        };
        if let Some((t, opening, front)) = self.first_shut(state, &ray)
            && !is_own_leaf(PortalId(self.openings[opening as usize].portal))
        {
            let opening = &self.openings[opening as usize];
            let target = Target::Portal(PortalId(opening.portal));
            first = Some(self.hit(&ray, t, &opening.corners, front, target));
        }
        Ok(first)
    }

    /// Returns `true` if the closed segment from `a` to `b` meets no wall, no seal, and no portal that `state` shuts where it is
    /// crossed; `false` if a coordinate is not finite. Ignores details: for those, use [`Sightlines::pick`].
    #[must_use]
    pub fn is_clear(&self, state: &SightState, a: [f32; 3], b: [f32; 3]) -> bool {
        if !is_finite(a, b) {
            return false;
        }
        let (from, to) = (point(a), point(b));
        from == to
            || !self.whole.any_hit(from, to, |_| false)
                && self.first_shut(state, &Ray::segment(from, to)).is_none()
    }

    /// Returns the first opening that is shut where the ray crosses it: `t`, its index, and `true` if its front was hit.
    fn first_shut(&self, state: &SightState, ray: &Ray) -> Option<(f64, u32, bool)> {
        let mut best: Option<(f64, u32, bool)> = None;
        self.shut.for_each_hit(ray, |hit| {
            let portal = PortalId(self.openings[hit.triangle as usize].portal);
            let is_nearer = best.is_none_or(|(t, i, _)| (hit.t, hit.triangle) < (t, i));
            if is_nearer && state.is_shut_at(portal, ray.at(hit.t)) {
                best = Some((hit.t, hit.triangle, hit.front));
            }
        });
        best
    }

    fn hit(&self, ray: &Ray, t: f64, corners: &Triangle, front: bool, target: Target) -> Hit {
        let p = ray.at(t);
        let length = ray.direction.length();
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let normal = normal.normalize_or_zero();
        let back = (t - BEFORE / length).max(0.0);
        Hit {
            t,
            position: p.as_vec3().to_array(),
            normal: if normal.dot(ray.direction) > 0.0 {
                -normal
            } else {
                normal
            }
            .as_vec3()
            .to_array(),
            front,
            target,
            cell: self.locator.locate(ray.at(back)),
        }
    }
}

fn is_finite(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().chain(&b).all(|x| x.is_finite())
}
