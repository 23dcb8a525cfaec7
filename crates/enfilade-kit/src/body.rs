//! Convex bodies that may collide: how far one must move to leave another.
//!
//! Two convex bodies are apart exactly if a plane parts them whose normal is that of a face of either, or crosses an edge of
//! each (Gottschalk, Lin & Manocha, "OBBTree", SIGGRAPH 1996, for boxes). The least overlap along these axes is the
//! distance by which one must move.

use enfilade_geom::{Aabb, DVec3, poly};
use enfilade_world::Pose;

use crate::region::Region;

/// Directions closer than this are one. [Units: sine of an angle]
const SAME: f64 = 1e-6;

/// A convex polytope or polygon.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    pub(crate) bounds: Aabb,
    points: Vec<DVec3>,
    /// Normals of faces and directions of edges, each once up to its sign.
    normals: Vec<DVec3>,
    edges: Vec<DVec3>,
}

fn add_direction(all: &mut Vec<DVec3>, v: DVec3) {
    let v = v.normalize_or_zero();
    if v != DVec3::ZERO && all.iter().all(|w| w.cross(v).length() > SAME) {
        all.push(v);
    }
}

impl Body {
    pub(crate) fn of_region(region: &Region) -> Self {
        let polygons = region.faces.iter().map(|f| &f.1[..]);
        Self::of_polygons(polygons)
    }

    /// Returns the convex hull of polygons that bound it.
    pub(crate) fn of_polygons<'a>(polygons: impl Iterator<Item = &'a [DVec3]>) -> Self {
        let (mut points, mut normals, mut edges) = (Vec::new(), Vec::new(), Vec::new());
        for polygon in polygons {
            add_direction(&mut normals, poly::area_normal(polygon));
            for (i, &p) in polygon.iter().enumerate() {
                add_direction(&mut edges, polygon[(i + 1) % polygon.len()] - p);
                if points.iter().all(|q: &DVec3| q.distance_squared(p) > 1e-14) {
                    points.push(p);
                }
            }
        }
        Self {
            bounds: Aabb::of_points(&points),
            points,
            normals,
            edges,
        }
    }

    /// Returns how far it is from leaving `other`, which stands at a pose in its frame; `None` if that is at most
    /// `tolerance`. [Units: wu]
    pub(crate) fn overlap(&self, other: &Self, pose: &Pose, tolerance: f64) -> Option<f64> {
        let mut depth = f64::INFINITY;
        let mut is_apart = |axis: DVec3| {
            let length = axis.length();
            if length < SAME {
                return false;
            }
            let axis = axis / length;
            let [low, high] = extent(&self.points, axis);
            let [its_low, its_high] = extent(&other.points, pose.turn.conjugate() * axis);
            let shift = axis.dot(pose.at);
            depth = depth.min((high - its_low - shift).min(its_high + shift - low));
            depth <= tolerance
        };
        for &normal in &self.normals {
            if is_apart(normal) {
                return None;
            }
        }
        for &normal in &other.normals {
            if is_apart(pose.direction(normal)) {
                return None;
            }
        }
        for &edge in &other.edges {
            let edge = pose.direction(edge);
            if self.edges.iter().any(|own| is_apart(own.cross(edge))) {
                return None;
            }
        }
        Some(depth)
    }
}

fn extent(points: &[DVec3], axis: DVec3) -> [f64; 2] {
    let heights = points.iter().map(|p| p.dot(axis));
    heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| {
        [low.min(h), high.max(h)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::DQuat;

    fn cube() -> Body {
        let bounds = Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0));
        Body::of_region(&Region::of_box(&bounds))
    }

    #[test]
    fn bodies_are_as_far_in_each_other_as_one_must_move_to_leave() {
        let at = |x: f64| Pose::from_translation(DVec3::new(x, 0.3, 0.0));
        assert_eq!(cube().overlap(&cube(), &at(2.0), 1e-6), None);
        let depth = cube().overlap(&cube(), &at(1.75), 1e-6);
        assert!((depth.unwrap() - 0.25).abs() < 1e-12);
        // On edge, a cube reaches √2: no axis of the first parts them sooner.
        let turn = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_4);
        let turned = |x: f64| Pose {
            turn,
            at: DVec3::X * x,
        };
        assert_eq!(cube().overlap(&cube(), &turned(2.42), 1e-6), None);
        let depth = cube().overlap(&cube(), &turned(2.4), 1e-6).unwrap();
        assert!((depth - (1.0 + 2_f64.sqrt() - 2.4)).abs() < 1e-9);
    }

    #[test]
    fn a_sheet_in_the_middle_of_a_room_is_half_its_width_in_it() {
        let corners = [[0.0, -0.5, -0.5], [0.0, 0.5, -0.5], [0.0, 0.0, 0.5]];
        let sheet = corners.map(DVec3::from_array);
        let sheet = Body::of_polygons(std::iter::once(&sheet[..]));
        let depth = cube().overlap(&sheet, &Pose::IDENTITY, 1e-6).unwrap();
        assert!((depth - 1.0).abs() < 1e-12, "{depth}");
    }
}
