//! `KHR_draco_mesh_compression`: the geometry of a primitive as one Draco bitstream.

use super::accessor::{Component, Document};
use super::json::DracoDef;
use crate::ImportError;
use crate::builder::Builder;
use draco_core::draco_types::DataType;
use draco_core::geometry_indices::PointIndex;
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute};
use std::collections::BTreeMap;

/// A decoded primitive.
pub(super) struct DracoMesh {
    /// Three a triangle.
    pub(super) indices: Vec<u32>,
    /// By name of glTF, those that the bitstream holds.
    pub(super) attributes: BTreeMap<String, DracoAttribute>,
}

/// One value a vertex, without gaps.
pub(super) struct DracoAttribute {
    pub(super) component: Component,
    pub(super) n_components: usize,
    pub(super) bytes: Vec<u8>,
}

/// Bytes that a face takes while it is decoded, at least.
const FACE_BYTES: u64 = 24;

/// Decodes a primitive, within the memory and the counts that are left.
pub(super) fn decode(
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

/// A value a vertex; Draco stores equal ones once.
fn unpacked(attribute: &PointAttribute, n_vertices: usize) -> Result<DracoAttribute, String> {
    let component = match attribute.data_type() {
        DataType::Int8 => Component::I8,
        DataType::Uint8 => Component::U8,
        DataType::Int16 => Component::I16,
        DataType::Uint16 => Component::U16,
        DataType::Uint32 => Component::U32,
        DataType::Float32 => Component::F32,
        other => return Err(format!("is {other:?}, which glTF does not know")),
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
    Ok(DracoAttribute {
        component,
        n_components,
        bytes,
    })
}
