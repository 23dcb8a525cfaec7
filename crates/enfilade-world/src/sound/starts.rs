//! Starts of searches: places in the graph, and lengths from them.

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;

use crate::sound::acoustics::Acoustics;
use crate::sound::graph::SoundGraph;
use crate::sound::route::Spot;
use crate::space::Place;

/// Distance from an opening within which its toll fades to nothing, so that it does not matter on which side of it one is.
/// [Units: wu]
pub(super) const NEAR: f64 = 2.0;

/// Greatest distance of a point of an opening from those at which searches cross it. [Units: wu]
const APART: f64 = 0.71;

/// Returns a place in the graph; `None` in a part that it does not know.
pub(super) fn spot(graph: &SoundGraph, place: Place, at: DVec3) -> Option<Spot> {
    (place.part.idx() < graph.joined.n_parts()).then(|| Spot {
        cell: graph.joined.cell(place),
        at: graph.to_root(place.part, at),
    })
}

/// Writes the lengths from a place to the points of its cell. Openings close by are crossed at any point of them, not only at those,
/// which are a meter apart: less than the distance from the opening to the nearest of them, so that sequences through an
/// opening in which one stands do not seem longer than others.
pub(super) fn lengths_from(
    acoustics: &Acoustics,
    graph: &SoundGraph,
    cell: CellId,
    at: DVec3,
    lengths: &mut Vec<f64>,
) {
    let ways = &graph.ways;
    graph.lengths_from(&acoustics.parts, cell, at, lengths);
    for exit in ways.exits_of(cell) {
        let distance = graph.bounds[exit.portal.idx()].distance_squared(at).sqrt();
        if distance >= NEAR {
            continue;
        }
        let own = &mut lengths[ways.places(exit.portal, cell)];
        let nearest = own.iter().copied().fold(f64::INFINITY, f64::min);
        let extra = (nearest - distance).clamp(0.0, APART) * (1.0 - distance / NEAR);
        own.iter_mut().for_each(|length| *length -= extra);
    }
}
