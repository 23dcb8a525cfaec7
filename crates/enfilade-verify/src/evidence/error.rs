//! Why evidence is not accepted.

use enfilade_cpg::SightGraphError;

/// Why evidence is not accepted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EvidenceError {
    /// The graph itself is broken.
    #[error(transparent)]
    Graph(#[from] SightGraphError),
    /// The bytes are no evidence, or are cut off or damaged.
    #[error("the evidence is damaged: {0}")]
    Damaged(&'static str),
    /// It speaks of another graph.
    #[error("the evidence belongs to another graph; compute it again")]
    OtherGraph,
    /// A setting that would make claims empty.
    #[error("the evidence claims too little: {0}")]
    Weak(&'static str),
    /// A line does not cross the openings it is said to.
    #[error("line {line}: {problem}")]
    Line {
        /// Its number.
        line: u64,
        /// What does not hold.
        problem: &'static str,
    },
    /// Two openings are called hidden from each other without reason.
    #[error("openings {from} and {to}: {problem}")]
    Hidden {
        /// Direction crossed first.
        from: usize,
        /// Direction crossed later.
        to: usize,
        /// What does not hold.
        problem: &'static str,
    },
    /// The trace of an opening does not close its chains.
    #[error("trace of opening {opening}, byte {at}: {problem}")]
    Trace {
        /// Direction it starts from.
        opening: usize,
        /// Byte of the trace.
        at: usize,
        /// What does not hold.
        problem: &'static str,
    },
    /// The totals are not those that the claims give.
    #[error("the evidence says {said} {what}, its claims give {found}")]
    Totals {
        /// What is counted.
        what: &'static str,
        /// As said.
        said: u64,
        /// As found.
        found: u64,
    },
}
