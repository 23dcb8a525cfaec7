//! Merges cells of a world until it is within bounds.

use enfilade_cpg::{CellId, PortalId, World};

use super::cost::{CostModel, cost_graph};
use super::doorways::Doorways;
use super::merge::{self, Bounds};
use super::settings::{Metric, SimplifySettings};
use super::{apply, metric, views};

/// A simplified world and its costs.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Simplified {
    /// The world.
    pub world: World,
    /// The new cell that each old cell is part of.
    pub cell_of: Vec<CellId>,
    /// Greatest cost of a cell.
    pub max_cost: f64,
    /// Least cost of a cell.
    pub min_cost: f64,
}

/// Sampled eyes for the metric; twice as many change few merges.
const EYES: usize = 512;
/// Merges cells of a world until they are within bounds.
///
/// Deterministic for any number of threads. Time: the metric's rays, about 100,000, and the merges.
#[must_use]
pub fn simplify(world: &World, settings: &SimplifySettings) -> Simplified {
    let mut graph = cost_graph(world, &settings.cost);
    graph.doorways = settings.doorway.map(|d| Doorways::of(&world.graph, d));
    let bounds = Bounds {
        min_cost: settings.min_cost,
        max_cost: settings.max_cost.unwrap_or(f64::INFINITY),
        max_cells: settings.max_cells.unwrap_or(usize::MAX),
        max_portals: settings.max_portals.unwrap_or(usize::MAX),
        joins_outdoors: settings.join_outdoors,
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

/// Removes a portal: its two cells become one, and all other portals between them disappear, too.
///
/// `None` if the portal does not exist.
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
