//! Cuts through cells that have no floor to stand on: shafts, spaces above ceilings, cavities.

use enfilade_cpg::{CellId, World};
use enfilade_geom::DVec3;

use crate::floors::{Tiles, tile_at};

/// Heights to try, as fractions of the cell's height: the middle first.
const HEIGHTS: [f64; 5] = [0.5, 0.25, 0.75, 0.1, 0.9];
/// Sample points along each side of a cell's box: few at first, more if these find nothing.
const SIDES: [usize; 2] = [32, 128];
/// A height serves as well as the best cut if it has at least this fraction of its points.
const AS_GOOD: f64 = 0.5;

/// A cell without a floor to stand on, with the height that shows most of it.
pub(crate) struct Shaft {
    pub(crate) cell: CellId,
    /// Bottom and top of the cell. [Units: wu]
    pub(crate) floor: f64,
    pub(crate) top: f64,
    /// Height of the cut. [Units: wu]
    pub(crate) at: f64,
    /// Approximate area of the cut. [Units: wu²]
    pub(crate) area: f64,
    /// Tiles of the cut. Empty for a cell thinner than the spacing of its points.
    pub(crate) tiles: Tiles,
    /// The heights tried that show nearly as much.
    heights: [Option<f64>; HEIGHTS.len()],
}

impl Shaft {
    /// Returns `true` if a cut at this height shows nearly as much as its own: it lies between two that do.
    pub(crate) fn is_shown_at(&self, height: f64) -> bool {
        let known = || self.heights.iter().flatten().copied();
        let low = known().fold(self.at, f64::min);
        let high = known().fold(self.at, f64::max);
        (low..=high).contains(&height)
    }
}

/// Finds a cut for each of the cells. O(cells).
pub(crate) fn find_shafts(world: &World, cells: &[CellId], tile: f64) -> Vec<Shaft> {
    cells.iter().map(|&c| shaft(world, c, tile)).collect()
}

fn shaft(world: &World, cell: CellId, tile: f64) -> Shaft {
    let [low, high] = world.graph[cell].aabb.map(|p| p.map(f64::from));
    let at = |part: f64| low[1] + part * (high[1] - low[1]);
    let mut out = Shaft {
        cell,
        floor: low[1],
        top: high[1],
        at: at(HEIGHTS[0]),
        area: 0.0,
        tiles: Tiles::new(),
        heights: [None; HEIGHTS.len()],
    };
    for n in SIDES {
        let found = HEIGHTS.map(|part| points(world, cell, at(part), n));
        let most = found.iter().map(Vec::len).max().unwrap_or(0);
        if most == 0 {
            continue;
        }
        let best = found.iter().position(|p| p.len() == most).unwrap_or(0);
        out.at = at(HEIGHTS[best]);
        let each = (high[0] - low[0]) * (high[2] - low[2]) / (n * n) as f64;
        out.area = most as f64 * each;
        out.tiles = found[best]
            .iter()
            .map(|p| tile_at(p.x, p.z, tile))
            .collect();
        for (height, (part, points)) in out.heights.iter_mut().zip(HEIGHTS.iter().zip(&found)) {
            let is_good = points.len() as f64 >= AS_GOOD * most as f64;
            *height = is_good.then(|| at(*part));
        }
        break;
    }
    out
}

/// The points of an `n` × `n` grid over the cell's box that lie in the cell at this height.
fn points(world: &World, cell: CellId, y: f64, n: usize) -> Vec<DVec3> {
    let [low, high] = world.graph[cell].aabb.map(|p| p.map(f64::from));
    let mut out = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let part = |k: usize, axis: usize| {
                low[axis] + (k as f64 + 0.5) / n as f64 * (high[axis] - low[axis])
            };
            let p = DVec3::new(part(i, 0), y, part(j, 2));
            if world.graph.locator.locate(p) == Some(cell) {
                out.push(p);
            }
        }
    }
    out
}
