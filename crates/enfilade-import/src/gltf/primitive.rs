//! Primitives and instances.

use super::accessor::{Document, Elements};
use super::json::{Instancing, PrimitiveDef};
use super::{compose, data_error, unsupported_extension};
use crate::ImportError;
use crate::builder::Builder;
use enfilade_geom::scene::Primitive;
use enfilade_geom::{DMat4, DVec3};
use std::collections::BTreeMap;

/// Most texture coordinate sets kept.
const MAX_UV_SETS: usize = 8;

/// Reads one primitive; `None` where it holds no triangles.
pub(super) fn read_primitive(
    document: &Document<'_>,
    def: &PrimitiveDef,
    materials: &[u32],
    place: &str,
    builder: &mut Builder<'_>,
) -> Result<Option<Primitive>, ImportError> {
    let mode = def.mode.unwrap_or(4);
    match mode {
        4..=6 => {}
        0..=3 => {
            builder.note(place, "points or lines; left out");
            return Ok(None);
        }
        _ => return Err(builder.malformed(place, format!("unknown mode {mode}"))),
    }
    let Some(&position) = def.attributes.get("POSITION") else {
        builder.note(place, "no POSITION; left out");
        return Ok(None);
    };
    let is_hollow = document
        .root
        .accessors
        .get(position as usize)
        .is_some_and(|a| a.buffer_view.is_none());
    if is_hollow && def.extensions.as_ref().is_some_and(|e| e.draco.is_some()) {
        return Err(unsupported_extension(builder, "KHR_draco_mesh_compression"));
    }
    let positions = document
        .elements(position, &["VEC3"])
        .map_err(|problem| data_error(builder, place, &format!("POSITION: {problem}")))?;
    let n_vertices = positions.count;
    let mut indices = match def.indices {
        None => {
            builder.charge_vertices(place, n_vertices)?;
            builder.charge_memory(place, n_vertices, 4)?;
            (0..n_vertices as u32).collect()
        }
        Some(index) => {
            let elements = document
                .elements(index, &["SCALAR"])
                .map_err(|problem| data_error(builder, place, &format!("indices: {problem}")))?;
            builder.check_triangles(place, elements.count / 3)?;
            // A strip or fan grows to three times its length.
            builder.charge_memory(place, elements.count, if mode == 4 { 4 } else { 12 })?;
            elements
                .read_indices()
                .map_err(|problem| builder.malformed(place, problem))?
        }
    };
    if let Some(&bad) = indices.iter().find(|&&i| u64::from(i) >= n_vertices) {
        return Err(builder.malformed(
            place,
            format!("index {bad} is out of range: there are {n_vertices} vertices"),
        ));
    }
    indices = match mode {
        5 => unroll_strip(&indices),
        6 => unroll_fan(&indices),
        _ => indices,
    };
    let n_over = indices.len() % 3;
    if n_over != 0 {
        builder.note(
            place,
            "one or two indices after the last triangle; left out",
        );
        indices.truncate(indices.len() - n_over);
    }
    if indices.is_empty() {
        return Ok(None);
    }
    // Exporters let many primitives share one long vertex list. Take the used ones only, or a
    // small file could ask for (primitives x vertices) of memory.
    let mut used: Option<Vec<u32>> = None;
    if def.indices.is_some() {
        let distinct = distinct(&indices, n_vertices);
        builder.charge_vertices(place, distinct.len() as u64)?;
        if distinct.len() as u64 != n_vertices {
            for i in &mut indices {
                // Found: `distinct` holds every index.
                *i = distinct.binary_search(i).unwrap_or(0) as u32;
            }
            used = Some(distinct);
        }
    }
    let material = match def.material {
        None => None,
        Some(m) => match materials.get(m as usize) {
            Some(&m) => Some(m),
            None => return Err(builder.malformed(place, format!("no material {m}"))),
        },
    };
    let used = used.as_deref();
    let n_used = used.map_or(n_vertices, |u| u.len() as u64);
    builder.charge_memory(place, n_used, bytes_a_vertex(&def.attributes))?;
    let mut primitive = Primitive {
        positions: positions.read(used, 0.0),
        indices,
        material,
        ..Primitive::default()
    };
    let attribute = |name: &str, shapes: &[&str]| -> Result<_, ImportError> {
        let Some(&index) = def.attributes.get(name) else {
            return Ok(None);
        };
        let elements = document
            .elements(index, shapes)
            .map_err(|problem| data_error(builder, place, &format!("{name}: {problem}")))?;
        if elements.count != n_vertices {
            return Err(builder.malformed(
                place,
                format!(
                    "{name} has {} elements and POSITION {n_vertices}",
                    elements.count
                ),
            ));
        }
        Ok(Some(elements))
    };
    let normals = attribute("NORMAL", &["VEC3"])?;
    let tangents = attribute("TANGENT", &["VEC4"])?;
    let colors = attribute("COLOR_0", &["VEC3", "VEC4"])?;
    let mut uvs: Vec<Elements<'_>> = Vec::new();
    while uvs.len() < MAX_UV_SETS {
        match attribute(&format!("TEXCOORD_{}", uvs.len()), &["VEC2"])? {
            Some(set) => uvs.push(set),
            None => break,
        }
    }
    let n_kept = 1 + uvs.len() + [&normals, &tangents, &colors].into_iter().flatten().count();
    if n_kept < def.attributes.len() {
        builder.note(
            place,
            "attributes other than position, normal, tangent, texture coordinates and \
             the first color; left out",
        );
    }
    if def.targets.is_some() {
        builder.note(place, "morph targets; left out");
    }
    let mut n_repaired = 0;
    primitive.normals = cleaned(normals.map(|e| e.read(used, 0.0)), &mut n_repaired);
    primitive.tangents = cleaned(tangents.map(|e| e.read(used, 1.0)), &mut n_repaired);
    primitive.colors = cleaned(colors.map(|e| e.read(used, 1.0)), &mut n_repaired);
    for set in uvs {
        primitive
            .uvs
            .push(cleaned(Some(set.read(used, 0.0)), &mut n_repaired));
    }
    if n_repaired > 0 {
        builder.note(
            place,
            "normals, tangents, colors or texture coordinates that are no finite numbers; set to 0",
        );
    }
    builder.drop_nonfinite(place, &mut primitive);
    Ok(Some(primitive))
}

/// Bytes that the attributes of a vertex take here.
fn bytes_a_vertex(attributes: &BTreeMap<String, u32>) -> u64 {
    let bytes = |name: &String| match name.as_str() {
        "POSITION" | "NORMAL" => 12,
        "TANGENT" | "COLOR_0" => 16,
        _ if name.starts_with("TEXCOORD_") => 8,
        _ => 0,
    };
    attributes.keys().map(bytes).sum()
}

/// The indices in use, increasing.
fn distinct(indices: &[u32], n_vertices: u64) -> Vec<u32> {
    // Marking is several times faster, but its time goes with all vertices, used or not.
    if n_vertices <= 16 * indices.len() as u64 {
        let mut is_used = vec![false; n_vertices as usize];
        indices.iter().for_each(|&i| is_used[i as usize] = true);
        return (0..n_vertices as u32)
            .filter(|&i| is_used[i as usize])
            .collect();
    }
    let mut sorted = indices.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    sorted
}

/// The values, each that is no finite number replaced by zero.
fn cleaned<const N: usize>(values: Option<Vec<[f32; N]>>, n_repaired: &mut u64) -> Vec<[f32; N]> {
    let mut values = values.unwrap_or_default();
    for c in values.iter_mut().flatten() {
        if !c.is_finite() {
            *c = 0.0;
            *n_repaired += 1;
        }
    }
    values
}

/// Triangles of a strip; those with two equal indices only join its pieces.
fn unroll_strip(strip: &[u32]) -> Vec<u32> {
    strip
        .windows(3)
        .enumerate()
        .filter(|(_, t)| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
        .flat_map(|(i, t)| {
            if i % 2 == 0 {
                [t[0], t[1], t[2]]
            } else {
                [t[1], t[0], t[2]]
            }
        })
        .collect()
}

fn unroll_fan(fan: &[u32]) -> Vec<u32> {
    let Some((&hub, rim)) = fan.split_first() else {
        return Vec::new();
    };
    rim.windows(2)
        .flat_map(|pair| [hub, pair[0], pair[1]])
        .collect()
}

/// Transforms of `EXT_mesh_gpu_instancing`.
pub(super) fn read_instances(
    document: &Document<'_>,
    instancing: &Instancing,
    place: &str,
    builder: &mut Builder<'_>,
) -> Result<Vec<DMat4>, ImportError> {
    let mut count: Option<u64> = None;
    let mut attribute = |name: &str, shape: &str| -> Result<Option<Elements<'_>>, String> {
        let Some(&index) = instancing.attributes.get(name) else {
            return Ok(None);
        };
        let elements = document.elements(index, &[shape])?;
        if count.is_some_and(|n| n != elements.count) {
            return Err("instance attributes differ in length".into());
        }
        count = Some(elements.count);
        Ok(Some(elements))
    };
    let mut attribute =
        |name, shape| attribute(name, shape).map_err(|problem| builder.malformed(place, problem));
    let translations = attribute("TRANSLATION", "VEC3")?;
    let rotations = attribute("ROTATION", "VEC4")?;
    let scales = attribute("SCALE", "VEC3")?;
    let Some(n) = count else {
        // Nothing placed by attributes that are known: one instance, where the node is.
        return Ok(vec![DMat4::IDENTITY]);
    };
    builder.check_objects(place, n)?;
    builder.charge_memory(place, n, 2 * size_of::<DMat4>() as u64 + 40)?;
    let translations: Option<Vec<[f32; 3]>> = translations.map(|e| e.read(None, 0.0));
    let rotations: Option<Vec<[f32; 4]>> = rotations.map(|e| e.read(None, 0.0));
    let scales: Option<Vec<[f32; 3]>> = scales.map(|e| e.read(None, 0.0));
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    Ok((0..n as usize)
        .map(|i| {
            compose(
                translations.as_ref().map_or(DVec3::ZERO, |t| vector(t[i])),
                rotations
                    .as_ref()
                    .map_or([0.0, 0.0, 0.0, 1.0], |r| r[i].map(f64::from)),
                scales.as_ref().map_or(DVec3::ONE, |s| vector(s[i])),
            )
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_the_winding() {
        assert_eq!(unroll_strip(&[0, 1, 2, 3]), [0, 1, 2, 2, 1, 3]);
        assert_eq!(unroll_strip(&[0, 1, 2, 2, 3, 3, 4, 5]), [0, 1, 2, 4, 3, 5]);
        assert_eq!(unroll_fan(&[7, 1, 2, 3]), [7, 1, 2, 7, 2, 3]);
        assert!(unroll_fan(&[]).is_empty());
        assert!(unroll_strip(&[1, 2]).is_empty());
    }
}
