//! The flow of the Delaunay builder: structure → tetrahedra → cells → rooms → candidate portals and votes.

use super::decimate::default_stop;
use super::session::Session;
use crate::config::DelaunayConfig;
use crate::proposal::Proposal;
use crate::structure::Structure;
use crate::{BakeConfig, BakeContext, BakeError};

/// Finds rooms by tetrahedra.
///
/// About `O(n log n)` in the points sampled on surfaces, and in triangles.
///
/// # Errors
/// If a setting or coordinate is out of limits, or the caller cancels.
pub(crate) fn propose(
    structure: &Structure<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Proposal, BakeError> {
    let session = Session::of(structure, config, context)?;
    propose_of(
        structure,
        &session,
        session.decimation.stop,
        config,
        context,
    )
}

/// Proposes the rooms that remain after the first `n_steps` of a session's decimation.
///
/// # Errors
/// If the caller cancels.
pub(crate) fn propose_of(
    structure: &Structure<'_>,
    session: &Session,
    n_steps: usize,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Proposal, BakeError> {
    let rooms = session.rooms_after(n_steps);
    let mut proposal = rooms.propose(structure, config, context)?;
    let space = &session.space;
    proposal.counts.extend([
        ("tetrahedra", space.delaunay.n_finite as f64),
        ("finest", space.finest),
        ("passed_over", space.n_passed_over as f64),
        ("steps", n_steps as f64),
    ]);
    let DelaunayConfig { weight, stop, .. } = &config.delaunay;
    let stop = stop.unwrap_or_else(|| default_stop(*weight));
    let settings = [
        ("weight", format!("{weight:?}")),
        ("stop", stop.to_string()),
    ];
    let settings = settings.map(|(name, value)| (name.to_owned(), value));
    proposal.settings.extend(settings);
    Ok(proposal)
}
