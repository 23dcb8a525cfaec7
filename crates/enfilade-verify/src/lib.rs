//! The independent checker of a baked world's promises.
//!
//! It shares no code with any builder. Its input is the world as a consumer loads it (cells, portals, locator,
//! triangles) and, optionally, the triangles from which the world was baked.
//!
//! | promise | test |
//! | --- | --- |
//! | sealed | segments that no structural triangle and no seal blocks; the portals they cross must lead, one by one, from the cell of the start to the cell of the end; short segments across every face of the locator's leaves; and no seal closes more than a gap |
//! | complete | rays to the first structural triangle; its batch must list the cell in which the ray arrives |
//! | planar, convex outline | every portal directly: its pieces lie apart from each other and between its two cells; and `validate()` of the world |
//! | conservative | the world's sets of visible cells, volumes and parts against all these paths, in both directions, and against lines aimed at hidden ones; the run-time's answers ([`verify_views`]) |
//! | consistent | names, counts, boxes and volumes of cells, and the cells of details, against geometry and locator; kinds of portals, as far as a file determines them; leaves, frames and panes against their shapes, and the motion of leaves; sources against each other; decisions against what cells are and what is measured; and everything that came with the source against the source ([`compare_details`], [`compare_scene`]) |
//!
//! ```
//! use enfilade_cpg::World;
//! use enfilade_verify::{VerifyOptions, verify_world};
//!
//! let report = verify_world(&World::default(), None, &VerifyOptions::default());
//! assert!(report.holds() && report.sealed.judged == 0);
//! ```
//!
//! # Limits
//!
//! A world stores vertices as `f32`, and a builder may snap planes together by [`tolerance`] (`eps`). So two readers
//! of one file may place the same wall or opening up to `eps` apart, and each of two surfaces. An event within
//! `2 eps` of a surface is not a statement about the world:
//!
//! - end points closer than `2 eps` to a structural triangle or a portal are drawn again;
//! - a segment that meets no triangle but passes a triangle, or the rim of a portal's piece, closer than that is
//!   *grazing*: counted, not judged. So is a ray that meets its first triangle that close to an edge.
//!
//! A file cannot prove claims to which nothing else in it relates. `docs/verify.md` lists them with reasons: above
//! all the positions of furniture within its room, the names of walls, and their looks. With the source, they are
//! judged.
//!
//! Everything else is judged. Sampling finds faults, but does not prove their absence; so the report always contains
//! how much was judged.

mod carried;
mod claims;
mod complete;
mod decisions;
mod details;
mod drawn;
mod evidence;
mod faces;
mod fittings;
mod kinds;
mod locator_cells;
mod options;
mod origins;
mod outlines;
mod portal_sides;
mod report;
mod rng;
mod sample;
mod sealed;
mod seals;
mod source;
mod subject;
mod views;
mod visible;

use std::sync::atomic::{AtomicU64, Ordering};

use enfilade_cpg::{GraphError, MAX_REPORTED, World};
use enfilade_geom::Triangle;
use rayon::prelude::*;

pub use carried::compare_scene;
pub use drawn::check_drawn;
pub use evidence::{EvidenceError, EvidenceReport, verify_evidence};
pub use options::VerifyOptions;
pub use report::{CompleteCounts, Failure, FailureKind, SealedCounts, VerifyReport, VisibleCounts};
pub use source::{SourceDetail, compare_details, other_scene};
pub use subject::{structural_triangles, tolerance};
pub use views::{Missed, Seer, ViewAnswer, ViewOptions, ViewQuery, ViewReport, verify_views};

use report::Tally;
use rng::Rng;
use subject::Subject;
use visible::Visible;

/// Rays that share a random sequence. Fixed, so that the number of threads does not change the rays.
const CHUNK: u64 = 2048;

/// Checks the promises of `world`; see the [crate page](crate).
///
/// `source` are the structural triangles from which the world was baked, in world space; `None` for the world's own.
/// Uses the current rayon pool; the report does not depend on it. Time: a few microseconds a ray.
#[must_use]
pub fn verify_world(
    world: &World,
    source: Option<&[Triangle]>,
    options: &VerifyOptions,
) -> VerifyReport {
    verify_world_with_progress(world, source, options, &|_, _| ())
}

/// Same as [`verify_world`], but calls `progress` with the finished and all rays, from any thread.
#[must_use]
pub fn verify_world_with_progress(
    world: &World,
    source: Option<&[Triangle]>,
    options: &VerifyOptions,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> VerifyReport {
    let mut problems = Vec::new();
    let mut is_safe = true;
    if let Err(errors) = world.validate() {
        is_safe = errors.len() < MAX_REPORTED && errors.iter().all(is_harmless_to_rays);
        problems.extend(errors.iter().map(ToString::to_string));
    }
    if !is_safe {
        problems.push("no ray was shot: the world's ids or lists are broken".into());
        return VerifyReport::unshot(world, options, problems);
    }
    let subject = Subject::new(world, source, options);
    problems.extend(outlines::check(world, subject.eps));
    problems.extend(seals::check(world, source));
    problems.extend(claims::check(world));
    problems.extend(details::check(world));
    problems.extend(portal_sides::check(&subject, options.seed));
    let not_seal = |t: &&(Triangle, u32)| !world.batches[t.1 as usize].is_seal;
    let own: Vec<Triangle> = subject.own.iter().filter(not_seal).map(|t| t.0).collect();
    problems.extend(kinds::check(world, &own));
    problems.extend(fittings::check(world));
    problems.extend(origins::check(world));
    problems.extend(decisions::check(&subject, &own, options.seed));
    let visible = Visible::new(world, subject.eps);
    problems.extend(visible.iter().flat_map(Visible::check));
    if let Some(source) = source {
        problems.extend(source::problem(&own, source, source::REACH * subject.eps));
    }

    let n_chunks = options.rays.div_ceil(CHUNK);
    let n_sets = if visible.is_some() { 3 } else { 2 };
    let done = AtomicU64::new(0);
    // Independent sets of chunks; tallies add up in any order to the same sum.
    let tally = (0..n_sets * n_chunks)
        .into_par_iter()
        .map(|number| {
            let (set, chunk) = (number / n_chunks, number % n_chunks);
            let first = chunk * CHUNK;
            let n = CHUNK.min(options.rays - first);
            let mut rng = Rng::new(options.seed, stream(set, chunk));
            let mut tally = Tally::default();
            for i in first..first + n {
                try_one(&subject, visible.as_ref(), set, &mut rng, i, &mut tally);
            }
            progress(
                done.fetch_add(n, Ordering::Relaxed) + n,
                options.rays.saturating_mul(n_sets),
            );
            tally
        })
        .reduce(Tally::default, Tally::merged);
    let tally = tally.merged(faces::try_all(&subject, options.seed));
    VerifyReport::new(&subject, options, problems, tally)
}

/// Returns the random sequence of a chunk of a set: those of segments and rays alternate, as before lines were added.
fn stream(set: u64, chunk: u64) -> u64 {
    if set < 2 {
        2 * chunk + set
    } else {
        (1 << 61) + chunk
    }
}

/// Tries number `i` of a set: of segments, of rays, or of lines aimed at hidden things.
fn try_one(
    subject: &Subject,
    visible: Option<&Visible>,
    set: u64,
    rng: &mut Rng,
    i: u64,
    tally: &mut Tally,
) {
    let seen = match set {
        0 => sealed::try_segment(subject, rng, i, tally).map(|path| (path, Vec::new())),
        1 => complete::try_ray(subject, rng, i, tally),
        _ => None,
    };
    let Some(visible) = visible else { return };
    if set == 2 {
        visible.try_line(subject, rng, i, tally);
    }
    if let Some((path, met)) = seen {
        visible.check_cells(subject, &path, i, tally);
        visible.check_parts(subject, &path, &met, i, tally);
    }
}

/// Returns `true` if following rays through a world with this error cannot index out of any list.
fn is_harmless_to_rays(error: &GraphError) -> bool {
    matches!(
        error,
        GraphError::DuplicateName { .. }
            | GraphError::TwoOutdoors { .. }
            | GraphError::OutdoorVoid { .. }
            | GraphError::CellPortals { .. }
            | GraphError::PortalNormal { .. }
            | GraphError::TooFewCorners { .. }
            | GraphError::NotPlanar { .. }
            | GraphError::NotConvex { .. }
            | GraphError::WrongWay { .. }
            | GraphError::PieceOutside { .. }
            | GraphError::PortalArea { .. }
            | GraphError::Statistic { .. }
            | GraphError::Detail { .. }
            | GraphError::Look { .. }
            | GraphError::OutsideOutdoors { .. }
            | GraphError::FarBox { .. }
    )
}
