//! Visibility before run-time: which cells can be seen from which.
//!
//! Works on a [`SightGraph`]: cells and convex openings, from a world, a portal file or a generator.
//! [`see_all`] runs the stages in order:
//!
//! 1. `dirs`: each portal as two directions; what lies on the right sides of planes *might* be seen.
//! 2. `narrow`: planes between two openings in a row cut most of that.
//! 3. `rays`, `grow`: random lines, and lines turned from those, prove most of what is visible.
//! 4. `flow`: a search over portal chains settles the rest, chain by chain, by planes, lines and
//!    splitting, and at last by `stabbing`, a linear programme. This is the heart; start reading there.
//! 5. `occlude`: where walls are known, beams settle what they hide inside cells.
//!
//! `search` puts them together in rounds, so that results do not depend on threads.
//!
//! **The answer is a superset of the truth.** Sight is symmetric and so is the answer. A line that passes
//! every opening on its way at least [`VisConfig::clearance`] inside its edges is never lost; whatever a
//! plane or a line cannot settle counts as visible and is counted in [`VisOutput::undecided`].

mod bits;
mod checkpoint;
mod clip;
mod dirs;
mod evidence;
mod flow;
mod grow;
mod narrow;
mod occlude;
mod planes;
mod prove;
mod rays;
mod search;
mod stabbing;

use std::time::{Duration, Instant};

use enfilade_cpg::{CellId, CellSet, SightGraph, SightGraphError};
use enfilade_geom::{Bvh, DVec3, Triangle};

use bits::BitTable;
use dirs::Dirs;
use occlude::Sheets;
use rays::Blocker;
use search::{Rest, Search};

/// Share of the clearance that the search itself uses; a checker's sums may differ in the last digits.
const KEPT: f64 = 0.9;

/// Lines tried between cells that walls may hide from each other, and how often, before each beam is looked at.
const INSIST_LINES: usize = 50;
const INSIST_ROUNDS: u64 = 2;

/// How thoroughly to look.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum VisMode {
    /// Sides of planes, and planes between two openings in a row: seconds on any graph, a larger answer.
    Fast,
    /// The search over portal chains.
    #[default]
    Exact,
}

/// What to compute.
#[derive(Clone, Debug, PartialEq)]
pub struct VisConfig {
    /// How thoroughly to look.
    pub mode: VisMode,
    /// Lines that pass nearer to an opening's edge than this may be lost. `None`: 1e-8 of the largest
    /// coordinate, less than that coordinate's rounding in `f32`. [Units: wu] [Limit: >= 0]
    pub clearance: Option<f64>,
    /// Nothing farther than this is seen. [Units: wu] [Limit: >= 0]
    pub far: Option<f64>,
    /// Random lines cast from each portal; more are grown from those that find something.
    pub n_rays: usize,
    /// Pieces that an opening may be split into to settle one chain.
    pub max_pieces: u32,
    /// Write down proofs: [`VisOutput::evidence`]. Costs about as much again.
    pub has_evidence: bool,
}

impl Default for VisConfig {
    fn default() -> Self {
        Self {
            mode: VisMode::Exact,
            clearance: None,
            far: None,
            n_rays: 12,
            max_pieces: 64,
            has_evidence: false,
        }
    }
}

/// Why nothing was computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VisError {
    /// The graph is broken.
    #[error(transparent)]
    Graph(#[from] SightGraphError),
    /// A setting makes no sense.
    #[error("{name} is {value}; a number of at least 0 is needed")]
    Setting {
        /// The setting.
        name: &'static str,
        /// What it is.
        value: f64,
    },
    /// A checkpoint does not fit.
    #[error("the checkpoint cannot be used: {problem}; delete it to start anew")]
    Checkpoint {
        /// Why.
        problem: &'static str,
    },
    /// What was found could not be shown again: a bug, and no evidence is written.
    #[error("the search could not repeat its proof (a bug); leave the evidence out")]
    Evidence,
}

/// A line that proves cells to see each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Witness {
    /// A point in one of the openings it crosses. [Units: wu]
    pub origin: DVec3,
    /// Where it goes; any length.
    pub direction: DVec3,
    /// The openings it crosses, in order, as directions of [`SightGraph`].
    pub chain: Vec<u32>,
}

/// What can be seen.
#[derive(Clone, Debug, PartialEq)]
pub struct VisOutput {
    /// By cell: the cells that might be seen from it, itself included. Symmetric.
    pub cells: Vec<CellSet>,
    /// By cell: those of `cells` that no line proves; none of the rest is in doubt.
    pub undecided: Vec<CellSet>,
    /// Lines that together prove everything else in `cells`.
    pub witnesses: Vec<Witness>,
    /// Whether the search ended by itself; if not, the answer is larger than need be.
    pub is_complete: bool,
    /// Pairs left by sides of planes alone, as an upper bound to compare with.
    pub n_base: u64,
    /// Chains searched.
    pub n_steps: u64,
    /// Proofs of all this, for `enfilade-verify`, where asked for; see `docs/evidence.md`.
    pub evidence: Option<Vec<u8>>,
}

/// What surrounds a computation: threads come from the current rayon pool.
pub struct VisContext<'a> {
    /// Hears work done and work in all, weighted by cost, and says whether to go on.
    pub on_round: &'a mut (dyn FnMut(u64, u64) -> bool + Send),
    /// What else blocks sight; without it, a line is free wherever it passes openings.
    pub walls: Option<&'a [Triangle]>,
    /// Where to keep what was found, and what to go on from. Not used by [`VisMode::Fast`].
    pub checkpoint: Option<VisCheckpoint<'a>>,
}

/// How a search is kept for another day; what it finds then is what it would have found in one go.
pub struct VisCheckpoint<'a> {
    /// What was saved before. Refused where the graph or the settings were others.
    pub resume: Option<Vec<u8>>,
    /// A number that changes with [`VisContext::walls`].
    pub salt: u64,
    /// How long to search between saves.
    pub every: Duration,
    /// Takes the state: when it is due, and when [`VisContext::on_round`] stops the search.
    pub save: &'a mut (dyn FnMut(Vec<u8>) + Send),
}

/// Finds what can be seen from every cell.
///
/// Memory: a bit for each pair of directions, three times over for short. Time grows with what is to be
/// told apart: a map of 3,000 portals takes a second, one of 10,000 a minute.
///
/// # Errors
///
/// A broken graph, a setting that is negative or no number, or a checkpoint that does not fit.
pub fn see_all(
    graph: &SightGraph,
    config: &VisConfig,
    context: &mut VisContext<'_>,
) -> Result<VisOutput, VisError> {
    graph.validate()?;
    check("clearance", config.clearance)?;
    check("the far plane", config.far)?;
    let dirs = Dirs::new(graph);
    let clearance = config.clearance.unwrap_or(1e-8 * dirs.scale);
    // The search keeps more than it promises, so that a checker that rounds otherwise still closes every chain.
    let bvh = context.walls.map(Bvh::build);
    let is_blocked = bvh
        .as_ref()
        .map(|bvh| move |a: DVec3, b: DVec3| bvh.any_hit(a, b, |_| false));
    let blocker = is_blocked.as_ref().map(|f| f as Blocker<'_>);
    let mut search = Search::new(&dirs, KEPT * clearance, config.far, blocker);
    let n_base = count_all(&search.visible());
    let salt = context.checkpoint.as_ref().map_or(0, |c| c.salt);
    let key = checkpoint::key(graph, config, salt);
    let resumed = match &context.checkpoint {
        Some(VisCheckpoint {
            resume: Some(bytes),
            ..
        }) if config.mode == VisMode::Exact => Some(checkpoint::decode(bytes, &mut search, key)?),
        _ => None,
    };
    if resumed.is_none() {
        narrow::narrow_might(
            &dirs,
            &mut search.might,
            &mut search.settled,
            &search.tolerance,
        );
    }
    let is_complete = match (config.mode, resumed) {
        (VisMode::Fast, _) => {
            search.cast(config.n_rays);
            search.grow();
            true
        }
        (VisMode::Exact, Some(rest)) => run(&mut search, config, context, rest, key),
        (VisMode::Exact, None) => {
            search.cast(config.n_rays);
            search.grow();
            let rest = search.all_openings();
            run(&mut search, config, context, rest, key)
        }
    };
    if config.mode == VisMode::Exact
        && is_complete
        && let (Some(walls), Some(bvh)) = (context.walls, &bvh)
    {
        search.insist(INSIST_LINES, INSIST_ROUNDS, &mut *context.on_round);
        let sheets = Sheets::new(walls, bvh);
        search.settle_by_walls(&sheets, clearance, &mut *context.on_round);
    }
    let evidence = config
        .has_evidence
        .then(|| evidence::encode(graph, &search, config))
        .transpose()?;
    Ok(VisOutput {
        evidence,
        ..output(search, n_base, is_complete)
    })
}

/// Searches, and saves what was found now and then, and when told to stop.
fn run(
    search: &mut Search<'_>,
    config: &VisConfig,
    context: &mut VisContext<'_>,
    rest: Rest,
    key: u64,
) -> bool {
    let VisContext {
        on_round,
        checkpoint,
        ..
    } = context;
    let mut saved = Instant::now();
    search.run(config.max_pieces, rest, |search, rest| {
        let goes_on = on_round(rest.done, rest.total);
        if let Some(at) = checkpoint
            && (!goes_on || saved.elapsed() >= at.every)
        {
            (at.save)(checkpoint::encode(search, rest, key));
            saved = Instant::now();
        }
        goes_on
    })
}

fn check(name: &'static str, value: Option<f64>) -> Result<(), VisError> {
    match value {
        Some(value) if value.is_nan() || value < 0.0 => Err(VisError::Setting { name, value }),
        _ => Ok(()),
    }
}

fn output(search: Search<'_>, n_base: u64, is_complete: bool) -> VisOutput {
    let n = search.dirs.n_cells;
    let visible = search.visible();
    let mut cells = vec![CellSet::new(n); n];
    let mut undecided = cells.clone();
    for a in 0..n {
        for b in bits::ones(visible.row(a)) {
            let id = CellId(b as u32);
            cells[a].insert(id);
            if !search.seen.get(a, b) || search.undecided.get(a, b) {
                undecided[a].insert(id);
            }
        }
    }
    let n_steps = search.effort.steps;
    let id = |d: u32| search.dirs.all[d as usize].id;
    let witnesses = search
        .lines
        .into_iter()
        .map(|line| Witness {
            origin: line.origin,
            direction: line.direction,
            chain: line.chain.into_iter().map(id).collect(),
        })
        .collect();
    VisOutput {
        cells,
        undecided,
        witnesses,
        is_complete,
        n_base,
        n_steps,
        evidence: None,
    }
}

fn count_all(table: &BitTable) -> u64 {
    table
        .words()
        .iter()
        .map(|w| u64::from(w.count_ones()))
        .sum()
}
