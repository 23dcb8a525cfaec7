//! Makes any cell-and-portal graph simpler: merges cells until their costs are within bounds.
//!
//! After Lefebvre & Hornus 2003, §3: the cheapest cell first, the worst of its portals removed; the
//! lower bound is sought, the upper one guaranteed. Where only a number of cells or portals is asked for,
//! the merge that adds least to what sampled views draw is next, wherever it is (`views.rs`). Works on
//! any [`World`], whatever built it, since a merge needs nothing but the world: the two cells become one,
//! the portals between them go, what either saw the new one sees.
//!
//! **Every promise is kept:** a portal is left out only where both its sides are the same cell.

mod apply;
mod cost;
mod graph;
mod merge;
mod metric;
mod views;

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, PortalId, World};

pub(crate) use apply::Batches;
use cost::cost_graph;
pub use cost::{CostModel, UnknownMaterial, costs};
pub(crate) use cost::{Surface, cost_of_cell, surfaces_of};
pub use graph::{SimplifiedGraph, simplify_graph};
use merge::{Bounds, Eyes};
pub use metric::{PortalScore, portal_scores};

/// How portals are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Metric {
    /// Triangles that sampled views draw more without the portal.
    #[default]
    ExpectedTriangles,
    /// Volume that sees the portal times the difference of its cells' costs (Lefebvre & Hornus 2003).
    VisibleVolume,
}

/// Settings of the simplifier.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SimplifySettings {
    /// Cheaper cells are merged with neighbors, where that keeps the upper bound. What reaches through
    /// several cells counts in each in part: no portal between them hides it.
    pub min_cost: f64,
    /// No merge makes a cell that costs more; [`keep_bounds`](crate::bound::keep_bounds) cuts those that do.
    pub max_cost: Option<f64>,
    /// Whether the outdoors is cut, too, where it costs more.
    pub outdoors: bool,
    /// Cells are merged until there are no more than this, where that keeps the upper bound.
    pub max_cells: Option<usize>,
    /// Cells are merged until there are no more portals than this, where that keeps the upper bound.
    pub max_portals: Option<usize>,
    /// How portals are compared.
    pub metric: Metric,
    /// What drawing costs.
    pub cost: CostModel,
}

impl SimplifySettings {
    /// Every setting by name, as text, for the provenance of the file.
    #[must_use]
    pub fn to_settings(&self) -> BTreeMap<String, String> {
        let number = |v: Option<f64>| v.map_or_else(|| "none".to_owned(), |v| v.to_string());
        let mut out: BTreeMap<String, String> = [
            ("simplify.min_cost", self.min_cost.to_string()),
            ("simplify.max_cost", number(self.max_cost)),
            (
                "simplify.max_cells",
                number(self.max_cells.map(|n| n as f64)),
            ),
            (
                "simplify.max_portals",
                number(self.max_portals.map(|n| n as f64)),
            ),
            ("simplify.metric", format!("{:?}", self.metric)),
            ("cost.triangle", self.cost.triangle.to_string()),
            ("cost.area", self.cost.area.to_string()),
            ("cost.detail", self.cost.detail.to_string()),
        ]
        .map(|(k, v)| (k.to_owned(), v))
        .into();
        if self.outdoors {
            out.insert("simplify.outdoors".to_owned(), "true".to_owned());
        }
        for (name, weight) in &self.cost.materials {
            out.insert(format!("cost.material.{name}"), weight.to_string());
        }
        out
    }
}

/// A simpler world and how it compares.
#[derive(Clone, Debug)]
pub struct Simplified {
    /// The world.
    pub world: World,
    /// The cell of the result that each old cell is part of.
    pub cell_of: Vec<CellId>,
    /// Greatest cost of a cell.
    pub max_cost: f64,
    /// Least cost of a cell.
    pub min_cost: f64,
}

/// Sampled eyes for the metric; twice as many change few merges.
const EYES: usize = 512;
/// Where the sequence of eyes that judge results begins: none of them helped to choose.
const JUDGES: u32 = 1 << 20;

/// Merges cells of a world until they are within bounds.
///
/// Deterministic for any number of threads. Time: the metric's rays, about 100,000, and the merges.
#[must_use]
pub fn simplify(world: &World, settings: &SimplifySettings) -> Simplified {
    let graph = cost_graph(world, &settings.cost);
    let bounds = Bounds {
        min_cost: settings.min_cost,
        max_cost: settings.max_cost.unwrap_or(f64::INFINITY),
        max_cells: settings.max_cells.unwrap_or(usize::MAX),
        max_portals: settings.max_portals.unwrap_or(usize::MAX),
    };
    let (n, n_portals) = (world.graph.cells.len(), world.graph.portals.len());
    let is_few = n <= bounds.max_cells && n_portals <= bounds.max_portals;
    let is_done = is_few && graph.shares().iter().all(|&s| s >= bounds.min_cost);
    let into = if is_done {
        (0..n as u32).collect()
    } else {
        match settings.metric {
            Metric::ExpectedTriangles => {
                views::merge(&graph, &bounds, metric::views(world, EYES, 0))
            }
            Metric::VisibleVolume => {
                merge::merge(graph, &bounds, &mut metric::visible_volumes(world))
            }
        }
    };
    finish(world, &into, &settings.cost)
}

/// Takes a portal away: its two cells become one, and all other portals between them go, too.
///
/// `None` when there is no such portal.
#[must_use]
pub fn delete_portal(world: &World, portal: PortalId) -> Option<Simplified> {
    let [a, b] = world
        .graph
        .portals
        .get(portal.0 as usize)?
        .cells
        .map(|c| c.0);
    let into: Vec<u32> = (0..world.graph.cells.len() as u32)
        .map(|c| if c == a || c == b { a.min(b) } else { c })
        .collect();
    Some(finish(world, &into, &CostModel::default()))
}

fn finish(world: &World, into: &[u32], cost: &CostModel) -> Simplified {
    let (world, cell_of) = apply::merged(world, into);
    let graph = cost_graph(&world, cost);
    // The sum of nothing is -0; adding 0 makes it 0.
    let costs = || (0..world.graph.cells.len() as u32).map(|c| graph.cost(c) + 0.0);
    Simplified {
        cell_of,
        max_cost: costs().fold(0.0, f64::max),
        min_cost: costs().fold(f64::INFINITY, f64::min),
        world,
    }
}

/// Mean cost of what a view reaches, over sampled views: what a metric is judged by.
///
/// A cell is drawn whole if a ray of the view comes into it; views are none of those that the metric
/// [`Metric::ExpectedTriangles`] looks at.
#[must_use]
pub fn expected_cost(world: &World, cost: &CostModel, n_views: usize) -> f64 {
    let all = (0..world.graph.cells.len() as u32).map(CellId);
    cost_of_views(world, world, &all.collect::<Vec<_>>(), cost, n_views)
}

/// The same for a world made simpler, from the same eyes as [`expected_cost`] of the world `before`.
///
/// Views begin indoors, and a room that was joined to the outdoors would begin none any more.
///
/// # Panics
/// When `after` was not made from `before`.
#[must_use]
pub fn expected_cost_after(
    before: &World,
    after: &Simplified,
    cost: &CostModel,
    n_views: usize,
) -> f64 {
    cost_of_views(before, &after.world, &after.cell_of, cost, n_views)
}

/// Cells of worlds of which all ways to join them are tried: there are 115,975 for ten.
const MAX_TRIED: usize = 10;

/// The least mean cost of a view that any way to join cells comes to which leaves at most `max_portals`: all are tried, from
/// the same eyes as [`expected_cost`] looks. `None` for worlds of more than ten cells.
///
/// Cells need not touch to be joined here, so that [`simplify`] may not reach it, but nothing is less.
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
    // Sets of cells are bits of a number from here on.
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
    // A part for each cell, numbered as they come up, counted through like digits.
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

/// Views of one world, each of whose cells is drawn as a cell of another.
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
