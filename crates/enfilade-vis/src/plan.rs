//! Blocks of cells that are searched one by one: in any order, on any machine, each by itself.
//!
//! Cells are ordered by place, halving the set across its longest side again and again; cells next to each other in
//! this order make a block once few enough directions lead out of them. All this follows from the graph alone. Of two
//! cells of different blocks, one owns the pair, and settles it for both.

use std::ops::Range;

use enfilade_cpg::SightGraph;
use enfilade_geom::{Aabb, DVec3};

use crate::checkpoint;
use crate::config::{KEPT, VisConfig, VisError, VisMode};
use crate::dirs::Dirs;
use crate::tolerance::Tolerance;
use crate::windows::Ground;

/// Most directions out of a block's cells, unless it is a single cell. A graph of no more is searched in one piece.
const MOST_OWN: usize = 20_000;

/// Most directions in the part of the graph in which a block is searched. Time and memory go with its square.
const MOST_DIRECTIONS: usize = 60_000;

/// Memory of the graph, and of the answer to neighbors. [Units: bytes for a direction]
const PER_DIRECTION: u64 = 512;

/// A search in blocks: what each takes and gives is fixed by the graph and the settings, so that blocks can be searched
/// in any order, in several processes, and a second time with the same bytes.
///
/// ```
/// use enfilade_cpg::SightGraph;
/// use enfilade_vis::{VisConfig, VisContext, VisPlan};
///
/// let graph = SightGraph::default();
/// let config = VisConfig::default();
/// let plan = VisPlan::new(&graph, &config, 0)?;
/// let mut on_round = |_, _| true;
/// let mut context = VisContext { on_round: &mut on_round, walls: None, checkpoint: None };
/// let mut blocks = Vec::new();
/// let all: Vec<usize> = (0..plan.n_blocks()).collect();
/// plan.search(&all, &mut context, &mut |_, bytes, _| blocks.push(bytes));
/// assert_eq!(plan.finish(&blocks)?.cells.n_cells(), 0);
/// # Ok::<(), enfilade_vis::VisError>(())
/// ```
pub struct VisPlan<'a> {
    pub(crate) graph: &'a SightGraph,
    pub(crate) config: &'a VisConfig,
    pub(crate) dirs: Dirs,
    /// The promised clearance; the search uses a smaller one, see [`VisPlan::ground`].
    pub(crate) clearance: f64,
    /// Cells in the order of their places; those without a portal are not in it.
    order: Vec<u32>,
    /// For each cell, its place in `order` and its block.
    ranks: Vec<u32>,
    block_of: Vec<u32>,
    /// Ranges of `order`.
    blocks: Vec<Range<usize>>,
    /// The graph is one block, which is searched in one piece.
    pub(crate) is_whole: bool,
    /// Most directions in the part of the graph in which a block is searched.
    pub(crate) most_directions: usize,
    key: u64,
}

impl<'a> VisPlan<'a> {
    /// Divides the cells of a graph into blocks. `salt` is a number that changes with
    /// [`VisContext::walls`](crate::VisContext::walls). Time and memory are linear in the graph but for a logarithm.
    ///
    /// # Errors
    ///
    /// A broken graph, one that exceeds [`VisConfig::max_memory`] by itself or with the tables that evidence takes, or
    /// a setting that is negative or not a number.
    pub fn new(graph: &'a SightGraph, config: &'a VisConfig, salt: u64) -> Result<Self, VisError> {
        Self::of_size(graph, config, salt, MOST_OWN)
    }

    /// Divides the cells into blocks of at most `most_own` directions.
    pub(crate) fn of_size(
        graph: &'a SightGraph,
        config: &'a VisConfig,
        salt: u64,
        most_own: usize,
    ) -> Result<Self, VisError> {
        graph.validate()?;
        check("clearance", config.clearance)?;
        check("the far plane", config.far)?;
        let n_directions = 2 * graph.portals.len();
        let linear = PER_DIRECTION.saturating_mul(n_directions as u64);
        let whole = linear.saturating_add(memory(n_directions as u64, config.has_evidence));
        let estimate = if config.has_evidence { whole } else { linear };
        if estimate > config.max_memory {
            return Err(VisError::TooLarge {
                n_portals: graph.portals.len(),
                estimate,
                limit: config.max_memory,
            });
        }
        let dirs = Dirs::new(graph);
        let is_whole =
            config.has_evidence || whole <= config.max_memory && n_directions <= most_own;
        let most_directions = if is_whole {
            n_directions
        } else {
            // The inverse of `memory`.
            let left = config.max_memory - linear;
            (left.saturating_mul(2).isqrt() as usize).min(MOST_DIRECTIONS)
        };
        let n = dirs.n_cells;
        let mut order: Vec<u32> = (0..n as u32).collect();
        let mut blocks = Vec::new();
        let middles: Vec<DVec3> = (0..n).map(|cell| middle(&dirs, cell)).collect();
        // Room for what the cells of a block see beyond them.
        let most = if is_whole {
            usize::MAX
        } else {
            most_own.min(most_directions / 2)
        };
        divide(&dirs, &middles, &mut order, 0, most, &mut blocks);
        let (mut ranks, mut block_of) = (vec![0; n], vec![0; n]);
        for (block, range) in (0..).zip(&blocks) {
            for rank in range.clone() {
                ranks[order[rank] as usize] = rank as u32;
                block_of[order[rank] as usize] = block;
            }
        }
        let clearance = config.clearance.unwrap_or(1e-8 * dirs.scale);
        let mode = u64::from(config.mode == VisMode::Exact);
        let salts = [
            checkpoint::key(graph, config, salt),
            most_directions as u64,
            mode,
        ];
        let bytes: Vec<u8> = salts.iter().flat_map(|w| w.to_le_bytes()).collect();
        Ok(Self {
            graph,
            config,
            dirs,
            clearance,
            order,
            ranks,
            block_of,
            blocks,
            is_whole,
            most_directions,
            key: checkpoint::fnv(&bytes),
        })
    }

    /// Returns the number of blocks; 0 for a graph without portals.
    #[must_use]
    pub fn n_blocks(&self) -> usize {
        self.blocks.len()
    }

    /// Returns the hash of everything that a block's bytes depend on: the graph, the settings, the salt, the version
    /// and the block's number.
    #[must_use]
    pub fn key(&self, block: usize) -> u64 {
        let words = [self.key, block as u64];
        let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        checkpoint::fnv(&bytes)
    }

    /// Returns the ranks of a block's cells.
    pub(crate) fn range(&self, block: usize) -> Range<usize> {
        self.blocks[block].clone()
    }

    /// Returns the cells of some ranks.
    pub(crate) fn cells(&self, ranks: Range<usize>) -> &[u32] {
        &self.order[ranks]
    }

    /// Returns the names of a block's cells, ascending.
    pub(crate) fn names(&self, block: usize) -> Vec<u32> {
        let cells = self.cells(self.range(block)).iter();
        let mut names: Vec<u32> = cells.map(|&c| self.dirs.cells[c as usize]).collect();
        names.sort_unstable();
        names
    }

    pub(crate) fn ground(&self) -> Ground<'_> {
        // The search keeps more than it promises, so that a checker that rounds differently still closes every chain.
        Ground {
            dirs: &self.dirs,
            tolerance: Tolerance::new(self.dirs.scale, KEPT * self.clearance),
            far: self.config.far,
        }
    }

    /// Returns two halves of a range of ranks with about as many directions; `None` for a single cell.
    pub(crate) fn halves(&self, ranks: &Range<usize>) -> Option<[Range<usize>; 2]> {
        (ranks.len() > 1).then(|| {
            let at = ranks.start + half(&self.dirs, self.cells(ranks.clone()));
            [ranks.start..at, at..ranks.end]
        })
    }

    /// Returns `true` if a cell is among some ranks.
    pub(crate) fn is_in(&self, ranks: &Range<usize>, cell: u32) -> bool {
        ranks.contains(&(self.ranks[cell as usize] as usize))
    }

    /// Returns `true` if the pairs of a cell and those among `ranks`, which are of one block, are settled with these. Of
    /// two blocks, one owns all pairs; of two parts of a block, the lower one.
    pub(crate) fn owns(&self, ranks: &Range<usize>, cell: u32) -> bool {
        let ours = self.block_of[self.order[ranks.start] as usize];
        let other = self.block_of[cell as usize];
        if ours == other {
            return self.ranks[cell as usize] as usize >= ranks.start;
        }
        (ours < other) == ((ours ^ other) & 1 == 1)
    }
}

/// Returns the memory of the tables of a search. [Units: bytes]
pub(crate) fn memory(n_directions: u64, has_evidence: bool) -> u64 {
    let n_tables = if has_evidence { 5 } else { 3 };
    // A cell has a direction at least, and rarely fewer than two.
    let square = n_directions.saturating_mul(n_directions);
    square.saturating_mul(n_tables + 1) / 8
}

fn check(name: &'static str, value: Option<f64>) -> Result<(), VisError> {
    match value {
        Some(value) if value.is_nan() || value < 0.0 => Err(VisError::Setting { name, value }),
        _ => Ok(()),
    }
}

/// Returns the middle of a cell's openings.
fn middle(dirs: &Dirs, cell: usize) -> DVec3 {
    let exits = dirs.exits(cell as u32);
    let n = exits.len().max(1) as f64;
    exits.map(|d| dirs.all[d].center).sum::<DVec3>() / n
}

/// Orders cells by place, and adds blocks of at most `most` directions, as ranges that begin at `first`.
fn divide(
    dirs: &Dirs,
    middles: &[DVec3],
    cells: &mut [u32],
    first: usize,
    most: usize,
    blocks: &mut Vec<Range<usize>>,
) {
    let at = |&c: &u32| middles[c as usize];
    let size = Aabb::of_points(cells.iter().map(|c| &middles[*c as usize])).size();
    let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    cells.sort_unstable_by(|a, b| at(a)[axis].total_cmp(&at(b)[axis]).then(a.cmp(b)));
    let n_exits: usize = cells.iter().map(|&c| dirs.exits(c).len()).sum();
    if cells.len() > 1 {
        let (low, high) = cells.split_at_mut(half(dirs, cells));
        let is_block = n_exits <= most;
        let mut inner = Vec::new();
        let into = if is_block { &mut inner } else { &mut *blocks };
        let middle = first + low.len();
        divide(dirs, middles, low, first, most, into);
        divide(dirs, middles, high, middle, most, into);
        if is_block {
            blocks.push(first..first + cells.len());
        }
    } else if !cells.is_empty() {
        blocks.push(first..first + 1);
    }
}

/// Returns the number of the first cells with about half of the directions, neither none nor all of them.
fn half(dirs: &Dirs, cells: &[u32]) -> usize {
    let n_exits: usize = cells.iter().map(|&c| dirs.exits(c).len()).sum();
    let mut before = 0;
    let reaches = |&c: &u32| {
        before += dirs.exits(c).len();
        2 * before >= n_exits
    };
    let at = cells.iter().position(reaches).map_or(0, |i| i + 1);
    at.clamp(1, cells.len() - 1)
}
