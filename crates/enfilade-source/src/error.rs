//! Errors and limits of sources.

/// A source that cannot be read, and the remedy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{place}: {problem}")]
pub struct SourceError {
    /// Element, line or byte.
    pub place: String,
    /// The problem and the remedy.
    pub problem: String,
}

impl SourceError {
    /// Makes an error.
    #[must_use]
    pub fn new(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            problem: problem.into(),
        }
    }
}

/// Limits of a source, so that hostile input ends in an error in bounded memory and time.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceLimits {
    /// Most samples of a volume, and lattice points of an extraction that are not pruned.
    pub max_samples: u64,
    /// Most voxels of a scan; where more would be needed, they are larger.
    pub max_voxels: u64,
    /// Most triangles of an extracted surface, before it is simplified.
    pub max_triangles: u64,
    /// Most nodes of an implicit scene.
    pub max_nodes: u64,
    /// Largest depth of a node below the scene.
    pub max_depth: u32,
    /// Most evaluations of nodes during an extraction.
    pub max_work: u64,
}

impl Default for SourceLimits {
    fn default() -> Self {
        Self {
            max_samples: 1 << 30,
            max_voxels: 200_000_000,
            max_triangles: 20_000_000,
            max_nodes: 100_000,
            max_depth: 64,
            max_work: 20_000_000_000,
        }
    }
}

impl SourceLimits {
    /// Returns limits small enough for fuzzing.
    #[must_use]
    pub fn tiny() -> Self {
        Self {
            max_samples: 1 << 16,
            max_voxels: 1 << 15,
            max_triangles: 20_000,
            max_nodes: 100,
            max_depth: 16,
            max_work: 1_000_000,
        }
    }
}
