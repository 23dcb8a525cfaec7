//! Part of a primitive.

use std::collections::BTreeMap;

use enfilade_geom::scene::Primitive;

/// Returns the triangles of a primitive listed by `indices`, with the vertices that they use.
pub(crate) fn subset_of(p: &Primitive, indices: &[u32]) -> Primitive {
    let mut number: BTreeMap<u32, u32> = BTreeMap::new();
    let mut used: Vec<usize> = Vec::new();
    let indices = indices
        .iter()
        .map(|&i| {
            *number.entry(i).or_insert_with(|| {
                used.push(i as usize);
                used.len() as u32 - 1
            })
        })
        .collect();
    fn pick<T: Copy>(used: &[usize], from: &[T]) -> Vec<T> {
        if from.is_empty() {
            Vec::new()
        } else {
            used.iter().map(|&i| from[i]).collect()
        }
    }
    Primitive {
        positions: pick(&used, &p.positions),
        normals: pick(&used, &p.normals),
        tangents: pick(&used, &p.tangents),
        uvs: p.uvs.iter().map(|set| pick(&used, set)).collect(),
        colors: pick(&used, &p.colors),
        indices,
        ..p.clone()
    }
}
