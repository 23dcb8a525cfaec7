//! Frames and outlines of attachments, and the pose by which two of them meet.

use enfilade_cpg::Portal;
use enfilade_geom::{DMat3, DQuat, DVec2, DVec3};
use enfilade_world::Pose;

/// Normals closer than this to level, or to an axis, are meant to be so: doorways in files of `f32` lean by less. [Units: sine of
/// an angle]
const LEANING: f64 = 1e-4;

/// An opening in a frame of its own.
///
/// The frame's z axis points out of the piece. Its y axis points up, or north (-z) if the opening lies flat. Its origin is the middle
/// of the sill, or of the box around an opening that lies flat.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Mouth {
    /// Maps points of its frame to those of the piece.
    pub frame: Pose,
    /// Convex outline in its plane, counter-clockwise seen from outside. [Units: wu]
    pub outline: Vec<DVec2>,
    /// Area of the true opening, which is less than that of its outline if parts of it are closed. [Units: wu²]
    pub area: f64,
}

impl Mouth {
    /// Returns the mouth of a portal; `out` is a normal that points out of the piece.
    pub(crate) fn of_portal(portal: &Portal, out: DVec3) -> Self {
        let z = straightened(out);
        let is_flat = z.y.abs() > 0.99;
        let up = if is_flat { -DVec3::Z } else { DVec3::Y };
        let y = (up - z * up.dot(z)).normalize();
        let turn = DQuat::from_mat3(&DMat3::from_cols(y.cross(z), y, z)).normalize();
        let corners = portal.outline.iter().map(|p| point(*p));
        let mut frame = Pose {
            turn,
            at: corners.clone().sum::<DVec3>() / portal.outline.len().max(1) as f64,
        };
        let flat = |frame: &Pose| -> Vec<DVec2> {
            let own = corners.clone().map(|p| frame.point_back(p));
            own.map(|p| DVec2::new(p.x, p.y)).collect()
        };
        let [low, high] = bounds(&flat(&frame));
        let middle = 0.5 * (low + high);
        let origin = DVec2::new(middle.x, if is_flat { middle.y } else { low.y });
        frame.at = frame.point(DVec3::new(origin.x, origin.y, 0.0));
        let mut outline = flat(&frame);
        if signed_area(&outline) < 0.0 {
            outline.reverse();
        }
        Self {
            frame,
            outline,
            area: f64::from(portal.area),
        }
    }

    /// Returns its width and height. [Units: wu]
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        let [low, high] = bounds(&self.outline);
        (high - low).to_array()
    }

    /// Returns how far its outline is from that of `other` when both face each other, `other` turned by `spin` about its normal:
    /// the largest distance of a vertex of either from the other polygon, or the width of a strip along its longer side of the area
    /// within the outline that is closed in one only. [Units: wu, rad]
    #[must_use]
    #[doc(hidden)]
    pub fn misfit(&self, other: &Self, spin: f64) -> f64 {
        let turn = DVec2::from_angle(spin);
        let its = other.outline.iter().map(|p| turn.rotate(*p));
        // Seen from this side.
        let its: Vec<DVec2> = its.map(|p| DVec2::new(-p.x, p.y)).rev().collect();
        let far = |a: &[DVec2], b: &[DVec2]| {
            let distances = a.iter().map(|p| distance(*p, b));
            distances.fold(0.0, f64::max)
        };
        let outline = far(&self.outline, &its).max(far(&its, &self.outline));
        let longer = self.size().into_iter().fold(1e-9, f64::max);
        let closed = [self, other].map(|m| signed_area(&m.outline) - m.area);
        outline.max((closed[0] - closed[1]).abs() / longer)
    }

    /// Returns the pose, in this mouth's piece, of a piece whose mouth `other` meets this one, turned by `spin` about its normal.
    /// [Units: rad]
    #[must_use]
    #[doc(hidden)]
    pub fn meeting(&self, other: &Self, spin: f64) -> Pose {
        let half_turn = Pose {
            turn: DQuat::from_xyzw(0.0, 1.0, 0.0, 0.0) * DQuat::from_rotation_z(spin),
            at: DVec3::ZERO,
        };
        self.frame.after(&half_turn).after(&other.frame.inverse())
    }

    /// Returns its outline in the piece's frame, counter-clockwise seen from outside.
    pub(crate) fn corners(&self) -> Vec<DVec3> {
        let own = self.outline.iter().map(|p| DVec3::new(p.x, p.y, 0.0));
        own.map(|p| self.frame.point(p)).collect()
    }

    /// Returns the distance from its origin within which its outline lies. [Units: wu]
    pub(crate) fn radius(&self) -> f64 {
        self.outline.iter().map(|p| p.length()).fold(0.0, f64::max)
    }
}

pub(crate) fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// Returns a unit normal, exactly level or along an axis if it almost is.
fn straightened(normal: DVec3) -> DVec3 {
    let mut n = normal.normalize_or(DVec3::Z);
    for k in 0..3 {
        if n[k].abs() < LEANING && (k == 1 || n.abs().max_element() > 1.0 - LEANING) {
            n[k] = 0.0;
        }
    }
    n.normalize_or(DVec3::Z)
}

fn bounds(points: &[DVec2]) -> [DVec2; 2] {
    let ends = [DVec2::INFINITY, DVec2::NEG_INFINITY];
    (points.iter()).fold(ends, |[low, high], p| [low.min(*p), high.max(*p)])
}

fn edges(polygon: &[DVec2]) -> impl Iterator<Item = [DVec2; 2]> {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(a, b)| [*a, *b])
}

fn signed_area(polygon: &[DVec2]) -> f64 {
    0.5 * edges(polygon).map(|[a, b]| a.perp_dot(b)).sum::<f64>()
}

/// Returns the distance of a point from a convex polygon; 0 inside. [Units: wu]
fn distance(p: DVec2, polygon: &[DVec2]) -> f64 {
    if edges(polygon).all(|[a, b]| (b - a).perp_dot(p - a) >= 0.0) {
        return 0.0;
    }
    let to_edge = |[a, b]: [DVec2; 2]| {
        let along = b - a;
        let t = (p - a).dot(along) / along.length_squared().max(1e-30);
        p.distance(a + along * t.clamp(0.0, 1.0))
    };
    edges(polygon).map(to_edge).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn doorway(size: [f32; 2], at: f32) -> Mouth {
        let [w, h] = size;
        let outline = vec![
            [at, 0.0, 3.0],
            [at + w, 0.0, 3.0],
            [at + w, h, 3.0],
            [at, h, 3.0],
        ];
        let portal = Portal {
            cells: [enfilade_cpg::CellId(0), enfilade_cpg::CellId(1)],
            kind: enfilade_cpg::PortalKind::Open,
            normal: [0.0, 0.0, 1.0],
            pieces: vec![outline.clone()],
            outline,
            area: w * h,
            fittings: Vec::new(),
            why: Vec::new(),
        };
        Mouth::of_portal(&portal, DVec3::Z)
    }

    /// Covers W14: outlines are compared as they face each other, by the farthest vertex.
    #[test]
    fn outlines_fit_if_no_vertex_is_far_from_the_other() {
        let door = doorway([1.2, 2.1], 0.0);
        assert!(door.misfit(&doorway([1.2, 2.1], 5.0), 0.0) < 1e-6);
        let off = door.misfit(&doorway([1.0, 2.1], 0.0), 0.0);
        assert!((off - 0.1).abs() < 1e-6, "{off}");
        let mut arched = door.clone();
        arched.area -= 0.21;
        assert!((door.misfit(&arched, 0.0) - 0.1).abs() < 1e-6);
        assert!(door.misfit(&doorway([1.2, 2.2], 0.0), 0.0) > 0.09);
        // Turned by a quarter, only a square hatch fits.
        assert!(door.misfit(&door, FRAC_PI_2) > 0.8);
    }

    #[test]
    fn mouths_that_meet_face_each_other_with_both_sills_down() {
        let (a, b) = (doorway([1.2, 2.1], 0.0), doorway([1.2, 2.1], 7.0));
        let pose = a.meeting(&b, 0.0);
        let met = pose.point(b.frame.at);
        assert!(met.distance(a.frame.at) < 1e-6);
        let out = pose.direction(b.frame.direction(DVec3::Z));
        assert!(out.distance(-a.frame.direction(DVec3::Z)) < 1e-9);
        assert!(pose.direction(DVec3::Y).distance(DVec3::Y) < 1e-9);
        let turned = a.meeting(&b, PI);
        assert!(turned.direction(DVec3::Y).distance(-DVec3::Y) < 1e-9);
    }
}
