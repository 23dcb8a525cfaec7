//! Victims: pieces fetched again on a walk within a small memory, against caches of others.

use std::collections::{BTreeSet, HashMap, HashSet};

use anyhow::ensure;
use enfilade::World;
use enfilade::stream::{
    Changes, PieceId, Policy, SimulatedLink, SimulatedLinkOptions, StreamOptions, Streamer,
};
use quick_cache::Weighter;
use quick_cache::unsync::Cache;

use super::replay::frame_of;
use super::site::{FRAME, Recorder, Recording, Step, Streamed, route};
use crate::rows::Figure;

const STRETCHES: usize = 200;
const SPEED: f32 = 1.4;

/// Misses of each cache on the same walk.
struct Misses {
    ours: u64,
    belady: u64,
    lru: u64,
    quick: u64,
    capacity: u64,
    all: u64,
}

fn misses(site: &Streamed) -> anyhow::Result<Misses> {
    let walk = Recorder::new(site).walk(&route(site, 2, STRETCHES)?, SPEED)?;
    // The pieces of the cells in view, frame by frame, as all caches get them.
    let wanted = |step: &Step| {
        let cells = step.in_view.iter();
        let pieces = cells.flat_map(|v| site.catalog().pieces_of(v.cell));
        pieces.copied().collect::<BTreeSet<PieceId>>()
    };
    let frames: Vec<BTreeSet<PieceId>> = walk.steps.iter().map(wanted).collect();
    let largest = frames
        .iter()
        .map(|f| site.resident(f.iter().copied()))
        .max();
    let all: HashSet<PieceId> = frames.iter().flatten().copied().collect();
    let all = site.resident(all);
    // Half of what the walk needs, and no less than what is in view.
    let capacity = (all / 2).max(largest.unwrap_or(0));
    ensure!(capacity > 0, "nothing is in view");
    Ok(Misses {
        ours: ours(site, &walk, capacity),
        belady: evicting(site, &frames, capacity, &Order::Belady),
        lru: evicting(site, &frames, capacity, &Order::Lru),
        quick: quick(site, &frames, capacity),
        capacity,
        all,
    })
}

/// The streamer's cache over a link that takes no time.
fn ours(site: &Streamed, walk: &Recording, capacity: u64) -> u64 {
    let options = StreamOptions {
        policy: Policy::Cache,
        max_resident: capacity,
        max_in_flight: usize::MAX,
        max_bytes_in_flight: u64::MAX,
        max_bytes_a_frame: u64::MAX,
        ..StreamOptions::default()
    };
    let link = SimulatedLinkOptions {
        latency: std::time::Duration::ZERO,
        bandwidth: 1e18,
        ..SimulatedLinkOptions::default()
    };
    let mut link = SimulatedLink::new(site.catalog(), link);
    let catalog = site.catalog().clone();
    let pvs = Some(site.pvs.clone());
    let mut streamer = Streamer::new(catalog, &site.world.graph, pvs, options);
    let mut changes = Changes::default();
    for step in &walk.steps {
        let now = FRAME + step.now;
        link.advance(now);
        streamer.update(&mut link, &frame_of(walk, step, now), &mut changes);
        link.advance(now + FRAME / 2);
        let now = now + FRAME / 2;
        streamer.update(&mut link, &frame_of(walk, step, now), &mut changes);
    }
    streamer.counts().n_requests
}

/// The piece that goes first, of those not wanted in this frame.
enum Order {
    /// That which is wanted again last, known from the rest of the walk (Belady 1966).
    Belady,
    /// That which was wanted last the longest ago.
    Lru,
}

fn evicting(site: &Streamed, frames: &[BTreeSet<PieceId>], capacity: u64, order: &Order) -> u64 {
    let mut uses: HashMap<PieceId, Vec<usize>> = HashMap::new();
    for (i, frame) in frames.iter().enumerate() {
        for &piece in frame {
            uses.entry(piece).or_default().push(i);
        }
    }
    let mut held: HashSet<PieceId> = HashSet::new();
    let (mut n_bytes, mut n_misses) = (0, 0);
    for (i, frame) in frames.iter().enumerate() {
        for &piece in frame {
            if held.contains(&piece) {
                continue;
            }
            n_misses += 1;
            let size = site.resident([piece]);
            while n_bytes + size > capacity {
                let key = |p: &PieceId| {
                    let uses = &uses[p];
                    let next = uses.partition_point(|u| *u <= i);
                    match order {
                        Order::Belady => uses.get(next).copied().unwrap_or(usize::MAX),
                        Order::Lru => frames.len() - next.checked_sub(1).map_or(0, |k| uses[k]),
                    }
                };
                let others = held.iter().filter(|p| !frame.contains(p));
                let Some(&victim) = others.max_by_key(|p| (key(p), **p)) else {
                    break;
                };
                held.remove(&victim);
                n_bytes -= site.resident([victim]);
            }
            held.insert(piece);
            n_bytes += size;
        }
    }
    n_misses
}

#[derive(Clone)]
struct Sizes(Vec<u64>);

impl Weighter<PieceId, ()> for Sizes {
    fn weight(&self, piece: &PieceId, (): &()) -> u64 {
        self.0[piece.idx()].max(1)
    }
}

/// `quick_cache`, asked for each piece in view whenever the view changes.
fn quick(site: &Streamed, frames: &[BTreeSet<PieceId>], capacity: u64) -> u64 {
    let sizes: Vec<u64> = site
        .catalog()
        .pieces()
        .iter()
        .map(|p| p.n_resident)
        .collect();
    let n = sizes.len();
    let mut cache = Cache::with_weighter(n, capacity, Sizes(sizes));
    let mut n_misses = 0;
    let mut last = None;
    for frame in frames {
        if last == Some(frame) {
            continue;
        }
        last = Some(frame);
        for &piece in frame {
            if cache.get(&piece).is_none() {
                n_misses += 1;
                cache.insert(piece, ());
            }
        }
    }
    n_misses
}

fn note(m: &Misses) -> String {
    format!(
        "misses: ours {}, Belady {}, LRU {}, quick_cache {}; {} kB of {} kB",
        m.ours,
        m.belady,
        m.lru,
        m.quick,
        m.capacity / 1000,
        m.all / 1000
    )
}

/// Misses divided by Belady's.
pub(super) fn belady(world: &World) -> anyhow::Result<Figure> {
    let m = misses(&Streamed::of(world)?)?;
    Ok(Figure::new(m.ours as f64 / m.belady as f64, 1.15, note(&m)))
}

/// Misses less the fewer of those of LRU and `quick_cache`: fewer than both.
pub(super) fn peers(world: &World) -> anyhow::Result<Figure> {
    let m = misses(&Streamed::of(world)?)?;
    Ok(Figure::new(
        m.ours as f64 - m.lru.min(m.quick) as f64,
        -1.0,
        note(&m),
    ))
}
