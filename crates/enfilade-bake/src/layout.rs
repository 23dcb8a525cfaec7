//! Which primitives can share a vertex buffer.

use enfilade_geom::scene::Primitive;

/// Which attributes a primitive carries: normals, tangents, sets of texture coordinates, colors. Primitives that carry
/// different ones cannot share a vertex buffer.
pub(crate) type Layout = (bool, bool, usize, bool);

pub(crate) fn layout_of(p: &Primitive) -> Layout {
    (
        !p.normals.is_empty(),
        !p.tangents.is_empty(),
        p.uvs.len(),
        !p.colors.is_empty(),
    )
}
