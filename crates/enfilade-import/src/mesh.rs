//! Operations on whole meshes.

use enfilade_geom::scene::{Mesh, Primitive};

/// Returns the bytes that a mesh's lists hold.
pub(crate) fn bytes_of(mesh: &Mesh) -> u64 {
    let bytes = |p: &Primitive| {
        size_of_val(&*p.positions)
            + size_of_val(&*p.normals)
            + size_of_val(&*p.tangents)
            + size_of_val(&*p.colors)
            + size_of_val(&*p.indices)
            + p.uvs.iter().map(|u| size_of_val(&**u)).sum::<usize>()
    };
    mesh.primitives.iter().map(bytes).sum::<usize>() as u64
}

/// Mirrors at the plane `x = 0` and reverses the winding. Exact.
pub(crate) fn mirror(primitive: &mut Primitive) {
    for p in &mut primitive.positions {
        p[0] = -p[0];
    }
    for n in &mut primitive.normals {
        n[0] = -n[0];
    }
    for t in &mut primitive.tangents {
        // The bitangent is `cross(normal, tangent) * w`; a mirror negates the cross product.
        t[0] = -t[0];
        t[3] = -t[3];
    }
    for t in primitive.indices.chunks_exact_mut(3) {
        t.swap(1, 2);
    }
}
