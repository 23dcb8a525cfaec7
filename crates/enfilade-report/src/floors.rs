//! Finds the heights at which the cells have floors.
//!
//! Points spread over the level triangles are located in a cell. The heights of a cell's points, weighted by area,
//! form a histogram; its heaviest windows are the cell's levels. A cell on sloping ground has several, as does one
//! that contains a stair.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{CellId, World};
use enfilade_geom::{Attitude, DVec2, DVec3, Triangle, is_rather_level, triangle_area_normal};

/// Half the height of the window in which floor areas add up to one level. [Units: wu]
const WINDOW: f64 = 0.1;
/// Floors of one cell closer in height than this are one level: a cut at the usual height still passes above all of
/// them. [Units: wu]
const APART: f64 = 1.0;
/// The least area of a second level in a cell: admits a landing, excludes treads and sills. [Units: wu²]
const LEAST_LEVEL: f64 = 1.0;
/// Spacing of the sample points on a floor. [Units: wu]
const SPACING: f64 = 0.5;
/// Most rows of points on one triangle: enough to sample a floor 64 m long every half meter.
const MAX_ROWS: usize = 128;
/// Points located together.
const RUN: usize = 16;
/// Most tiles along a side of the world.
const MAX_TILES: f64 = 1000.0;
/// Height above a floor that must be in the same cell for a person to stand there: the usual height of a cut.
/// [Units: wu]
const HEADROOM: f64 = 1.2;
/// Height above a floor at which its cell is looked up. [Units: wu]
const JUST_ABOVE: f64 = 0.1;
/// A cell with a smaller share of level ground stands on slopes: it is terrain.
const LEAST_LEVEL_SHARE: f64 = 0.25;

/// Squares of the plane (x, z), by integer coordinates.
pub(crate) type Tiles = BTreeSet<(i32, i32)>;

/// A floor of a cell, near one height.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Level {
    pub(crate) cell: CellId,
    /// [Units: wu]
    pub(crate) height: f64,
    /// [Units: wu²]
    pub(crate) area: f64,
    /// Tiles that the level covers.
    pub(crate) tiles: Tiles,
}

/// All floors of a world.
pub(crate) struct Floors {
    /// Floors to stand on, cells ascending, the largest of a cell first.
    pub(crate) levels: Vec<Level>,
    /// Rooms without a floor to stand on, ascending: shafts, spaces above ceilings, cavities.
    pub(crate) unfloored: Vec<CellId>,
    /// Side of a tile. [Units: wu]
    pub(crate) tile: f64,
}

/// Points of floors, by the cell that stands on them.
pub(crate) type Samples = BTreeMap<CellId, Vec<Sample>>;

/// A point of a floor.
pub(crate) struct Sample {
    p: DVec3,
    area: f64,
    is_level: bool,
}

/// Finds the floors of a world. O(samples).
pub(crate) fn find_floors(world: &World, samples: &Samples) -> Floors {
    let tile = tile_of(world);
    let sizes = LevelSizes { tile, apart: APART };
    let mut out = Floors {
        levels: Vec::new(),
        unfloored: Vec::new(),
        tile,
    };
    for (cell, _) in world.graph.places() {
        match samples.get(&cell) {
            Some(samples) => levels_of(cell, samples, sizes, &mut out.levels),
            None => out.unfloored.push(cell),
        }
    }
    out
}

/// Returns the levels of all rooms that differ in height by `apart` or more, the largest of a cell first. [Units: wu]
pub(crate) fn find_levels(world: &World, samples: &Samples, apart: f64) -> Vec<Level> {
    let sizes = LevelSizes {
        tile: tile_of(world),
        apart,
    };
    let mut out = Vec::new();
    for (cell, samples) in samples {
        levels_of(*cell, samples, sizes, &mut out);
    }
    out
}

/// The side of a tile, and the least difference of two levels of a cell. [Units: wu]
#[derive(Clone, Copy)]
struct LevelSizes {
    tile: f64,
    apart: f64,
}

/// The tile of a point.
pub(crate) fn tile_at(x: f64, z: f64, tile: f64) -> (i32, i32) {
    ((x / tile).floor() as i32, (z / tile).floor() as i32)
}

/// The side of a tile: at least the sample spacing on the largest possible triangle, and large enough for a million
/// tiles at most.
fn tile_of(world: &World) -> f64 {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    let mut reach = 0.0_f64;
    for (_, cell) in world.graph.places() {
        let [a, b] = cell.aabb.map(|p| DVec2::new(p[0].into(), p[2].into()));
        reach = reach.max((b - a).length());
        (low, high) = (low.min(a), high.max(b));
    }
    let whole = (high - low).max_element().max(0.0);
    SPACING.max(reach / MAX_ROWS as f64).max(whole / MAX_TILES)
}

/// Returns points on the surfaces that a room stands on. O(floor area + triangles).
pub(crate) fn floor_samples(world: &World) -> Samples {
    let mut out = Samples::new();
    for batch in &world.batches {
        let is_room = |c: &CellId| world.graph[*c].is_place();
        if !batch.cells.iter().any(is_room) {
            continue;
        }
        let p = &batch.primitive;
        for t in p.triangles() {
            let n = triangle_area_normal(&t);
            // Surfaces within 45° of level are walkable, whichever way they face: models turn floors upside down.
            if is_rather_level(n) {
                let is_level = Attitude::of(n) == Attitude::Level;
                ask(world, &t, 0.5 * n.length(), is_level, &mut out);
            }
        }
    }
    out
}

/// Samples points spread over the triangle; those with headroom are assigned to the cell above them.
fn ask(world: &World, t: &Triangle, area: f64, is_level: bool, out: &mut Samples) {
    let longest = t[0]
        .distance(t[1])
        .max(t[1].distance(t[2]))
        .max(t[2].distance(t[0]));
    // A sliver needs only as many points as its area holds.
    let side = longest.min(4.0 * area.sqrt());
    let n = ((side / SPACING).ceil() as usize).clamp(1, MAX_ROWS);
    let each = area / (n * n) as f64;
    // Centroids of the n² small triangles, upright and inverted alternately.
    let point = |i: usize, j: usize| {
        let (row, column, third) = (
            i as f64,
            (j / 2) as f64,
            if j.is_multiple_of(2) { 1.0 } else { 2.0 },
        );
        let (u, v) = (
            (row + third / 3.0) / n as f64,
            (column + third / 3.0) / n as f64,
        );
        t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v
    };
    let mut run: Vec<DVec3> = Vec::with_capacity(RUN);
    for i in 0..n {
        let n_of_row = 2 * (n - i) - 1;
        for first in (0..n_of_row).step_by(RUN) {
            run.clear();
            run.extend((first..n_of_row.min(first + RUN)).map(|j| point(i, j)));
            ask_run(world, &run, each, is_level, out);
        }
    }
}

/// Assigns neighboring points of two lines to the cells above them, if there is headroom.
fn ask_run(world: &World, run: &[DVec3], each: f64, is_level: bool, out: &mut Samples) {
    // The vertices of their hull: both ends of both lines.
    let last = run.len() - 1;
    let ends = [0, last.min(1), last.saturating_sub(1), last].map(|k| run[k]);
    let hull = [JUST_ABOVE, HEADROOM].map(|up| ends.map(|p| p + DVec3::Y * up));
    let locator = world.graph.locator.around(hull.as_flattened());
    for &p in run {
        let above = |up: f64| locator.locate(p + DVec3::Y * up);
        let Some(cell) = above(JUST_ABOVE).filter(|&c| world.graph[c].is_place()) else {
            continue;
        };
        // The top of a suspended ceiling, or of a wall under the roof, is not a floor of either cell.
        if above(HEADROOM) == Some(cell) && above(0.5 * HEADROOM).is_some() {
            out.entry(cell).or_default().push(Sample {
                p,
                area: each,
                is_level,
            });
        }
    }
}

/// Adds the levels of one cell.
fn levels_of(cell: CellId, samples: &[Sample], sizes: LevelSizes, out: &mut Vec<Level>) {
    let sum = |only_level: bool| -> f64 {
        let counted = samples.iter().filter(|s| s.is_level || !only_level);
        counted.map(|s| s.area).sum()
    };
    let is_terrain = sum(true) < LEAST_LEVEL_SHARE * sum(false);
    let mut votes: Vec<&Sample> = samples
        .iter()
        .filter(|s| s.is_level || is_terrain)
        .collect();
    votes.sort_by(|a, b| {
        let by = |f: fn(&DVec3) -> f64| f(&a.p).total_cmp(&f(&b.p));
        by(|p| p.y).then(by(|p| p.x)).then(by(|p| p.z))
    });
    let mut is_taken = vec![false; votes.len()];
    let first_of_cell = out.len();
    while let Some((first, last)) = heaviest_window(&votes, &is_taken) {
        let weight: f64 = votes[first..last].iter().map(|v| v.area).sum();
        if out.len() > first_of_cell && weight < LEAST_LEVEL {
            break;
        }
        let height = votes[first..last]
            .iter()
            .map(|v| v.p.y * v.area)
            .sum::<f64>()
            / weight;
        let mut level = Level {
            cell,
            height,
            area: 0.0,
            tiles: Tiles::new(),
        };
        for (taken, vote) in is_taken.iter_mut().zip(&votes) {
            if !*taken && (vote.p.y - height).abs() < sizes.apart {
                *taken = true;
                level.area += vote.area;
                level.tiles.insert(tile_at(vote.p.x, vote.p.z, sizes.tile));
            }
        }
        out.push(level);
    }
}

/// The run of votes (sorted by height, none taken) within one window that has the largest sum.
fn heaviest_window(votes: &[&Sample], is_taken: &[bool]) -> Option<(usize, usize)> {
    let mut best: Option<(f64, usize, usize)> = None;
    let (mut first, mut sum) = (0, 0.0);
    for last in 0..votes.len() {
        if is_taken[last] {
            (first, sum) = (last + 1, 0.0);
            continue;
        }
        sum += votes[last].area;
        while votes[last].p.y - votes[first].p.y > 2.0 * WINDOW {
            sum -= votes[first].area;
            first += 1;
        }
        if best.is_none_or(|b| sum > b.0) {
            best = Some((sum, first, last + 1));
        }
    }
    best.map(|(_, first, last)| (first, last))
}
