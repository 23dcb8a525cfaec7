//! Passage of a moving door over a point at rest.
//!
//! In the frame of the moving part, the point moves along a curve (Dirkse 2002, section 3.2.2: portals are tested in portal
//! space). Its height over the opening's plane is zero at a passage; a straight line between the two ends of a step, as used
//! there, misses passages of the curve and finds false ones. Here time advances by at most the height divided by the greatest
//! speed (conservative advancement, Mirtich 1996), so no side is skipped; a change of side is then bisected. O(log) steps per
//! crossing where the curve meets the plane at an angle; bounded by [`SHORTEST`] where it runs along it.

use enfilade_cpg::PortalId;
use enfilade_geom::DVec3;

use crate::layout::Opening;
use crate::pose::Pose;
use crate::space::{PartId, Space};

/// Least step in time, as a fraction of the motion: a passage that reverses within it does not count.
const SHORTEST: f64 = 1.0 / 16_384.0;

/// Bisections of the interval in which the side changes.
const HALVINGS: u32 = 40;

/// Passage of a door over a point.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Passing {
    /// Time, as a fraction of the motion.
    pub at: f64,
    /// The door of the part that moved.
    pub portal: PortalId,
    /// True if the point entered the part.
    pub is_inward: bool,
}

impl Space {
    /// Appends to `into` the doors of `part` that pass over a point as the part moves from one pose to another, in order of
    /// time. The poses and the point are in the host's frame; the motion between is [`Pose::toward`].
    ///
    /// A passage within the part's tolerance of an opening's rim counts.
    pub fn passings(
        &self,
        part: PartId,
        motion: [&Pose; 2],
        point: DVec3,
        into: &mut Vec<Passing>,
    ) {
        let first = into.len();
        let own = &self.parts[part.idx()];
        let [start, end] = motion;
        let angle = start.turn.angle_between(end.turn);
        let far = point.distance(start.at).max(point.distance(end.at));
        // Speed bound of the point in the part's frame, per unit of time.
        let speed = angle * far + start.at.distance(end.at);
        let place = |t: f64| start.toward(end, t).point_back(point);
        for door in &own.doors {
            let opening = own.layout.opening(door.portal);
            // The second cell is on the side of the normal.
            let is_outward = own.border == Some(opening.cells()[1]);
            let margin = own.layout.tolerance();
            each_crossing(&opening, speed, place, margin, |at, is_up| {
                into.push(Passing {
                    at,
                    portal: door.portal,
                    is_inward: is_up != is_outward,
                });
            });
        }
        into[first..].sort_by(|a, b| a.at.total_cmp(&b.at).then(a.portal.cmp(&b.portal)));
    }
}

/// Calls `found` with the time of each change of side through an opening, and `true` if it is to the side of its normal. A point
/// on the plane is on the lower side.
fn each_crossing(
    opening: &Opening,
    speed: f64,
    place: impl Fn(f64) -> DVec3,
    margin: f64,
    mut found: impl FnMut(f64, bool),
) {
    let height = |t: f64| opening.height_of(place(t));
    let (mut t, mut h) = (0.0, height(0.0));
    while t < 1.0 {
        let step = (h.abs() / speed).max(SHORTEST);
        let next = (t + step).min(1.0);
        let h_next = height(next);
        if (h > 0.0) != (h_next > 0.0) {
            let (mut low, mut high) = (t, next);
            for _ in 0..HALVINGS {
                let middle = f64::midpoint(low, high);
                if (height(middle) > 0.0) == (h > 0.0) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            if opening.is_over(place(high), margin) {
                found(high, h_next > 0.0);
            }
        }
        (t, h) = (next, h_next);
    }
}
