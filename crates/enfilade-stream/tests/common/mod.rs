//! A program that streams, and a source that watches it.

#![allow(dead_code, reason = "not all tests use all of it")]

use std::collections::HashSet;
use std::time::Duration;

use enfilade_cpg::{CellId, Pvs, World};
use enfilade_stream::{
    Catalog, Changes, Eye, InView, PieceId, PieceSizes, Reply, SimulatedLink, SimulatedLinkOptions,
    Source, StreamFrame, StreamOptions, Streamer,
};
use enfilade_testkit::Rng;

/// A link that counts the memory of all that was asked for and is neither refused nor freed, by its own books.
pub(crate) struct Watched {
    pub(crate) link: SimulatedLink,
    pub(crate) catalog: Catalog,
    pub(crate) on_their_way: HashSet<PieceId>,
    /// Arrived, not handed over, unless dropped before.
    pub(crate) arrived: HashSet<PieceId>,
    /// In memory of the program.
    pub(crate) resident: HashSet<PieceId>,
    pub(crate) most: u64,
    pub(crate) max_in_flight: usize,
    pub(crate) max_bytes_in_flight: u64,
    pub(crate) log: Vec<PieceId>,
    pub(crate) n_canceled: usize,
    pub(crate) n_regretted: usize,
}

impl Watched {
    pub(crate) fn size(&self, piece: PieceId) -> u64 {
        self.catalog.pieces()[piece.idx()].n_resident
    }

    /// Memory of what is on its way or in memory of the program. What has arrived and is not handed over is left out, as
    /// dropping it cannot be seen from outside.
    pub(crate) fn n_bytes(&self) -> u64 {
        let all = self.on_their_way.iter().chain(&self.resident);
        all.map(|p| self.size(*p)).sum()
    }
}

impl Source for Watched {
    fn request(&mut self, piece: PieceId) {
        assert!(self.on_their_way.insert(piece), "{piece:?} twice");
        // Freed in this frame, and asked for again.
        self.n_regretted += usize::from(self.resident.contains(&piece));
        let n = self.on_their_way.len();
        assert!(n <= self.max_in_flight.max(1), "{n} requests");
        let packed = |p: &PieceId| self.catalog.pieces()[p.idx()].n_packed;
        let bytes: u64 = self.on_their_way.iter().map(packed).sum();
        assert!(n == 1 || bytes <= self.max_bytes_in_flight, "{bytes} bytes");
        self.log.push(piece);
        self.link.request(piece);
    }

    fn cancel(&mut self, piece: PieceId) {
        assert!(self.on_their_way.remove(&piece), "{piece:?} is not coming");
        self.n_canceled += 1;
        self.link.cancel(piece);
    }

    fn poll(&mut self, replies: &mut Vec<Reply>) {
        let first = replies.len();
        self.link.poll(replies);
        for reply in &replies[first..] {
            assert!(self.on_their_way.remove(&reply.piece));
            if reply.bytes.is_ok() {
                self.arrived.insert(reply.piece);
            }
        }
    }
}

/// A program: its streamer, link and clock.
pub(crate) struct Program {
    pub(crate) streamer: Streamer,
    pub(crate) source: Watched,
    pub(crate) options: StreamOptions,
    pub(crate) now: Duration,
    pub(crate) changes: Changes,
    pub(crate) eye: Eye,
    pub(crate) view: Vec<InView>,
}

pub(crate) const FRAME: Duration = Duration::from_micros(16_667);

impl Program {
    pub(crate) fn new(
        world: &World,
        catalog: &Catalog,
        pvs: Option<Pvs>,
        options: StreamOptions,
        link: SimulatedLinkOptions,
    ) -> Self {
        let source = Watched {
            link: SimulatedLink::new(catalog, link),
            catalog: catalog.clone(),
            on_their_way: HashSet::new(),
            arrived: HashSet::new(),
            resident: HashSet::new(),
            most: options.max_resident,
            max_in_flight: options.max_in_flight,
            max_bytes_in_flight: options.max_bytes_in_flight,
            log: Vec::new(),
            n_canceled: 0,
            n_regretted: 0,
        };
        Self {
            streamer: Streamer::new(catalog.clone(), &world.graph, pvs, options.clone()),
            source,
            options,
            now: Duration::ZERO,
            changes: Changes::default(),
            eye: Eye {
                speed: 1.4,
                ..Eye::default()
            },
            view: Vec::new(),
        }
    }

    /// Stands in a cell, and looks at cells with these shares.
    pub(crate) fn look(&mut self, world: &World, cell: u32, view: &[(u32, f32)]) {
        let [low, high] = world.graph.cells[cell as usize].aabb;
        self.eye.cell = Some(CellId(cell));
        self.eye.position = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
        let seen = |&(c, share)| InView {
            cell: CellId(c),
            share,
        };
        self.view = view.iter().map(seen).collect();
    }

    pub(crate) fn frame(&mut self) {
        self.now += FRAME;
        self.source.link.advance(self.now);
        let frame = StreamFrame {
            now: self.now,
            eye: self.eye,
            in_view: &self.view,
        };
        self.streamer
            .update(&mut self.source, &frame, &mut self.changes);
        for piece in &self.changes.removed {
            assert!(self.source.resident.remove(piece), "{piece:?} freed twice");
        }
        for loaded in &self.changes.added {
            assert!(self.source.arrived.remove(&loaded.piece));
            assert!(self.source.resident.insert(loaded.piece));
        }
        let kept = self.streamer.counts().n_kept;
        assert!(self.source.n_bytes() <= kept && kept <= self.source.most);
        assert_eq!(
            self.streamer.counts().n_in_flight,
            self.source.on_their_way.len()
        );
        for piece in &self.source.resident {
            assert!(self.streamer.is_resident(*piece));
        }
    }

    pub(crate) fn frames(&mut self, n: usize) {
        for _ in 0..n {
            self.frame();
        }
    }

    /// Runs until all is settled. Panics if it is not after ten minutes.
    pub(crate) fn settle(&mut self) {
        for _ in 0..36_000 {
            self.frame();
            if self.streamer.settled() {
                return;
            }
        }
        panic!("not settled after ten minutes: {:?}", self.streamer);
    }

    /// Runs until all in view is settled.
    pub(crate) fn settle_view(&mut self) {
        for _ in 0..36_000 {
            self.frame();
            if self.streamer.view_settled() {
                return;
            }
        }
        panic!("not settled after ten minutes: {:?}", self.streamer);
    }

    pub(crate) fn has_cell(&self, cell: u32) -> bool {
        let pieces = self.source.catalog.pieces_of(CellId(cell));
        pieces.iter().all(|p| self.source.resident.contains(p))
    }
}

/// One piece of `size` for each cell.
pub(crate) fn piece_a_cell(world: &World, size: u64) -> Catalog {
    let n = world.graph.cells.len() as u32;
    let piece = PieceSizes {
        n_packed: size,
        n_resident: size,
    };
    let rows: Vec<Vec<PieceId>> = (0..n).map(|c| vec![PieceId(c)]).collect();
    Catalog::new(vec![piece; n as usize], &rows)
}

/// Pieces of random sizes, alone and shared by random cells.
pub(crate) fn random_catalog(rng: &mut Rng, n_cells: usize) -> Catalog {
    let n = n_cells + rng.below(2 * n_cells);
    let mut rows = vec![Vec::new(); n_cells];
    let mut pieces = Vec::new();
    for i in 0..n {
        let size = 1 + rng.below(30_000) as u64;
        pieces.push(PieceSizes {
            n_packed: size / 3 + 1,
            n_resident: size,
        });
        for _ in 0..=rng.below(3) {
            rows[if i < n_cells { i } else { rng.below(n_cells) }].push(PieceId(i as u32));
        }
    }
    Catalog::new(pieces, &rows)
}
