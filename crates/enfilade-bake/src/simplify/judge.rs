//! The drawing cost of sampled views, to judge merges and metrics.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, World};

use super::cost::{CostModel, cost_graph};
use super::merge::Eyes;
use super::metric;
use super::run::Simplified;

/// Start of the sequence of eyes that judge results; none of them takes part in choosing merges.
const JUDGES: u32 = 1 << 20;

/// Returns the mean cost of the cells that a view reaches, over sampled views. It judges metrics.
///
/// A cell is drawn whole if a ray of the view enters it. The views differ from those that the metric
/// [`ExpectedTriangles`](super::Metric::ExpectedTriangles) uses.
#[must_use]
pub fn expected_cost(world: &World, cost: &CostModel, n_views: usize) -> f64 {
    let all = (0..world.graph.cells.len() as u32).map(CellId);
    cost_of_views(world, world, &all.collect::<Vec<_>>(), cost, n_views)
}

/// Returns the same for a simplified world, from the same eyes as [`expected_cost`] of the world `before`.
///
/// Views begin indoors, and none would begin in a room that was joined to the outdoors.
///
/// # Panics
/// If `after` was not made from `before`.
#[must_use]
pub fn expected_cost_after(
    before: &World,
    after: &Simplified,
    cost: &CostModel,
    n_views: usize,
) -> f64 {
    cost_of_views(before, &after.world, &after.cell_of, cost, n_views)
}

/// Most cells for which all ways to join them are tried: ten have 115,975.
const MAX_TRIED: usize = 10;

/// Returns the lowest mean cost of a view over all ways to join cells that leave at most `max_portals`, from the same
/// eyes as [`expected_cost`]. `None` for worlds of more than ten cells.
///
/// A lower bound that [`simplify`](super::simplify) may not reach: here, cells need not touch to be joined.
#[must_use]
pub fn least_expected_cost(
    world: &World,
    max_portals: usize,
    cost: &CostModel,
    n_views: usize,
) -> Option<f64> {
    let n = world.graph.cells.len();
    if n > MAX_TRIED {
        return None;
    }
    let graph = cost_graph(world, cost);
    let Eyes(seen_by) = metric::views(world, n_views, JUDGES);
    // From here on, sets of cells are bits of a number.
    let mut cells_of_item = vec![0_usize; graph.weights.len()];
    for (cell, items) in graph.items.iter().enumerate() {
        for &item in items {
            cells_of_item[item as usize] |= 1 << cell;
        }
    }
    let cost_of_cells: Vec<f64> = (0..1 << n)
        .map(|cells| {
            let items = cells_of_item.iter().zip(&graph.weights);
            items
                .filter(|(c, _)| **c & cells != 0)
                .map(|(_, w)| w)
                .sum()
        })
        .collect();
    let mut n_views_of: BTreeMap<usize, usize> = BTreeMap::new();
    for eye in 0..n_views {
        let sees = |c: &usize| seen_by[*c][eye / 64] >> (eye % 64) & 1 == 1;
        let cells = (0..n).filter(sees).fold(0, |cells, c| cells | 1 << c);
        *n_views_of.entry(cells).or_default() += 1;
    }
    let mut least = f64::INFINITY;
    // The part of each cell, numbered by first appearance, counted up like digits.
    let mut part = vec![0_usize; n];
    loop {
        let parts = world.graph.portals.iter();
        let n_left = parts.filter(|p| part[p.cells[0].0 as usize] != part[p.cells[1].0 as usize]);
        if n_left.count() <= max_portals {
            let mut cells_of_part = vec![0; n];
            for (c, &p) in part.iter().enumerate() {
                cells_of_part[p] |= 1 << c;
            }
            let drawn = |seen: usize| -> usize {
                let parts = cells_of_part.iter().filter(|cells| **cells & seen != 0);
                parts.sum()
            };
            let views = n_views_of.iter();
            let total: f64 = views
                .map(|(&seen, &n)| n as f64 * cost_of_cells[drawn(seen)])
                .sum();
            least = least.min(total / n_views.max(1) as f64);
        }
        let can_rise =
            |&c: &usize| c > 0 && part[c] <= part[..c].iter().copied().max().unwrap_or(0);
        let Some(rises) = (0..n).rev().find(can_rise) else {
            return Some(least);
        };
        part[rises] += 1;
        part[rises + 1..].fill(0);
    }
}

/// Returns the mean cost of views of `world`, drawing for each of its cells the cell of `drawn` that it is part of.
fn cost_of_views(
    world: &World,
    drawn: &World,
    cell_of: &[CellId],
    cost: &CostModel,
    n_views: usize,
) -> f64 {
    let graph = cost_graph(drawn, cost);
    let Eyes(seen_by) = metric::views(world, n_views, JUDGES);
    let total: f64 = (0..n_views)
        .map(|eye| {
            let sees = |c: usize| seen_by[c][eye / 64] >> (eye % 64) & 1 == 1;
            let mut items: Vec<u32> = (0..seen_by.len())
                .filter(|&c| sees(c))
                .flat_map(|c| graph.items[cell_of[c].0 as usize].iter().copied())
                .collect();
            items.sort_unstable();
            items.dedup();
            items
                .iter()
                .map(|&i| graph.weights[i as usize])
                .sum::<f64>()
        })
        .sum();
    total / n_views.max(1) as f64
}
