//! Curved surfaces of Quake 3 and Doom 3 as triangles.
//!
//! A patch is a grid of control points; each three by three of them, with shared rims, make a biquadratic Bezier
//! surface.

use enfilade_geom::DVec3;
use enfilade_geom::scene::Primitive;

use super::parse::Patch;

/// Largest distance of a triangle from the curve: 3 cm. [Units: those of the map]
const TOLERANCE: f64 = 1.0;
/// Most segments per curve over three points.
const MAX_SEGMENTS: usize = 32;

/// A patch divided into rectangles.
pub(super) struct Tessellation<'p> {
    patch: &'p Patch<'p>,
    /// Segments per curve over three points, along columns and along rows.
    n_segments: [usize; 2],
}

impl<'p> Tessellation<'p> {
    pub(super) fn new(patch: &'p Patch<'p>) -> Self {
        let n_segments = [0, 1].map(|axis| match patch.n_segments {
            Some(n) if n[axis] > 0 => n[axis].min(MAX_SEGMENTS),
            _ => n_segments(patch, axis),
        });
        Self { patch, n_segments }
    }

    /// Returns the number of vertices along columns and along rows.
    fn size(&self) -> [usize; 2] {
        [0, 1].map(|axis| self.patch.size[axis] / 2 * self.n_segments[axis] + 1)
    }

    pub(super) fn n_vertices(&self) -> usize {
        self.size().iter().product()
    }

    /// Appends the triangles.
    pub(super) fn append(&self, to: &mut Primitive) {
        let [n_rows, n_columns] = self.size();
        let first = to.positions.len() as u32;
        let vertices: Vec<DVec3> = (0..n_rows * n_columns)
            .map(|i| self.point([i / n_columns, i % n_columns]))
            .collect();
        let mut normals = vec![DVec3::ZERO; vertices.len()];
        for row in 1..n_rows {
            for column in 1..n_columns {
                let d = row * n_columns + column;
                let [a, b, c] = [d - n_columns - 1, d - n_columns, d - 1];
                for t in [[a, b, d], [a, d, c]] {
                    let [p, q, r] = t.map(|v| vertices[v]);
                    let normal = (q - p).cross(r - p);
                    // Rows that meet in a point give triangles without area.
                    if normal.length() > 1e-6 {
                        t.iter().for_each(|&v| normals[v] += normal);
                        to.indices.extend(t.map(|v| first + v as u32));
                    }
                }
            }
        }
        let narrow = |v: DVec3| v.as_vec3().to_array();
        to.positions.extend(vertices.into_iter().map(narrow));
        let normals = normals
            .into_iter()
            .map(|n| narrow(n.normalize_or(DVec3::Z)));
        to.normals.extend(normals);
    }

    /// Returns a vertex by its row and column.
    fn point(&self, at: [usize; 2]) -> DVec3 {
        let mut first = [0; 2];
        let mut weights = [[0.0; 3]; 2];
        for axis in 0..2 {
            let n = self.n_segments[axis];
            // The last vertex is the end of the last curve.
            let curve = (at[axis] / n).min(self.patch.size[axis] / 2 - 1);
            let t = (at[axis] - curve * n) as f64 / n as f64;
            first[axis] = 2 * curve;
            weights[axis] = [(1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t];
        }
        let mut sum = DVec3::ZERO;
        for (i, u) in weights[0].into_iter().enumerate() {
            for (j, v) in weights[1].into_iter().enumerate() {
                sum += control(self.patch, [first[0] + i, first[1] + j]) * (u * v);
            }
        }
        sum
    }
}

fn control(patch: &Patch<'_>, [row, column]: [usize; 2]) -> DVec3 {
    DVec3::from_array(patch.controls[row * patch.size[1] + column])
}

/// Returns the least number of segments that keeps all curves along an axis within [`TOLERANCE`]: a quadratic curve
/// over points `p q r`, cut into `n`, is at most `|p - 2q + r| / 4n²` off.
fn n_segments(patch: &Patch<'_>, axis: usize) -> usize {
    let mut most: f64 = 0.0;
    for along in (0..patch.size[axis] - 2).step_by(2) {
        for across in 0..patch.size[1 - axis] {
            let at = |k: usize| {
                let place = [along + k, across];
                control(
                    patch,
                    if axis == 0 {
                        place
                    } else {
                        [across, along + k]
                    },
                )
            };
            most = most.max((at(0) - 2.0 * at(1) + at(2)).length());
        }
    }
    ((most / (4.0 * TOLERANCE)).sqrt().ceil() as usize).clamp(1, MAX_SEGMENTS)
}
