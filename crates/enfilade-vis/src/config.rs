//! What is asked for: settings, surroundings, and why they may be refused.

use std::time::Duration;

use enfilade_cpg::SightGraphError;
use enfilade_geom::Triangle;

/// Share of the clearance that the search itself uses; a checker's sums may differ in the last digits.
pub(crate) const KEPT: f64 = 0.9;

const GIB: f64 = (1u64 << 30) as f64;

/// How thoroughly to look.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum VisMode {
    /// Sides of planes, and planes between two openings in a row: seconds on any graph, a larger answer.
    Fast,
    /// The search over portal chains.
    #[default]
    Exact,
}

/// What to compute.
#[derive(Clone, Debug, PartialEq)]
pub struct VisConfig {
    /// How thoroughly to look.
    pub mode: VisMode,
    /// Lines that pass nearer to an opening's edge than this may be lost. `None`: 1e-8 of the largest
    /// coordinate, less than that coordinate's rounding in `f32`. [Units: wu] [Limit: >= 0]
    pub clearance: Option<f64>,
    /// Nothing farther than this is seen. [Units: wu] [Limit: >= 0]
    pub far: Option<f64>,
    /// Random lines cast from each portal; more are grown from those that find something.
    pub n_rays: usize,
    /// Pieces that an opening may be split into to settle one chain.
    pub max_pieces: u32,
    /// Write down proofs: [`crate::VisOutput::evidence`]. Costs about as much again.
    pub has_evidence: bool,
    /// Graphs that are estimated to take more than this are refused before anything is allocated. [Units: bytes]
    pub max_memory: u64,
}

impl Default for VisConfig {
    fn default() -> Self {
        Self {
            mode: VisMode::Exact,
            clearance: None,
            far: None,
            n_rays: 12,
            max_pieces: 64,
            has_evidence: false,
            max_memory: 8 << 30,
        }
    }
}

/// Why nothing was computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VisError {
    /// The graph is broken.
    #[error(transparent)]
    Graph(#[from] SightGraphError),
    /// A setting makes no sense.
    #[error("{name} is {value}; a number of at least 0 is needed")]
    Setting {
        /// The setting.
        name: &'static str,
        /// What it is.
        value: f64,
    },
    /// The graph would take more memory than is allowed.
    #[error(
        "{n_portals} portals would take about {:.1} GiB, more than the {:.1} GiB that are allowed; allow more with \
         --max-memory (max_memory), or make fewer and larger portals (detail brushes take no part in them)",
        *.estimate as f64 / GIB, *.limit as f64 / GIB
    )]
    TooLarge {
        /// How many portals there are.
        n_portals: usize,
        /// What they would take. [Units: bytes]
        estimate: u64,
        /// What is allowed. [Units: bytes]
        limit: u64,
    },
    /// A checkpoint does not fit.
    #[error("the checkpoint cannot be used: {problem}; delete it to start anew")]
    Checkpoint {
        /// Why.
        problem: &'static str,
    },
    /// What was found could not be shown again: a bug, and no evidence is written.
    #[error("the search could not repeat its proof (a bug); leave the evidence out")]
    Evidence,
}

/// What surrounds a computation: threads come from the current rayon pool.
pub struct VisContext<'a> {
    /// Hears work done and work in all, weighted by cost, and says whether to go on.
    pub on_round: &'a mut (dyn FnMut(u64, u64) -> bool + Send),
    /// What else blocks sight; without it, a line is free wherever it passes openings.
    pub walls: Option<&'a [Triangle]>,
    /// Where to keep what was found, and what to go on from. Not used by [`VisMode::Fast`].
    pub checkpoint: Option<VisCheckpoint<'a>>,
}

/// How a search is kept for another day; what it finds then is what it would have found in one go.
pub struct VisCheckpoint<'a> {
    /// What was saved before. Refused where the graph or the settings were others.
    pub resume: Option<Vec<u8>>,
    /// A number that changes with [`VisContext::walls`].
    pub salt: u64,
    /// How long to search between saves.
    pub every: Duration,
    /// Takes the state: when it is due, and when [`VisContext::on_round`] stops the search.
    pub save: &'a mut (dyn FnMut(Vec<u8>) + Send),
}
