//! Precomputed visibility: which cells can be seen from which.
//!
//! Works on a [`SightGraph`]: cells and convex openings, from a world, a portal file or a generator. [`see_all`] runs
//! the stages in order:
//!
//! 1. `dirs`: splits each portal into two directions; everything on the right sides of planes *might* be seen.
//! 2. `narrow`: planes between two consecutive openings rule out most of that.
//! 3. `rays`, `grow`: random lines, and lines turned from those, prove most of what is visible.
//! 4. `flow`: a search over portal chains settles the rest, chain by chain, with planes, lines and splitting, and
//!    finally with `stabbing`, a linear program. This is the heart; start reading there.
//! 5. `occlude`: if walls are given, beams settle what they hide inside cells.
//!
//! `search` runs the stages in rounds, so that results do not depend on threads.
//!
//! [`see_world`] does the same for a world's graph, special portals included: it searches the graph unfolded at them
//! (`specials`, `unfold`).
//!
//! Afterwards [`see_parts`] finds the parts of each cell that can be seen: from the hourglasses of sequences of
//! portals ([`Hourglasses`]), less the parts that walls hide from the first or the last of them (`shade`).
//!
//! **The answer is a superset of the truth.** It is symmetric, as sight is
//! without special portals. A line that passes every opening on its
//! way at least [`VisConfig::clearance`] inside its edges is never lost. Everything that neither a plane nor a line
//! settles counts as visible and appears in [`VisOutput::undecided`].

mod bits;
mod checkpoint;
mod clip;
mod config;
mod cover;
mod dirs;
mod evidence;
mod flow;
mod grow;
mod hourglass;
mod narrow;
mod occlude;
mod output;
mod parts;
mod planes;
mod polytope;
mod prove;
mod rays;
mod recheck;
mod rng;
mod search;
mod shade;
mod sheets;
mod specials;
mod stabbing;
mod tolerance;
mod unfold;
mod volumes;

use std::time::Instant;

use enfilade_cpg::{Pvs, SightGraph};
use enfilade_geom::{Bvh, DVec3};

use config::KEPT;
use dirs::Dirs;
use rays::Blocker;
use search::{Rest, Search};
use sheets::Sheets;

pub use config::{VisCheckpoint, VisConfig, VisContext, VisError, VisMode};
pub use hourglass::{Hourglass, Hourglasses};
pub use output::{VisOutput, Witness};
pub use parts::{see_parts, see_parts_through};
pub use specials::{WorldVis, see_world};
pub use volumes::piece_faces;

/// Lines tried between each two cells that only walls may hide from each other, and rounds of that, before beams.
const INSIST_LINES: usize = 50;
const INSIST_ROUNDS: u64 = 2;

/// Finds the cells that can be seen from every cell.
///
/// Memory: three bits for each pair of directions, for a short time; cells without a portal take none. Time grows
/// with the pairs to decide: a map of 3,000 portals takes a second, one of 10,000 a minute.
///
/// # Errors
///
/// A broken graph, one whose tables would exceed [`VisConfig::max_memory`], a setting that is negative or not a
/// number, or a checkpoint that does not fit.
pub fn see_all(
    graph: &SightGraph,
    config: &VisConfig,
    context: &mut VisContext<'_>,
) -> Result<VisOutput, VisError> {
    graph.validate()?;
    check("clearance", config.clearance)?;
    check("the far plane", config.far)?;
    let dirs = Dirs::new(graph);
    let estimate = estimate(&dirs, config.has_evidence);
    if estimate > config.max_memory {
        return Err(VisError::TooLarge {
            n_portals: graph.portals.len(),
            estimate,
            limit: config.max_memory,
        });
    }
    let clearance = config.clearance.unwrap_or(1e-8 * dirs.scale);
    // The search keeps more than it promises, so that a checker that rounds differently still closes every chain.
    let bvh = context.walls.map(Bvh::build);
    let is_blocked = bvh
        .as_ref()
        .map(|bvh| move |a: DVec3, b: DVec3| bvh.any_hit(a, b, |_| false));
    let blocker = is_blocked.as_ref().map(|f| f as Blocker<'_>);
    let mut search = Search::new(&dirs, KEPT * clearance, config.far, blocker);
    let n_base = search.visible().count_all() + dirs.n_alone();
    let salt = context.checkpoint.as_ref().map_or(0, |c| c.salt);
    let key = checkpoint::key(graph, config, salt);
    let resumed = match &context.checkpoint {
        Some(VisCheckpoint {
            resume: Some(bytes),
            ..
        }) if config.mode == VisMode::Exact => {
            let base = search.might.clone();
            let rest = checkpoint::decode(bytes, &mut search, key)?;
            recheck::check(&search, &rest, &base, config.max_pieces)?;
            Some(rest)
        }
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

/// Returns the estimated memory of a search's tables. [Units: bytes]
fn estimate(dirs: &Dirs, has_evidence: bool) -> u64 {
    let square = |n: usize| (n as u64).saturating_mul(n as u64);
    let n_tables = if has_evidence { 5 } else { 3 };
    let bits = square(dirs.len()).saturating_mul(n_tables);
    bits.saturating_add(square(dirs.n_cells).saturating_mul(4)) / 8
}

/// Runs the search; saves its state from time to time and when `on_round` stops it. Returns `true` if it is complete.
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
    let visible = search.visible();
    let names = &search.dirs.cells;
    let is_undecided = |a: usize, b: usize| !search.seen.get(a, b) || search.undecided.get(a, b);
    // A cell without a portal sees only itself.
    let rows = |is_alone_in: bool, keep: &dyn Fn(usize, usize) -> bool| {
        let mut next = 0;
        let rows = (0..search.dirs.n_all_cells as u32).map(|name| {
            if names.get(next) != Some(&name) {
                return if is_alone_in { vec![name] } else { Vec::new() };
            }
            let a = next;
            next += 1;
            let seen = bits::ones(visible.row(a)).filter(|&b| keep(a, b));
            seen.map(|b| names[b]).collect()
        });
        Pvs::of_ascending(rows)
    };
    let cells = rows(true, &|_, _| true);
    let undecided = rows(false, &is_undecided);
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
