//! Lines and translucent polygons drawn over a picture: portals, the regions to which they narrow the view, the eye and
//! its frustum.

use glam::{Vec3, Vec4};

use crate::camera::Projection;

/// The shape of a mark.
#[derive(Clone, Debug, PartialEq)]
pub enum MarkShape {
    /// A closed line through world points. [Units: wu]
    Outline(Vec<[f32; 3]>),
    /// A line between two world points. [Units: wu]
    Line([[f32; 3]; 2]),
    /// A filled convex polygon. [Units: wu]
    Area(Vec<[f32; 3]>),
    /// The outline of a rectangle of the screen: `[left, bottom, right, top]`, -1 to 1.
    Rectangle([f32; 4]),
}

/// A line or polygon over a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureMark {
    /// The shape.
    pub shape: MarkShape,
    /// Linear color with opacity.
    pub color: [f32; 4],
    /// Width of lines. [Units: px]
    pub width: f32,
    /// True if surfaces before it do not hide it.
    pub on_top: bool,
}

/// A vertex in the shader's layout: clip space position, color.
pub(crate) type MarkCorner = [[f32; 4]; 2];

/// Factor by which marks count as nearer, so that they win over the surface in which they lie.
const NEARER: f32 = 1.002;

/// Returns the triangles of marks, three vertices each: those that surfaces hide, and those on top.
pub(crate) fn corners(
    marks: &[PictureMark],
    projection: &Projection,
    size: [u32; 2],
) -> [Vec<MarkCorner>; 2] {
    let mut out = [Vec::new(), Vec::new()];
    let clip = |p: [f32; 3]| {
        projection.clip_from_relative * (Vec3::from(p) - projection.origin).extend(1.0)
    };
    for mark in marks {
        let out = &mut out[usize::from(mark.on_top)];
        let mut line = |a, b| add_line(out, mark, [a, b], size);
        match &mark.shape {
            MarkShape::Line([a, b]) => line(clip(*a), clip(*b)),
            MarkShape::Outline(points) => {
                let next = points.iter().cycle().skip(1);
                for (a, b) in points.iter().zip(next) {
                    line(clip(*a), clip(*b));
                }
            }
            MarkShape::Rectangle([l, b, r, t]) => {
                let points =
                    [[l, b], [r, b], [r, t], [l, t]].map(|[x, y]| Vec4::new(*x, *y, 1.0, 1.0));
                for i in 0..4 {
                    line(points[i], points[(i + 1) % 4]);
                }
            }
            MarkShape::Area(points) => {
                for pair in points.windows(2).skip(1) {
                    let triangle = [points[0], pair[0], pair[1]].map(clip);
                    // The adapter clips parts behind the eye.
                    out.extend(triangle.map(|q| [nearer(q), mark.color]));
                }
            }
        }
    }
    out
}

fn nearer(q: Vec4) -> [f32; 4] {
    [q.x, q.y, (q.z * NEARER).min(q.w), q.w]
}

/// Adds a line as two triangles that face the camera.
fn add_line(out: &mut Vec<MarkCorner>, mark: &PictureMark, [a, b]: [Vec4; 2], size: [u32; 2]) {
    const LEAST: f32 = 1e-3;
    let cut = |p: Vec4, q: Vec4| {
        if p.w >= LEAST {
            p
        } else {
            p.lerp(q, (LEAST - p.w) / (q.w - p.w))
        }
    };
    if a.w < LEAST && b.w < LEAST {
        return;
    }
    let (a, b) = (cut(a, b), cut(b, a));
    let half = [size[0] as f32 * 0.5, size[1] as f32 * 0.5];
    let pixel = |p: Vec4| [p.x / p.w * half[0], p.y / p.w * half[1]];
    let (pa, pb) = (pixel(a), pixel(b));
    let (dx, dy) = (pb[0] - pa[0], pb[1] - pa[1]);
    let length = dx.hypot(dy);
    if length.is_nan() || length < 1e-6 {
        return;
    }
    // Slightly longer than the line, so that joints of outlines close.
    let (ux, uy) = (
        dx / length * mark.width * 0.5,
        dy / length * mark.width * 0.5,
    );
    let at = |p: Vec4, along: f32, across: f32| {
        let x = (ux * along - uy * across) / half[0] * p.w;
        let y = (uy * along + ux * across) / half[1] * p.w;
        [nearer(p + Vec4::new(x, y, 0.0, 0.0)), mark.color]
    };
    let (q0, q1) = (at(a, -1.0, -1.0), at(a, -1.0, 1.0));
    let (q2, q3) = (at(b, 1.0, 1.0), at(b, 1.0, -1.0));
    out.extend([q0, q1, q2, q0, q2, q3]);
}
