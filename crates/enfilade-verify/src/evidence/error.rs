//! The reason why evidence is rejected.

use enfilade_cpg::SightGraphError;

/// The reason why evidence is rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EvidenceError {
    /// The graph itself is broken.
    #[error(transparent)]
    Graph(#[from] SightGraphError),
    /// The bytes are not evidence, or are truncated or damaged.
    #[error("the evidence is damaged: {0}")]
    Damaged(&'static str),
    /// It belongs to another graph.
    #[error("the evidence belongs to another graph; compute it again")]
    OtherGraph,
    /// A setting that would make its claims empty.
    #[error("the evidence claims too little: {0}")]
    Weak(&'static str),
    /// A line does not cross its openings.
    #[error("line {line}: {problem}")]
    Line {
        /// Index of the line.
        line: u64,
        /// The condition that fails.
        problem: &'static str,
    },
    /// Two openings are claimed hidden from each other without a valid reason.
    #[error("openings {from} and {to}: {problem}")]
    Hidden {
        /// Direction crossed first.
        from: usize,
        /// Direction crossed later.
        to: usize,
        /// The condition that fails.
        problem: &'static str,
    },
    /// The trace of an opening does not close its chains.
    #[error("trace of opening {opening}, byte {at}: {problem}")]
    Trace {
        /// Direction from which it starts.
        opening: usize,
        /// Byte of the trace.
        at: usize,
        /// The condition that fails.
        problem: &'static str,
    },
    /// The totals differ from those of the claims.
    #[error("the evidence records {said} {what}, but its claims give {found}")]
    Totals {
        /// The counted quantity.
        what: &'static str,
        /// The recorded total.
        said: u64,
        /// The total of the claims.
        found: u64,
    },
}
