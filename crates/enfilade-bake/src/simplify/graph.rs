//! Simplification of graphs without surfaces: portal files of games.

use std::collections::BTreeMap;

use enfilade_cpg::SightGraph;
use enfilade_geom::Winding;

use super::merge::{Badness, Bounds, CostGraph, merge};
use super::settings::SimplifySettings;

/// The merged cells of a graph, and their costs.
#[derive(Clone, Debug, PartialEq)]
pub struct SimplifiedGraph {
    /// The new cell that each old cell is part of; numbered in the order of their lowest old cells.
    pub cell_of: Vec<u32>,
    /// Cells of the result.
    pub n_cells: u32,
    /// Openings between different cells of the result.
    pub n_portals: usize,
    /// Greatest cost of a cell.
    pub max_cost: f64,
    /// Least cost of a cell.
    pub min_cost: f64,
}

/// Area of the openings between two cells. [Units: that of the graph, squared]
struct Openness(BTreeMap<[u32; 2], f64>);

impl Badness for Openness {
    fn of(&mut self, _: &CostGraph, a: u32, b: u32) -> f64 {
        self.0.get(&[a.min(b), a.max(b)]).copied().unwrap_or(0.0)
    }

    fn merged(&mut self, kept: u32, gone: u32) {
        // Pairs with `gone` as the lower one form a range, but the others need a look at every pair.
        let of_gone: Vec<[u32; 2]> = (self.0.keys())
            .filter(|pair| pair.contains(&gone))
            .copied()
            .collect();
        for pair in of_gone {
            let area = self.0.remove(&pair).unwrap_or(0.0);
            let other = if pair[0] == gone { pair[1] } else { pair[0] };
            if other != kept {
                *self
                    .0
                    .entry([kept.min(other), kept.max(other)])
                    .or_default() += area;
            }
        }
    }
}

/// Merges cells of any graph of cells and openings until they are within bounds: the cheapest first, with the
/// neighbor that it is most open to (Lefebvre & Hornus 2003, §3, except for the metric).
///
/// `costs` holds one cost per cell. The paper compares the volume that sees an opening, which is unknown without
/// surfaces; this uses the area of the openings between two cells: the wider they are, the less they hide. Ignores the
/// metric and the cost model of `settings`. A cell without openings stays as it is.
///
/// Time: `O(m n)` for `m` merges and `n` openings.
///
/// # Panics
///
/// If the numbers of costs and cells differ, or an opening refers to a missing cell.
#[must_use]
pub fn simplify_graph(
    graph: &SightGraph,
    costs: &[f64],
    settings: &SimplifySettings,
) -> SimplifiedGraph {
    let n = graph.n_cells as usize;
    assert_eq!(costs.len(), n, "a cost for each cell");
    let pairs: Vec<[u32; 2]> = graph.portals.iter().map(|p| p.cells).collect();
    let mut areas = BTreeMap::new();
    for portal in &graph.portals {
        let [a, b] = portal.cells;
        let area = Winding::new(portal.winding.clone()).area();
        *areas.entry([a.min(b), a.max(b)]).or_insert(0.0) += area;
    }
    let bounds = Bounds {
        min_cost: settings.min_cost,
        max_cost: settings.max_cost.unwrap_or(f64::INFINITY),
        max_cells: settings.max_cells.unwrap_or(usize::MAX),
        max_portals: settings.max_portals.unwrap_or(usize::MAX),
        joins_outdoors: settings.join_outdoors,
    };
    let whole = CostGraph {
        weights: costs.to_vec(),
        items: (0..n as u32).map(|c| vec![c]).collect(),
        pairs: pairs.clone(),
        aloof: vec![false; n],
        alone: Vec::new(),
        doorways: None,
    };
    let into = merge(whole, &bounds, &mut Openness(areas));
    let mut cell_of = vec![0; n];
    let mut sums: Vec<f64> = Vec::new();
    for (c, &host) in into.iter().enumerate() {
        // A host has the lowest number of its group.
        cell_of[c] = if host as usize == c {
            sums.push(0.0);
            sums.len() as u32 - 1
        } else {
            cell_of[host as usize]
        };
        sums[cell_of[c] as usize] += costs[c];
    }
    let is_left = |p: &&[u32; 2]| cell_of[p[0] as usize] != cell_of[p[1] as usize];
    SimplifiedGraph {
        n_cells: sums.len() as u32,
        n_portals: pairs.iter().filter(is_left).count(),
        max_cost: sums.iter().copied().fold(0.0, f64::max),
        min_cost: sums.iter().copied().fold(f64::INFINITY, f64::min),
        cell_of,
    }
}
