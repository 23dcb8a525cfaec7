//! What dividing the air may take.

use enfilade_geom::Allowance;

/// Memory that a point takes, at most, while tetrahedra become cells. [Units: bytes]
pub(super) const BYTES_A_POINT: u64 = 5_000;

/// What dividing may take.
pub(super) struct Limits<'a> {
    /// Most points added to surfaces.
    pub(super) n_points: usize,
    /// What loops may spend.
    pub(super) allowance: &'a Allowance,
}
