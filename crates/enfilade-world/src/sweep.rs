//! When a door that moves passes over a point that stands still.
//!
//! In the frame of the part that moves, the point moves along a curve (Dirkse 2002, section 3.2.2: portals are tested in portal
//! space). Its height over the opening's plane is zero where it passes; a straight line between the two ends of a step, as
//! there, misses what the curve passes, and finds what it does not. Here time advances by no more than the height divided by
//! the greatest speed (conservative advancement, Mirtich 1996), so no side is skipped; a change of side is then bisected.
//! O(log) steps a crossing where the curve meets the plane at an angle; bounded by [`SHORTEST`] where it runs along it.

use enfilade_cpg::PortalId;
use enfilade_geom::DVec3;

use crate::layout::Opening;
use crate::pose::Pose;
use crate::space::{PartId, Space};

/// The least step in time, as a share of the motion: what passes and returns within it has not passed.
const SHORTEST: f64 = 1.0 / 16_384.0;

/// Halvings of the interval in which the side changes.
const HALVINGS: u32 = 40;

/// A point and a door have passed each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passing {
    /// When, as a share of the motion.
    pub at: f64,
    /// The door, of the part that moved.
    pub portal: PortalId,
    /// Whether the point came into the part.
    pub is_inward: bool,
}

impl Space {
    /// The doors of `part` that pass over a point as the part moves from one pose to another, in the order in which they do,
    /// at the end of `into`. The poses are in the host's frame, in between as [`Pose::toward`] has it; so is the point.
    ///
    /// What passes within the part's tolerance of an opening's rim counts as passing through it.
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
        // Of the point in the part's frame, for each unit of time.
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

/// Calls `found` with the time of each change of side through an opening, and whether it is to the side of its normal. A point
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
            if is_in(opening, place(high), margin) {
                found(high, h_next > 0.0);
            }
        }
        (t, h) = (next, h_next);
    }
}

/// Whether a point of an opening's plane is in one of its pieces, or within `margin` of each of its edges' lines.
fn is_in(opening: &Opening, p: DVec3, margin: f64) -> bool {
    let normal = opening.normal();
    opening.pieces().any(|piece| {
        (0..piece.len()).all(|i| {
            let along = piece[(i + 1) % piece.len()] - piece[i];
            normal.cross(along).dot(p - piece[i]) >= -margin * along.length()
        })
    })
}
