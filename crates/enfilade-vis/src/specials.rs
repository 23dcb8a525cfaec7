//! Visibility through special portals: mirrors, leads into other places, doorways open from one side, monitors.
//!
//! A line of sight that passes special portals is straight in the unfolded graph (`unfold`), so the search of
//! [`see_all`] decides it there, from the openings of the first layer only. The unfolded graph is made as far as it is
//! seen: each round searches the layers so far, then opens those whose first cell is still visible from anywhere.
//! Layers are shared by all cells that look into them. A layer entered in cell `c` holds no cell that `c` does not see
//! without special portals.
//!
//! Time: rounds of at most [`VisConfig::max_specials`] special portals and of doorways open from one side; each takes
//! the time of [`see_all`] for the openings that the layers hold. A row of the graph that sees no special portal
//! costs nothing more.
//!
//! Errs to visible. Beyond the bounds, whoever sees a special portal also sees all that might be seen from the cell
//! behind it by any chain: the closure over cells. Who sees a monitor sees all that its camera's cell sees. Walls
//! narrow what is seen without special portals, and so the cells of each layer; other than that, they hide nothing
//! beyond special portals.

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, CellPortalGraph, Pvs, SightGraph};

use crate::bits;
use crate::config::{KEPT, VisConfig, VisContext, VisError, VisMode};
use crate::dirs::Dirs;
use crate::output::VisOutput;
use crate::plan::memory;
use crate::search::{Rest, Search};
use crate::see_all;
use crate::unfold::{Goal, Node, Unfolded};

/// Precomputed visibility of a world's graph, special portals included.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WorldVis {
    /// The answer. Not symmetric if the graph has special portals. Witnesses are lines that pass none, and all pairs
    /// that are seen through one count as undecided if walls are given.
    pub vis: VisOutput,
    /// For each cell, the cells that might be seen from it through a special portal or a doorway open from one side.
    pub through: Pvs,
    /// Number of chains of special portals that are looked into from anywhere.
    pub n_chains: u64,
    /// Number of chains cut at [`VisConfig::max_specials`] or [`VisConfig::max_chains`]: everything that might be seen
    /// by any longer chain counts as visible.
    pub n_cut: u64,
}

impl WorldVis {
    /// Makes the answer of a graph without special portals.
    #[must_use]
    pub fn of(vis: VisOutput) -> Self {
        let through = Pvs::of_ascending((0..vis.cells.n_cells()).map(|_| Vec::new()));
        Self {
            vis,
            through,
            n_chains: 0,
            n_cut: 0,
        }
    }
}

/// Finds the cells that can be seen from every cell of a world, directly or through special portals. Without special
/// portals, the answer is that of [`see_all`].
///
/// # Errors
///
/// As [`see_all`]; and [`VisError::SpecialEvidence`] if evidence is requested of a graph with special portals.
pub fn see_world(
    graph: &CellPortalGraph,
    config: &VisConfig,
    context: &mut VisContext<'_>,
) -> Result<WorldVis, VisError> {
    if graph.specials.is_empty() {
        return see_all(&SightGraph::of_graph(graph), config, context).map(WorldVis::of);
    }
    if config.has_evidence {
        return Err(VisError::SpecialEvidence);
    }
    let mut unfolded = Unfolded::new(graph);
    let (plain, portals) = unfolded.plain_graph();
    let mut vis = see_all(&plain, config, context)?;
    for direction in vis.witnesses.iter_mut().flat_map(|w| &mut w.chain) {
        *direction = 2 * portals[*direction as usize / 2] + *direction % 2;
    }
    let direct = vis.cells.clone();
    let mut rows = Rows::new(&mut unfolded, &direct);
    let mut is_complete = vis.is_complete;
    let scale = Dirs::new(&unfolded.graph(&rows.nodes())).scale;
    let clearance = config.clearance.unwrap_or(1e-8 * scale);
    // A layer that is opened and not searched in the end is a bound: all that its first cell sees.
    loop {
        let nodes = rows.nodes();
        let sight = unfolded.graph(&nodes);
        if sight.validate().is_err() {
            break;
        }
        let dirs = Dirs::new(&sight);
        if memory(dirs.len() as u64, false) > config.max_memory {
            break;
        }
        let clearance = KEPT * clearance * unfolded.least_scale();
        let mut search = Search::new(&dirs, clearance, config.far, None);
        let is_done = rows.search(&nodes, &mut search, config, context);
        vis.n_steps += search.effort.steps;
        is_complete &= is_done;
        if !is_done {
            break;
        }
        let n_open = unfolded.layers.iter().filter(|l| l.is_open).count() - 1;
        let seen = rows.closed_layers(&unfolded).into_iter();
        let seen = seen.filter(|&l| unfolded.can_open(l, config.max_specials));
        let opened: Vec<u32> = seen
            .take(config.max_chains.saturating_sub(n_open))
            .collect();
        if opened.is_empty() {
            break;
        }
        for layer in opened {
            rows.open(&mut unfolded, layer, &direct);
        }
    }
    vis.is_complete = is_complete;
    Ok(rows.output(&unfolded, vis, context.walls.is_some()))
}

/// Returns the graph that [`see_world`] searches first, and in blocks if it is large: that of the doorways that are open
/// from both sides. For [`VisPlan`](crate::VisPlan).
#[must_use]
pub fn plain_sight(graph: &CellPortalGraph) -> SightGraph {
    if graph.specials.is_empty() {
        return SightGraph::of_graph(graph);
    }
    Unfolded::new(graph).plain_graph().0
}

/// Cells seen from those of the first layer that see a special portal.
struct Rows<'a> {
    plain: &'a Pvs,
    all: Vec<SpecialRow>,
}

struct SpecialRow {
    cell: u32,
    /// Nodes that might be seen.
    seen: BTreeSet<Node>,
    /// Those of `seen` that a search left; others are only bounds.
    searched: BTreeSet<Node>,
    /// Those of `seen` that a line through the openings reaches.
    proved: BTreeSet<Node>,
}

impl<'a> Rows<'a> {
    /// Returns the bounds before any search: the cells that are seen without special portals, and everything that is
    /// behind their special portals.
    fn new(unfolded: &mut Unfolded, plain: &'a Pvs) -> Self {
        let mut all = Vec::new();
        for cell in (0..plain.n_cells() as u32).map(CellId) {
            let has_gate = |c: CellId| !unfolded.gates_of[c.idx()].is_empty();
            if !plain.visible_from(cell).any(has_gate) {
                continue;
            }
            let own = plain.visible_from(cell).map(|c| (0, c.0)).collect();
            let mut row = SpecialRow {
                cell: cell.0,
                seen: BTreeSet::new(),
                searched: own,
                proved: BTreeSet::new(),
            };
            unfolded.open(0, plain.visible_from(cell).map(|c| c.0), &mut row.seen);
            all.push(row);
        }
        Self { plain, all }
    }

    fn nodes(&self) -> Vec<Node> {
        let nodes: BTreeSet<Node> = self.all.iter().flat_map(|r| &r.seen).copied().collect();
        nodes.into_iter().collect()
    }

    /// Drops what a search of the graph of `nodes` does not find. Returns `true` if the search is complete.
    fn search(
        &mut self,
        nodes: &[Node],
        search: &mut Search<'_>,
        config: &VisConfig,
        context: &mut VisContext<'_>,
    ) -> bool {
        let dirs = search.dirs;
        let at = |node: &Node| {
            let name = nodes.binary_search(node).ok()? as u32;
            dirs.cells.binary_search(&name).ok()
        };
        let mut sources = vec![false; dirs.n_cells];
        let mut cells = vec![0; dirs.n_cells.div_ceil(64)];
        let mut entries = vec![0; search.might.n_words()];
        for row in &self.all {
            let Some(a) = at(&(0, row.cell)) else {
                continue;
            };
            sources[a] = true;
            cells.fill(0);
            row.seen
                .iter()
                .filter_map(at)
                .for_each(|c| bits::set(&mut cells, c));
            dirs.entries_of(&cells, &mut entries);
            for s in dirs.exits(a as u32) {
                let row = search.might.row_mut(s).iter_mut();
                row.zip(&entries)
                    .for_each(|(word, &allowed)| *word &= allowed);
            }
            for c in row.searched.iter().filter_map(at) {
                search.seen.set(a, c);
            }
        }
        search.narrow();
        search.cast(config.n_rays);
        search.grow();
        let mut is_complete = true;
        if config.mode == VisMode::Exact {
            let mut order = search.all_openings().order;
            order.retain(|&(_, d)| sources[dirs.all[d].from as usize]);
            let total = order.iter().map(|&(n, _)| n as u64).sum();
            let rest = Rest {
                order,
                done: 0,
                total,
            };
            let on_round = &mut *context.on_round;
            let on_round = |_: &Search<'_>, rest: &Rest| on_round(rest.done, rest.total);
            is_complete = search.run(config.max_pieces, rest, on_round);
        }
        let visible = search.visible();
        for row in &mut self.all {
            let a = at(&(0, row.cell));
            let finds = |table: &bits::BitTable, node: &Node| {
                a.zip(at(node)).is_some_and(|(a, c)| table.get(a, c))
            };
            row.seen.retain(|node| node.0 == 0 || finds(&visible, node));
            let is_proved = |node: &&Node| {
                !row.searched.contains(node)
                    && finds(&search.seen, node)
                    && !finds(&search.undecided, node)
            };
            row.proved.extend(row.seen.iter().filter(is_proved));
            row.searched.clone_from(&row.seen);
        }
        is_complete
    }

    /// Returns the layers that are seen and not open, other than monitors, ascending.
    fn closed_layers(&self, unfolded: &Unfolded) -> Vec<u32> {
        let layers: BTreeSet<u32> = (self.all.iter().flat_map(|row| &row.seen))
            .map(|node| node.0)
            .filter(|&layer| !unfolded.layers[layer as usize].is_open)
            .filter(|&layer| matches!(unfolded.goal(layer), Some(Goal::Cell(_))))
            .collect();
        layers.into_iter().collect()
    }

    fn open(&mut self, unfolded: &mut Unfolded, layer: u32, plain: &Pvs) {
        let first = unfolded.first_cell(layer);
        for row in &mut self.all {
            if row.seen.contains(&(layer, first)) {
                let cells = plain.visible_from(CellId(first)).map(|c| c.0);
                unfolded.open(layer, cells, &mut row.seen);
            }
        }
    }

    fn output(&self, unfolded: &Unfolded, vis: VisOutput, has_walls: bool) -> WorldVis {
        let n = self.plain.n_cells();
        // Only cells with a row see anything through special portals. Rows ascend.
        let place = |cell: usize| {
            self.all
                .binary_search_by_key(&(cell as u32), |row| row.cell)
                .ok()
        };
        let mut through = bits::BitTable::new(self.all.len(), n);
        let mut proved = bits::BitTable::new(self.all.len(), n);
        // Rows that see what the cameras in which cells see.
        let mut watched: BTreeSet<(usize, usize)> = BTreeSet::new();
        for (a, row) in self.all.iter().enumerate() {
            for &(layer, cell) in row.seen.iter().filter(|node| node.0 != 0) {
                match unfolded.goal(layer) {
                    Some(Goal::Cameras(cells)) => {
                        watched.extend(cells.iter().map(|&c| (a, c as usize)));
                    }
                    _ if unfolded.layers[layer as usize].is_open => {
                        through.set(a, cell as usize);
                    }
                    _ => self.closure(unfolded, cell, through.row_mut(a)),
                }
            }
            if !has_walls {
                let nodes = row.proved.iter().filter(|node| node.0 != 0);
                nodes.for_each(|node| proved.set(a, node.1 as usize));
            }
        }
        let mut has_changed = !watched.is_empty();
        while has_changed {
            has_changed = false;
            for &(a, camera) in &watched {
                let before = bits::count(through.row(a));
                if let Some(camera) = place(camera) {
                    let seen = through.row(camera).to_vec();
                    bits::unite(through.row_mut(a), &seen);
                }
                for c in self.plain.visible_from(CellId(camera as u32)) {
                    through.set(a, c.idx());
                }
                has_changed |= bits::count(through.row(a)) != before;
            }
        }
        let ids = || (0..n as u32).map(CellId);
        let seen_through = |a: CellId| {
            let row = place(a.idx()).map(|row| through.row(row));
            row.into_iter().flat_map(bits::ones).map(|b| b as u32)
        };
        let row = |a: CellId| {
            let plain = self.plain.visible_from(a).map(|b| b.0);
            let all: BTreeSet<u32> = plain.chain(seen_through(a)).collect();
            all
        };
        let cells = Pvs::of_ascending(ids().map(row));
        let is_undecided = |a: CellId, b: CellId| {
            let is_plain = self.plain.sees(a, b) && !vis.undecided.sees(a, b);
            !is_plain && place(a.idx()).is_none_or(|row| !proved.get(row, b.idx()))
        };
        let row = |a: CellId| {
            let seen = cells.visible_from(a);
            seen.filter(move |&b| is_undecided(a, b)).map(|b| b.0)
        };
        let undecided = Pvs::of_ascending(ids().map(row));
        let through_rows = Pvs::of_ascending(ids().map(seen_through));
        WorldVis {
            n_chains: unfolded.n_open_specials(),
            n_cut: self.closed_layers(unfolded).len() as u64,
            through: through_rows,
            vis: VisOutput {
                cells,
                undecided,
                ..vis
            },
        }
    }

    /// Adds everything that might be seen from a cell, by any number of special portals.
    fn closure(&self, unfolded: &Unfolded, cell: u32, row: &mut [u64]) {
        let mut is_done = vec![false; self.plain.n_cells()];
        let mut left = vec![cell];
        while let Some(at) = left.pop() {
            if std::mem::replace(&mut is_done[at as usize], true) {
                continue;
            }
            for c in self.plain.visible_from(CellId(at)) {
                bits::set(row, c.idx());
                for &gate in &unfolded.gates_of[c.idx()] {
                    match &unfolded.gates[gate as usize].goal {
                        Goal::Cell(to) => left.push(*to),
                        Goal::Cameras(cells) => left.extend(cells),
                    }
                }
            }
        }
    }
}
