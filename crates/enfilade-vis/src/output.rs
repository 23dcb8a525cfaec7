//! What is found out.

use enfilade_cpg::Pvs;
use enfilade_geom::DVec3;

/// A line that proves cells to see each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Witness {
    /// A point in one of the openings it crosses. [Units: wu]
    pub origin: DVec3,
    /// Where it goes; any length.
    pub direction: DVec3,
    /// The openings it crosses, in order, as directions of [`SightGraph`](enfilade_cpg::SightGraph).
    pub chain: Vec<u32>,
}

/// What can be seen.
#[derive(Clone, Debug, PartialEq)]
pub struct VisOutput {
    /// By cell: the cells that might be seen from it, itself included. Symmetric.
    pub cells: Pvs,
    /// By cell: those of `cells` that no line proves; none of the rest is in doubt.
    pub undecided: Pvs,
    /// Lines that together prove everything else in `cells`.
    pub witnesses: Vec<Witness>,
    /// Whether the search ended by itself; if not, the answer is larger than need be.
    pub is_complete: bool,
    /// Pairs left by sides of planes alone, as an upper bound to compare with.
    pub n_base: u64,
    /// Chains searched.
    pub n_steps: u64,
    /// Proofs of all this, for `enfilade-verify`, where asked for; see `docs/evidence.md`.
    pub evidence: Option<Vec<u8>>,
}
