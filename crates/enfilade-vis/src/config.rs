//! Settings, context and errors of [`see_all`](crate::see_all).

use std::fmt;
use std::time::Duration;

use enfilade_cpg::SightGraphError;
use enfilade_geom::Triangle;

/// Share of the clearance that the search itself uses; a checker may compute other last digits.
pub(crate) const KEPT: f64 = 0.9;

const GIB: f64 = (1u64 << 30) as f64;

/// How thoroughly to search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum VisMode {
    /// Sides of planes, and planes between two consecutive openings: seconds on any graph, but a larger answer.
    Fast,
    /// A search over portal chains.
    #[default]
    Exact,
}

/// Settings of [`see_all`](crate::see_all).
#[derive(Clone, Debug, PartialEq)]
pub struct VisConfig {
    /// How thoroughly to search.
    pub mode: VisMode,
    /// Lines that pass nearer to an opening's edge than this may be lost. `None`: 1e-8 of the largest coordinate,
    /// which is less than its rounding in `f32`. [Units: wu] [Limit: >= 0]
    pub clearance: Option<f64>,
    /// View distance: nothing farther away is visible. [Units: wu] [Limit: >= 0]
    pub far: Option<f64>,
    /// Random lines cast from each portal. The search grows more from those that find something.
    pub n_rays: usize,
    /// Most pieces that an opening is split into to settle one chain.
    pub max_pieces: u32,
    /// Most special portals that one chain passes in [`crate::see_world`]. What longer ones show is bounded by the
    /// cells that they might lead to.
    pub max_specials: u32,
    /// Most chains of special portals followed, for all cells together; the shortest first.
    pub max_chains: usize,
    /// Record proofs in [`crate::VisOutput::evidence`]. About doubles the time.
    pub has_evidence: bool,
    /// Most memory that a graph may be estimated to need. A graph whose tables are larger is searched in blocks that
    /// fit; one that is itself larger, or with evidence, is refused before anything is allocated. [Units: bytes]
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
            max_specials: 4,
            max_chains: 256,
            has_evidence: false,
            max_memory: 8 << 30,
        }
    }
}

/// The reasons why nothing was computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VisError {
    /// The graph is broken.
    #[error(transparent)]
    Graph(#[from] SightGraphError),
    /// A setting is out of range.
    #[error("{name} is {value}; it must be at least 0")]
    Setting {
        /// The setting's name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The graph needs more memory than the limit.
    #[error(
        "{n_portals} portals need about {:.1} GiB, more than the limit of {:.1} GiB; raise the limit with \
         --max-memory (max_memory), or make fewer and larger portals (detail brushes make none)",
        *.estimate as f64 / GIB, *.limit as f64 / GIB
    )]
    TooLarge {
        /// Number of portals.
        n_portals: usize,
        /// Estimated need. [Units: bytes]
        estimate: u64,
        /// [`VisConfig::max_memory`]. [Units: bytes]
        limit: u64,
    },
    /// The checkpoint is damaged or belongs to another search.
    #[error("the checkpoint cannot be used: {problem}; delete it to start over")]
    Checkpoint {
        /// The reason.
        problem: &'static str,
    },
    /// Evidence is requested of a graph with special portals.
    #[error(
        "evidence covers straight lines only, and the world has special portals; run without --evidence (has_evidence)"
    )]
    SpecialEvidence,
    /// A result could not be proved again: a bug. No evidence is written.
    #[error("the search could not repeat its proof (a bug); run without evidence")]
    Evidence,
}

/// Inputs and callbacks of [`see_all`](crate::see_all). Threads come from the current rayon pool.
pub struct VisContext<'a> {
    /// Receives work done and total work, weighted by cost; returns `false` to stop.
    pub on_round: &'a mut (dyn FnMut(u64, u64) -> bool + Send),
    /// Triangles that block sight inside cells. Without them, only openings limit lines.
    pub walls: Option<&'a [Triangle]>,
    /// Resumes and saves the search. Not used by [`VisMode::Fast`].
    pub checkpoint: Option<VisCheckpoint<'a>>,
}

impl fmt::Debug for VisContext<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("VisContext")
            .field("n_walls", &self.walls.map(<[_]>::len))
            .field("checkpoint", &self.checkpoint)
            .finish_non_exhaustive()
    }
}

/// Finished blocks of a search, kept in a folder or elsewhere; see [`VisPlan`](crate::VisPlan).
pub trait VisBlocks {
    /// Returns the bytes that were put under a key, if they are there.
    fn get(&mut self, key: u64) -> Option<Vec<u8>>;
    /// Keeps bytes under a key. Bytes of a key are always the same.
    fn put(&mut self, key: u64, bytes: &[u8]);
}

/// Saves and resumes a search; its result is that of an uninterrupted one.
pub struct VisCheckpoint<'a> {
    /// Place of the blocks of a graph that is searched in several.
    pub blocks: Option<&'a mut (dyn VisBlocks + Send)>,
    /// A saved state of a search in one piece. Refused if the graph or the settings differ.
    pub resume: Option<Vec<u8>>,
    /// A number that changes with [`VisContext::walls`].
    pub salt: u64,
    /// Time between saves.
    pub every: Duration,
    /// Receives the state whenever a save is due, and when [`VisContext::on_round`] stops the search.
    pub save: &'a mut (dyn FnMut(Vec<u8>) + Send),
}

impl fmt::Debug for VisCheckpoint<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("VisCheckpoint")
            .field("salt", &self.salt)
            .field("every", &self.every)
            .finish_non_exhaustive()
    }
}
