//! The flow of the Delaunay builder: structure → tetrahedra → cells → rooms → candidate portals and votes.

use enfilade_geom::Aabb;

use super::decimate::default_stop;
use super::rooms::find_rooms;
use super::session::Session;
use super::space::box_points;
use crate::complex::{Label, LabelSettings, Vote};
use crate::config::DelaunayConfig;
use crate::proposal::Proposal;
use crate::rooms::inside_stairs;
use crate::structure::{OUTDOORS, Structure};
use crate::{BakeConfig, BakeContext, BakeError, Resolution, Stage};

/// Width of the air around the scene that the cell complex covers. [Units: wu]
const AROUND: f64 = 1.0;

/// Returns votes for the outdoors in the empty space between two boxes. Tetrahedra there reach far beyond the outer
/// box, and so do their middles.
fn votes_around(inner: &Aabb, outer: &Aabb) -> impl Iterator<Item = Vote> {
    let [volume, less] = [outer, inner].map(|b| b.size().element_product());
    let middle = Aabb::new((inner.min + outer.min) * 0.5, (inner.max + outer.max) * 0.5);
    let points = box_points(&middle);
    let weight = ((volume - less) / points.len() as f64) as f32;
    points.into_iter().map(move |point| Vote {
        point,
        label: Label::Region(OUTDOORS),
        weight,
    })
}

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
    context.begin(Stage::Candidates)?;
    let rooms = find_rooms(
        session,
        &session.decimation.after(n_steps),
        config.merge.min_radius,
        context.allowance(),
    );
    // Points outside the tetrahedra have no room.
    let region_at = |p| {
        let part = session.space.part_at(p, 0, &session.bvh);
        part.map_or(0, |t| rooms.label_of_part[t as usize])
    };
    let (stairs, bvh) = (&structure.stairs, &structure.bvh);
    let voids = inside_stairs(stairs, bvh, &region_at, context.allowance());
    let bounds = structure.bounds();
    let around = bounds.expanded(AROUND);
    let mut votes = rooms.votes;
    votes.extend(votes_around(&bounds, &around));
    let space = &session.space;
    let counts = vec![
        ("tetrahedra", space.delaunay.n_finite as f64),
        ("finest", space.finest),
        ("passed_over", space.n_passed_over as f64),
        ("steps", n_steps as f64),
        ("screens", rooms.candidates.len() as f64),
    ];
    let DelaunayConfig { weight, stop, .. } = &config.delaunay;
    let stop = stop.unwrap_or_else(|| default_stop(*weight));
    let mut settings = config.merge.to_settings();
    settings.retain(|k, _| ["merge.min_radius", "merge.closed_share"].contains(&k.as_str()));
    settings.insert("min_opening".to_owned(), config.min_opening.to_string());
    settings.insert("weight".to_owned(), format!("{weight:?}"));
    settings.insert("stop".to_owned(), stop.to_string());
    Ok(Proposal {
        candidates: rooms.candidates,
        voids,
        label: LabelSettings {
            keeps_closed: false,
            ..LabelSettings::default()
        },
        counts,
        settings,
        resolution: Resolution::Balls {
            radius: space.finest,
        },
        ..Proposal::new(around, votes)
    })
}
