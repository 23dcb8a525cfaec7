//! World file → packed world, and back.

use enfilade_cpg::wire::{SplitFile, join_file, split_file};
use enfilade_cpg::{CellId, PortalKind};
use enfilade_runtime::{Sight, SightSkeleton, SightState, Start};

use crate::head::{
    PackError, PackedHead, PieceAt, compressed_piece, damaged, expanded_piece, hash_of,
};
use crate::{Catalog, PieceId, PieceSizes, WorldPieces, images_of};

/// A packed world in memory.
#[derive(Clone, Debug)]
pub struct PackedWorld {
    /// Its head.
    pub head: PackedHead,
    /// The packed pieces, one after the other, and then the rest.
    pub(crate) body: Vec<u8>,
}

impl PackedWorld {
    /// Packs a world file. Every triangle and picture is in one piece; [`PackedWorld::unpack`] gives the file back byte for byte.
    /// Takes memory of about four times the file, and time linear in it.
    ///
    /// # Errors
    ///
    /// A file of something else.
    pub fn pack(file: &[u8]) -> Result<Self, PackError> {
        let Divided {
            mut head,
            pieces,
            rest,
        } = Divided::of(file)?;
        let mut body = Vec::new();
        let mut sizes = vec![0; pieces.len()];
        head.places = vec![NOWHERE; pieces.len()];
        for piece in in_order_of_a_walk(&head)? {
            let packed = compressed_piece(&pieces[piece.idx()])?;
            (head.places[piece.idx()], sizes[piece.idx()]) = push(&mut body, &packed);
        }
        let mut sized = (rest.len() as u64).to_le_bytes().to_vec();
        sized.extend(compressed_piece(&rest)?);
        (head.rest, head.rest_packed) = push(&mut body, &sized);
        head.catalog = packed_as(&head.catalog, |piece| sizes[piece]);
        Ok(Self { head, body })
    }

    /// Checks that head and pieces are those of the file: a head that was forged, or written wrongly, answers queries and fetches
    /// pieces for another world than it unpacks to. Time and memory as for [`PackedWorld::pack`], without the compression.
    ///
    /// # Errors
    ///
    /// The first difference.
    #[doc(hidden)]
    pub fn check(&self, file: &[u8]) -> Result<(), PackError> {
        let differs = |what: &str| Err(damaged(format!("{what} is not that of its pieces")));
        let Divided {
            mut head, pieces, ..
        } = Divided::of(file)?;
        let own = self.head.catalog.pieces();
        if own.len() != pieces.len() {
            return differs("its list of pieces");
        }
        for (id, piece) in (0..).map(PieceId).zip(&pieces) {
            let packed = self.packed(id).unwrap_or_default();
            if self.head.expand(id, packed).as_ref() != Ok(piece) {
                return differs(&format!("piece {}", id.0));
            }
        }
        // Places and sizes depend on the compression.
        head.places.clone_from(&self.head.places);
        (head.rest, head.rest_packed) = (self.head.rest, self.head.rest_packed);
        head.catalog = packed_as(&head.catalog, |piece| own[piece].n_packed);
        if head.encode_body()? == self.head.encode_body()? {
            return Ok(());
        }
        for cell in head.world.graph.cell_ids() {
            if head.catalog.pieces_of(cell) != self.head.catalog.pieces_of(cell) {
                return differs(&format!("the list of the pieces of cell {}", cell.0));
            }
        }
        if head.skeleton.encode() != self.head.skeleton.encode() {
            return differs("its list of boxes");
        }
        differs("the world in its head")
    }

    /// Returns the file that was packed.
    ///
    /// # Errors
    ///
    /// Damage.
    pub fn unpack(&self) -> Result<Vec<u8>, PackError> {
        let n = self.head.places.len() as u32;
        let mut pieces = Vec::with_capacity(n as usize + 1);
        for piece in (0..n).map(PieceId) {
            let packed = self.packed(piece);
            let packed = packed.ok_or_else(|| damaged(format!("piece {} is missing", piece.0)))?;
            let bytes = self.head.expand(piece, packed);
            pieces.push(bytes.map_err(|why| damaged(format!("piece {}: {why}", piece.0)))?);
        }
        let at = self.head.rest.offset;
        let packed = range(&self.body, at, self.head.rest_packed);
        let packed = packed.ok_or_else(|| damaged("its rest is missing"))?;
        if hash_of(packed) != self.head.rest.hash {
            return Err(damaged("its rest has another hash than was packed"));
        }
        let (n, packed) = (packed.split_first_chunk::<8>()).ok_or_else(|| damaged("its rest"))?;
        pieces.push(expanded_piece(packed, u64::from_le_bytes(*n))?);
        let (len, hash) = self.head.file;
        let file = join_file(len, pieces.iter().map(Vec::as_slice))?;
        if hash_of(&file) != hash {
            return Err(damaged("the file has another hash than was packed"));
        }
        Ok(file)
    }

    /// Returns the packed bytes of a piece; `None` if there is none, or the bytes end before.
    #[must_use]
    #[doc(hidden)]
    pub fn packed(&self, piece: PieceId) -> Option<&[u8]> {
        let at = self.head.places.get(piece.idx())?;
        let size = self.head.catalog.pieces()[piece.idx()].n_packed;
        range(&self.body, at.offset, size)
    }

    /// Returns all packed pieces, and then the rest, as they are in a file.
    #[must_use]
    pub fn body(&self) -> &[u8] {
        &self.body
    }
}

impl PackedHead {
    /// Checks and unpacks the bytes of a piece as fetched: [`enfilade_cpg::wire::read_piece`] reads the result.
    ///
    /// # Errors
    ///
    /// The problem, in words.
    #[doc(hidden)]
    pub fn expand(&self, piece: PieceId, packed: &[u8]) -> Result<Vec<u8>, String> {
        let places = self.places.get(piece.idx());
        let at = places.ok_or_else(|| "there is no such piece".to_owned())?;
        let size = self.catalog.pieces()[piece.idx()];
        if packed.len() as u64 != size.n_packed {
            let n = packed.len();
            return Err(format!("{n} bytes came instead of {}", size.n_packed));
        }
        if hash_of(packed) != at.hash {
            return Err("it has another hash than was packed".to_owned());
        }
        expanded_piece(packed, size.n_resident).map_err(|why| why.to_string())
    }
}

/// Place of what is not packed yet.
const NOWHERE: PieceAt = PieceAt {
    offset: 0,
    hash: [0; 16],
};

/// Lists all pieces as they lie in the body: those of the room in which a walk begins, then those of the rooms on a tour from
/// there through open ways and doors, at last those of no room. So what is seen from a place lies in few ranges.
fn in_order_of_a_walk(head: &PackedHead) -> Result<Vec<PieceId>, PackError> {
    let graph = &head.world.graph;
    let sight = head.sight()?;
    let start = Start::find(&head.world, &sight, &SightState::as_modeled(&sight));
    let first = start.and_then(|start| sight.locate(start.eye));
    // The outdoors need most pieces, so they come last.
    let mut is_passed: Vec<bool> = graph.cells.iter().map(|cell| cell.outdoor).collect();
    let mut cells = Vec::new();
    for root in first.into_iter().chain(graph.cell_ids()) {
        let mut open = vec![root];
        while let Some(cell) = open.pop() {
            if std::mem::replace(&mut is_passed[cell.idx()], true) {
                continue;
            }
            cells.push(cell);
            let ways = graph
                .exits(cell)
                .filter(|exit| matches!(exit.portal.kind, PortalKind::Open | PortalKind::Door));
            open.extend(ways.map(|exit| exit.to));
        }
    }
    let all = (0..head.catalog.pieces().len() as u32).map(PieceId);
    let of_cells = cells.iter().flat_map(|c| head.catalog.pieces_of(*c));
    let mut is_listed = vec![false; all.len()];
    let listed = of_cells.copied().chain(all);
    Ok(listed
        .filter(|piece| !std::mem::replace(&mut is_listed[piece.idx()], true))
        .collect())
}

/// A world file in pieces, and all of its head but what depends on the compression.
struct Divided {
    head: PackedHead,
    pieces: Vec<Vec<u8>>,
    rest: Vec<u8>,
}

impl Divided {
    fn of(file: &[u8]) -> Result<Self, PackError> {
        let SplitFile {
            world,
            pieces,
            rest,
        } = split_file(file)?;
        let skeleton = Sight::build(&world)?.skeleton().clone();
        let needs = WorldPieces::of_world(&world, &|material| images_of(&world, material));
        if needs.catalog.pieces().len() != pieces.len() {
            return Err(damaged("the world falls into other pieces than its file"));
        }
        let rows: Vec<Vec<PieceId>> = (world.graph.cell_ids())
            .map(|cell| needs.catalog.pieces_of(cell).to_vec())
            .collect();
        let sizes = pieces.iter().map(|piece| PieceSizes {
            n_packed: 0,
            n_resident: piece.len() as u64,
        });
        let head = PackedHead {
            world: SightSkeleton::hollow(&world),
            skeleton,
            catalog: Catalog::new(sizes.collect(), &rows),
            places: Vec::new(),
            rest: NOWHERE,
            rest_packed: 0,
            file: (file.len() as u64, hash_of(file)),
        };
        Ok(Self { head, pieces, rest })
    }
}

/// Returns a catalog with these sizes in transit.
fn packed_as(catalog: &Catalog, n_packed: impl Fn(usize) -> u64) -> Catalog {
    let pieces = catalog
        .pieces()
        .iter()
        .enumerate()
        .map(|(i, piece)| PieceSizes {
            n_packed: n_packed(i),
            ..*piece
        });
    let rows: Vec<Vec<PieceId>> = (0..catalog.n_cells() as u32)
        .map(|cell| catalog.pieces_of(CellId(cell)).to_vec())
        .collect();
    Catalog::new(pieces.collect(), &rows)
}

/// Appends packed bytes; returns their place and size.
fn push(body: &mut Vec<u8>, packed: &[u8]) -> (PieceAt, u64) {
    let at = PieceAt {
        offset: body.len() as u64,
        hash: hash_of(packed),
    };
    body.extend_from_slice(packed);
    (at, packed.len() as u64)
}

fn range(body: &[u8], offset: u64, size: u64) -> Option<&[u8]> {
    let from = usize::try_from(offset).ok()?;
    let to = from.checked_add(usize::try_from(size).ok()?)?;
    body.get(from..to)
}
