//! Packed worlds drawn from pieces that come as they are needed, and go.
//!
//! [`Streamed::frame`] is the main flow: the [`Streamer`] says what comes and goes, a thread makes pieces ready for the adapter, and
//! each frame puts some of them there. Pictures settle in all that they show ([`Streamed::settle`]); a window draws what is there.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use enfilade::cpg::CellId;
use enfilade::cpg::wire::{PieceContent, read_piece};
use enfilade::runtime::{Seen, Sight};
use enfilade::stream::{
    Changes, Eye, FetchError, Frame, InView, PackedFiles, PackedHead, PackedPlace, PieceId,
    StreamOptions, Streamer, ThreadSource,
};
use enfilade_render::{GpuPiece, PieceMaker, PieceOf, Put, StreamLimits, Studio};

/// Time without a new piece after which a view counts as out of reach, besides the time that its largest piece may take.
const PATIENCE: Duration = Duration::from_secs(30);
/// Slowest link that is waited for, as for servers. [Units: bytes/s]
const SLOWEST: u64 = 16 << 10;
/// Time between two looks for what has come.
const PAUSE: Duration = Duration::from_millis(1);
/// Most vertices and indices that a byte of a piece decodes to, as [`read_piece`] checks: four times one of a byte.
const DECODED: u64 = 4;

/// A packed world whose head was read.
pub struct Packed {
    /// The head.
    pub head: Arc<PackedHead>,
    place: PackedPlace,
    name: String,
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

/// Numbers for people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StreamedCounts {
    /// Pieces on the adapter, and all pieces.
    pub n_there: [usize; 2],
    /// Unpacked size of pieces in memory or on their way, and the most it may be. [Units: bytes]
    pub kept: [u64; 2],
    /// Size as packed of what has come since the start, and of all pieces. [Units: bytes]
    pub loaded: [u64; 2],
    /// Requests on their way.
    pub n_in_flight: usize,
    /// Their size as packed. [Units: bytes]
    pub bytes_in_flight: u64,
    /// Pieces of the view.
    pub n_wanted: usize,
    /// Their unpacked size. [Units: bytes]
    pub bytes_wanted: u64,
    /// Pieces of the view that are not there yet, and fit.
    pub n_late: usize,
    /// Their unpacked size. [Units: bytes]
    pub bytes_late: u64,
    /// Pictures that came damaged or too large, and are drawn as a color.
    pub n_bare_pictures: usize,
}

/// A piece that was handed over.
struct Held {
    /// Number of its arrival: what was made of an earlier one is dropped.
    arrival: u64,
    /// Its parts on the adapter; none until it is there.
    parts: Vec<PieceOf>,
    is_there: bool,
}

/// A packed world whose pieces come and go.
pub struct Streamed {
    packed: Packed,
    streamer: Streamer,
    source: ThreadSource,
    changes: Changes,
    in_view: Vec<InView>,
    workshop: Workshop,
    held: BTreeMap<PieceId, Held>,
    /// ReadyPiece ready, not on the adapter.
    ready: VecDeque<ReadyPiece>,
    /// Handed over, and neither ready nor given up.
    n_making: usize,
    failures: BTreeMap<PieceId, FetchError>,
    /// Pieces that arrived whole and cannot be drawn.
    broken: BTreeMap<PieceId, String>,
    start: Instant,
    n_arrivals: u64,
    n_there: usize,
    bytes_loaded: u64,
    n_bare_pictures: usize,
}

impl Streamed {
    /// Starts to stream a world into a studio made for it by [`Studio::hollow`].
    ///
    /// # Errors
    ///
    /// A studio of a whole world.
    pub fn new(packed: Packed, studio: &Studio, options: StreamOptions) -> anyhow::Result<Self> {
        let maker = studio.world.piece_maker();
        let maker = maker.context("a packed world is streamed into a hollow one")?;
        let head = &packed.head;
        let pvs = head.world.pvs.clone();
        let streamer = Streamer::new(head.catalog.clone(), &head.world.graph, pvs, options);
        Ok(Self {
            source: packed.place.source(head),
            streamer,
            changes: Changes::default(),
            in_view: Vec::new(),
            workshop: Workshop::open(maker, studio.sight.clone()),
            held: BTreeMap::new(),
            ready: VecDeque::new(),
            n_making: 0,
            failures: BTreeMap::new(),
            broken: BTreeMap::new(),
            start: Instant::now(),
            n_arrivals: 0,
            n_there: 0,
            bytes_loaded: 0,
            n_bare_pictures: 0,
            packed,
        })
    }

    /// Sets the cells in view.
    pub fn look(&mut self, in_view: Vec<InView>) {
        self.in_view = in_view;
    }

    /// Runs a frame: frees what has to go, asks for what comes next, and puts what is ready on the adapter, for as long as `slice`,
    /// but one piece at least.
    ///
    /// # Errors
    ///
    /// An adapter without room for a piece.
    pub fn frame(&mut self, studio: &mut Studio, eye: Eye, slice: Duration) -> anyhow::Result<()> {
        let frame = Frame {
            now: self.start.elapsed(),
            eye,
            in_view: &self.in_view,
        };
        (self.streamer).update(&mut self.source, &frame, &mut self.changes);
        for piece in &self.changes.removed {
            if let Some(held) = self.held.remove(piece) {
                self.n_there -= usize::from(held.is_there);
                for of in held.parts {
                    studio.take(of);
                }
            }
        }
        for failed in self.changes.failed.drain(..) {
            self.failures.insert(failed.piece, failed.error);
        }
        for loaded in self.changes.added.drain(..) {
            let piece = loaded.piece;
            self.failures.remove(&piece);
            self.n_arrivals += 1;
            let sizes = self.streamer.catalog().pieces();
            self.bytes_loaded += sizes[piece.idx()].n_packed;
            let arrival = self.n_arrivals;
            let held = Held {
                arrival,
                parts: Vec::new(),
                is_there: false,
            };
            self.held.insert(piece, held);
            self.n_making += 1;
            self.workshop.make(piece, arrival, loaded.bytes);
        }
        for made in self.workshop.made.try_iter() {
            self.n_making -= 1;
            self.ready.push_back(made);
        }
        self.integrate(studio, slice)
    }

    /// Puts what is ready on the adapter.
    fn integrate(&mut self, studio: &mut Studio, slice: Duration) -> anyhow::Result<()> {
        let begin = Instant::now();
        while let Some(made) = self.ready.pop_front() {
            let held = self.held.get_mut(&made.piece);
            let Some(held) = held.filter(|h| h.arrival == made.arrival) else {
                continue;
            };
            let pieces = match made.pieces {
                Ok(pieces) => pieces,
                Err(why) => {
                    self.broken.insert(made.piece, why);
                    continue;
                }
            };
            for piece in &pieces {
                if studio.put(piece)? == Put::Full {
                    bail!(
                        "{}: the adapter has no room for piece {}; allow more memory",
                        self.packed.name,
                        made.piece.0
                    );
                }
                let is_picture = matches!(piece.of(), PieceOf::Image(_));
                self.n_bare_pictures += usize::from(is_picture && piece.n_bytes() == 0);
                held.parts.push(piece.of());
            }
            held.is_there = true;
            self.n_there += 1;
            if begin.elapsed() >= slice {
                break;
            }
        }
        Ok(())
    }

    /// Returns `true` if all that is in view and fits is on the adapter.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.streamer.view_settled() && self.n_making == 0 && self.ready.is_empty()
    }

    /// Waits until all pieces in view are on the adapter.
    ///
    /// # Errors
    ///
    /// Pieces that are missing or damaged; a server that sends no piece for half a minute, and a second for each 16 KiB of the
    /// largest.
    pub fn settle(&mut self, studio: &mut Studio, eye: Eye) -> anyhow::Result<()> {
        let mut last = (Instant::now(), self.n_arrivals);
        loop {
            self.frame(studio, eye, Duration::MAX)?;
            if let Some((piece, why)) = self.broken.first_key_value() {
                bail!(
                    "{}: piece {} cannot be drawn: {why}; pack the world again",
                    self.packed.name,
                    piece.0
                );
            }
            let absent = self.absent();
            if absent.is_empty() && self.is_settled() {
                return Ok(());
            }
            if self.n_arrivals != last.1 {
                last = (Instant::now(), self.n_arrivals);
            }
            let sizes = self.streamer.catalog().pieces();
            let largest = absent.iter().map(|p| sizes[p.idx()].n_packed).max();
            let patience = PATIENCE + Duration::from_secs(largest.unwrap_or(0) / SLOWEST);
            // Pieces that the streamer does not wait for, and those damaged on disk, do not come.
            let is_over = self.streamer.view_settled() && self.n_making == 0;
            let is_disk = matches!(self.packed.place, PackedPlace::Files(_));
            let is_failing = is_disk && absent.iter().any(|p| self.failures.contains_key(p));
            if is_over || is_failing || last.0.elapsed() > patience {
                bail!(self.told(&absent, last.0.elapsed()));
            }
            thread::sleep(PAUSE);
        }
    }

    /// Returns the pieces in view that did not arrive.
    fn absent(&self) -> BTreeSet<PieceId> {
        let catalog = self.streamer.catalog();
        let pieces = self
            .in_view
            .iter()
            .flat_map(|v| catalog.pieces_of(v.cell).iter().copied());
        pieces.filter(|p| !self.held.contains_key(p)).collect()
    }

    /// The error of a view that lacks pieces.
    fn told(&self, absent: &BTreeSet<PieceId>, waited: Duration) -> String {
        const SHOWN: usize = 8;
        let mut ids: Vec<String> = (absent.iter().take(SHOWN))
            .map(|p| p.0.to_string())
            .collect();
        if absent.len() > SHOWN {
            ids.push("…".into());
        }
        let why = absent.iter().find_map(|p| self.failures.get(p));
        let why = why.map_or_else(
            || format!("nothing came for {} s", waited.as_secs()),
            ToString::to_string,
        );
        format!(
            "{}: {} pieces that this view needs did not come ({}): {why}; see that the place is whole and in reach, and try again",
            self.packed.name,
            absent.len(),
            ids.join(", "),
        )
    }

    /// Returns the numbers as of the last frame.
    #[must_use]
    pub fn counts(&self) -> StreamedCounts {
        let counts = self.streamer.counts();
        let catalog = self.streamer.catalog();
        let sizes = catalog.pieces();
        let in_view = self.in_view.iter();
        let wanted: BTreeSet<PieceId> = in_view
            .flat_map(|v| catalog.pieces_of(v.cell).iter().copied())
            .collect();
        let bytes = |p: &PieceId| sizes[p.idx()].n_resident;
        let is_late = |p: &&PieceId| !self.held.get(p).is_some_and(|h| h.is_there);
        let late = || wanted.iter().filter(is_late);
        StreamedCounts {
            n_there: [self.n_there, sizes.len()],
            kept: [counts.n_kept, counts.max_kept],
            loaded: [self.bytes_loaded, sizes.iter().map(|p| p.n_packed).sum()],
            n_in_flight: counts.n_in_flight,
            bytes_in_flight: counts.bytes_in_flight,
            n_wanted: wanted.len(),
            bytes_wanted: wanted.iter().map(bytes).sum(),
            n_late: late().count(),
            bytes_late: late().map(bytes).sum(),
            n_bare_pictures: self.n_bare_pictures,
        }
    }
}

/// A piece made ready, or the reason why it cannot be.
struct ReadyPiece {
    piece: PieceId,
    arrival: u64,
    pieces: Result<Vec<GpuPiece>, String>,
}

/// A thread that makes pieces ready. It ends when this is dropped, after the piece at hand.
struct Workshop {
    orders: Sender<(PieceId, u64, Vec<u8>)>,
    made: Receiver<ReadyPiece>,
}

impl Workshop {
    fn open(maker: PieceMaker, sight: Sight) -> Self {
        let (orders, ordered) = channel::<(PieceId, u64, Vec<u8>)>();
        let (out, made) = channel();
        thread::spawn(move || {
            for (piece, arrival, bytes) in ordered {
                let pieces = make(&maker, &sight, &bytes);
                let made = ReadyPiece {
                    piece,
                    arrival,
                    pieces,
                };
                if out.send(made).is_err() {
                    break;
                }
            }
        });
        Self { orders, made }
    }

    fn make(&self, piece: PieceId, arrival: u64, bytes: Vec<u8>) {
        // The thread is there as long as the receiver of what it makes.
        let _ = self.orders.send((piece, arrival, bytes));
    }
}

/// Makes the bytes of a piece ready for the adapter.
fn make(maker: &PieceMaker, sight: &Sight, bytes: &[u8]) -> Result<Vec<GpuPiece>, String> {
    let pieces = match read_piece(bytes).map_err(|why| why.to_string())? {
        PieceContent::Batches(batches) => (batches.iter())
            .map(|(batch, primitive)| maker.batch(sight, *batch, primitive))
            .collect(),
        PieceContent::Mesh { mesh, primitives } => {
            maker.mesh(mesh, &primitives).map(|made| vec![made])
        }
        PieceContent::Image { image, bytes } => maker.image(image, &bytes).map(|made| vec![made]),
    };
    pieces.map_err(|why: enfilade_render::RenderError| why.to_string())
}
