//! Results of [`see_all`](crate::see_all).

use enfilade_cpg::Pvs;
use enfilade_geom::DVec3;

/// A line that proves that cells see each other.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Witness {
    /// A point in one of the openings it crosses. [Units: wu]
    pub origin: DVec3,
    /// Direction; any length.
    pub direction: DVec3,
    /// The openings it crosses, in order, as directions of [`SightGraph`](enfilade_cpg::SightGraph).
    pub chain: Vec<u32>,
}

/// Precomputed visibility of a graph.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct VisOutput {
    /// For each cell, the cells that might be seen from it, itself included. Symmetric, unless special portals show
    /// more ([`see_world`](crate::see_world)).
    pub cells: Pvs,
    /// For each cell, those of `cells` that no line proves. All others are certain.
    pub undecided: Pvs,
    /// Lines that together prove everything else in `cells`; none if the graph was searched in several blocks.
    pub witnesses: Vec<Witness>,
    /// Number of lines that prove it, kept or not.
    pub n_lines: u64,
    /// `true` if the search ended by itself; otherwise the answer is larger than necessary.
    pub is_complete: bool,
    /// Number of pairs of cells of which a test by planes alone (or, in several blocks, their floods) cannot tell that they do not
    /// see each other: an upper bound for comparison.
    pub n_base: u64,
    /// Number of chains searched.
    pub n_steps: u64,
    /// Proofs of the result for `enfilade-verify`, if requested; see `docs/evidence.md`.
    pub evidence: Option<Vec<u8>>,
}
