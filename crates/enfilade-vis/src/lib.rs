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
//! A large graph is searched block by block ([`VisPlan`]): `plan` divides it, `windows` finds the part of the graph that a
//! block's cells might see, with bounds that take the place of stages 1 and 2, `blocks` runs the others there, and `rows`
//! puts the rows of all blocks together.
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
mod blocks;
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
mod plan;
mod planes;
mod polytope;
mod prove;
mod rays;
mod recheck;
mod rng;
mod rows;
mod search;
mod shade;
mod sheets;
mod specials;
mod stabbing;
mod tolerance;
mod unfold;
mod volumes;
mod windows;

use enfilade_cpg::{Pvs, SightGraph};
use enfilade_geom::{Bvh, DVec3, Instant};

use config::KEPT;
use rays::Blocker;
use search::{Rest, Search};
use sheets::Sheets;

pub use config::{VisBlocks, VisCheckpoint, VisConfig, VisContext, VisError, VisMode};
pub use hourglass::{Hourglass, Hourglasses};
pub use output::{VisOutput, Witness};
pub use parts::{see_parts, see_parts_through};
pub use plan::VisPlan;
pub use specials::{WorldVis, plain_sight, see_world};
pub use volumes::piece_faces;

/// Finds the cells that can be seen from every cell.
///
/// A graph of up to 10,000 portals is searched in one piece. Memory: three bits for each pair of directions, for a short
/// time; cells without a portal take none. Time grows with the pairs to decide: a map of 3,000 portals takes a second,
/// one of 10,000 a minute. A larger graph is searched block by block ([`VisPlan`]): memory goes with what the cells of a
/// block might see, within [`VisConfig::max_memory`], and time with the cells if each sees about as much.
///
/// # Errors
///
/// As [`VisPlan::new`], or a checkpoint that does not fit.
pub fn see_all(
    graph: &SightGraph,
    config: &VisConfig,
    context: &mut VisContext<'_>,
) -> Result<VisOutput, VisError> {
    let salt = context.checkpoint.as_ref().map_or(0, |c| c.salt);
    let plan = VisPlan::new(graph, config, salt)?;
    if !plan.is_whole {
        return see_blocks(&plan, context);
    }
    if let Some(found) = kept_whole(&plan, context) {
        return plan.finish(&[found]);
    }
    let dirs = &plan.dirs;
    let bvh = context.walls.map(Bvh::build);
    let is_blocked = bvh
        .as_ref()
        .map(|bvh| move |a: DVec3, b: DVec3| bvh.any_hit(a, b, |_| false));
    let blocker = is_blocked.as_ref().map(|f| f as Blocker<'_>);
    // The search keeps more than it promises, so that a checker that rounds differently still closes every chain.
    let kept = KEPT * plan.clearance;
    let mut search = Search::new(dirs, kept, config.far, blocker);
    let n_base = search.n_pairs() + dirs.n_alone();
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
        search.narrow();
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
        let sheets = Sheets::new(walls, bvh);
        search.settle_inside(&sheets, plan.clearance, &mut *context.on_round);
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

/// Returns the bytes of a graph in one piece that are kept as a block.
fn kept_whole(plan: &VisPlan<'_>, context: &mut VisContext<'_>) -> Option<Vec<u8>> {
    if plan.config.has_evidence || plan.n_blocks() != 1 {
        return None;
    }
    let store = context.checkpoint.as_mut()?.blocks.as_deref_mut()?;
    let found = store.get(plan.key(0));
    found.filter(|bytes| plan.is_block(0, bytes))
}

/// Searches a graph block by block; takes those that are kept, and keeps those that are done.
fn see_blocks(plan: &VisPlan<'_>, context: &mut VisContext<'_>) -> Result<VisOutput, VisError> {
    let mut checkpoint = context.checkpoint.take();
    if let Some(VisCheckpoint {
        resume: Some(_), ..
    }) = &checkpoint
    {
        let problem = "it is of a search in one piece";
        return Err(VisError::Checkpoint { problem });
    }
    let mut store = checkpoint.as_mut().and_then(|c| c.blocks.as_deref_mut());
    let mut found = Vec::new();
    let mut left = Vec::new();
    for block in 0..plan.n_blocks() {
        let kept = store.as_mut().and_then(|s| s.get(plan.key(block)));
        match kept.filter(|bytes| plan.is_block(block, bytes)) {
            Some(bytes) => found.push(bytes),
            None => left.push(block),
        }
    }
    let is_complete = plan.search(&left, context, &mut |block, bytes, is_complete| {
        if let Some(store) = store.as_mut().filter(|_| is_complete) {
            store.put(plan.key(block), &bytes);
        }
        found.push(bytes);
    });
    context.checkpoint = checkpoint;
    Ok(VisOutput {
        is_complete,
        ..plan.finish(&found)?
    })
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
    let n_lines = search.lines.len() as u64;
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
        n_lines,
        evidence: None,
    }
}
