//! The plane of a portal, and the projection of an eye before it onto that plane.

use enfilade_cpg::{CellId, PortalId};
use enfilade_runtime::{View, ViewError};
use glam::{DVec2, DVec3, Mat4, Vec4};

use crate::camera::Projection;
use crate::scene::GpuWorld;

/// A portal as seen from one side: its rectangle, and axes of its plane.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Doorway {
    pub(crate) portal: PortalId,
    /// The cell behind it.
    pub(crate) into: CellId,
    /// The cell on the eye's side.
    pub(crate) before: CellId,
    /// A point of the plane, from which places are measured. [Units: wu]
    origin: DVec3,
    /// Right, up, and the normal into the cell behind.
    pub(crate) axes: [DVec3; 3],
    /// Least and largest coordinates of the outline along the first two axes. [Units: wu]
    pub(crate) low: DVec2,
    pub(crate) high: DVec2,
    /// Convex outline. [Units: wu]
    outline: Vec<DVec3>,
}

/// Share by which outlines are drawn larger, into the wall around: its triangles have other vertices along the same edge, and
/// rounding would leave single pixels to neither.
const GROWN: f64 = 2e-3;

/// A place before a doorway: coordinates in its plane, and distance from the plane. [Units: wu]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DoorwayPlace {
    pub(crate) at: DVec2,
    pub(crate) height: f64,
}

impl DoorwayPlace {
    pub(crate) fn lerp(self, to: Self, t: f64) -> Self {
        Self {
            at: self.at.lerp(to.at, t),
            height: self.height + (to.height - self.height) * t,
        }
    }
}

impl Doorway {
    /// Returns a portal as seen before the cell `into`; `None` if it has no area or does not lead there.
    pub(crate) fn of(world: &GpuWorld, portal: PortalId, into: CellId) -> Option<Self> {
        let cells = world.portal_cells.get(portal.idx())?;
        let outline: Vec<DVec3> = (world.outlines[portal.idx()].iter())
            .map(|p| DVec3::from(p.map(f64::from)))
            .collect();
        let origin = *outline.first()?;
        // Counter-clockwise seen from the second cell: Newell's normal points into it.
        let next = outline.iter().cycle().skip(1);
        let sum = |sum: DVec3, (a, b): (&DVec3, &DVec3)| sum + (*a - origin).cross(*b - origin);
        let normal = outline.iter().zip(next).fold(DVec3::ZERO, sum);
        let normal = normal.try_normalize()?;
        let (normal, before) = match *cells {
            [before, to] if to == into => (normal, before),
            [to, before] if to == into => (-normal, before),
            _ => return None,
        };
        let right = normal.cross(DVec3::Y);
        let right = right.try_normalize().filter(|_| right.length() > 1e-3);
        let right = right.unwrap_or_else(|| normal.any_orthonormal_vector());
        let axes = [right, right.cross(normal), normal];
        let flat = |p: &DVec3| DVec2::new(axes[0].dot(*p - origin), axes[1].dot(*p - origin));
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for p in outline.iter().map(flat) {
            (low, high) = (low.min(p), high.max(p));
        }
        ((high - low).min_element() > 1e-3).then_some(Self {
            portal,
            into,
            before,
            origin,
            axes,
            low,
            high,
            outline,
        })
    }

    /// Returns the place of a point.
    pub(crate) fn place(&self, p: DVec3) -> DoorwayPlace {
        let [right, up, normal] = self.axes;
        let p = p - self.origin;
        DoorwayPlace {
            at: DVec2::new(right.dot(p), up.dot(p)),
            height: -normal.dot(p),
        }
    }

    /// Returns the point of a place.
    pub(crate) fn point(&self, place: DoorwayPlace) -> DVec3 {
        let [right, up, normal] = self.axes;
        self.origin + right * place.at.x + up * place.at.y - normal * place.height
    }

    /// Returns the polygon to draw.
    pub(crate) fn outline(&self) -> Vec<DVec3> {
        let middle = self.outline.iter().sum::<DVec3>() / self.outline.len() as f64;
        let grown = self.outline.iter().map(|p| *p + (*p - middle) * GROWN);
        grown.collect()
    }

    /// Returns the middle of its rectangle, in its plane.
    pub(crate) fn middle(&self) -> DVec2 {
        (self.low + self.high) * 0.5
    }

    /// Returns the distance of a place from its rectangle. [Units: wu]
    pub(crate) fn distance(&self, place: DoorwayPlace) -> f64 {
        let beside = place.at - place.at.clamp(self.low, self.high);
        beside.length().hypot(place.height)
    }

    /// Returns the projection that maps its rectangle, seen from a place, to the whole picture. Its plane is the near plane:
    /// depths are the height of the place over the distance along the normal, and nothing before the plane is drawn.
    pub(crate) fn projection(&self, from: DoorwayPlace) -> Projection {
        let [right, up, normal] = self.axes;
        let size = self.high - self.low;
        let scale = 2.0 * from.height / size;
        let shift = 2.0 * (from.at - self.low) / size - 1.0;
        let row = |v: DVec3| v.as_vec3().extend(0.0);
        let rows = [
            row(right * scale.x + normal * shift.x),
            row(up * scale.y + normal * shift.y),
            Vec4::new(0.0, 0.0, 0.0, from.height as f32),
            row(normal),
        ];
        let exact = self.point(from);
        let origin = exact.as_vec3();
        Projection {
            clip_from_relative: Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose(),
            origin,
            origin_low: (exact - origin.as_dvec3()).as_vec3(),
            eye: origin,
            is_parallel: false,
        }
    }

    /// Returns the view from a place through its rectangle.
    pub(crate) fn view(&self, from: DoorwayPlace) -> Result<View, ViewError> {
        let projection = self.projection(from);
        let eye = projection.exact_origin();
        let rows = [0, 1, 3].map(|k| projection.clip_from_relative.row(k).truncate().as_dvec3());
        let whole = |n: DVec3| n.extend(-n.dot(eye)).as_vec4();
        let [x, y, w] = rows.map(whole);
        let z = Vec4::new(0.0, 0.0, 0.0, from.height as f32);
        let matrix = Mat4::from_cols(x, y, z, w).transpose();
        View::from_view_projection(eye.as_vec3().to_array(), matrix.to_cols_array_2d())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doorway(into: u32) -> Doorway {
        // Seen from +z, where the second cell is, counter-clockwise.
        let outline = vec![
            DVec3::new(2.0, 0.0, 5.0),
            DVec3::new(3.0, 0.0, 5.0),
            DVec3::new(3.0, 2.0, 5.0),
            DVec3::new(2.0, 2.0, 5.0),
        ];
        let normal = if into == 1 { DVec3::Z } else { DVec3::NEG_Z };
        let right = normal.cross(DVec3::Y);
        let axes = [right, right.cross(normal), normal];
        let flat = |p: &DVec3| DVec2::new(right.dot(*p - outline[0]), axes[1].dot(*p - outline[0]));
        let at: Vec<DVec2> = outline.iter().map(flat).collect();
        Doorway {
            portal: PortalId(0),
            into: CellId(into),
            before: CellId(1 - into),
            origin: outline[0],
            axes,
            low: at.iter().copied().reduce(DVec2::min).unwrap(),
            high: at.iter().copied().reduce(DVec2::max).unwrap(),
            outline,
        }
    }

    #[test]
    fn places_are_points_and_back() {
        for own in [doorway(0), doorway(1)] {
            let p = DVec3::new(1.0, 1.6, if own.into.0 == 1 { 3.0 } else { 8.0 });
            let place = own.place(p);
            assert!(place.height > 0.0, "{place:?}");
            assert!(own.point(place).distance(p) < 1e-12);
        }
    }

    #[test]
    fn the_rectangle_fills_the_picture_and_its_plane_is_at_depth_one() {
        for own in [doorway(0), doorway(1)] {
            let from = own.place(DVec3::new(
                1.0,
                1.6,
                if own.into.0 == 1 { 3.0 } else { 8.0 },
            ));
            let projection = own.projection(from);
            for p in &own.outline {
                let relative = (*p - projection.exact_origin()).as_vec3();
                let q = projection.clip_from_relative * relative.extend(1.0);
                assert!((q.x.abs() / q.w - 1.0).abs() < 1e-5, "{q}");
                assert!((q.y.abs() / q.w - 1.0).abs() < 1e-5, "{q}");
                assert!((q.z / q.w - 1.0).abs() < 1e-5, "{q}");
            }
            // Up in the world is up in the picture, and right is right.
            let q = |p: DVec3| {
                let relative = (p - projection.exact_origin()).as_vec3();
                let q = projection.clip_from_relative * relative.extend(1.0);
                [q.x / q.w, q.y / q.w]
            };
            assert!(q(own.outline[2])[1] > q(own.outline[1])[1]);
            assert!(own.view(from).is_ok());
        }
    }
}
