//! Boxes around placed objects, and the check of those in a file.

use enfilade_geom::scene::Primitive;
use enfilade_geom::{Aabb, DMat4, DVec3};

/// Returns the box around a mesh in its own space; empty without vertices.
pub(super) fn of_mesh<'a>(primitives: impl IntoIterator<Item = &'a Primitive>) -> Aabb {
    let positions = primitives.into_iter().flat_map(|p| &p.positions);
    positions
        .map(|&p| DVec3::from(p.map(f64::from)))
        .fold(Aabb::EMPTY, Aabb::including)
}

/// Returns the box in world space around the placed box of a mesh. Constant time for meshes of any size.
pub(super) fn placed(local: &Aabb, transform: &[f32; 16]) -> Option<[[f64; 3]; 2]> {
    if local.is_empty() {
        return None;
    }
    let by = DMat4::from_cols_array(&transform.map(f64::from));
    let corner = |k: usize| {
        let pick = |axis: usize| {
            if k >> axis & 1 == 0 {
                local.min[axis]
            } else {
                local.max[axis]
            }
        };
        by.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
    };
    let b = (0..8).map(corner).fold(Aabb::EMPTY, Aabb::including);
    // JSON cannot hold infinity.
    let limit = f64::from(f32::MAX);
    let rounded = |p: DVec3| p.to_array().map(|v| v.clamp(-limit, limit) as f32 as f64);
    Some([rounded(b.min), rounded(b.max)])
}

/// Returns `true` if the box in a file is the placed one, up to the rounding of a program that decomposes and
/// recomposes transforms in `f32`: a hundred times its epsilon, relative to the largest number involved.
pub(super) fn agree(said: &[[f64; 3]; 2], local: &Aabb, transform: &[f32; 16]) -> bool {
    let Some(found) = placed(local, transform) else {
        return false;
    };
    let scale = transform[..12].iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    let translation = transform[12..15].iter().map(|&v| f64::from(v));
    let of_world = found.as_flattened().iter().copied().chain(translation);
    let of_world = of_world.fold(0.0_f64, |m, v| m.max(v.abs()));
    let of_mesh = local.min.abs().max(local.max.abs()).max_element() * f64::from(scale);
    let slack = 1e-5 * of_world.max(of_mesh) + 1e-6;
    let pairs = said.as_flattened().iter().zip(found.as_flattened());
    pairs.into_iter().all(|(a, b)| (a - b).abs() <= slack)
}
