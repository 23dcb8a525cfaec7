//! Limits on dividing the air.

use enfilade_geom::Allowance;

/// Most memory per point while tetrahedra become cells. [Units: bytes]
pub(super) const BYTES_A_POINT: u64 = 5_000;

/// Limits on dividing the air.
pub(super) struct Limits<'a> {
    /// Most points added to surfaces.
    pub(super) n_points: usize,
    /// Allowance of work for loops.
    pub(super) allowance: &'a Allowance,
}
