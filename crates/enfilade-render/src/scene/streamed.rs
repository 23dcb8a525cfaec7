//! State of a hollow world on the adapter: its pieces, and the room for them.

use std::collections::BTreeMap;
use std::ops::Range;

use enfilade_cpg::CellId;

use super::filling::Span;
use super::pieces::PieceMaker;
use super::room::FreeRoom;

/// The pieces of a hollow world, and its memory.
#[derive(Clone)]
pub(super) struct Streamed {
    pub(super) maker: PieceMaker,
    pub(super) corners: FreeRoom,
    pub(super) indices: FreeRoom,
    /// Number of vertices and indices that there is room for.
    pub(super) n_room: [u32; 2],
    pub(super) batches: Vec<Option<Held>>,
    pub(super) meshes: Vec<Option<Held>>,
    /// Batch of each range of indices of a batch, by its start.
    pub(super) batch_at: BTreeMap<u32, u32>,
    /// The chunks that lie in several ranges.
    pub(super) scattered: BTreeMap<u32, Vec<Span>>,
    /// Per image: its size, if it is there. [Units: bytes]
    pub(super) images: Vec<Option<u64>>,
    pub(super) slots: Vec<TextureSlot>,
    pub(super) layout: wgpu::BindGroupLayout,
    /// [Units: bytes]
    pub(super) picture_room: u64,
    pub(super) picture_bytes: u64,
    pub(super) cells: Vec<Furnishing>,
}

/// Where a piece is.
#[derive(Clone, Default)]
pub(super) struct Held {
    pub(super) corners: Vec<Range<u32>>,
    pub(super) indices: Vec<Range<u32>>,
    /// True for leaves of doors, which stay.
    pub(super) is_fixed: bool,
}

/// A texture of the world.
#[derive(Clone)]
pub(super) struct TextureSlot {
    pub(super) image: u32,
    /// Index into [`super::GpuWorld::textures`].
    pub(super) group: usize,
    pub(super) wrap: [wgpu::AddressMode; 2],
}

/// The batches of a cell: number of all, and of those that are there.
#[derive(Clone, Copy, Default)]
pub(super) struct Furnishing {
    /// Those that no other cell sees.
    pub(super) own: [u32; 2],
    pub(super) shared: [u32; 2],
}

impl Furnishing {
    /// Returns `true` if none of its own batches is there; if it has no own ones, none at all.
    pub(super) fn is_bare(&self) -> bool {
        let [n, n_there] = if self.own[0] > 0 {
            self.own
        } else {
            self.shared
        };
        n > 0 && n_there == 0
    }
}

pub(super) fn furnish(
    cells: &mut [Furnishing],
    seen_by: &[CellId],
    change: impl Fn(&mut [u32; 2]),
) {
    for cell in seen_by {
        if let Some(cell) = cells.get_mut(cell.idx()) {
            let is_own = seen_by.len() == 1;
            change(if is_own {
                &mut cell.own
            } else {
                &mut cell.shared
            });
        }
    }
}
