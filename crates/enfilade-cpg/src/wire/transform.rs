//! Transforms of placed objects, within what glTF nodes can express.

use enfilade_geom::scene::Primitive;
use enfilade_geom::{DMat3, DMat4, DQuat, DVec3};

use super::json::Node;

/// The identity.
pub(super) const IDENTITY: [f32; 16] = [
    1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
];

/// Returns the transform of a node: its matrix, or its translation, rotation (x, y, z, w) and scale.
///
/// # Errors
///
/// A node with both, which glTF forbids, or a rotation that is not a unit quaternion.
pub(super) fn of_node(node: &Node) -> Result<[f32; 16], &'static str> {
    let has_parts = node.translation.is_some() || node.rotation.is_some() || node.scale.is_some();
    if !has_parts {
        return Ok(node.matrix.map_or(IDENTITY, |m| m.map(|v| v as f32)));
    }
    if node.matrix.is_some() {
        return Err("has both a matrix and a translation, rotation or scale");
    }
    let rotation = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    // Quaternions rounded to a few digits are common; larger errors are not rotations.
    if (rotation.length() - 1.0).abs() > 1e-2 || !rotation.is_finite() {
        return Err("its rotation is not of unit length");
    }
    let whole = DMat4::from_scale_rotation_translation(
        node.scale.unwrap_or([1.0; 3]).into(),
        rotation.normalize(),
        node.translation.unwrap_or_default().into(),
    );
    Ok(whole.to_cols_array().map(|v| v as f32))
}

/// Returns `true` if a transform consists of translation, rotation and scale, as glTF requires of a node's matrix.
///
/// The limit is a fifth of the Khronos validator's (columns' sums of absolute values within 5·10⁻⁵, at any scale),
/// which leaves room for rounding in its decomposition in `f32`.
pub(super) fn is_trs(transform: &[f32; 16]) -> bool {
    let m = linear(transform);
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    let lengths = columns.map(DVec3::length);
    // To a validator that works in f32, smaller determinants are zero.
    if m.determinant().abs() < 1e-30 || lengths.iter().any(|&l| l < 1e-9) {
        return transform == &IDENTITY;
    }
    let largest = lengths.into_iter().fold(0.0, f64::max);
    [(0, 1), (0, 2), (1, 2)].into_iter().all(|(a, b)| {
        let cosine = columns[a].dot(columns[b]) / (lengths[a] * lengths[b]);
        cosine.abs() * largest <= 1e-5
    })
}

fn linear(t: &[f32; 16]) -> DMat3 {
    DMat3::from_mat4(DMat4::from_cols_array(&t.map(f64::from)))
}

/// Returns the primitive with `transform` applied to its vertices.
pub(super) fn transformed(p: &Primitive, transform: &[f32; 16]) -> Primitive {
    let whole = DMat4::from_cols_array(&transform.map(f64::from));
    let linear = linear(transform);
    // The adjugate's transpose also transforms normals by singular matrices, and keeps the side.
    let normal_matrix = DMat3::from_cols(
        linear.y_axis.cross(linear.z_axis),
        linear.z_axis.cross(linear.x_axis),
        linear.x_axis.cross(linear.y_axis),
    );
    let mirror = if linear.determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let vec = |v: [f32; 3]| DVec3::from(v.map(f64::from));
    let mut moved = p.clone();
    for position in &mut moved.positions {
        *position = whole.transform_point3(vec(*position)).as_vec3().to_array();
    }
    for normal in &mut moved.normals {
        let n = (normal_matrix * vec(*normal) * mirror).normalize_or_zero();
        *normal = n.as_vec3().to_array();
    }
    for tangent in &mut moved.tangents {
        let [x, y, z, w] = *tangent;
        let t = (linear * vec([x, y, z])).normalize_or_zero().as_vec3();
        *tangent = [t.x, t.y, t.z, w * mirror as f32];
    }
    if mirror < 0.0 {
        // Keep front faces in front.
        for triangle in moved.indices.chunks_exact_mut(3) {
            triangle.swap(1, 2);
        }
    }
    moved
}
