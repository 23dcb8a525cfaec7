//! Decodes Draco bitstreams.

use super::super::accessor::{Component, Document};
use super::super::json::DracoDef;
use crate::ImportError;
use crate::builder::Builder;
use draco_core::draco_types::DataType;
use draco_core::geometry_indices::PointIndex;
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute};
use std::collections::BTreeMap;

use super::{DracoAttribute, DracoMesh};

/// Least memory of a face during decoding. [Units: bytes]
const FACE_BYTES: u64 = 24;

/// Decodes a primitive, within the remaining memory and counts.
pub(in crate::gltf) fn decode(
    document: &Document<'_>,
    def: &DracoDef,
    place: &str,
    builder: &mut Builder<'_>,
) -> Result<DracoMesh, ImportError> {
    let (packed, _) = document
        .view(def.buffer_view)
        .map_err(|problem| builder.malformed(place, format!("Draco: {problem}")))?;
    let n_left = builder.memory_left();
    let limits = DecodeLimits::default()
        .with_max_points(builder.limits().max_vertices)
        .with_max_faces(builder.limits().max_triangles.min(n_left / FACE_BYTES))
        .with_max_decoded_bytes(n_left);
    let mut mesh = Mesh::new();
    let mut buffer = DecoderBuffer::new(packed).with_limits(limits);
    MeshDecoder::new()
        .decode(&mut buffer, &mut mesh)
        .map_err(|e| builder.malformed(place, format!("Draco: {e}; export the file again")))?;
    let n_vertices = mesh.num_points();
    let mut attributes = BTreeMap::new();
    let mut n_plain = 12 * mesh.num_faces() as u64;
    builder.charge_memory(place, mesh.num_faces() as u64, 12)?;
    for (name, &id) in &def.attributes {
        let attribute = mesh
            .attribute_by_unique_id(id)
            .ok_or_else(|| builder.malformed(place, format!("Draco: no attribute {id}, {name}")))?;
        let n_bytes = attribute.num_components() as u64 * 4;
        builder.charge_memory(place, n_vertices as u64, n_bytes)?;
        let attribute = unpacked(attribute, n_vertices)
            .map_err(|problem| builder.malformed(place, format!("Draco: {name}: {problem}")))?;
        n_plain += attribute.bytes.len() as u64;
        attributes.insert(name.clone(), attribute);
    }
    builder.add_unpacked_bytes(packed.len() as u64, n_plain);
    let corners = mesh.faces().iter().flat_map(|face| face.map(|p| p.0));
    Ok(DracoMesh {
        indices: corners.collect(),
        attributes,
    })
}

/// Returns one value per vertex; Draco stores equal ones once.
fn unpacked(attribute: &PointAttribute, n_vertices: usize) -> Result<DracoAttribute, String> {
    let component = match attribute.data_type() {
        DataType::Int8 => Component::I8,
        DataType::Uint8 => Component::U8,
        DataType::Int16 => Component::I16,
        DataType::Uint16 => Component::U16,
        DataType::Uint32 => Component::U32,
        DataType::Float32 => Component::F32,
        other => return Err(format!("is {other:?}, which glTF does not support")),
    };
    let n_components = usize::from(attribute.num_components());
    let size = component.size() as usize * n_components;
    let stride = usize::try_from(attribute.byte_stride()).unwrap_or(0);
    let data = attribute.buffer().data();
    let mut bytes = Vec::with_capacity(n_vertices * size);
    for vertex in 0..n_vertices as u32 {
        let start = attribute.mapped_index(PointIndex(vertex)).0 as usize;
        let value = start
            .checked_mul(stride)
            .and_then(|start| data.get(start..start.checked_add(size)?))
            .ok_or_else(|| format!("no value for vertex {vertex}"))?;
        bytes.extend(value);
    }
    let step = match component {
        Component::F32 => step_of(&bytes, n_components),
        _ => 0.0,
    };
    Ok(DracoAttribute {
        component,
        n_components,
        bytes,
        step,
    })
}

/// Usual numbers of bits that encoders round positions to: 11 and 14 are common.
const BITS: std::ops::RangeInclusive<u32> = 8..=20;

/// Returns the width of the coarsest grid that contains all values; 0 if there is none.
///
/// Draco divides the longest edge of the box by `2^bits - 1` and counts from the minimum vertex, and the decoder does
/// not report the number of bits. Values on a grid of fewer bits than in [`BITS`] were not rounded to it: they happen
/// to lie there.
fn step_of(bytes: &[u8], n_components: usize) -> f32 {
    let value = |b: &[u8; 4]| f64::from(f32::from_le_bytes(*b));
    let values: Vec<f64> = bytes.as_chunks::<4>().0.iter().map(value).collect();
    if values.iter().any(|v| !v.is_finite()) {
        return 0.0;
    }
    let mut low = vec![f64::INFINITY; n_components];
    let mut high = vec![f64::NEG_INFINITY; n_components];
    for (i, &v) in values.iter().enumerate() {
        let k = i % n_components;
        (low[k], high[k]) = (low[k].min(v), high[k].max(v));
    }
    let range = low
        .iter()
        .zip(&high)
        .map(|(l, h)| h - l)
        .fold(0.0, f64::max);
    let most = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let is_grid = |step: f64| {
        // Four roundings to f32 precede.
        let noise = 4.0 * most * f64::from(f32::EPSILON) / step;
        let place = |(i, v): (usize, &f64)| (v - low[i % n_components]) / step;
        noise < 0.1
            && values
                .iter()
                .enumerate()
                .map(place)
                .all(|x| (x - x.round()).abs() <= noise)
    };
    let steps = (1..=*BITS.end()).map(|bits| (bits, range / f64::from((1_u32 << bits) - 1)));
    let found = steps.filter(|s| s.1 > 0.0).find(|s| is_grid(s.1));
    found
        .filter(|(bits, _)| BITS.contains(bits))
        .map_or(0.0, |(_, step)| step as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bytes(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    proptest! {
        #[test]
        fn the_grid_that_values_were_rounded_to_is_found(
            bits in BITS.start() + 1..=15,
            range in 1.0f32..60.0,
            low in -1.0f32..1.0,
            places in prop::collection::vec(prop::array::uniform3(0.0f32..1.0), 6..40),
        ) {
            let most = ((1_u32 << bits) - 1) as f32;
            let step = range / most;
            // The ends of the longest edge are on the grid, and so is the minimum vertex.
            let mut values = vec![low; 3];
            values.extend([low + range, low, low]);
            values.extend(places.iter().flatten().map(|x| low + (x * most).round() * step));
            let found = step_of(&bytes(&values), 3);
            prop_assert!((found / step - 1.0).abs() < 1e-3, "{} for {}", found, step);
        }

        #[test]
        fn values_that_were_not_rounded_have_none(
            places in prop::collection::vec(prop::array::uniform3(-9.0f32..9.0), 8..40),
        ) {
            prop_assert_eq!(step_of(&bytes(places.as_flattened()), 3), 0.0);
        }
    }

    #[test]
    fn a_box_and_nonsense_have_none() {
        assert_eq!(step_of(&bytes(&[0.0, 0.0, 0.0, 4.0, 4.0, 0.0]), 3), 0.0);
        assert_eq!(step_of(&bytes(&[1.0; 6]), 3), 0.0);
        assert_eq!(step_of(&bytes(&[f32::NAN, 0.0, 0.0]), 3), 0.0);
        assert_eq!(step_of(&[], 3), 0.0);
    }
}
