//! Following a point through special portals.
//!
//! A straight step is cut where it passes a special portal that leads somewhere: the rest is mapped to the other side, and
//! continues there (Dirkse 2002, section 6.1.5, left this open). A point passes when it goes from the front of the plane to the
//! back; one that ends on the plane has not. The mapped rest begins on the plane of the other side and leads away from it, so
//! rounding cannot send it back. Each passage costs O(special portals of the part).

use enfilade_cpg::SpecialId;
use enfilade_geom::{DVec3, Similarity};

use super::{PartId, Place, Space};

/// Passages of one step after which the rest of it is dropped: a step that long between facing portals does not end.
const MAX_PASSED: u32 = 64;

/// A step through special portals.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Followed {
    /// The part in whose frame the end is: that of the last special portal passed, otherwise that of the step.
    pub frame: PartId,
    /// The end. [Units: wu]
    pub at: DVec3,
    /// The place of the end; `None` in solid matter.
    pub place: Option<Place>,
    /// The map from the frame of the step to that of the end, special portals included: for what moves along, and its speed,
    /// direction and size.
    pub map: Similarity,
    /// Number of special portals passed.
    pub n_passed: u32,
    /// The last of them.
    pub last: Option<(PartId, SpecialId)>,
    /// True if the step passes more than 64, and ends at the last.
    pub is_capped: bool,
}

impl Space {
    /// Follows a point that moves straight `by` a displacement in the frame of a part, through whatever special portals it
    /// passes. Walls do not stop it: cast first. [Units: wu]
    #[must_use]
    pub fn follow(&self, frame: PartId, from: DVec3, by: DVec3) -> Followed {
        let mut step = Followed {
            frame,
            at: from,
            place: None,
            map: Similarity::IDENTITY,
            n_passed: 0,
            last: None,
            is_capped: false,
        };
        let mut left = by;
        let is_way = |part: PartId, special| {
            let layout = &self.parts[part.idx()].layout;
            layout.passage(special).is_some()
        };
        while let Some((t, part, special)) = self.first_crossing(step.frame, step.at, left, is_way)
        {
            if step.n_passed == MAX_PASSED {
                step.is_capped = true;
                left = DVec3::ZERO;
                break;
            }
            let Some((_, map)) = self.parts[part.idx()].layout.passage(special) else {
                break;
            };
            let whole = map.after(&self.between(step.frame, part).into());
            step.at = whole.point(step.at + left * t);
            left = whole.vector(left * (1.0 - t));
            step.map = whole.after(&step.map);
            step.frame = part;
            step.n_passed += 1;
            step.last = Some((part, special));
        }
        step.at += left;
        step.place = self.locate(step.frame, step.at);
        step
    }

    /// Returns the first open special portal, of those that count, that a step passes: the share of the step before it.
    pub(super) fn first_crossing(
        &self,
        frame: PartId,
        from: DVec3,
        by: DVec3,
        counts: impl Fn(PartId, SpecialId) -> bool,
    ) -> Option<(f64, PartId, SpecialId)> {
        let mut first: Option<(f64, PartId, SpecialId)> = None;
        for (id, part) in (0..).map(PartId).zip(&self.parts) {
            let n = part.layout.n_specials();
            if n == 0 || !part.is_present {
                continue;
            }
            let (a, b) = if id == frame {
                (from, from + by)
            } else {
                let map = self.between(frame, id);
                (map.point(from), map.point(from + by))
            };
            for special in (0..n as u32).map(SpecialId) {
                if !counts(id, special) {
                    continue;
                }
                let crossed = self.crossing(id, special, [a, b]);
                if let Some(t) = crossed.filter(|t| first.is_none_or(|f| *t < f.0)) {
                    first = Some((t, id, special));
                }
            }
        }
        first
    }

    /// Returns the share of a segment, in the frame of a part, before it passes a special portal.
    fn crossing(&self, part: PartId, special: SpecialId, [a, b]: [DVec3; 2]) -> Option<f64> {
        let own = &self.parts[part.idx()];
        let opening = own.layout.special_opening(special);
        let (before, after) = (opening.height_of(a), opening.height_of(b));
        if before > 0.0 || after <= 0.0 {
            return None;
        }
        let t = before / (before - after);
        let p = a.lerp(b, t);
        let margin = own.layout.tolerance();
        let is_near = p.distance(opening.center()) <= opening.radius() + margin;
        let is_passed =
            is_near && opening.is_over(p, margin) && self.is_special_open(part, special);
        is_passed.then_some(t)
    }

    /// Returns `true` if nothing shuts a special portal: the doorway of which it is a side is open.
    pub(crate) fn is_special_open(&self, part: PartId, special: SpecialId) -> bool {
        let own = &self.parts[part.idx()];
        let portal = own.layout.portal_of_special(special);
        portal.is_none_or(|portal| own.state.is_open(portal))
    }
}
