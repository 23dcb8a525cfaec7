//! Packed worlds that are spawned: their pieces come with what cameras see, and go when room is needed.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, poll_once};
use enfilade::CellId;
use enfilade::stream::{
    Catalog, Changes, Eye, StreamFrame, InView, PackedHead, PieceId, PieceSizes, StreamCounts, StreamOptions,
    Streamer, ThreadSource,
};

use crate::arrivals::{CellLoaded, CellUnloaded, PieceFailed};
use crate::culling::PortalView;
use crate::labels::{PartKind, WorldPart};
use crate::packed::{PackedRoot, PackedWorld};
use crate::pieces::{Made, MadeMesh, PieceMaker};
use crate::site::{Mirrored, Site};
use crate::state::PortalState;

/// Memory of a vertex with position, normal, a set of coordinates, and half a tangent or color. [Units: bytes]
const VERTEX: f64 = 40.0;
/// Memory of a vertex of a mesh that came without normals: then each triangle has its own. [Units: bytes]
const FLAT_VERTEX: f64 = 24.0;
/// Memory of an index. [Units: bytes]
const INDEX: f64 = 4.0;
/// Expected compression of pictures: their size is known once they have come.
const EXPANSION: u64 = 16;
/// Largest picture that is expected. [Units: bytes]
const LARGEST_PICTURE: u64 = 2048 * 2048 * 4;

/// Settings of the streaming of a packed world. Put it on the entity with the `WorldAssetRoot`, or anywhere above; without it, the
/// defaults hold.
#[derive(Component, Clone, Debug)]
pub struct StreamSettings {
    /// Budget of memory, policy, limits of requests. Its budget is for vertices, indices and pictures as they are drawn, each once. It
    /// is by estimates: pieces are counted before they come, meshes by the mean of the world, pictures at sixteen times their files.
    /// [`PortalStream::n_bytes`] tells what they take.
    pub options: StreamOptions,
    /// The greatest speed that the eye can soon have, even if it stands. [Units: wu/s]
    pub speed: f32,
}

impl Default for StreamSettings {
    fn default() -> Self {
        Self {
            options: StreamOptions::default(),
            speed: 3.0,
        }
    }
}

/// The streaming of a spawned packed world. On the entity of its [`PortalRoot`](crate::PortalRoot), once the head has been loaded.
///
/// Each frame, cells that cameras with [`PortalCulling`](crate::PortalCulling) see are fetched, and with the default policy those that
/// they may soon see. Threads fetch and decode; meshes appear below the nodes they belong to, with labels as in a whole file. Entities
/// of pieces that go are despawned, so keep own children off them; children of nodes stay.
#[derive(Component)]
pub struct PortalStream {
    head: Arc<PackedHead>,
    streamer: Streamer,
    source: ThreadSource,
    changes: Changes,
    maker: Arc<PieceMaker>,
    speed: f32,
    in_view: Vec<InView>,
    eye: Eye,
    pieces: BTreeMap<PieceId, Held>,
    failures: BTreeMap<PieceId, String>,
    /// For each piece, the cells that need it.
    cells_of: Vec<Vec<CellId>>,
    /// For each cell, its pieces that are not there.
    n_missing: Vec<u32>,
    /// For each mesh, its detail objects.
    details_of: Vec<Vec<u32>>,
    mirrored: Mirrored,
    n_bytes: u64,
    revision: u32,
}

/// A piece that was handed over.
enum Held {
    /// A thread makes its contents.
    Making(Task<Result<Made, String>>),
    /// It is in the scene.
    There {
        entities: Vec<Entity>,
        /// With their indices.
        textures: Vec<(u32, Handle<Image>)>,
        n_bytes: u64,
    },
    /// It cannot be drawn.
    Broken,
}

impl PortalStream {
    fn open(
        packed: &PackedWorld,
        settings: &StreamSettings,
        images: &Assets<Image>,
        revision: u32,
    ) -> Self {
        let head = Arc::clone(&packed.head);
        let catalog = drawn_sizes(&head);
        let mut cells_of = vec![Vec::new(); catalog.pieces().len()];
        let mut n_missing = vec![0; catalog.n_cells()];
        for cell in (0..catalog.n_cells() as u32).map(CellId) {
            let pieces = catalog.pieces_of(cell);
            n_missing[cell.idx()] = pieces.len() as u32;
            pieces.iter().for_each(|p| cells_of[p.idx()].push(cell));
        }
        let mut details_of = vec![Vec::new(); head.world.detail_meshes.len()];
        for (i, detail) in (0..).zip(&head.world.details) {
            details_of[detail.mesh as usize].push(i);
        }
        let (graph, pvs) = (&head.world.graph, head.world.pvs.clone());
        Self {
            streamer: Streamer::new(catalog, graph, pvs, settings.options.clone()),
            source: packed.place.source(&head),
            changes: Changes::default(),
            maker: Arc::new(PieceMaker::new(packed, images)),
            speed: settings.speed,
            in_view: Vec::new(),
            eye: Eye::default(),
            pieces: BTreeMap::new(),
            failures: BTreeMap::new(),
            cells_of,
            n_missing,
            details_of,
            mirrored: Mirrored::new(),
            n_bytes: 0,
            revision,
            head,
        }
    }

    /// Returns the numbers as of the last frame.
    #[must_use]
    pub fn counts(&self) -> StreamCounts {
        self.streamer.counts()
    }

    /// Returns the memory of all vertices, indices and pictures that are in the scene, each once. [Units: bytes]
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// Returns the number of pieces in the scene, and of all.
    #[must_use]
    pub fn n_pieces(&self) -> [usize; 2] {
        let held = self.pieces.values();
        let n_there = held.filter(|p| matches!(p, Held::There { .. })).count();
        [n_there, self.cells_of.len()]
    }

    /// Returns `true` if all is in the scene that was in view in the frame before, fits, and is not damaged; `false` before any
    /// camera has seen the world.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        let in_view = self.in_view.iter();
        let mut pieces = in_view.flat_map(|v| self.streamer.catalog().pieces_of(v.cell));
        let is_waited_for = |p: &PieceId| match self.pieces.get(p) {
            Some(Held::Making(_)) => true,
            Some(_) => false,
            None => !self.streamer.view_settled() && !self.failures.contains_key(p),
        };
        !self.in_view.is_empty() && !pieces.any(is_waited_for)
    }

    /// Returns `true` if all pieces of a cell are in the scene.
    #[must_use]
    pub fn is_complete(&self, cell: CellId) -> bool {
        self.n_missing.get(cell.idx()) == Some(&0)
    }

    /// Returns the pieces that failed and have not come since, with the reasons.
    pub fn failures(&self) -> impl Iterator<Item = (PieceId, &str)> {
        self.failures.iter().map(|(p, why)| (*p, why.as_str()))
    }

    /// Returns the streamer: its catalog, and which pieces it keeps.
    #[must_use]
    pub fn streamer(&self) -> &Streamer {
        &self.streamer
    }

    /// Returns the streamer, to pin cells in which something happens out of view, and to ask again for pieces that were missing.
    pub fn streamer_mut(&mut self) -> &mut Streamer {
        &mut self.streamer
    }

    /// Collects what cameras see of the world; the first one is the eye.
    fn look<'a>(&mut self, root: Entity, cameras: impl Iterator<Item = &'a PortalView>) {
        let mut shares: BTreeMap<CellId, f32> = BTreeMap::new();
        let mut eye = None;
        for view in cameras.filter_map(|v| v.world(root)) {
            eye.get_or_insert(Eye {
                cell: view.cell,
                position: view.eye,
                speed: self.speed,
            });
            if view.is_lost {
                for cell in self.head.world.graph.cell_ids() {
                    shares.entry(cell).or_insert(0.0);
                }
            }
            for &cell in &view.cells {
                shares.entry(cell).or_insert(0.0);
            }
            for visit in &view.visits {
                let [left, low, right, high] = visit.rectangle;
                let share = shares.entry(visit.cell).or_insert(0.0);
                *share = (*share + (right - left) * (high - low) * 0.25).clamp(0.0, 1.0);
            }
        }
        self.eye = eye.unwrap_or(self.eye);
        self.in_view.clear();
        let in_view = shares.into_iter();
        self.in_view
            .extend(in_view.map(|(cell, share)| InView { cell, share }));
    }

    /// Runs a frame: takes away what has to go, and puts into the scene what is ready.
    fn run(&mut self, at: At, site: &mut Site) {
        let frame = StreamFrame {
            now: site.time.elapsed(),
            eye: self.eye,
            in_view: &self.in_view,
        };
        (self.streamer).update(&mut self.source, &frame, &mut self.changes);
        for piece in std::mem::take(&mut self.changes.removed) {
            self.take_away(at.root, piece, site);
        }
        for failed in std::mem::take(&mut self.changes.failed) {
            let is_retried = failed.retry.is_some();
            let reason = failed.error.to_string();
            self.fail(at.root, failed.piece, reason, is_retried, site);
        }
        for loaded in std::mem::take(&mut self.changes.added) {
            let maker = Arc::clone(&self.maker);
            let make = async move { maker.make(&loaded.bytes) };
            let task = AsyncComputeTaskPool::get().spawn(make);
            self.pieces.insert(loaded.piece, Held::Making(task));
            self.failures.remove(&loaded.piece);
        }
        let making = self.pieces.iter_mut();
        let ready = making.filter_map(|(&piece, held)| match held {
            Held::Making(task) => Some((piece, block_on(poll_once(task))?)),
            _ => None,
        });
        for (piece, made) in ready.collect::<Vec<_>>() {
            match made {
                Ok(made) => self.put(at, piece, made, site),
                Err(reason) => {
                    self.pieces.insert(piece, Held::Broken);
                    self.fail(at.root, piece, reason, false, site);
                }
            }
        }
    }

    fn fail(
        &mut self,
        root: Entity,
        piece: PieceId,
        reason: String,
        is_retried: bool,
        site: &mut Site,
    ) {
        self.failures.insert(piece, reason.clone());
        let event = PieceFailed {
            entity: root,
            piece,
            reason,
            is_retried,
        };
        site.failed.write(event.clone());
        site.commands.trigger(event);
    }

    /// Puts the contents of a piece into the scene.
    fn put(&mut self, at: At, piece: PieceId, made: Made, site: &mut Site) {
        let n_bytes = made.n_bytes();
        let (mut entities, mut textures) = (Vec::new(), Vec::new());
        match made {
            Made::Batches(batches) => {
                for (batch, made) in batches {
                    entities.extend(self.put_batch(at, batch, made, site));
                }
            }
            Made::Details(mesh, meshes) => {
                for made in meshes {
                    self.put_details(at, mesh, made, site, &mut entities);
                }
            }
            Made::Textures(images) => {
                for (index, image) in images {
                    if let Some(texture) = at.packed.textures.get(index as usize) {
                        site.show(texture, image);
                        textures.push((index, texture.clone()));
                    }
                }
            }
        }
        self.n_bytes += n_bytes;
        let held = Held::There {
            entities,
            textures,
            n_bytes,
        };
        self.pieces.insert(piece, held);
        for &cell in &self.cells_of[piece.idx()] {
            self.n_missing[cell.idx()] -= 1;
            if self.n_missing[cell.idx()] == 0 {
                let event = CellLoaded {
                    entity: at.root,
                    cell,
                };
                site.loaded.write(event);
                site.commands.trigger(event);
            }
        }
    }

    /// Spawns the mesh of a batch; below the node of its cell, if it has only one, as in a whole file.
    fn put_batch(&self, at: At, batch: u32, mut made: MadeMesh, site: &mut Site) -> Option<Entity> {
        let cells = &self.head.world.batches.get(batch as usize)?.cells;
        let node = match cells[..] {
            [cell] => site.cell(at.state.cell(cell)),
            _ => None,
        };
        let part = WorldPart {
            root: at.root,
            kind: PartKind::Batch(batch),
        };
        let material = site.material(at.packed, made.material, None);
        let mesh = site.meshes.add(made.take_mesh());
        Some(site.spawn(node.unwrap_or(at.root), part, &mesh, material, &made))
    }

    /// Spawns a part of a mesh below the nodes of its detail objects.
    fn put_details(
        &mut self,
        at: At,
        mesh: u32,
        mut made: MadeMesh,
        site: &mut Site,
        entities: &mut Vec<Entity>,
    ) {
        let handle = site.meshes.add(made.take_mesh());
        let details = self.details_of.get(mesh as usize);
        for &detail in details.into_iter().flatten() {
            let Some((node, is_mirrored)) = site.detail(at.state.detail(detail)) else {
                continue;
            };
            let mirrored = is_mirrored.then_some(&mut self.mirrored);
            let part = WorldPart {
                root: at.root,
                kind: PartKind::Detail(detail),
            };
            let material = site.material(at.packed, made.material, mirrored);
            entities.push(site.spawn(node, part, &handle, material, &made));
        }
    }

    /// Takes a piece out of the scene.
    fn take_away(&mut self, root: Entity, piece: PieceId, site: &mut Site) {
        let Some(Held::There {
            entities,
            textures,
            n_bytes,
        }) = self.pieces.remove(&piece)
        else {
            return;
        };
        self.n_bytes -= n_bytes;
        for entity in entities {
            site.commands.entity(entity).try_despawn();
        }
        for (index, texture) in textures {
            site.hide(&texture, index, &self.maker);
        }
        for &cell in &self.cells_of[piece.idx()] {
            if self.n_missing[cell.idx()] == 0 {
                let event = CellUnloaded { entity: root, cell };
                site.unloaded.write(event);
                site.commands.trigger(event);
            }
            self.n_missing[cell.idx()] += 1;
        }
    }
}

/// A root, and its world.
#[derive(Clone, Copy)]
struct At<'a> {
    root: Entity,
    state: &'a PortalState,
    packed: &'a PackedWorld,
}

/// Lists the pieces with their sizes as drawn, as far as these are known before a piece has come: those of meshes by the mean of the
/// world, those of pictures as for strong compression.
fn drawn_sizes(head: &PackedHead) -> Catalog {
    let catalog = &head.catalog;
    let first_picture = catalog.pieces().len() - head.world.images.len();
    let meshes = &catalog.pieces()[..first_picture];
    let unpacked: u64 = meshes.iter().map(|p| p.n_resident).sum();
    let [n_vertices, n_indices] = head.skeleton.sizes();
    let shared = n_vertices as f64 * VERTEX + n_indices as f64 * INDEX;
    let drawn = shared.max(n_indices as f64 * FLAT_VERTEX);
    let growth = (drawn / unpacked.max(1) as f64).max(1.0);
    let sized = |(i, piece): (usize, &PieceSizes)| {
        let n = piece.n_resident;
        let drawn = if i < first_picture {
            (n as f64 * growth).ceil() as u64
        } else {
            n.saturating_mul(EXPANSION).min(LARGEST_PICTURE)
        };
        PieceSizes {
            n_resident: n.max(drawn),
            ..*piece
        }
    };
    let pieces = catalog.pieces().iter().enumerate().map(sized);
    let cells = (0..catalog.n_cells() as u32).map(CellId);
    let rows: Vec<Vec<PieceId>> = cells.map(|c| catalog.pieces_of(c).to_vec()).collect();
    Catalog::new(pieces.collect(), &rows)
}

type PackedRoots<'a> = (
    Entity,
    &'a PackedRoot,
    &'a PortalState,
    Option<&'a PortalStream>,
);

/// Opens the streams of packed worlds that were just spawned or loaded anew.
pub(crate) fn open_streams(
    mut commands: Commands,
    roots: Query<PackedRoots>,
    settings: Query<&StreamSettings>,
    parents: Query<&ChildOf>,
    packed: Res<Assets<PackedWorld>>,
    images: Res<Assets<Image>>,
) {
    for (root, own, state, stream) in &roots {
        if let Some(stream) = stream {
            if stream.revision != state.revision {
                commands.entity(root).remove::<PortalStream>();
            }
            continue;
        }
        let Some(packed) = packed.get(&own.packed) else {
            continue;
        };
        let mut above = std::iter::once(root).chain(parents.iter_ancestors(root));
        let settings = above.find_map(|e| settings.get(e).ok());
        let settings = settings.cloned().unwrap_or_default();
        let stream = PortalStream::open(packed, &settings, &images, state.revision);
        commands.entity(root).insert(stream);
    }
}

/// Streams what cameras see.
pub(crate) fn run_streams(
    mut streams: Query<(Entity, &PackedRoot, &PortalState, &mut PortalStream)>,
    cameras: Query<(&Camera, &PortalView)>,
    packed: Res<Assets<PackedWorld>>,
    mut site: Site,
) {
    for (root, own, state, mut stream) in &mut streams {
        let Some(packed) = packed.get(&own.packed) else {
            continue;
        };
        let cameras = cameras.iter().filter(|(camera, _)| camera.is_active);
        stream.look(root, cameras.map(|(_, view)| view));
        let at = At {
            root,
            state,
            packed,
        };
        stream.run(at, &mut site);
    }
}

/// Takes the pieces of a stream that ends out of the scene.
pub(crate) fn close_stream(
    removed: On<Remove, PortalStream>,
    streams: Query<&PortalStream>,
    mut site: Site,
) {
    let Ok(stream) = streams.get(removed.entity) else {
        return;
    };
    for held in stream.pieces.values() {
        let Held::There {
            entities, textures, ..
        } = held
        else {
            continue;
        };
        for &entity in entities {
            site.commands.entity(entity).try_despawn();
        }
        for (index, texture) in textures {
            site.hide(texture, *index, &stream.maker);
        }
    }
}
