//! The head of a packed world: all that is always in memory.

use enfilade_cpg::wire::{WireError, decode_glb, encode_glb};
use enfilade_cpg::{CellId, World};
use enfilade_runtime::{Sight, SightError, SightSkeleton};
use serde::{Deserialize, Serialize};

use crate::{Catalog, PieceId, PieceSizes, WorldPieces, images_of};

/// First bytes of a head.
const MAGIC: [u8; 8] = *b"enfpack\0";

/// Version of packed worlds that this program writes. It reads version 1, too, in which pieces lie in the order of their ids.
const VERSION: u32 = 2;

/// Bytes before the compressed body: magic, version, sizes and hash of the body.
const FRONT: usize = 8 + 4 + 8 + 8 + 16;

/// Largest head, packed. [Units: bytes]
const MOST_PACKED: u64 = 256 << 20;

/// Largest head or piece, unpacked. [Units: bytes]
const MOST: u64 = 4 << 30;

/// Size to which any part may expand, whatever it takes packed. [Units: bytes]
const MOST_FREE: u64 = 16 << 20;

/// Most bytes of a head for each packed one. Hashes of pieces and coordinates are half of it: heads take 2 to 6.
const HEAD_RATIO: u64 = 64;

/// Most bytes of a piece for each packed one.
const PIECE_RATIO: u64 = 512;

/// The reasons why a world cannot be packed, or bytes are not a packed world.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackError {
    /// The world, or a piece of it.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// The world cannot be prepared for queries.
    #[error(transparent)]
    Sight(#[from] SightError),
    /// Bytes of something else.
    #[error("this is not a packed world; make one with `enfilade pack IN.glb -o OUT.enf`")]
    NotPacked,
    /// A packed world of another version.
    #[error(
        "this packed world has version {0}, but this program reads versions up to {VERSION}; pack the world again"
    )]
    Version(u32),
    /// Damage.
    #[error("the packed world is damaged: {0}; pack the world again, or fetch it again")]
    Damaged(String),
    /// A head beyond all proportion.
    #[error("its head takes more than 256 MiB; divide the world, and pack the parts")]
    TooLarge,
    /// A file or folder.
    #[error("{path}: {problem}")]
    File {
        /// The path.
        path: String,
        /// The problem.
        problem: String,
    },
}

pub(crate) fn damaged(problem: impl Into<String>) -> PackError {
    PackError::Damaged(problem.into())
}

/// Returns the hash that guards bytes against damage: XXH3 with 128 bits. It does not detect forgery.
pub(crate) fn hash_of(bytes: &[u8]) -> [u8; 16] {
    twox_hash::XxHash3_128::oneshot(bytes).to_le_bytes()
}

/// Place of a piece among all packed pieces, and its hash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PieceAt {
    /// Offset of its first byte among the packed pieces. [Units: bytes]
    pub offset: u64,
    /// Hash of its packed bytes.
    pub hash: [u8; 16],
}

/// The head of a packed world: graph, locator, potentially visible set, placed objects, boxes of what is drawn, and the list of
/// pieces.
#[derive(Clone, Debug)]
pub struct PackedHead {
    /// The world without triangles and pictures.
    pub world: World,
    /// Boxes of chunks and objects, for [`Sight::build_hollow`].
    pub skeleton: SightSkeleton,
    /// Pieces and the cells that need them.
    pub catalog: Catalog,
    /// For each piece, its place.
    pub places: Vec<PieceAt>,
    /// The part of the file that is in no piece; only for putting it together again.
    pub(crate) rest: PieceAt,
    pub(crate) rest_packed: u64,
    /// Size and hash of the file that was packed.
    pub(crate) file: (u64, [u8; 16]),
}

/// The list of pieces as written.
#[derive(Serialize, Deserialize)]
struct Listed {
    /// For each piece: offset, packed size, size in memory.
    pieces: Vec<[u64; 3]>,
    hashes: Vec<[u8; 16]>,
    /// For each cell, its pieces.
    cells: Vec<Vec<u32>>,
    /// For each batch, its material: the hollow world has no triangles to say so.
    materials: Vec<Option<u32>>,
    rest: ([u64; 2], [u8; 16]),
    file: (u64, [u8; 16]),
}

impl Listed {
    /// Checks that the pieces lie one after the other, in any order, are those into which the world falls, and that each cell lists all that
    /// the head knows it needs: only the pictures of objects depend on triangles.
    fn check(&self, world: &World) -> Result<(), PackError> {
        let mut places: Vec<_> = self.pieces.iter().map(|[at, n, _]| (*at, *n)).collect();
        places.sort_unstable();
        let mut end = Some(0_u64);
        for (offset, n_packed) in &places {
            if end != Some(*offset) {
                return Err(damaged("its pieces do not lie one after the other"));
            }
            end = offset.checked_add(*n_packed);
        }
        if end != Some(self.rest.0[0]) {
            return Err(damaged("its rest does not follow its pieces"));
        }
        let needs = WorldPieces::of_world(world, &|material| images_of(world, material)).catalog;
        let n = self.pieces.len();
        if needs.pieces().len() != n {
            let expected = needs.pieces().len();
            let problem = format!("it lists {n} pieces, and its world falls into {expected}");
            return Err(damaged(problem));
        }
        for (cell, row) in (0..).zip(&self.cells) {
            let is_list = row.is_sorted_by(|a, b| a < b) && row.iter().all(|p| (*p as usize) < n);
            let lacks = |p: &&PieceId| row.binary_search(&p.0).is_err();
            if !is_list {
                return Err(damaged(format!("cell {cell} has no list of its pieces")));
            }
            if let Some(piece) = needs.pieces_of(CellId(cell)).iter().find(lacks) {
                let piece = piece.0;
                return Err(damaged(format!(
                    "cell {cell} needs piece {piece}, and does not list it"
                )));
            }
        }
        Ok(())
    }
}

impl PackedHead {
    /// Prepares the world for queries: answers are those of the whole world.
    ///
    /// # Errors
    ///
    /// A head that was put together from different worlds.
    pub fn sight(&self) -> Result<Sight, SightError> {
        Sight::build_hollow(&self.world, self.skeleton.clone())
    }

    /// Encodes the body of a head, as [`PackedHead::decode_body`] reads it.
    ///
    /// # Errors
    ///
    /// A world that breaks invariants.
    #[doc(hidden)]
    pub fn encode_body(&self) -> Result<Vec<u8>, PackError> {
        let pieces = self.catalog.pieces().iter().zip(&self.places);
        let of_cell = |c: u32| {
            let pieces = self.catalog.pieces_of(CellId(c));
            pieces.iter().map(|p| p.0).collect()
        };
        let batches = self.world.batches.iter();
        let listed = Listed {
            pieces: pieces
                .map(|(piece, at)| [at.offset, piece.n_packed, piece.n_resident])
                .collect(),
            hashes: self.places.iter().map(|at| at.hash).collect(),
            cells: (0..self.catalog.n_cells() as u32).map(of_cell).collect(),
            materials: batches.map(|b| b.primitive.material).collect(),
            rest: ([self.rest.offset, self.rest_packed], self.rest.hash),
            file: self.file,
        };
        let listed = serde_json::to_vec(&listed).map_err(|e| damaged(e.to_string()))?;
        let sections = [listed, encode_glb(&self.world)?, self.skeleton.encode()];
        let mut body = Vec::new();
        for section in &sections {
            body.extend((section.len() as u64).to_le_bytes());
            body.extend(section);
        }
        Ok(body)
    }

    /// Encodes the head.
    ///
    /// # Errors
    ///
    /// A world that breaks invariants.
    #[doc(hidden)]
    pub fn encode(&self) -> Result<Vec<u8>, PackError> {
        let body = self.encode_body()?;
        let packed = compressed(&body, HEAD_RATIO)?;
        if packed.len() as u64 > MOST_PACKED {
            return Err(PackError::TooLarge);
        }
        let mut out = MAGIC.to_vec();
        out.extend(VERSION.to_le_bytes());
        out.extend((packed.len() as u64).to_le_bytes());
        out.extend((body.len() as u64).to_le_bytes());
        out.extend(hash_of(&packed));
        out.extend(packed);
        Ok(out)
    }

    /// Returns the size of the head that begins with `bytes`, of which 44 are enough. [Units: bytes]
    ///
    /// # Errors
    ///
    /// Bytes of something else, or of another version.
    pub fn size(bytes: &[u8]) -> Result<u64, PackError> {
        let front = bytes.get(..FRONT).ok_or(PackError::NotPacked)?;
        if front[..8] != MAGIC {
            return Err(PackError::NotPacked);
        }
        let version = u32::from_le_bytes([front[8], front[9], front[10], front[11]]);
        if !(1..=VERSION).contains(&version) {
            return Err(PackError::Version(version));
        }
        let n = word(front, 12).saturating_add(FRONT as u64);
        (n <= MOST_PACKED + FRONT as u64)
            .then_some(n)
            .ok_or(PackError::TooLarge)
    }

    /// Decodes a head; bytes after it are ignored. Safe on hostile bytes: no panic, memory of a small multiple of 16 MiB and 64
    /// times their number.
    ///
    /// # Errors
    ///
    /// Bytes of something else, another version, damage.
    pub fn decode(bytes: &[u8]) -> Result<Self, PackError> {
        let n = Self::size(bytes)?;
        let packed = usize::try_from(n).ok().and_then(|n| bytes.get(FRONT..n));
        let packed = packed.ok_or_else(|| damaged("its head is cut off"))?;
        if bytes[FRONT - 16..FRONT] != hash_of(packed) {
            return Err(damaged("its head has another hash than was packed"));
        }
        Self::decode_body(&expanded(packed, word(bytes, 20), HEAD_RATIO)?)
    }

    /// Decodes the body of a head, unpacked: for fuzzers, which would not get past its hash.
    ///
    /// # Errors
    ///
    /// Damage.
    #[doc(hidden)]
    pub fn decode_body(body: &[u8]) -> Result<Self, PackError> {
        let mut rest = body;
        let mut section = || {
            let (n, after) = rest.split_first_chunk::<8>()?;
            let n = usize::try_from(u64::from_le_bytes(*n)).ok()?;
            let (own, after) = after.split_at_checked(n)?;
            rest = after;
            Some(own)
        };
        let cut = || damaged("a section of its head is cut off");
        let listed: Listed = serde_json::from_slice(section().ok_or_else(cut)?)
            .map_err(|e| damaged(e.to_string()))?;
        let mut world = decode_glb(section().ok_or_else(cut)?)?;
        let skeleton = SightSkeleton::decode(section().ok_or_else(cut)?)
            .map_err(|e| damaged(e.to_string()))?;
        let n_materials = world.materials.len() as u32;
        let is_whole = listed.hashes.len() == listed.pieces.len()
            && listed.cells.len() == world.graph.cells.len()
            && listed.materials.len() == world.batches.len()
            && listed.materials.iter().flatten().all(|m| *m < n_materials);
        if !is_whole {
            return Err(damaged("its list of pieces is of another world"));
        }
        for (batch, material) in world.batches.iter_mut().zip(&listed.materials) {
            batch.primitive.material = *material;
        }
        listed.check(&world)?;
        let pieces = listed
            .pieces
            .iter()
            .map(|[_, n_packed, n_resident]| PieceSizes {
                n_packed: *n_packed,
                n_resident: *n_resident,
            });
        let rows: Vec<Vec<PieceId>> = (listed.cells.iter())
            .map(|row| row.iter().copied().map(PieceId).collect())
            .collect();
        let places = listed.pieces.iter().zip(&listed.hashes);
        Ok(Self {
            world,
            skeleton,
            catalog: Catalog::new(pieces.collect(), &rows),
            places: places
                .map(|([offset, ..], hash)| PieceAt {
                    offset: *offset,
                    hash: *hash,
                })
                .collect(),
            rest: PieceAt {
                offset: listed.rest.0[0],
                hash: listed.rest.1,
            },
            rest_packed: listed.rest.0[1],
            file: listed.file,
        })
    }
}

fn word(bytes: &[u8], at: usize) -> u64 {
    let mut word = [0; 8];
    word.copy_from_slice(&bytes[at..at + 8]);
    u64::from_le_bytes(word)
}

/// Returns the most bytes that packed ones may expand to.
fn most_of(packed: &[u8], ratio: u64) -> u64 {
    MOST_FREE.saturating_add(ratio.saturating_mul(packed.len() as u64))
}

/// Packs bytes so that they [may be expanded](most_of).
fn compressed(bytes: &[u8], ratio: u64) -> Result<Vec<u8>, PackError> {
    const LEVEL: i32 = 9;
    /// First bytes of a frame that decoders skip.
    const SKIPPED: [u8; 4] = 0x184D_2A50_u32.to_le_bytes();
    let mut packed = zstd::bulk::compress(bytes, LEVEL).map_err(|e| damaged(e.to_string()))?;
    let lacks = (bytes.len() as u64).saturating_sub(most_of(&packed, ratio));
    if lacks > 0 {
        // Tens of megabytes of zeros: rare enough to be filled up.
        let n = lacks.div_ceil(ratio) as u32;
        packed.extend(SKIPPED);
        packed.extend(n.to_le_bytes());
        packed.resize(packed.len() + n as usize, 0);
    }
    Ok(packed)
}

/// Packs the bytes of a piece.
pub(crate) fn compressed_piece(bytes: &[u8]) -> Result<Vec<u8>, PackError> {
    compressed(bytes, PIECE_RATIO)
}

/// Unpacks the bytes of a piece, of a known size.
pub(crate) fn expanded_piece(packed: &[u8], n: u64) -> Result<Vec<u8>, PackError> {
    expanded(packed, n, PIECE_RATIO)
}

/// Unpacks bytes of a known size, at most `ratio` for each beside [`MOST_FREE`].
fn expanded(packed: &[u8], n: u64, ratio: u64) -> Result<Vec<u8>, PackError> {
    if n > MOST.min(most_of(packed, ratio)) {
        return Err(damaged(format!(
            "{n} bytes are more than a part of it that takes {} expands to",
            packed.len()
        )));
    }
    // Read bit by bit: a false size allocates no more than the bytes hold.
    let mut out = Vec::new();
    let reader = zstd::stream::read::Decoder::new(packed).map_err(|e| damaged(e.to_string()))?;
    let mut limited = std::io::Read::take(reader, n.saturating_add(1));
    std::io::Read::read_to_end(&mut limited, &mut out).map_err(|e| damaged(e.to_string()))?;
    if out.len() as u64 != n {
        return Err(damaged("a part of it has another size than was packed"));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_packed_so_that_they_may_be_expanded() {
        for n in [0, 1 << 10, (MOST_FREE as usize) + (40 << 20)] {
            let zeros = vec![0; n];
            let packed = compressed_piece(&zeros).unwrap();
            assert!(expanded_piece(&packed, n as u64).unwrap() == zeros);
        }
        // Others than we pack more tightly.
        let tight = zstd::bulk::compress(&vec![0; 56 << 20], 9).unwrap();
        let why = expanded_piece(&tight, 56 << 20).unwrap_err().to_string();
        assert!(why.contains("more than a part of it that takes"), "{why}");
    }
}
