//! The independent checker: does a baked world keep its promises?
//!
//! It shares no code with any builder. All it knows is the world as a consumer reads it (cells,
//! portals, locator, triangles) and, if given, the triangles that the world was baked from.
//!
//! | promise | how it is tried |
//! | --- | --- |
//! | sealed | segments that no structural triangle and no seal blocks; the portals crossed must lead, one by one, from the cell of the start to the cell of the end; short ones across every face of the locator's leaves; and no seal closes more than a gap |
//! | complete | rays to the first structural triangle; its batch must list the cell that the ray arrives in |
//! | planar, convex outline | every portal, directly, with its pieces apart from each other and between its two cells; and `validate()` of the world |
//! | conservative | what the world says is seen of a cell from another (cells, volumes, parts) against all these ways, in both directions, and lines aimed at what it says is not seen; the run-time's answers ([`verify_views`]) |
//! | true to itself | names, counts, boxes and volumes of cells, and the cells of details, against geometry and locator; kinds of portals, as far as a file tells; leaves, frames and panes against their shapes, and how leaves turn; sources against each other; and all that came with the source against the source ([`compare_details`], [`compare_scene`]) |
//!
//! ```
//! use enfilade_cpg::World;
//! use enfilade_verify::{VerifyOptions, verify_world};
//!
//! let report = verify_world(&World::default(), None, &VerifyOptions::default());
//! assert!(report.holds() && report.sealed.judged == 0);
//! ```
//!
//! # What is not judged, and why
//!
//! A world stores corners as `f32`, and a builder may snap planes together by [`tolerance`] (`eps`).
//! Two readers of one file may therefore place the same wall or opening up to `eps` apart, each of
//! two surfaces, so what happens within `2 eps` of one is not a statement about the world:
//!
//! - end points nearer than `2 eps` to a structural triangle or a portal are drawn again;
//! - a segment that meets no triangle but passes a triangle, or the rim of a portal's piece, nearer
//!   than that is *grazing*: counted, not judged. So is a ray whose first triangle is met that close
//!   to an edge.
//!
//! Claims of which nothing else in a file knows cannot be proved by the file. `docs/verify.md` lists it, with the reasons: above all
//! where furniture stands within its room, what walls were called, and what they look like. With the source, it is judged.
//!
//! Everything else is judged. Sampling finds breaks, it does not prove their absence; the report
//! therefore always says how much was judged.

mod carried;
mod claims;
mod complete;
mod details;
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
pub use evidence::{EvidenceError, EvidenceReport, verify_evidence};
pub use options::VerifyOptions;
pub use report::{CompleteCounts, Failure, FailureKind, SealedCounts, VerifyReport, VisibleCounts};
pub use source::{SourceDetail, compare_details};
pub use subject::{structural_triangles, tolerance};
pub use views::{Missed, Seer, ViewAnswer, ViewOptions, ViewQuery, ViewReport, verify_views};

use report::Tally;
use rng::Rng;
use subject::Subject;
use visible::Visible;

/// Rays that share a random sequence. Fixed, so that threads cannot change what is drawn.
const CHUNK: u64 = 2048;

/// Tries the promises on `world`; see the [crate page](crate).
///
/// `source` are the structural triangles that the world was baked from, in world space; without
/// them the world's own block. Uses the current rayon pool; the report does not depend on it.
/// Time: a few microseconds a ray.
#[must_use]
pub fn verify_world(
    world: &World,
    source: Option<&[Triangle]>,
    options: &VerifyOptions,
) -> VerifyReport {
    verify_world_with_progress(world, source, options, &|_, _| ())
}

/// [`verify_world`], calling `progress` with the rays done and the rays in all, from any thread.
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
    let visible = Visible::new(world, subject.eps);
    problems.extend(visible.iter().flat_map(Visible::check));
    if let Some(source) = source {
        problems.extend(source::problem(&own, source, 4.0 * subject.eps));
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
    let tally = if options.faces {
        tally.merged(faces::try_all(&subject, options.seed))
    } else {
        tally
    };
    VerifyReport::new(&subject, options, problems, tally)
}

/// The random sequence of a chunk of a set: those of segments and rays alternate, as they did before there were lines.
fn stream(set: u64, chunk: u64) -> u64 {
    if set < 2 {
        2 * chunk + set
    } else {
        (1 << 61) + chunk
    }
}

/// Tries number `i` of a set: of segments, of rays, of lines aimed at what is said not to be seen.
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
        visible.judge(subject, &path, i, tally);
        visible.judge_parts(subject, &path, &met, i, tally);
    }
}

/// Whether following rays through a world with this error cannot go out of any list's range.
fn is_harmless_to_rays(error: &GraphError) -> bool {
    matches!(
        error,
        GraphError::DuplicateName { .. }
            | GraphError::TwoOutdoors { .. }
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
