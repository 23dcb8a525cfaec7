//! A world file in pieces, each readable by itself, and together the same file again.
//!
//! A piece holds the bytes of some accessors or of one image as they are in the file, behind a small JSON that says where they
//! were and what they are. What no piece holds is the *rest*: the JSON chunk, the graph's arrays, gaps. So the file comes back byte
//! for byte, whichever program wrote it. See `docs/packed.md`.

use std::collections::BTreeMap;
use std::ops::Range;

use enfilade_geom::scene::Primitive;
use serde::{Deserialize, Serialize};

use super::arrays::Arrays;
use super::decode::{chunks, decode_glb, json_error};
use super::json::{self, U8, U16};
use super::{WireError, broken};
use crate::{CellId, World};

/// A world file taken apart.
pub struct SplitFile {
    /// The world.
    pub world: World,
    /// First one piece per set of cells, in the order in which batches name them; then one per mesh of objects; then one per
    /// image. Read by [`read_piece`].
    pub pieces: Vec<Vec<u8>>,
    /// All that is in no piece.
    pub rest: Vec<u8>,
}

/// The contents of a piece.
#[derive(Clone, Debug)]
pub enum PieceContent {
    /// The triangles of batches, by index; those without triangles are left out.
    Batches(Vec<(u32, Primitive)>),
    /// The triangles of a mesh of objects.
    Mesh {
        /// Index in [`World::detail_meshes`].
        mesh: u32,
        /// Its primitives, all of them.
        primitives: Vec<Primitive>,
    },
    /// The bytes of an image.
    Image {
        /// Index in [`World::images`].
        image: u32,
        /// Its file.
        bytes: Vec<u8>,
    },
}

/// The head of a piece.
#[derive(Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct PieceHead {
    /// Places of its bytes in the file: offset and length, without gaps in the piece.
    ranges: Vec<[u64; 2]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    batches: Vec<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mesh: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    image: Option<u32>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    primitives: Vec<json::Primitive>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    accessors: Vec<json::Accessor>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    buffer_views: Vec<json::BufferView>,
}

/// Takes a world file apart. Linear in the file; allocates about its size twice, beside the world.
///
/// # Errors
///
/// As [`decode_glb`].
pub fn split_file(bytes: &[u8]) -> Result<SplitFile, WireError> {
    let world = decode_glb(bytes)?;
    let (text, bin) = chunks(bytes)?;
    let root: json::Root = serde_json::from_str(text).map_err(json_error)?;
    let mut splitter = Splitter {
        bytes,
        bin_start: bytes.len() - bin.len(),
        arrays: Arrays::new(&root.accessors, &root.buffer_views, bin),
        root: &root,
        pieces: Vec::new(),
        taken: Vec::new(),
    };
    let graph = &root.extensions.graph;
    let mut sets: BTreeMap<&[CellId], usize> = BTreeMap::new();
    let mut members: Vec<Vec<usize>> = Vec::new();
    for (i, batch) in world.batches.iter().enumerate() {
        let set = *sets.entry(&batch.cells).or_insert_with(|| {
            members.push(Vec::new());
            members.len() - 1
        });
        members[set].push(i);
    }
    for members in &members {
        let mut draft = Draft::default();
        for &i in members {
            if let (Some(mesh), Some(primitive)) =
                (graph.batches[i].mesh, graph.batches[i].primitive)
            {
                draft.head.batches.push(i as u32);
                let of_mesh = &root.meshes[mesh as usize];
                splitter.add(&mut draft, &of_mesh.primitives[primitive as usize])?;
            }
        }
        splitter.finish(draft)?;
    }
    for (i, mesh) in (0..).zip(&graph.detail_meshes) {
        let mut draft = Draft::default();
        draft.head.mesh = Some(i);
        if let Some(mesh) = mesh {
            for primitive in &root.meshes[*mesh as usize].primitives {
                splitter.add(&mut draft, primitive)?;
            }
        }
        splitter.finish(draft)?;
    }
    for (i, image) in (0..).zip(&root.images) {
        let mut draft = Draft::default();
        draft.head.image = Some(i);
        let range = (splitter.arrays).range(image.buffer_view, || format!("image {i}"))?;
        splitter.push(&mut draft, range);
        splitter.finish(draft)?;
    }
    let rest = splitter.rest();
    let pieces = splitter.pieces;
    Ok(SplitFile {
        world,
        pieces,
        rest,
    })
}

/// A piece being made.
#[derive(Default)]
struct Draft {
    head: PieceHead,
    body: Vec<u8>,
    /// The piece's accessor for each of the file.
    accessors: BTreeMap<u32, u32>,
}

struct Splitter<'a> {
    bytes: &'a [u8],
    /// Start of the binary chunk's data in the file.
    bin_start: usize,
    root: &'a json::Root,
    arrays: Arrays<'a>,
    pieces: Vec<Vec<u8>>,
    /// Ranges of the file that pieces hold.
    taken: Vec<Range<usize>>,
}

impl Splitter<'_> {
    /// Adds a range of the buffer to a piece; returns its place there.
    fn push(&mut self, draft: &mut Draft, range: Range<usize>) -> u64 {
        let (start, len) = (self.bin_start + range.start, range.len());
        let at = draft.body.len() as u64;
        draft
            .body
            .extend_from_slice(&self.bytes[start..start + len]);
        draft.head.ranges.push([start as u64, len as u64]);
        self.taken.push(start..start + len);
        at
    }

    /// Adds a primitive with the attributes that worlds have.
    fn add(&mut self, draft: &mut Draft, primitive: &json::Primitive) -> Result<(), WireError> {
        let is_read = |name: &str| {
            ["POSITION", "NORMAL", "TANGENT", "COLOR_0"].contains(&name)
                || name.starts_with("TEXCOORD_")
        };
        let mut attributes = BTreeMap::new();
        for (name, accessor) in primitive
            .attributes
            .iter()
            .filter(|(name, _)| is_read(name))
        {
            attributes.insert(name.clone(), self.accessor(draft, *accessor)?);
        }
        let indices = primitive.indices.map(|i| self.accessor(draft, i));
        draft.head.primitives.push(json::Primitive {
            attributes,
            indices: indices.transpose()?,
            material: primitive.material,
            mode: None,
        });
        Ok(())
    }

    /// Adds an accessor unless it is there; returns its number in the piece.
    fn accessor(&mut self, draft: &mut Draft, accessor: u32) -> Result<u32, WireError> {
        if let Some(&known) = draft.accessors.get(&accessor) {
            return Ok(known);
        }
        let own = &self.root.accessors[accessor as usize];
        let component = match own.component_type {
            U8 => 1,
            U16 => 2,
            _ => 4,
        };
        let n = match own.kind.as_str() {
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 1,
        };
        let (range, stride) = self.arrays.extent(accessor, component * n)?;
        let byte_length = range.len() as u64;
        let byte_offset = self.push(draft, range);
        let number = draft.head.accessors.len() as u32;
        draft.head.buffer_views.push(json::BufferView {
            buffer: 0,
            byte_offset,
            byte_length,
            byte_stride: (stride != component * n).then_some(stride as u64),
            target: None,
        });
        draft.head.accessors.push(json::Accessor {
            buffer_view: Some(number),
            byte_offset: 0,
            component_type: own.component_type,
            count: own.count,
            kind: own.kind.clone(),
            min: None,
            max: None,
        });
        draft.accessors.insert(accessor, number);
        Ok(number)
    }

    fn finish(&mut self, draft: Draft) -> Result<(), WireError> {
        let text = serde_json::to_vec(&draft.head).map_err(json_error)?;
        let mut piece = Vec::with_capacity(4 + text.len() + draft.body.len());
        piece.extend((text.len() as u32).to_le_bytes());
        piece.extend(text);
        piece.extend(draft.body);
        self.pieces.push(piece);
        Ok(())
    }

    /// Returns what is in no piece: as a piece without contents.
    fn rest(&mut self) -> Vec<u8> {
        self.taken.sort_unstable_by_key(|r| (r.start, r.end));
        let (mut ranges, mut body, mut end) = (Vec::new(), Vec::new(), 0);
        let n = self.bytes.len();
        for range in self.taken.iter().chain(std::iter::once(&(n..n))) {
            if range.start > end {
                ranges.push([end as u64, (range.start - end) as u64]);
                body.extend_from_slice(&self.bytes[end..range.start]);
            }
            end = end.max(range.end);
        }
        let head = PieceHead {
            ranges,
            ..PieceHead::default()
        };
        let text = serde_json::to_vec(&head).unwrap_or_default();
        let mut piece = (text.len() as u32).to_le_bytes().to_vec();
        piece.extend(text);
        piece.extend(body);
        piece
    }
}

/// Reads a piece. Safe on hostile bytes: no panic, memory within a small factor of the piece.
///
/// # Errors
///
/// Damage, with its place.
pub fn read_piece(piece: &[u8]) -> Result<PieceContent, WireError> {
    let (head, body) = head_of(piece)?;
    if let Some(image) = head.image {
        let bytes = body.to_vec();
        return Ok(PieceContent::Image { image, bytes });
    }
    let mut arrays = Arrays::new(&head.accessors, &head.buffer_views, body);
    let primitives = head.primitives.iter().map(|p| arrays.primitive(p));
    let primitives = primitives.collect::<Result<Vec<_>, _>>()?;
    // Accessors were checked as those of a file are; indices are, too.
    for primitive in &primitives {
        let n = primitive.positions.len() as u32;
        let attributes = [
            primitive.normals.len(),
            primitive.tangents.len(),
            primitive.colors.len(),
        ];
        let uvs = primitive.uvs.iter().map(Vec::len);
        let fits = |len: usize| len == 0 || len as u32 == n;
        let is_whole = attributes.into_iter().chain(uvs).all(fits)
            && primitive.indices.len() % 3 == 0
            && primitive.indices.iter().all(|i| *i < n);
        if !is_whole {
            return Err(broken(
                "a piece",
                "its vertices and indices do not fit together",
            ));
        }
    }
    if let Some(mesh) = head.mesh {
        return Ok(PieceContent::Mesh { mesh, primitives });
    }
    if head.batches.len() != primitives.len() {
        return Err(broken("a piece", "has not one primitive per batch"));
    }
    let batches = head.batches.into_iter().zip(primitives);
    Ok(PieceContent::Batches(batches.collect()))
}

/// Puts a file of `len` bytes together from its rest and its pieces, in any order.
///
/// # Errors
///
/// Damage; pieces that are missing, or not of the same file.
pub fn join_file<'p>(
    len: u64,
    pieces: impl IntoIterator<Item = &'p [u8]>,
) -> Result<Vec<u8>, WireError> {
    let mut parts: Vec<(u64, &[u8])> = Vec::new();
    for piece in pieces {
        let (head, mut body) = head_of(piece)?;
        for [at, n] in head.ranges {
            let part = usize::try_from(n)
                .ok()
                .and_then(|n| body.split_at_checked(n));
            let (part, left) = part.ok_or_else(|| broken("a piece", "is cut off"))?;
            parts.push((at, part));
            body = left;
        }
        if !body.is_empty() {
            return Err(broken("a piece", "is longer than its head says"));
        }
    }
    parts.sort_by_key(|(at, _)| *at);
    let mut out = Vec::new();
    for (at, part) in parts {
        let gap = || broken(format!("byte {}", out.len()), "is in no piece");
        let known = (out.len() as u64).checked_sub(at).ok_or_else(gap)?;
        // Arrays that several pieces share are in all of them.
        if let Some(new) = part.get(usize::try_from(known).unwrap_or(usize::MAX)..) {
            out.extend_from_slice(new);
        }
    }
    if out.len() as u64 != len {
        let problem = format!("its pieces hold {} bytes of {len}", out.len());
        return Err(broken("the file", problem));
    }
    Ok(out)
}

fn head_of(piece: &[u8]) -> Result<(PieceHead, &[u8]), WireError> {
    let short = || broken("a piece", "is cut off");
    let (n, rest) = piece.split_first_chunk::<4>().ok_or_else(short)?;
    let n = u32::from_le_bytes(*n) as usize;
    let (text, body) = rest.split_at_checked(n).ok_or_else(short)?;
    let head: PieceHead = serde_json::from_slice(text).map_err(json_error)?;
    Ok((head, body))
}
