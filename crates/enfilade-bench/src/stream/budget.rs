//! The budget over random worlds, views, limits and links, by books of its own.

use std::collections::HashSet;
use std::time::Duration;

use enfilade::CellId;
use enfilade::stream::{
    Catalog, Changes, Eye, InView, PieceId, PieceSizes, Policy, Reply, SimulatedLink,
    SimulatedLinkOptions, Source, StreamFrame, StreamOptions, Streamer,
};
use enfilade_testkit::oracle::near_sets;
use enfilade_testkit::{GridParams, Rng, room_grid};

use super::site::FRAME;
use crate::rows::Figure;

const WORLDS: u64 = 1000;
const FRAMES: usize = 500;

/// A link that counts the requests on their way.
struct Counted {
    link: SimulatedLink,
    open: HashSet<PieceId>,
    n_twice: usize,
}

impl Source for Counted {
    fn request(&mut self, piece: PieceId) {
        self.n_twice += usize::from(!self.open.insert(piece));
        self.link.request(piece);
    }

    fn cancel(&mut self, piece: PieceId) {
        self.open.remove(&piece);
        self.link.cancel(piece);
    }

    fn poll(&mut self, replies: &mut Vec<Reply>) {
        let first = replies.len();
        self.link.poll(replies);
        for reply in &replies[first..] {
            self.open.remove(&reply.piece);
        }
    }
}

fn draw_catalog(rng: &mut Rng, n_cells: usize) -> Catalog {
    let mut rows = vec![Vec::new(); n_cells];
    let pieces = (0..3 * n_cells as u32).map(|p| {
        for _ in 0..=rng.below(3) {
            rows[rng.below(n_cells)].push(PieceId(p));
        }
        let size = 1 + rng.below(100_000) as u64;
        PieceSizes {
            n_packed: size / 3 + 1,
            n_resident: size,
        }
    });
    Catalog::new(pieces.collect(), &rows)
}

/// Adds one of five cells.
fn draw_view(rng: &mut Rng, n_cells: usize, in_view: &mut Vec<InView>) {
    for cell in (0..n_cells as u32).map(CellId) {
        if rng.chance(0.2) {
            let share = rng.unit() as f32;
            in_view.push(InView { cell, share });
        }
    }
}

/// Counts frames with more memory on its way and resident than the budget, or more requests than the limit, and requests that
/// do not end once the view rests.
pub(super) fn budget(_: &str) -> anyhow::Result<Figure> {
    let (mut n_above, mut n_open, mut n_frames, mut n_requests, mut most) = (0, 0, 0, 0, 0.0);
    for seed in 0..WORLDS {
        let mut rng = Rng::new(seed);
        let world = room_grid(&GridParams {
            furniture: 0,
            merges: 0.2,
            ..GridParams::offices(5 + rng.below(60), seed)
        });
        let n_cells = world.graph.cells.len();
        let catalog = draw_catalog(&mut rng, n_cells);
        let pieces = catalog.pieces().to_vec();
        let all: u64 = pieces.iter().map(|p| p.n_resident).sum();
        let policies = [
            Policy::Minimal,
            Policy::Delayed { first_share: 0.3 },
            Policy::Cache,
            Policy::default(),
        ];
        let options = StreamOptions {
            policy: policies[rng.below(4)],
            max_resident: (all as f64 * rng.unit()) as u64,
            max_in_flight: 1 + rng.below(12),
            ..StreamOptions::default()
        };
        let link = SimulatedLinkOptions {
            latency: Duration::from_millis(rng.below(300) as u64),
            bandwidth: rng.range(1e5, 5e6),
            error_rate: rng.range(0.0, 0.3),
            short_read_rate: rng.range(0.0, 0.5),
            seed,
        };
        let mut source = Counted {
            link: SimulatedLink::new(&catalog, link),
            open: HashSet::new(),
            n_twice: 0,
        };
        let pvs = rng.chance(0.8).then(|| near_sets(&world.graph));
        let mut streamer = Streamer::new(catalog, &world.graph, pvs, options.clone());
        let mut changes = Changes::default();
        let mut resident: HashSet<PieceId> = HashSet::new();
        let (mut eye, mut in_view) = (Eye::default(), Vec::new());
        let mut n_rest = 0;
        for i in 0.. {
            if i < FRAMES && rng.chance(0.1) {
                let cell = rng.below(n_cells);
                let low = world.graph.cells[cell].aabb[0];
                eye = Eye {
                    cell: Some(CellId(cell as u32)),
                    position: low,
                    speed: rng.range(0.0, 6.0) as f32,
                };
                in_view.clear();
                draw_view(&mut rng, n_cells, &mut in_view);
            }
            let now = FRAME * (i as u32 + 1);
            source.link.advance(now);
            let frame = StreamFrame {
                now,
                eye,
                in_view: &in_view,
            };
            streamer.update(&mut source, &frame, &mut changes);
            changes.removed.iter().for_each(|p| {
                resident.remove(p);
            });
            resident.extend(changes.added.iter().map(|l| l.piece));
            let held = resident.iter().chain(&source.open);
            let bytes: u64 = held.map(|p| pieces[p.idx()].n_resident).sum();
            let bytes = bytes.max(streamer.counts().n_kept);
            let is_above =
                bytes > options.max_resident || source.open.len() > options.max_in_flight;
            n_above += usize::from(is_above);
            most = f64::max(most, bytes as f64 / options.max_resident.max(1) as f64);
            n_frames += 1;
            // At rest until no request is open for ten seconds, which is longer than any wait; at most 20 minutes.
            n_rest = if source.open.is_empty() {
                n_rest + 1
            } else {
                0
            };
            if i > FRAMES && (n_rest > 600 || i > 72_000) {
                break;
            }
        }
        n_open += source.open.len() + source.n_twice + usize::from(!streamer.view_settled());
        n_requests += streamer.counts().n_requests;
    }
    let note = format!(
        "{n_above} frames above a limit, {n_open} requests without end, of {n_frames} frames and {n_requests} requests in \
             {WORLDS} worlds; at most {most:.4} of a budget"
    );
    Ok(Figure::new((n_above + n_open) as f64, 0.0, note))
}
