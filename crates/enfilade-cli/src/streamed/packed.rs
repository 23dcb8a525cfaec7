//! Heads of packed worlds, and the memory that their pieces take.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use enfilade::cpg::CellId;
use enfilade::runtime::Seen;
use enfilade::stream::{
    Catalog, InView, PackedFiles, PackedHead, PackedPlace, PieceId, PieceSizes,
};
use enfilade_render::StreamLimits;

/// Most vertices and indices that a byte of a piece decodes to: four times one of a byte.
const DECODED: u64 = 4;
/// One part in so many of the memory is for pieces that have come and are not on the adapter.
const SHARE_IN_TRANSIT: u64 = 8;
/// Compression of a picture that is expected before it has come.
const EXPANSION: u64 = 16;
/// Largest picture on the adapter, with its mipmaps. [Units: bytes]
const LARGEST_PICTURE: u64 = 2048 * 2048 * 4 * 4 / 3;

/// A packed world whose head was read. Clones are cheap.
#[derive(Clone)]
pub struct Packed {
    /// The head.
    pub head: Arc<PackedHead>,
    pub(super) place: PackedPlace,
    pub(super) name: String,
}

impl Packed {
    /// Returns `true` for addresses, and for what looks like a packed world on disk.
    #[must_use]
    pub fn is_at(path: &Path) -> bool {
        PackedPlace::is_url(path) || PackedFiles::is_packed(path)
    }

    /// Reads the head of a packed world.
    ///
    /// # Errors
    ///
    /// A place without a packed world, damage; the error names it.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let name = path.display().to_string();
        let opened = PackedPlace::open(path).with_context(|| format!("cannot read {name}"))?;
        Ok(Self {
            head: Arc::new(opened.0),
            place: opened.1,
            name,
        })
    }

    /// Returns the unpacked size of all pieces that cells need together. [Units: bytes]
    #[must_use]
    pub fn size_of(&self, cells: &[InView]) -> u64 {
        let catalog = &self.head.catalog;
        let pieces = cells.iter().flat_map(|c| catalog.pieces_of(c.cell));
        let pieces: BTreeSet<PieceId> = pieces.copied().collect();
        let sizes = pieces.iter().map(|p| catalog.pieces()[p.idx()].n_resident);
        sizes.sum()
    }

    /// Returns limits under which pieces of `n` bytes, unpacked, always find room.
    #[must_use]
    pub fn limits_for(&self, n: u64) -> StreamLimits {
        let [n_corners, n_indices] = self.head.skeleton.sizes();
        // As much of the whole as these bytes can be of its vertices, of 12 bytes, or of its indices.
        let most = |whole: u64, size: u64| DECODED as f64 * (n / size) as f64 / whole.max(1) as f64;
        let share = most(n_corners, 12).max(most(n_indices, 1)).min(1.0);
        // 40 bytes a vertex, and up to 16 an index.
        let whole = n_corners as f64 * 40.0 + n_indices as f64 * 16.0;
        StreamLimits {
            triangle_bytes: if share < 1.0 {
                (whole * share).ceil() as u64
            } else {
                u64::MAX
            },
            picture_bytes: 1 << 40,
        }
    }

    /// Divides memory: for the adapter, and for pieces on their way to it.
    pub(super) fn limits_within(&self, memory: u64) -> (StreamLimits, u64) {
        let transit = memory / SHARE_IN_TRANSIT;
        let [n_corners, n_indices] = self.head.skeleton.sizes().map(u128::from);
        let whole = u64::try_from(n_corners * 40 + n_indices * 16).unwrap_or(u64::MAX);
        let triangle_bytes = whole.min(memory / 2);
        let limits = StreamLimits {
            triangle_bytes,
            picture_bytes: memory - transit - triangle_bytes,
        };
        (limits, transit)
    }

    /// Lists the pieces with their sizes on the adapter, as far as these are known before a piece has come: those of triangles at
    /// most, if vertices are not shared, those of pictures as for strong compression.
    pub(super) fn on_adapter(&self) -> Catalog {
        let catalog = &self.head.catalog;
        let first_picture = catalog.pieces().len() - self.head.world.images.len();
        let sized = |(i, piece): (usize, &PieceSizes)| {
            let n = piece.n_resident;
            let on_adapter = if i < first_picture {
                // A vertex of 12 bytes takes 40.
                n.saturating_mul(10) / 3
            } else {
                n.saturating_mul(EXPANSION).min(LARGEST_PICTURE)
            };
            PieceSizes {
                n_resident: n.max(on_adapter),
                ..*piece
            }
        };
        let rows: Vec<Vec<PieceId>> = (0..catalog.n_cells() as u32)
            .map(|cell| catalog.pieces_of(CellId(cell)).to_vec())
            .collect();
        let pieces = catalog.pieces().iter().enumerate().map(sized);
        Catalog::new(pieces.collect(), &rows)
    }
}

/// Lists the cells that a query has seen, each with its share of the screen; all cells if the eye is lost, or the query gave up.
pub fn cells_in_view(seen: &Seen<'_>, n_cells: usize, out: &mut BTreeMap<CellId, f32>) {
    let counts = seen.counts();
    if counts.is_eye_lost || counts.is_capped {
        for cell in (0..n_cells as u32).map(CellId) {
            out.entry(cell).or_insert(0.0);
        }
    }
    for &cell in seen.cells() {
        out.entry(cell).or_insert(0.0);
    }
    for visit in seen.visits() {
        let [left, low, right, high] = visit.rectangle;
        if let Some(share) = out.get_mut(&visit.cell) {
            *share = (*share + (right - left) * (high - low) * 0.25).clamp(0.0, 1.0);
        }
    }
}

/// Turns listed cells into those of a view.
#[must_use]
pub fn view_of(cells: &BTreeMap<CellId, f32>) -> Vec<InView> {
    let view = cells.iter();
    view.map(|(&cell, &share)| InView { cell, share }).collect()
}
