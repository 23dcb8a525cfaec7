//! `KHR_draco_mesh_compression`: the geometry of a primitive as one Draco bitstream.

#[cfg(feature = "draco")]
mod bitstream;

#[cfg(feature = "draco")]
pub(super) use bitstream::decode;

use super::accessor::Component;
use std::collections::BTreeMap;

/// A decoded primitive.
pub(super) struct DracoMesh {
    /// Three per triangle.
    pub(super) indices: Vec<u32>,
    /// Attributes in the bitstream, by glTF name.
    pub(super) attributes: BTreeMap<String, DracoAttribute>,
}

/// One value per vertex, without gaps.
pub(super) struct DracoAttribute {
    pub(super) component: Component,
    pub(super) n_components: usize,
    pub(super) bytes: Vec<u8>,
    /// Width of the grid that its floats were rounded to; 0 if none was detected.
    pub(super) step: f32,
}

/// Refuses a compressed primitive: this build has no decoder.
#[cfg(not(feature = "draco"))]
pub(super) fn decode(
    _: &super::accessor::Document<'_>,
    _: &super::json::DracoDef,
    place: &str,
    builder: &mut crate::builder::Builder<'_>,
) -> Result<DracoMesh, crate::ImportError> {
    Err(builder.malformed(place, crate::not_built("Draco", "draco")))
}
