//! Morph targets at rest: the shape that the weights of a mesh or node give before any animation.
//!
//! glTF 2.0 §3.7.2.2 (morph targets): a vertex is its own value plus the weighted sum of the targets' values.

use super::accessor::Document;
use super::json::AccessorOf;
use crate::ImportError;
use crate::builder::Builder;
use enfilade_geom::scene::Primitive;

/// The shape in which a mesh is placed.
#[derive(Clone, Copy)]
pub(super) struct Rest<'w> {
    /// Weight of each target; targets without one have no effect.
    pub(super) weights: &'w [f64],
    /// The vertices of the file that `primitive` has, of `n_vertices`; `None` if it has all.
    pub(super) used: Option<&'w [u32]>,
    pub(super) n_vertices: u64,
}

/// Displaces positions, normals and tangents of a primitive.
///
/// Charges memory for each target with a weight: targets may share accessors, and time grows with their sum.
pub(super) fn apply(
    document: &Document<'_>,
    targets: &[AccessorOf],
    rest: Rest<'_>,
    place: &str,
    primitive: &mut Primitive,
    builder: &mut Builder<'_>,
) -> Result<(), ImportError> {
    let mut n_applied = 0;
    for (k, (target, &weight)) in targets.iter().zip(rest.weights).enumerate() {
        if weight == 0.0 {
            continue;
        }
        let place = format!("{place} target {k}");
        for (name, &accessor) in target {
            let malformed = |builder: &Builder<'_>, problem: String| {
                Err(builder.malformed(&place, format!("{name}: {problem}")))
            };
            let elements = match document.elements(accessor, &["VEC2", "VEC3", "VEC4"]) {
                Ok(elements) => elements,
                Err(problem) => return malformed(builder, problem),
            };
            if elements.count != rest.n_vertices {
                let (n, of) = (elements.count, rest.n_vertices);
                return malformed(builder, format!("has {n} elements and POSITION {of}"));
            }
            let n_bytes = primitive.positions.len() as u64;
            builder.charge_memory(&place, n_bytes, size_of::<[f32; 3]>() as u64)?;
            let values: Vec<[f32; 3]> = elements.read(rest.used, 0.0);
            match name.as_str() {
                "POSITION" => displace(&mut primitive.positions, &values, weight),
                "NORMAL" => displace(&mut primitive.normals, &values, weight),
                "TANGENT" => displace(&mut primitive.tangents, &values, weight),
                _ => {}
            }
        }
        n_applied += 1;
    }
    builder.note(
        place,
        if n_applied == 0 {
            "morph targets without weight; left out"
        } else {
            "morph targets; fixed at the weights of the mesh or node"
        },
    );
    Ok(())
}

/// Displaces the first three components; a tangent's fourth is its handedness.
fn displace<const N: usize>(values: &mut [[f32; N]], by: &[[f32; 3]], weight: f64) {
    for (value, by) in values.iter_mut().zip(by) {
        for (v, d) in value.iter_mut().zip(by) {
            *v = (f64::from(*v) + weight * f64::from(*d)) as f32;
        }
    }
}
