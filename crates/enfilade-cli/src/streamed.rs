//! Packed worlds drawn from pieces that come as they are needed, and go.
//!
//! [`Streamed::frame`] is the main flow: the [`Streamer`] says what comes and goes, a thread makes pieces ready for the adapter, and
//! each frame puts some of them there. Pictures settle in all that they show ([`Streamed::settle`]); a window draws what is there.

mod packed;
#[cfg(test)]
mod tests;
mod workshop;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use enfilade::runtime::{Sight, SightState};
use enfilade::stream::{
    Catalog, Changes, Eye, FetchError, InView, PackedPlace, PieceId, Policy, StreamFrame,
    StreamOptions, Streamer, ThreadSource,
};
use enfilade_render::{Gpu, PieceOf, Put, RenderError, Studio};

pub use self::packed::{Packed, cells_in_view, view_of};
use self::workshop::{ReadyPiece, Workshop};

/// Time without a new piece after which a view counts as out of reach, besides the time that its largest piece may take.
const PATIENCE: Duration = Duration::from_secs(30);
/// Slowest link that is waited for, as for servers. [Units: bytes/s]
const SLOWEST: u64 = 16 << 10;
/// Time between two looks for what has come.
const PAUSE: Duration = Duration::from_millis(1);

/// Numbers for people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StreamedCounts {
    /// Pieces on the adapter, and all pieces.
    pub n_there: [usize; 2],
    /// Size of pieces in memory or on their way, and the most it may be; on the adapter, in walks, and otherwise unpacked. [Units: bytes]
    pub kept: [u64; 2],
    /// Size as packed of what has come since the start, and of all pieces. [Units: bytes]
    pub loaded: [u64; 2],
    /// Requests on their way.
    pub n_in_flight: usize,
    /// Their size as packed. [Units: bytes]
    pub bytes_in_flight: u64,
    /// Pieces of the view.
    pub n_wanted: usize,
    /// Their size, as of those kept. [Units: bytes]
    pub bytes_wanted: u64,
    /// Pieces of the view that are not there.
    pub n_late: usize,
    /// Their size, as of those kept. [Units: bytes]
    pub bytes_late: u64,
    /// Pictures that came damaged or too large, and are drawn as a color.
    pub n_bare_pictures: usize,
}

impl fmt::Display for StreamedCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mib = |n: u64| n as f64 / f64::from(1 << 20);
        let [there, all] = self.n_there;
        write!(
            f,
            "{there} of {all} pieces resident, {:.1} of {:.0} MiB\n\
             wanted {} ({:.1} MiB), in flight {} ({:.1} MiB), late {} ({:.1} MiB)",
            mib(self.kept[0]),
            mib(self.kept[1]),
            self.n_wanted,
            mib(self.bytes_wanted),
            self.n_in_flight,
            mib(self.bytes_in_flight),
            self.n_late,
            mib(self.bytes_late)
        )
    }
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
    /// Pieces of the cells in view.
    wanted: BTreeSet<PieceId>,
    workshop: Workshop,
    held: BTreeMap<PieceId, Held>,
    /// Made ready, not on the adapter.
    ready: VecDeque<ReadyPiece>,
    /// Made ready, and without room on the adapter.
    waiting: Vec<ReadyPiece>,
    /// `true` if waiting pieces may find room, or are needed more than before.
    may_fit: bool,
    /// Handed over, and neither ready nor given up.
    n_making: usize,
    /// Memory of pieces handed over that are not on the adapter, and the most before others are taken. [Units: bytes]
    backlog: u64,
    max_backlog: u64,
    failures: BTreeMap<PieceId, FetchError>,
    /// Pieces that arrived whole and cannot be drawn.
    broken: BTreeMap<PieceId, String>,
    start: Instant,
    n_arrivals: u64,
    n_there: usize,
    bytes_loaded: u64,
    bytes_packed: u64,
    n_bare_pictures: usize,
}

impl Streamed {
    /// Makes a studio for pictures of given views, and streams into it: there is room for the largest of them.
    ///
    /// # Errors
    ///
    /// A view larger than the adapter's buffers.
    pub fn for_views(
        packed: Packed,
        gpu: Gpu,
        sight: Sight,
        state: SightState,
        views: &[Vec<InView>],
    ) -> anyhow::Result<(Studio, Self)> {
        let largest = views.iter().map(|v| packed.size_of(v)).max().unwrap_or(0);
        let limits = packed.limits_for(largest);
        let format = wgpu::TextureFormat::Rgba8UnormSrgb;
        let mut studio = Studio::hollow(gpu, &packed.head.world, sight, &limits, format)?;
        studio.state = state;
        let options = StreamOptions {
            policy: Policy::Cache,
            max_resident: largest,
            max_bytes_a_frame: u64::MAX,
            ..StreamOptions::default()
        };
        let catalog = packed.head.catalog.clone();
        let streamed = Self::new(packed, catalog, &studio, options, u64::MAX)?;
        Ok((studio, streamed))
    }

    /// Makes a studio for a walk, and streams into it: pieces take at most `memory`, a half of it for triangles, an eighth for
    /// those on their way to the adapter. [Units: bytes]
    ///
    /// # Errors
    ///
    /// Memory beyond the adapter's buffers.
    pub fn for_walk(
        packed: Packed,
        gpu: Gpu,
        sight: Sight,
        memory: u64,
        format: wgpu::TextureFormat,
    ) -> anyhow::Result<(Studio, Self)> {
        let (limits, transit) = packed.limits_within(memory);
        let studio = Studio::hollow(gpu, &packed.head.world, sight, &limits, format)?;
        let options = StreamOptions {
            policy: Policy::default(),
            max_resident: limits.triangle_bytes + limits.picture_bytes,
            ..StreamOptions::default()
        };
        let catalog = packed.on_adapter();
        let streamed = Self::new(packed, catalog, &studio, options, transit)?;
        Ok((studio, streamed))
    }

    fn new(
        packed: Packed,
        catalog: Catalog,
        studio: &Studio,
        options: StreamOptions,
        max_backlog: u64,
    ) -> anyhow::Result<Self> {
        let maker = studio.world.piece_maker();
        let maker = maker.context("a packed world is streamed into a hollow one")?;
        let head = &packed.head;
        let bytes_packed = catalog.pieces().iter().map(|p| p.n_packed).sum();
        let pvs = head.world.pvs.clone();
        Ok(Self {
            source: packed.place.source(head),
            streamer: Streamer::new(catalog, &head.world.graph, pvs, options),
            changes: Changes::default(),
            in_view: Vec::new(),
            wanted: BTreeSet::new(),
            workshop: Workshop::open(maker, studio.sight.clone()),
            held: BTreeMap::new(),
            ready: VecDeque::new(),
            waiting: Vec::new(),
            may_fit: false,
            n_making: 0,
            backlog: 0,
            max_backlog,
            failures: BTreeMap::new(),
            broken: BTreeMap::new(),
            start: Instant::now(),
            n_arrivals: 0,
            n_there: 0,
            bytes_loaded: 0,
            bytes_packed,
            n_bare_pictures: 0,
            packed,
        })
    }

    /// Returns the packed world.
    #[must_use]
    pub fn packed(&self) -> &Packed {
        &self.packed
    }

    /// Returns the cells in view.
    #[must_use]
    pub fn in_view(&self) -> &[InView] {
        &self.in_view
    }

    /// Sets the cells in view.
    pub fn look(&mut self, in_view: Vec<InView>) {
        let cells = |view: &[InView]| view.iter().map(|v| v.cell).collect::<Vec<_>>();
        if cells(&self.in_view) == cells(&in_view) {
            // Only shares of the screen have changed.
            self.in_view = in_view;
            return;
        }
        let catalog = self.streamer.catalog();
        let pieces = in_view.iter().flat_map(|v| catalog.pieces_of(v.cell));
        self.wanted = pieces.copied().collect();
        self.in_view = in_view;
        self.may_fit = true;
    }

    /// Runs a frame: frees what has to go, asks for what comes next, and puts what is ready on the adapter, for as long as `slice`,
    /// but one piece at least. Pieces in view that find no room there take that of others.
    pub fn frame(&mut self, studio: &mut Studio, eye: Eye, slice: Duration) {
        // Otherwise what has come would pile up.
        if self.backlog <= self.max_backlog {
            let frame = StreamFrame {
                now: self.start.elapsed(),
                eye,
                in_view: &self.in_view,
            };
            (self.streamer).update(&mut self.source, &frame, &mut self.changes);
            self.follow(studio);
        }
        for made in self.workshop.made.try_iter() {
            self.n_making -= 1;
            self.ready.push_back(made);
        }
        if std::mem::take(&mut self.may_fit) {
            for made in self.waiting.drain(..) {
                self.backlog += size(&self.streamer, made.piece);
                self.ready.push_back(made);
            }
        }
        let begin = Instant::now();
        while let Some(made) = self.ready.pop_front() {
            self.backlog -= size(&self.streamer, made.piece);
            self.put(studio, made);
            if begin.elapsed() >= slice {
                break;
            }
        }
    }

    /// Frees what the streamer frees, and takes what it hands over.
    fn follow(&mut self, studio: &mut Studio) {
        for piece in std::mem::take(&mut self.changes.removed) {
            self.free(studio, piece);
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
            self.backlog += sizes[piece.idx()].n_resident;
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
    }

    fn free(&mut self, studio: &mut Studio, piece: PieceId) {
        let Some(held) = self.held.remove(&piece) else {
            return;
        };
        self.n_there -= usize::from(held.is_there);
        for of in held.parts {
            studio.take(of);
        }
        self.waiting.retain(|made| made.piece != piece);
        self.may_fit = true;
    }

    /// Puts a piece on the adapter, or lets it wait.
    fn put(&mut self, studio: &mut Studio, made: ReadyPiece) {
        let ReadyPiece { piece, arrival, .. } = made;
        let is_current = |s: &Self| s.held.get(&piece).is_some_and(|h| h.arrival == arrival);
        while is_current(self) {
            let put = match &made.pieces {
                Ok(pieces) => pieces.iter().try_fold(Put::Done, |so_far, piece| {
                    Ok(match so_far {
                        Put::Done => studio.put(piece)?,
                        Put::Full => Put::Full,
                    })
                }),
                Err(why) => {
                    self.broken.insert(piece, why.clone());
                    return;
                }
            };
            let parts = made.pieces.iter().flatten();
            if let Ok(Put::Done) = put {
                let pictures = parts
                    .clone()
                    .filter(|p| matches!(p.of(), PieceOf::Image(_)));
                self.n_bare_pictures += pictures.filter(|p| p.n_bytes() == 0).count();
                if let Some(held) = self.held.get_mut(&piece) {
                    held.parts = parts.map(enfilade_render::GpuPiece::of).collect();
                    held.is_there = true;
                }
                self.n_there += 1;
                return;
            }
            for part in parts {
                studio.take(part.of());
            }
            match put {
                Err(why) => {
                    let why: RenderError = why;
                    self.broken.insert(piece, why.to_string());
                    return;
                }
                Ok(_) if self.wanted.contains(&piece) && self.make_room(studio) => {}
                Ok(_) => {
                    self.waiting.push(made);
                    return;
                }
            }
        }
    }

    /// Frees the piece out of view that came first; returns `false` if there is none.
    fn make_room(&mut self, studio: &mut Studio) -> bool {
        let others = self
            .held
            .iter()
            .filter(|(p, h)| h.is_there && !self.wanted.contains(p));
        let Some((&oldest, _)) = others.min_by_key(|(_, h)| h.arrival) else {
            return false;
        };
        self.free(studio, oldest);
        self.streamer.forget(oldest);
        true
    }

    /// Returns `true` if all that is in view and fits is on the adapter.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.streamer.view_settled() && self.n_making == 0 && self.ready.is_empty()
    }

    /// Returns the last problem with a piece in view, for people.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let wanted = || self.wanted.iter();
        let failed = wanted().find_map(|p| self.failures.get(p));
        let broken = || wanted().find_map(|p| self.broken.get(p)).cloned();
        failed.map(ToString::to_string).or_else(broken)
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
            self.frame(studio, eye, Duration::MAX);
            if let Some((piece, why)) = self.broken.first_key_value() {
                bail!(
                    "{}: piece {} cannot be drawn: {why}; pack the world again",
                    self.packed.name,
                    piece.0
                );
            }
            if let Some(made) = self.waiting.iter().find(|m| self.wanted.contains(&m.piece)) {
                bail!(
                    "{}: the adapter has no room for piece {}; choose another with --adapter, or a smaller view",
                    self.packed.name,
                    made.piece.0
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
        let absent = self.wanted.iter().filter(|p| !self.held.contains_key(p));
        absent.copied().collect()
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
        let is_late = |p: &&PieceId| !self.held.get(p).is_some_and(|h| h.is_there);
        let late = || self.wanted.iter().filter(is_late);
        let bytes = |p: &PieceId| size(&self.streamer, *p);
        StreamedCounts {
            n_there: [self.n_there, self.streamer.catalog().pieces().len()],
            kept: [counts.n_kept, counts.max_kept],
            loaded: [self.bytes_loaded, self.bytes_packed],
            n_in_flight: counts.n_in_flight,
            bytes_in_flight: counts.bytes_in_flight,
            n_wanted: self.wanted.len(),
            bytes_wanted: self.wanted.iter().map(bytes).sum(),
            n_late: late().count(),
            bytes_late: late().map(bytes).sum(),
            n_bare_pictures: self.n_bare_pictures,
        }
    }
}

fn size(streamer: &Streamer, piece: PieceId) -> u64 {
    streamer.catalog().pieces()[piece.idx()].n_resident
}
