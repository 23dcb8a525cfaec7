//! Rays that go on through special portals: for picking what a mirror shows, and lines of sight.
//!
//! A ray passes special portals as [`Space::follow`] does a step, and mirrors and one-way sides besides. Between two of them, whoever
//! asks finds the first surface. **Which way it errs:** where a surface and a special portal lie within rounding of each other, the
//! special portal counts as before it, as it does in pictures.

use enfilade_cpg::{SpecialId, Way};
use enfilade_geom::{Aabb, DVec3, Similarity};
use enfilade_runtime::{Hit, NotFinite};

use super::{PartId, Space};

/// Share of its distance by which a special portal counts as nearer than a surface, as it does in pictures.
const LIFT: f64 = 2e-5;

/// Tolerances of the layout by which a special portal counts as nearer than a surface, and within which the surface around the next
/// one is left out.
const IN_PLANE: f64 = 4.0;

/// A segment of sight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SightRay {
    /// The part in whose frame it begins.
    pub frame: PartId,
    /// Its start. [Units: wu]
    pub from: DVec3,
    /// Its direction and length, if nothing stops it. [Units: wu]
    pub by: DVec3,
    /// Most special portals that it passes.
    pub most: usize,
}

impl SightRay {
    /// The usual bound on the special portals that a ray passes: two mirrors that face each other show each other forever.
    pub const USUAL_MOST: usize = 16;

    /// Makes a ray with the usual bound.
    #[must_use]
    pub fn new(frame: PartId, from: DVec3, by: DVec3) -> Self {
        let most = Self::USUAL_MOST;
        Self {
            frame,
            from,
            by,
            most,
        }
    }
}

/// The end of a ray, and its way there.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Traced<H> {
    /// The reason why it ends.
    pub end: TraceEnd<H>,
    /// The part in whose frame the end is: that of the last special portal passed, otherwise that of the ray.
    pub frame: PartId,
    /// The start of the last stretch, beyond the plane of the last special portal. [Units: wu]
    pub since: DVec3,
    /// The end. [Units: wu]
    pub at: DVec3,
    /// The map from the frame of the ray to that of the end. Its inverse moves what is hit to where it seems to be.
    pub map: Similarity,
    /// Distance from the start at which the end seems to be: in the units of the start, whatever the scales on the way. [Units: wu]
    pub length: f64,
    /// Number of special portals passed.
    pub n_passed: usize,
}

/// The reason why a ray ends.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum TraceEnd<H> {
    /// It meets a surface.
    Surface(H),
    /// It meets a monitor, which shows the picture of a camera elsewhere.
    Monitor(PartId, SpecialId),
    /// It meets one special portal more than it may pass.
    Capped(PartId, SpecialId),
    /// It meets nothing along its whole length.
    Open,
}

impl<H> Traced<H> {
    /// Returns the surface, if the ray ends at one.
    pub fn surface(&self) -> Option<&H> {
        match &self.end {
            TraceEnd::Surface(hit) => Some(hit),
            _ => None,
        }
    }

    /// Returns the end as it seems from the start: straight ahead. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn seems_at(&self) -> DVec3 {
        self.map.point_back(self.at)
    }
}

impl Space {
    /// Follows a ray through special portals to the first surface: it is reflected by mirrors, moved by links, goes on through panes,
    /// and ends at monitors. A shut doorway has no sides.
    ///
    /// The ray takes the pass that is seen most: the last that covers at least half of those before it. `surfaces`
    /// returns the first surface on a segment in the frame of a part, and the share of the segment before it; it may be asked once
    /// for each special portal passed and once more. Those passed are written to `passed`, in order. A ray that is not finite
    /// meets nothing.
    pub fn trace<H>(
        &self,
        ray: &SightRay,
        passed: &mut Vec<(PartId, SpecialId)>,
        mut surfaces: impl FnMut(PartId, DVec3, DVec3) -> Option<(f64, H)>,
    ) -> Traced<H> {
        passed.clear();
        let mut traced = Traced {
            end: TraceEnd::Open,
            frame: ray.frame,
            since: ray.from,
            at: ray.from,
            map: Similarity::IDENTITY,
            length: 0.0,
            n_passed: 0,
        };
        let whole_length = ray.by.length();
        let (mut left, mut share_left, mut skipped) = (ray.by, 1.0, 0.0);
        if !(ray.from.is_finite() && ray.by.is_finite()) {
            return traced;
        }
        loop {
            let crossed = self.first_crossing(traced.frame, traced.at, left, |part, special| {
                self.shown_pass(part, special).is_some()
            });
            traced.since = traced.at + left * skipped;
            let met = if skipped < 1.0 {
                surfaces(traced.frame, traced.since, traced.at + left)
            } else {
                None
            };
            let met = met.map(|(t, hit)| (skipped + t * (1.0 - skipped), hit));
            let (t, end) = match (crossed, met) {
                (None, None) => (1.0, TraceEnd::Open),
                (None, Some((t, hit))) => (t, TraceEnd::Surface(hit)),
                (Some((t, part, special)), met) => {
                    let slack = self.slack(traced.frame, part, special, left, t);
                    match met {
                        Some((before, hit)) if before < t - slack => {
                            (before, TraceEnd::Surface(hit))
                        }
                        _ if passed.len() == ray.most => (t, TraceEnd::Capped(part, special)),
                        _ => (t, TraceEnd::Monitor(part, special)),
                    }
                }
            };
            traced.at += left * t;
            traced.length += whole_length * share_left * t;
            let (part, special) = match end {
                TraceEnd::Monitor(part, special) => (part, special),
                end => {
                    traced.end = end;
                    return traced;
                }
            };
            let Some(map) = self.map_shown(part, special) else {
                traced.end = end;
                return traced;
            };
            left *= 1.0 - t;
            share_left *= 1.0 - t;
            let whole = map.after(&self.between(traced.frame, part).into());
            traced.at = whole.point(traced.at);
            left = whole.vector(left);
            traced.map = whole.after(&traced.map);
            traced.frame = part;
            passed.push((part, special));
            traced.n_passed = passed.len();
            skipped = self.start_beyond(part, special, &map, left);
        }
    }

    /// Follows a ray, and picks what it meets in any part, as [`Sightlines::pick`](enfilade_runtime::Sightlines::pick) does. The hit
    /// is in the frame of its part, its `t` a share of the last stretch.
    ///
    /// # Errors
    ///
    /// If a coordinate is not finite.
    pub fn pick(
        &self,
        ray: &SightRay,
        passed: &mut Vec<(PartId, SpecialId)>,
    ) -> Result<Traced<(PartId, Hit)>, NotFinite> {
        let ends = [ray.from, ray.from + ray.by].map(|p| p.as_vec3().to_array());
        if !ends.as_flattened().iter().all(|x| x.is_finite()) {
            let [from, to] = ends;
            return Err(NotFinite { from, to });
        }
        Ok(self.trace(ray, passed, |frame, from, to| {
            let hits = self.parts_along(frame, [from, to]).filter_map(|id| {
                let [from, to] = self.ends_in(id, frame, [from, to]);
                let hit = self.sightlines(id).pick(self.state(id), from, to).ok()??;
                Some((hit.t, (id, hit)))
            });
            hits.min_by(|a, b| a.0.total_cmp(&b.0))
        }))
    }

    /// Returns the share of a segment, in the frame of a part, before the first wall of any part, if there is one. As
    /// [`Sightlines::first_hit`](enfilade_runtime::Sightlines::first_hit), without objects.
    #[must_use]
    pub fn first_wall(&self, frame: PartId, ends: [DVec3; 2]) -> Option<f64> {
        let hits = self.parts_along(frame, ends).filter_map(|id| {
            let [from, to] = self.ends_in(id, frame, ends);
            Some(self.sightlines(id).first_hit(from, to)?.t)
        });
        hits.min_by(f64::total_cmp)
    }

    /// Returns the parts whose boxes a segment, in the frame of a part, meets, and the root, which comes first.
    #[doc(hidden)]
    pub fn parts_along(
        &self,
        frame: PartId,
        ends: [DVec3; 2],
    ) -> impl Iterator<Item = PartId> + use<'_> {
        let pose = self.pose(frame);
        let [from, to] = ends.map(|p| pose.point(p));
        let others = (1..self.parts.len() as u32).map(PartId);
        let met = others.filter(move |id| {
            let bounds = self.neighbors.bounds(id.0);
            !bounds.is_empty() && meets(bounds, from, to)
        });
        std::iter::once(PartId::ROOT).chain(met)
    }

    fn ends_in(&self, part: PartId, frame: PartId, ends: [DVec3; 2]) -> [[f32; 3]; 2] {
        let map = self.between(frame, part);
        ends.map(|p| map.point(p).as_vec3().to_array())
    }

    /// Returns the pass of a special portal that a ray takes; `None` for one through which it goes on straight.
    fn shown_pass(&self, part: PartId, special: SpecialId) -> Option<usize> {
        let side = &self.parts[part.idx()].world.graph.specials[special.idx()];
        let most =
            (side.passes.iter().enumerate()).rfind(|(i, pass)| *i == 0 || pass.tint[3] >= 0.5);
        most.filter(|(_, pass)| pass.way != Way::Through)
            .map(|(i, _)| i)
    }

    fn map_shown(&self, part: PartId, special: SpecialId) -> Option<Similarity> {
        let pass = self.shown_pass(part, special)?;
        let layout = &self.parts[part.idx()].layout;
        layout.map_of_pass(special, pass).copied()
    }

    /// Returns the share of a segment by which a special portal that it crosses at `t` counts as nearer.
    fn slack(&self, frame: PartId, part: PartId, special: SpecialId, by: DVec3, t: f64) -> f64 {
        let layout = &self.parts[part.idx()].layout;
        let by = self.between(frame, part).direction(by);
        let climb = layout.special_opening(special).normal().dot(by).abs();
        t * LIFT + IN_PLANE * layout.tolerance() / climb
    }

    /// Returns the share of the rest of a ray within which it is in the plane of the special portal out of which it comes.
    fn start_beyond(&self, part: PartId, special: SpecialId, map: &Similarity, left: DVec3) -> f64 {
        let layout = &self.parts[part.idx()].layout;
        let normal = map.direction(layout.special_opening(special).normal());
        let share = IN_PLANE * layout.tolerance() / normal.dot(left).abs();
        share.min(1.0)
    }
}

/// Returns `true` if a segment meets a box.
fn meets(bounds: &Aabb, from: DVec3, to: DVec3) -> bool {
    let by = to - from;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for k in 0..3 {
        if by[k] == 0.0 {
            if from[k] < bounds.min[k] || from[k] > bounds.max[k] {
                return false;
            }
            continue;
        }
        let [a, b] = [bounds.min[k], bounds.max[k]].map(|x| (x - from[k]) / by[k]);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    enter <= leave
}
