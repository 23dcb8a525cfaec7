//! The binary chunk: its layout, and writing it.

use std::borrow::Cow;
use std::collections::BTreeMap;

use enfilade_geom::DVec3;
use enfilade_geom::scene::{Image, Primitive};

use super::json::{self, FLOAT, LINE_STRIP, TRIANGLES, U16, U32, VERTICES};
use super::special::surface;
use super::visible::words;
use crate::World;

/// A part of the buffer that holds one kind of vertex data or indices for all primitives.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    Positions,
    Normals,
    Tangents,
    Uvs,
    Colors,
    Indices16,
    Indices32,
}

impl Section {
    const ALL: [Self; 7] = [
        Self::Positions,
        Self::Normals,
        Self::Tangents,
        Self::Uvs,
        Self::Colors,
        Self::Indices16,
        Self::Indices32,
    ];

    const fn element_size(self) -> u64 {
        match self {
            Self::Positions | Self::Normals => 12,
            Self::Tangents | Self::Colors => 16,
            Self::Uvs => 8,
            Self::Indices16 => 2,
            Self::Indices32 => 4,
        }
    }

    const fn is_indices(self) -> bool {
        matches!(self, Self::Indices16 | Self::Indices32)
    }

    const fn component_type(self) -> u32 {
        match self {
            Self::Indices16 => U16,
            Self::Indices32 => U32,
            _ => FLOAT,
        }
    }

    const fn kind(self) -> &'static str {
        match self {
            Self::Positions | Self::Normals => "VEC3",
            Self::Tangents | Self::Colors => "VEC4",
            Self::Uvs => "VEC2",
            Self::Indices16 | Self::Indices32 => "SCALAR",
        }
    }
}

/// A primitive, and flags for the attributes that can be written.
struct Prepared<'a> {
    primitive: Cow<'a, Primitive>,
    has_normals: bool,
    has_tangents: bool,
    /// Number of texture coordinate sets that the material reads and the primitive lacks; written as zeros.
    n_missing_uvs: usize,
    indices: Section,
}

/// Layout of the buffer.
#[derive(Default)]
pub(super) struct Layout<'a> {
    /// For each material, the number of texture coordinate sets that it reads.
    n_uvs: Vec<usize>,
    prepared: Vec<Prepared<'a>>,
    /// Their `buffer_view` is the section's position in [`Section::ALL`] until sections are closed.
    pub(super) accessors: Vec<json::Accessor>,
    section_len: [u64; Section::ALL.len()],
    pub(super) views: Vec<json::BufferView>,
    pub(super) len: u64,
    pub(super) n_dropped_normals: u32,
    pub(super) n_dropped_tangents: u32,
    pub(super) n_flattened: u32,
}

impl<'a> Layout<'a> {
    /// Makes an empty layout for primitives whose materials read `n_uvs` texture coordinate sets each.
    pub(super) fn new(n_uvs: Vec<usize>) -> Self {
        Self {
            n_uvs,
            ..Self::default()
        }
    }

    pub(super) fn push_mesh(
        &mut self,
        name: &str,
        parts: impl Iterator<Item = Cow<'a, Primitive>>,
    ) -> json::Mesh {
        json::Mesh {
            name: name.to_owned(),
            primitives: parts.map(|p| self.push(p)).collect(),
        }
    }

    fn push(&mut self, primitive: Cow<'a, Primitive>) -> json::Primitive {
        let p = &*primitive;
        let has_normals = !p.normals.is_empty() && p.normals.iter().all(|&n| is_unit(n));
        let are_tangents_fit = p
            .tangents
            .iter()
            .all(|&[x, y, z, w]| is_unit([x, y, z]) && w.abs() == 1.0);
        let has_tangents = has_normals && !p.tangents.is_empty() && are_tangents_fit;
        self.n_dropped_normals += u32::from(!has_normals && !p.normals.is_empty());
        self.n_dropped_tangents += u32::from(!has_tangents && !p.tangents.is_empty());
        let n = p.positions.len();
        // 65,535 restarts a strip, so it cannot be an index.
        let indices = if n <= 65_535 {
            Section::Indices16
        } else {
            Section::Indices32
        };

        let mut attributes = BTreeMap::new();
        let position = self.accessor(Section::Positions, n);
        let (min, max) = extent(&p.positions);
        self.accessors[position as usize].min = Some(min.to_vec());
        self.accessors[position as usize].max = Some(max.to_vec());
        attributes.insert("POSITION".to_owned(), position);
        if has_normals {
            attributes.insert("NORMAL".to_owned(), self.accessor(Section::Normals, n));
        }
        if has_tangents {
            attributes.insert("TANGENT".to_owned(), self.accessor(Section::Tangents, n));
        }
        let n_read = p.material.map_or(0, |m| self.n_uvs[m as usize]);
        let n_missing_uvs = n_read.saturating_sub(p.uvs.len());
        for set in 0..p.uvs.len() + n_missing_uvs {
            attributes.insert(format!("TEXCOORD_{set}"), self.accessor(Section::Uvs, n));
        }
        if !p.colors.is_empty() {
            attributes.insert("COLOR_0".to_owned(), self.accessor(Section::Colors, n));
        }
        let (n_indices, material) = (p.indices.len(), p.material);
        let index_accessor = Some(self.accessor(indices, n_indices));
        self.prepared.push(Prepared {
            primitive,
            has_normals,
            has_tangents,
            n_missing_uvs,
            indices,
        });
        json::Primitive {
            attributes,
            indices: index_accessor,
            material,
            mode: None,
        }
    }

    /// Adds a polyline of at least two points.
    pub(super) fn push_line(&mut self, name: &str, points: &[[f32; 3]]) -> json::Mesh {
        let position = self.accessor(Section::Positions, points.len());
        let (min, max) = extent(points);
        self.accessors[position as usize].min = Some(min.to_vec());
        self.accessors[position as usize].max = Some(max.to_vec());
        self.prepared.push(Prepared {
            primitive: Cow::Owned(Primitive {
                positions: points.to_vec(),
                ..Primitive::default()
            }),
            has_normals: false,
            has_tangents: false,
            n_missing_uvs: 0,
            indices: Section::Indices16,
        });
        json::Mesh {
            name: name.to_owned(),
            primitives: vec![json::Primitive {
                attributes: [("POSITION".to_owned(), position)].into(),
                indices: None,
                material: None,
                mode: Some(LINE_STRIP),
            }],
        }
    }

    fn accessor(&mut self, section: Section, count: usize) -> u32 {
        let slot = section as usize;
        self.accessors.push(json::Accessor {
            buffer_view: Some(slot as u32),
            byte_offset: self.section_len[slot],
            component_type: section.component_type(),
            count: count as u64,
            kind: section.kind().to_owned(),
            min: None,
            max: None,
        });
        self.section_len[slot] += count as u64 * section.element_size();
        self.accessors.len() as u32 - 1
    }

    /// Gives every section in use its buffer view, once all primitives are added.
    pub(super) fn close_sections(&mut self) {
        let mut view_of = [None; Section::ALL.len()];
        for section in Section::ALL {
            let slot = section as usize;
            view_of[slot] = self.view(self.section_len[slot]);
            if let Some(view) = view_of[slot] {
                let view = &mut self.views[view as usize];
                view.target = Some(if section.is_indices() {
                    TRIANGLES
                } else {
                    VERTICES
                });
                view.byte_stride = (!section.is_indices()).then_some(section.element_size());
            }
        }
        for accessor in &mut self.accessors {
            accessor.buffer_view = accessor.buffer_view.and_then(|slot| view_of[slot as usize]);
        }
    }

    /// Reserves `byte_length` bytes; `None` for zero, as glTF does not allow an empty buffer view.
    pub(super) fn view(&mut self, byte_length: u64) -> Option<u32> {
        if byte_length == 0 {
            return None;
        }
        let byte_offset = self.len.next_multiple_of(ALIGNMENT);
        self.len = byte_offset + byte_length;
        self.views.push(json::BufferView {
            buffer: 0,
            byte_offset,
            byte_length,
            byte_stride: None,
            target: None,
        });
        Some(self.views.len() as u32 - 1)
    }

    /// Appends everything in the order in which the views were reserved.
    pub(super) fn write(&self, world: &World, out: &mut Vec<u8>) {
        let start = out.len();
        let mut bulk = Bulk { start, out };
        for section in Section::ALL {
            if self.section_len[section as usize] > 0 {
                bulk.align(ALIGNMENT);
                self.prepared.iter().for_each(|p| bulk.section(section, p));
            }
        }
        for image in &world.images {
            bulk.align(ALIGNMENT);
            bulk.out.extend_from_slice(&image_bytes(image));
        }
        if !world.graph.portals.is_empty() {
            bulk.align(ALIGNMENT);
            for portal in &world.graph.portals {
                bulk.floats(&portal.outline);
                portal.pieces.iter().for_each(|piece| bulk.floats(piece));
            }
        }
        let surfaces = || world.graph.specials.iter().filter_map(surface);
        if surfaces().next().is_some() {
            bulk.align(ALIGNMENT);
            surfaces().flatten().for_each(|piece| bulk.floats(piece));
        }
        let locator = &world.graph.locator;
        if !locator.planes.is_empty() {
            bulk.align(ALIGNMENT);
            for v in locator.planes.as_flattened() {
                bulk.out.extend_from_slice(&v.to_le_bytes());
            }
        }
        if !locator.nodes.is_empty() {
            bulk.align(ALIGNMENT);
            for node in &locator.nodes {
                bulk.out.extend_from_slice(&node.plane.to_le_bytes());
                bulk.out.extend_from_slice(&node.children[0].to_le_bytes());
                bulk.out.extend_from_slice(&node.children[1].to_le_bytes());
            }
        }
        if let Some(pvs) = &world.pvs {
            for words in words(pvs).filter(|w| !w.is_empty()) {
                bulk.align(ALIGNMENT);
                for word in words {
                    bulk.out.extend_from_slice(&word.to_le_bytes());
                }
            }
            if let Some(volumes) = pvs.volumes.as_ref().filter(|v| !v.planes.is_empty()) {
                bulk.align(ALIGNMENT);
                for v in volumes.planes.as_flattened() {
                    bulk.out.extend_from_slice(&v.to_le_bytes());
                }
            }
        }
        if world.batches.iter().any(|b| !b.sources.is_empty()) {
            bulk.align(ALIGNMENT);
            let runs = world.batches.iter().flat_map(|b| b.sources.runs());
            for word in runs.flatten() {
                bulk.out.extend_from_slice(&word.to_le_bytes());
            }
        }
        bulk.align(4);
    }
}

/// Alignment of buffer views; fits `f64` planes as well as vertices.
const ALIGNMENT: u64 = 8;

/// The buffer being written.
struct Bulk<'o> {
    start: usize,
    out: &'o mut Vec<u8>,
}

impl Bulk<'_> {
    fn align(&mut self, to: u64) {
        let len = (self.out.len() - self.start).next_multiple_of(to as usize);
        self.out.resize(self.start + len, 0);
    }

    fn floats<const N: usize>(&mut self, rows: &[[f32; N]]) {
        self.mapped(rows, |v| v);
    }

    fn mapped<const N: usize>(&mut self, rows: &[[f32; N]], f: impl Fn(f32) -> f32) {
        for &v in rows.as_flattened() {
            self.out.extend_from_slice(&f(v).to_le_bytes());
        }
    }

    fn section(&mut self, section: Section, prepared: &Prepared) {
        let p = &*prepared.primitive;
        match section {
            Section::Positions => self.floats(&p.positions),
            Section::Normals if prepared.has_normals => self.floats(&p.normals),
            Section::Tangents if prepared.has_tangents => self.floats(&p.tangents),
            Section::Uvs => {
                for set in &p.uvs {
                    self.mapped(set, |v| if v.is_finite() { v } else { 0.0 });
                }
                let n_zeros = prepared.n_missing_uvs * p.positions.len() * 8;
                self.out.resize(self.out.len() + n_zeros, 0);
            }
            // Comparisons turn NaN into 0, and never leave a negative zero.
            Section::Colors => {
                self.mapped(&p.colors, |v| if v > 0.0 { v.min(1.0) } else { 0.0 });
            }
            Section::Indices16 if prepared.indices == section => {
                for &i in &p.indices {
                    self.out.extend_from_slice(&(i as u16).to_le_bytes());
                }
            }
            Section::Indices32 if prepared.indices == section => {
                for &i in &p.indices {
                    self.out.extend_from_slice(&i.to_le_bytes());
                }
            }
            _ => {}
        }
    }
}

/// One white pixel, as PNG.
const WHITE_PIXEL: [u8; 67] =
    *b"\x89PNG\x0d\x0a\x1a\x0a\x00\x00\x00\x0dIHDR\x00\x00\x00\x01\x00\x00\x00\x01\x08\x00\
    \x00\x00\x00:~\x9bU\x00\x00\x00\x0aIDATx\xdac\xf8\x0f\x00\x01\x01\x01\x00\x1c\xb0\
    \x8c\x99\x00\x00\x00\x00IEND\xaeB`\x82";

pub(super) fn image_bytes(image: &Image) -> Cow<'_, [u8]> {
    if image.bytes.is_empty() {
        Cow::Owned(WHITE_PIXEL.to_vec())
    } else {
        Cow::Borrowed(&image.bytes)
    }
}

/// Returns the image's MIME type: by its first bytes if they are known, otherwise as in the input.
pub(super) fn mime(image: &Image) -> &str {
    let bytes = image_bytes(image);
    if bytes.starts_with(&WHITE_PIXEL[..8]) {
        "image/png"
    } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        "image/jpeg"
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        "image/webp"
    } else if bytes.starts_with(&[0xab, b'K', b'T', b'X', b' ', b'2', b'0', 0xbb]) {
        "image/ktx2"
    } else {
        &image.mime
    }
}

/// Returns `true` if a stored direction counts as of unit length; the Khronos validator allows 0.00674.
fn is_unit(v: [f32; 3]) -> bool {
    (DVec3::from(v.map(f64::from)).length() - 1.0).abs() <= 0.006
}

fn extent(positions: &[[f32; 3]]) -> ([f64; 3], [f64; 3]) {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for p in positions {
        for k in 0..3 {
            // Compared explicitly, as `f32::min` may return either of plus and minus zero.
            if p[k] < min[k] {
                min[k] = p[k];
            }
            if p[k] > max[k] {
                max[k] = p[k];
            }
        }
    }
    (min.map(f64::from), max.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computes CRC-32 bit by bit, as PNG defines it.
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0_u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |c, _| {
                (c >> 1) ^ (0xedb8_8320 * (c & 1))
            })
        })
    }

    #[test]
    fn the_white_pixel_is_a_sound_png() {
        let mut rest = &WHITE_PIXEL[8..];
        let mut kinds = Vec::new();
        while !rest.is_empty() {
            let n = u32::from_be_bytes(rest[..4].try_into().unwrap()) as usize;
            let stored = u32::from_be_bytes(rest[8 + n..12 + n].try_into().unwrap());
            assert_eq!(crc(&rest[4..8 + n]), stored);
            kinds.push(&rest[4..8]);
            rest = &rest[12 + n..];
        }
        assert_eq!(kinds, [b"IHDR", b"IDAT", b"IEND"]);
    }
}
