//! Vertex layouts: primitives with the same layout can share a vertex buffer.

use enfilade_geom::scene::Primitive;

/// Attributes of a primitive: has normals, has tangents, number of texture coordinate sets, has colors.
pub(crate) type Layout = (bool, bool, usize, bool);

pub(crate) fn layout_of(p: &Primitive) -> Layout {
    (
        !p.normals.is_empty(),
        !p.tangents.is_empty(),
        p.uvs.len(),
        !p.colors.is_empty(),
    )
}
