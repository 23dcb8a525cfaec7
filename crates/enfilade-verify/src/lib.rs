//! The independent checker: does a baked world keep its promises?
//!
//! It shares no code with any builder. All it knows is the world as a consumer reads it (cells,
//! portals, locator, triangles) and, if given, the triangles that the world was baked from.
//!
//! | promise | how it is tried |
//! | --- | --- |
//! | sealed | segments that no structural triangle and no seal blocks; the portals crossed must lead, one by one, from the cell of the start to the cell of the end; and no seal closes more than a gap |
//! | complete | rays to the first structural triangle; its batch must list the cell that the ray arrives in |
//! | planar, convex outline | every portal, directly, with its pieces apart from each other and between its two cells; and `validate()` of the world |
//! | true to itself | names, counts, boxes and volumes of cells, and the cells of details, against geometry and locator; kinds of portals, as far as a file tells; a source against the triangles, and its details against the world's ([`compare_details`]) |
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
//! Where a detail stands in its room is known to nobody but the source: without one, a detail that was moved within its room, or
//! taken away with all counts corrected, that of the whole file among them, is not found. Nor is a door that is called an
//! opening, or an opening called a door: which it is depends on the leaf or pane that a bake found in it, by its settings.
//! Windows, sills, heights and widths are judged in worlds of this version whose portals nobody cut since.
//!
//! Everything else is judged. Sampling finds breaks, it does not prove their absence; the report
//! therefore always says how much was judged.

mod claims;
mod complete;
mod details;
mod evidence;
mod kinds;
mod locator_cells;
mod options;
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

use std::sync::atomic::{AtomicU64, Ordering};

use enfilade_cpg::{GraphError, MAX_REPORTED, World};
use enfilade_geom::Triangle;
use rayon::prelude::*;

pub use evidence::{EvidenceError, EvidenceReport, verify_evidence};
pub use options::VerifyOptions;
pub use report::{CompleteCounts, Failure, FailureKind, SealedCounts, VerifyReport};
pub use source::{SourceDetail, compare_details};
pub use subject::{structural_triangles, tolerance};
pub use views::{Missed, Seer, ViewAnswer, ViewOptions, ViewQuery, ViewReport, verify_views};

use report::Tally;
use rng::Rng;
use subject::Subject;

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
    if let Some(source) = source {
        problems.extend(source::problem(&own, source, 4.0 * subject.eps));
    }

    let n_chunks = options.rays.div_ceil(CHUNK);
    let done = AtomicU64::new(0);
    // Two independent sets of chunks; tallies add up in any order to the same sum.
    let tally = (0..2 * n_chunks)
        .into_par_iter()
        .map(|chunk| {
            let is_sealed = chunk % 2 == 0;
            let first = chunk / 2 * CHUNK;
            let n = CHUNK.min(options.rays - first);
            let mut rng = Rng::new(options.seed, chunk);
            let mut tally = Tally::default();
            for i in first..first + n {
                if is_sealed {
                    sealed::try_segment(&subject, &mut rng, i, &mut tally);
                } else {
                    complete::try_ray(&subject, &mut rng, i, &mut tally);
                }
            }
            progress(
                done.fetch_add(n, Ordering::Relaxed) + n,
                options.rays.saturating_mul(2),
            );
            tally
        })
        .reduce(Tally::default, Tally::merged);
    VerifyReport::new(&subject, options, problems, tally)
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
