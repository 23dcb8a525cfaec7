//! A hollow world on the adapter: pieces come and go within a fixed amount of memory.
//!
//! Vertices and indices lie in two buffers of fixed size, in room given out by `FreeRoom`. A piece whose room is in parts is
//! scattered over them: its indices name the vertices wherever they are, and its triangles are drawn wherever their indices are.
//! So nothing is ever moved, and a piece finds no room only if there is none.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, World};
use enfilade_runtime::{DetailId, Sight};

use super::buffers::{PER_CORNER, PER_INDEX, PER_LISTED, TriangleBuffers};
use super::filling::{Dress, Filling, Level, Span, listed};
use super::gpu_world::GpuWorld;
use super::pieces::{GpuPiece, PieceContent, PieceMaker};
use super::room::FreeRoom;
use super::streamed::{Furnishing, Held, Streamed, TextureSlot, furnish};
use super::textures::{texture_group, texture_layout, upload, white_group};
use crate::gpu::{Gpu, RenderError};
use crate::materials::{Look, looks_of, wrapping};
use crate::piece_of::PieceOf;

/// Memory of a hollow world on the adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamLimits {
    /// Most bytes of vertices and indices, allocated at once; no more than the whole world needs. Divided between the two as
    /// the whole world would be. Plugs of portals, up to 440 bytes each, and leaves of doors come on top. [Units: bytes]
    pub triangle_bytes: u64,
    /// Most bytes of pictures. [Units: bytes]
    pub picture_bytes: u64,
}

/// The outcome of putting a piece on the adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Put {
    /// It is there.
    Done,
    /// There is no room for its vertices, its indices or its texels: take other pieces away and try again.
    Full,
}

impl GpuWorld {
    /// Makes room on the adapter for the pieces of a hollow world. At first plugs of portals and leaves of doors are there, which
    /// stay; objects and chunks that are absent are not drawn, and a visible cell without any of its own batches shows as [its mean
    /// color](crate::Sparing::stop_below) in its portals. There are no levels of detail.
    ///
    /// `world` may be hollow or whole: other triangles and its pictures are not read. `sight` must be built from it.
    ///
    /// # Errors
    ///
    /// Limits beyond the adapter's buffers.
    pub fn hollow(
        gpu: &Gpu,
        world: &World,
        sight: &Sight,
        limits: &StreamLimits,
    ) -> Result<Self, RenderError> {
        let looks = looks_of(world);
        let (slots, texture_of) = slots_of(world, &looks);
        let dress = Dress { looks, texture_of };
        let mut filling = Filling::new(&dress);
        let plugs = filling.add_plugs(world, sight);
        let mut leaves = BTreeMap::new();
        for (id, object) in (0..).map(DetailId).zip(&world.details) {
            let mesh = world.detail_meshes.get(object.mesh as usize);
            let mesh = mesh.filter(|_| sight.portals_of(id).next().is_some());
            if let Some(mesh) = mesh {
                let add = || filling.add_mesh(mesh.primitives.iter());
                leaves.entry(object.mesh).or_insert_with(add);
            }
        }
        let Filling {
            corners, indices, ..
        } = filling;
        let fixed = [corners.len() as u32, indices.len() as u32];
        let [n_corners, n_indices] = capacity(gpu, sight, fixed, limits)?;
        let triangles = TriangleBuffers::empty(gpu, n_corners, n_indices)?;
        triangles.write_corners(gpu, 0, &corners);
        triangles.write_indices(gpu, 0, &indices, || listed(&corners, &indices));
        let layout = texture_layout(gpu);
        let white = white_group(gpu, &layout)?;
        let mut out = Self::of_triangles(world, sight, &dress, triangles, plugs);
        out.chunks = vec![Span::NONE; sight.chunks().len()];
        out.meshes = vec![Vec::new(); world.detail_meshes.len()];
        out.textures = vec![white; slots.len() + 1];
        let mut meshes: Vec<Option<Held>> = out.meshes.iter().map(|_| None).collect();
        for (mesh, spans) in leaves {
            out.meshes[mesh as usize] = vec![Level { error: 0.0, spans }];
            meshes[mesh as usize] = Some(Held {
                is_fixed: true,
                ..Held::default()
            });
        }
        let mut rooms = [FreeRoom::new(n_corners), FreeRoom::new(n_indices)];
        for (room, n) in rooms.iter_mut().zip(fixed) {
            room.take(n, 1);
        }
        let n_room = [rooms[0].n_free(), rooms[1].n_free()];
        let [corners, indices] = rooms;
        let mut cells = vec![Furnishing::default(); world.graph.cells.len()];
        for (batch, seen_by) in (0..).zip(&out.batch_cells) {
            if !sight.chunks_of(batch).is_empty() {
                furnish(&mut cells, seen_by, |n| n[0] += 1);
            }
        }
        out.streamed = Some(Box::new(Streamed {
            maker: PieceMaker::new(gpu, world, sight, dress),
            corners,
            indices,
            n_room,
            batches: world.batches.iter().map(|_| None).collect(),
            meshes,
            batch_at: BTreeMap::new(),
            scattered: BTreeMap::new(),
            images: vec![None; world.images.len()],
            slots,
            layout,
            picture_room: limits.picture_bytes,
            picture_bytes: limits.picture_bytes,
            cells,
        }));
        Ok(out)
    }

    /// Returns the maker of its pieces; `None` if the world was loaded whole.
    #[must_use]
    pub fn piece_maker(&self) -> Option<PieceMaker> {
        self.streamed.as_ref().map(|s| s.maker.clone())
    }

    /// Returns `true` if pieces come and go.
    #[must_use]
    pub fn is_hollow(&self) -> bool {
        self.streamed.is_some()
    }

    /// Returns `true` if a piece is there; of a world loaded whole, every piece.
    #[must_use]
    pub fn has(&self, of: PieceOf) -> bool {
        let Some(streamed) = &self.streamed else {
            return true;
        };
        match of {
            PieceOf::Batch(i) => matches!(streamed.batches.get(i as usize), Some(Some(_))),
            PieceOf::Mesh(i) => matches!(streamed.meshes.get(i as usize), Some(Some(_))),
            PieceOf::Image(i) => matches!(streamed.images.get(i as usize), Some(Some(_))),
        }
    }

    /// Puts a piece on the adapter; one that is there stays as it is. Copies its bytes; O(n) in them, and in the free ranges.
    /// Draws after it shows the piece. Through a [`Studio`](crate::Studio), use [`Studio::put`](crate::Studio::put).
    ///
    /// # Errors
    ///
    /// A world loaded whole; a piece of another world; a piece larger than all the room there is, which no taking away helps.
    pub fn put(&mut self, gpu: &Gpu, piece: &GpuPiece) -> Result<Put, RenderError> {
        if self.streamed.is_none() {
            return Err(RenderError::NotHollow);
        }
        if self.has(piece.of) {
            return Ok(Put::Done);
        }
        match (&piece.content, piece.of) {
            (PieceContent::Picture(levels), PieceOf::Image(image)) => {
                self.put_picture(gpu, image, levels, piece.n_bytes())
            }
            _ => self.put_triangles(gpu, piece),
        }
    }

    fn put_picture(
        &mut self,
        gpu: &Gpu,
        image: u32,
        levels: &[image::RgbaImage],
        n_bytes: u64,
    ) -> Result<Put, RenderError> {
        let (Some(streamed), textures) = (&mut self.streamed, &mut self.textures) else {
            return Err(RenderError::NotHollow);
        };
        let of = PieceOf::Image(image);
        let there =
            (streamed.images.get_mut(image as usize)).ok_or(RenderError::OtherPiece { of })?;
        Gpu::check("a picture", n_bytes, streamed.picture_bytes)?;
        if n_bytes > streamed.picture_room {
            return Ok(Put::Full);
        }
        if !levels.is_empty() {
            let view = upload(gpu, levels)?;
            for slot in streamed.slots.iter().filter(|s| s.image == image) {
                textures[slot.group] = texture_group(gpu, &streamed.layout, &view, slot.wrap);
            }
        }
        *there = Some(n_bytes);
        streamed.picture_room -= n_bytes;
        Ok(Put::Done)
    }

    fn put_triangles(&mut self, gpu: &Gpu, piece: &GpuPiece) -> Result<Put, RenderError> {
        let of = piece.of;
        let own_chunks = match of {
            PieceOf::Batch(batch) => self.chunks_of(batch),
            _ => 0..0,
        };
        let (
            Some(streamed),
            PieceContent::Triangles {
                corners,
                indices,
                spans,
            },
        ) = (&mut self.streamed, &piece.content)
        else {
            return Err(RenderError::OtherPiece { of });
        };
        let (held, is_batch) = match of {
            PieceOf::Batch(i) => (streamed.batches.get_mut(i as usize), true),
            PieceOf::Mesh(i) => (streamed.meshes.get_mut(i as usize), false),
            PieceOf::Image(_) => (None, false),
        };
        let held = held.filter(|_| !is_batch || own_chunks.len() == spans.len());
        let held = held.ok_or(RenderError::OtherPiece { of })?;
        let sizes = [corners.len(), indices.len()];
        for (n, room) in sizes.into_iter().zip(streamed.n_room) {
            Gpu::check("vertices or indices of a piece", n as u64, room)?;
        }
        let [n_corners, n_indices] = sizes.map(|n| n as u32);
        let Some(at) = streamed.corners.take(n_corners, 1) else {
            return Ok(Put::Full);
        };
        let Some(ranges) = streamed.indices.take(n_indices, 3) else {
            at.into_iter().for_each(|r| streamed.corners.give(r));
            return Ok(Put::Full);
        };
        self.triangles
            .write_scattered(gpu, [&at, &ranges], corners, indices);
        match of {
            PieceOf::Batch(batch) => {
                if !own_chunks.is_empty() {
                    let seen_by = &self.batch_cells[batch as usize];
                    furnish(&mut streamed.cells, seen_by, |n| n[1] += 1);
                }
                streamed
                    .batch_at
                    .extend(ranges.iter().map(|r| (r.start, batch)));
                for (chunk, span) in own_chunks.zip(spans) {
                    let own: Vec<Span> = span.put_into(&ranges).collect();
                    match own[..] {
                        [one] => self.chunks[chunk] = one,
                        _ => drop(streamed.scattered.insert(chunk as u32, own)),
                    }
                }
            }
            PieceOf::Mesh(mesh) => {
                let spans = spans.iter().flat_map(|s| s.put_into(&ranges)).collect();
                self.meshes[mesh as usize] = vec![Level { error: 0.0, spans }];
            }
            PieceOf::Image(_) => {}
        }
        *held = Some(Held {
            corners: at,
            indices: ranges,
            is_fixed: false,
        });
        Ok(Put::Done)
    }

    /// Takes a piece away; what is drawn after it is drawn without. Returns `true` if it was there. Through a
    /// [`Studio`](crate::Studio), use [`Studio::take`](crate::Studio::take).
    pub fn take(&mut self, of: PieceOf) -> bool {
        let own_chunks = match of {
            PieceOf::Batch(batch) => self.chunks_of(batch),
            _ => 0..0,
        };
        let Some(streamed) = &mut self.streamed else {
            return false;
        };
        let held = match of {
            PieceOf::Batch(i) => streamed.batches.get_mut(i as usize),
            PieceOf::Mesh(i) => streamed.meshes.get_mut(i as usize),
            PieceOf::Image(i) => {
                let size = streamed.images.get_mut(i as usize).and_then(Option::take);
                streamed.picture_room += size.unwrap_or(0);
                for slot in streamed
                    .slots
                    .iter()
                    .filter(|s| s.image == i && size.is_some())
                {
                    self.textures[slot.group] = self.textures[0].clone();
                }
                return size.is_some();
            }
        };
        let held = held.and_then(|h| h.take_if(|h| !h.is_fixed));
        let Some(held) = held else {
            return false;
        };
        match of {
            PieceOf::Batch(batch) => {
                if !own_chunks.is_empty() {
                    let seen_by = &self.batch_cells[batch as usize];
                    furnish(&mut streamed.cells, seen_by, |n| n[1] -= 1);
                }
                for range in &held.indices {
                    streamed.batch_at.remove(&range.start);
                }
                for chunk in own_chunks {
                    self.chunks[chunk] = Span::NONE;
                    streamed.scattered.remove(&(chunk as u32));
                }
            }
            PieceOf::Mesh(mesh) => self.meshes[mesh as usize].clear(),
            PieceOf::Image(_) => {}
        }
        held.corners
            .into_iter()
            .for_each(|r| streamed.corners.give(r));
        held.indices
            .into_iter()
            .for_each(|r| streamed.indices.give(r));
        true
    }

    /// Returns the free room: vertices, indices, and bytes of pictures; none in a world loaded whole.
    #[must_use]
    pub fn free_room(&self) -> [u64; 3] {
        let room = |s: &Streamed| {
            let [corners, indices] = [&s.corners, &s.indices].map(|r| u64::from(r.n_free()));
            [corners, indices, s.picture_room]
        };
        self.streamed.as_ref().map_or([0; 3], |s| room(s))
    }

    /// Returns the cells in which a piece is seen, or stands.
    pub(crate) fn cells_of_piece(&self, of: PieceOf) -> Vec<CellId> {
        match of {
            PieceOf::Batch(batch) => {
                let cells = self.batch_cells.get(batch as usize);
                cells.cloned().unwrap_or_default()
            }
            PieceOf::Mesh(mesh) => {
                let placed = self.details.iter().filter(|d| d.mesh == mesh);
                placed.flat_map(|d| d.cells.iter().copied()).collect()
            }
            PieceOf::Image(_) => Vec::new(),
        }
    }

    /// Returns `true` if a portal into a cell shows its mean color, since nothing of the cell is there.
    pub(crate) fn is_bare(&self, cell: CellId) -> bool {
        let cells = self.streamed.as_ref().map(|s| &s.cells);
        let own = cells.and_then(|c| c.get(cell.idx()));
        own.is_some_and(Furnishing::is_bare)
    }
}

/// Returns the textures that materials use and images fill, and for each texture of the world its group.
fn slots_of(world: &World, looks: &[Look]) -> (Vec<TextureSlot>, Vec<u32>) {
    let mut texture_of = vec![0; world.textures.len()];
    let mut slots: Vec<TextureSlot> = Vec::new();
    for texture in looks.iter().filter_map(|l| l.texture) {
        let image = (world.textures.get(texture as usize)).and_then(|t| t.image);
        let image = image.filter(|i| (*i as usize) < world.images.len());
        let Some(image) = image.filter(|_| texture_of[texture as usize] == 0) else {
            continue;
        };
        let group = slots.len() + 1;
        texture_of[texture as usize] = group as u32;
        let wrap = wrapping(world, texture);
        slots.push(TextureSlot { image, group, wrap });
    }
    (slots, texture_of)
}

/// Returns the number of vertices and indices for which the limits leave room, besides `fixed` ones.
fn capacity(
    gpu: &Gpu,
    sight: &Sight,
    fixed: [u32; 2],
    limits: &StreamLimits,
) -> Result<[u32; 2], RenderError> {
    let listed = if gpu.fetches() { 0 } else { PER_LISTED };
    let per = [PER_CORNER, PER_INDEX + listed];
    let whole = sight.skeleton().sizes();
    let needed = (0..2)
        .map(|k| u128::from(whole[k]) * u128::from(per[k]))
        .sum::<u128>();
    let bytes = needed.min(limits.triangle_bytes.into());
    let mut out = fixed;
    for (k, what) in ["vertices", "indices"].into_iter().enumerate() {
        let own = (u128::from(whole[k]) * bytes)
            .checked_div(needed)
            .unwrap_or(0);
        let n = u64::try_from(own)
            .unwrap_or(u64::MAX)
            .saturating_add(fixed[k].into());
        Gpu::check(what, n, u32::MAX)?;
        out[k] = n as u32;
    }
    Ok(out)
}
