//! Pieces of a cell that lie in one plane, whatever planes of the tree they come from.

use std::collections::BTreeMap;

use enfilade_cpg::CellId;
use enfilade_geom::Plane;

use super::piece::Piece;

/// Farthest distance of a vertex from the plane that its piece counts to. [Units: wu]
const FLAT: f64 = 2e-3;
/// Cosine of the largest angle between pieces of one plane.
const ALONG: f64 = 0.999_99;

/// Numbers the planes of each cell: a piece counts to the plane of the largest piece that it fits. O(pieces × planes of a cell).
pub(crate) fn number_planes(pieces: &mut [Piece]) {
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    let areas: Vec<f64> = pieces.iter().map(Piece::area).collect();
    order.sort_by(|&a, &b| areas[b].total_cmp(&areas[a]).then(a.cmp(&b)));
    let mut planes: BTreeMap<CellId, Vec<Plane>> = BTreeMap::new();
    for i in order {
        let piece = &mut pieces[i];
        let own = planes.entry(piece.cell).or_default();
        let fits = |plane: &Plane| {
            plane.normal.dot(piece.normal) > ALONG
                && (piece.points.iter()).all(|&p| plane.signed_distance(p).abs() <= FLAT)
        };
        let number = own.iter().position(fits).unwrap_or_else(|| {
            own.push(piece.plane_of());
            own.len() - 1
        });
        piece.plane = number as u32;
    }
}
