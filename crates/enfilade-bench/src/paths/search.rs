//! Paths: distances between all cells, size of their table, time of hops and flips; lengths of walks beside Recast.

use std::hint::black_box;
use std::time::Instant;

use anyhow::Context;
use enfilade::cpg::{CellId, PortalId, World};
use enfilade::geom::DVec3;
use enfilade::world::{
    Agent, Hops, Layout, LayoutExit, LengthSearch, PartId, Path, PathSearch, Place, Sampling,
    Space, WalkMap, Ways,
};
use enfilade_testkit::oracle::least_lengths;
use enfilade_testkit::{GridParams, Rng, room_grid};

use super::graphs::graph;
use crate::rows::Figure;

/// Repetitions of a timed operation.
const REPEATS: usize = 5;

const ROOT: PartId = PartId::ROOT;

fn place(cell: CellId) -> Place {
    Place { part: ROOT, cell }
}

fn hops(name: &str) -> anyhow::Result<(Space, Vec<f64>, Hops)> {
    let (middles, space) = graph(name)?;
    let layout = space.layout(ROOT);
    let steps: Vec<f64> = (0..layout.n_portals() as u32)
        .map(|p| {
            let opening = layout.opening(PortalId(p));
            let [a, b] = opening
                .cells()
                .map(|c| middles[c.idx()].distance(opening.center()));
            a + b
        })
        .collect();
    let hops = Hops::new(&space, |_, p| Some(steps[p.idx()]));
    Ok((space, steps, hops))
}

/// Returns lengths from a cell to all others, in whole tenths of a millimeter.
fn dijkstra(layout: &Layout, from: CellId, step: impl Fn(LayoutExit) -> Option<u64>) -> Vec<u64> {
    let lengths = least_lengths(layout.n_cells(), from.0, |cell| {
        let exits = layout.exits(CellId(cell)).iter();
        exits.filter_map(|&e| Some((e.to.0, step(e)?)))
    });
    lengths.into_iter().map(|l| l.unwrap_or(u64::MAX)).collect()
}

/// Counts pairs of cells whose distance differs from Dijkstra's algorithm on all cells, or whose next portal leads
/// elsewhere: initially, and after random flips of doors.
pub(super) fn distances(name: &str) -> anyhow::Result<Figure> {
    let (space, steps, mut hops) = hops(name)?;
    let layout = space.layout(ROOT);
    let mut rng = Rng::new(1);
    let mut is_open = vec![true; layout.n_portals()];
    let (mut n_pairs, mut n_wrong) = (0_u64, 0_u64);
    for n_flips in [0, 20, 200] {
        for _ in 0..n_flips {
            let p = PortalId(rng.below(layout.n_portals()) as u32);
            is_open[p.idx()] ^= true;
            hops.set_open(ROOT, p, is_open[p.idx()]);
        }
        let step = |e: LayoutExit| {
            is_open[e.portal.idx()].then(|| (steps[e.portal.idx()] * 1e4).round() as u64)
        };
        for from in (0..layout.n_cells() as u32).map(CellId) {
            let expected = dijkstra(layout, from, step);
            for to in (0..layout.n_cells() as u32).map(CellId) {
                n_pairs += 1;
                let least = expected[to.idx()];
                let next = hops.next(&space, place(to), place(from));
                let next = next.map(|hop| LayoutExit {
                    portal: hop.portal,
                    to: hop.to.cell,
                });
                let is_next = match next {
                    Some(exit) => step(exit).is_some_and(|s| s + expected[exit.to.idx()] == least),
                    None => from == to || least == u64::MAX,
                };
                let length = hops.distance(&space, place(from), place(to));
                let length = length.map_or(u64::MAX, |d| (d * 1e4).round() as u64);
                n_wrong += u64::from(length != least || !is_next);
            }
        }
    }
    let note = format!("pairs that differ, of {n_pairs}, with 0, 20 and 220 flips");
    Ok(Figure::new(n_wrong as f64, 0.0, note))
}

/// Measures junctions per cell.
pub(super) fn contraction(name: &str) -> anyhow::Result<Figure> {
    let (space, _, hops) = hops(name)?;
    let (n, of) = (hops.n_junctions(ROOT), space.layout(ROOT).n_cells());
    let note = format!(
        "{of} cells, {n} junctions: {:.1} times fewer",
        of as f64 / n as f64
    );
    Ok(Figure::new(n as f64 / of as f64, 0.2, note))
}

/// Measures the time to find the next portal, for random pairs of cells. [Units: ns]
pub(super) fn next_hop(name: &str) -> anyhow::Result<Figure> {
    let (space, _, mut hops) = hops(name)?;
    let layout = space.layout(ROOT);
    let mut rng = Rng::new(2);
    let mut cell = || place(CellId(rng.below(layout.n_cells()) as u32));
    let pairs: Vec<[Place; 2]> = (0..1 << 16).map(|_| [cell(), cell()]).collect();
    let mut least = f64::INFINITY;
    // The table exceeds the processor's caches: other programs slow most repetitions down.
    for _ in 0..20 * REPEATS {
        let start = Instant::now();
        for &[from, to] in &pairs {
            black_box(hops.next(&space, from, to));
        }
        least = least.min(start.elapsed().as_secs_f64() / pairs.len() as f64);
    }
    Ok(Figure::new(least * 1e9, 100.0, "ns"))
}

/// Measures each flip of every door, and returns the number of junctions. [Units: ms]
fn flips(name: &str) -> anyhow::Result<(Vec<f64>, usize)> {
    let (space, _, mut hops) = hops(name)?;
    let layout = space.layout(ROOT);
    // The fastest of several repetitions of each flip, to exclude time of other programs.
    let mut least = vec![f64::INFINITY; 2 * layout.n_portals()];
    for _ in 0..REPEATS {
        for (i, least) in least.iter_mut().enumerate() {
            let start = Instant::now();
            hops.set_open(ROOT, PortalId(i as u32 / 2), i % 2 == 1);
            *least = least.min(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    Ok((least, hops.n_junctions(ROOT)))
}

/// Returns the slowest flip and the mean, with a note.
fn slowest_and_mean(name: &str) -> anyhow::Result<(f64, f64, String)> {
    let (flips, n_junctions) = flips(name)?;
    let slowest = flips.iter().copied().fold(0.0, f64::max);
    let (n, mean) = (flips.len(), flips.iter().sum::<f64>() / flips.len() as f64);
    let note = format!(
        "ms; {n} flips: {slowest:.3} the slowest, {mean:.4} on average; {n_junctions} junctions"
    );
    Ok((slowest, mean, note))
}

/// Measures the slowest flip of all doors. [Units: ms]
pub(super) fn door_flip(name: &str) -> anyhow::Result<Figure> {
    let (value, _, note) = slowest_and_mean(name)?;
    Ok(Figure::new(value, 1.0, note))
}

/// Measures the mean flip where hardly a cell leaves the table. [Units: ms]
pub(super) fn mean_flip(name: &str) -> anyhow::Result<Figure> {
    let (_, value, note) = slowest_and_mean(name)?;
    Ok(Figure::new(value, 1.0, note))
}

/// Measures a length search through 1,000 rooms, to all portals, with one point in each. [Units: ms]
pub(super) fn search(_: &str) -> anyhow::Result<Figure> {
    let params = GridParams {
        outdoors: false,
        ..GridParams::offices(1000, 1)
    };
    let layout = Layout::new(&room_grid(&params));
    let mut times = [Sampling::MIDDLES, Sampling::default()].map(|sampling| {
        let ways = Ways::new(&layout, sampling);
        let (mut search, mut least) = (LengthSearch::new(), f64::INFINITY);
        for i in 0..20 {
            let cell = CellId(i * 31 % layout.n_cells() as u32);
            let start = Instant::now();
            let from = layout.cell(cell).bounds.center();
            search.run(&ways, cell, from, f64::INFINITY, |_| Some(0.0));
            least = least.min(start.elapsed().as_secs_f64() * 1e3);
        }
        least
    });
    times.sort_by(f64::total_cmp);
    Ok(Figure {
        value: times[0],
        // The budget of 64 sources at 5 µs each.
        most: 0.32,
        note: format!(
            "ms with one point a portal; {:.2} ms with ten; {} portals",
            times[1],
            layout.n_portals()
        ),
    })
}

/// Pairs of points and Recast's lengths, generated by `scripts/recast_lengths.mjs`.
const INSTITUTE: &str = include_str!("../../peers/recast-institute.csv");
const DUNGEON: &str = include_str!("../../peers/recast-dungeon.csv");

/// The walker of these pairs.
const RECAST: Agent = Agent {
    radius: 0.3,
    height: 1.8,
    eye: 1.6,
    step: 0.4,
    slope: std::f64::consts::FRAC_PI_4,
};

/// Compares our lengths with Recast's, pair by pair where both find a path, and lists the pairs that only one finds.
fn lengths(world: &World, pairs: &str) -> anyhow::Result<Figure> {
    let space = Space::new(world.clone())?;
    let start = Instant::now();
    let map = WalkMap::with_objects(&space, RECAST, |_, _| false);
    let made = start.elapsed().as_secs_f64();
    let (mut search, mut path) = (PathSearch::new(), Path::default());
    let (mut ratios, mut seconds) = (Vec::new(), 0.0);
    let mut only = [Vec::new(), Vec::new()];
    let mut n_neither = 0;
    for line in pairs.lines().skip(1) {
        let numbers: Vec<&str> = line.split(',').collect();
        let number = |i: usize| numbers[i].parse::<f64>().with_context(|| line.to_owned());
        let end = |i| anyhow::Ok(DVec3::new(number(i)?, number(i + 1)?, number(i + 2)?));
        let ends = [end(0)?, end(3)?];
        let from_to = ends.map(|p| (PartId::ROOT, p));
        let start = Instant::now();
        let found = search.find(&map, &space, from_to, |_, _| true, &mut path);
        seconds += start.elapsed().as_secs_f64();
        match (found, numbers[6].is_empty()) {
            (Ok(()), false) => ratios.push(path.length_in_plan / number(6)?),
            (Ok(()), true) => only[0].push(ends),
            (Err(_), false) => only[1].push(ends),
            (Err(_), true) => n_neither += 1,
        }
    }
    let n = ratios.len();
    anyhow::ensure!(n > 0, "no pair that both find");
    let mean = ratios.iter().sum::<f64>() / n as f64;
    let n_pairs = n + only[0].len() + only[1].len() + n_neither;
    let [ours, theirs] = only.map(|ends| {
        let listed: Vec<String> = ends.iter().map(|[a, b]| format!("{a:.1} {b:.1}")).collect();
        format!("{}: {}", ends.len(), listed.join("; "))
    });
    let note = format!(
        "worst of {n} pairs, length in plan by Recast's, mean {mean:.4}; only ours finds {ours}; only Recast finds {theirs}; \
             neither {n_neither}; {made:.1} s to make, {:.2} ms a path",
        seconds * 1e3 / n_pairs as f64
    );
    Ok(Figure::new(
        ratios.into_iter().fold(0.0, f64::max),
        1.02,
        note,
    ))
}

pub(super) fn institute(world: &World) -> anyhow::Result<Figure> {
    lengths(world, INSTITUTE)
}

pub(super) fn dungeon(world: &World) -> anyhow::Result<Figure> {
    lengths(world, DUNGEON)
}
