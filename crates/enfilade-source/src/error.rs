//! Errors and limits of sources.

use std::sync::Arc;

use enfilade_geom::{Allowance, Purse};

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
#[derive(Clone, Debug)]
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
    /// Time and memory, shared with whoever goes on with the result. If it is limited in time, work is not refused beforehand
    /// because it would take long.
    pub allowance: Option<Arc<Allowance>>,
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
            allowance: None,
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
            allowance: None,
        }
    }

    /// Returns what loops spend from.
    pub(crate) fn purse(&self) -> Purse<'_> {
        self.allowance
            .as_deref()
            .map_or(Purse::endless(), Purse::from)
    }

    /// Spends work, in units of about 100 ns.
    ///
    /// # Errors
    ///
    /// If the allowance is over; whoever gave it knows why.
    pub(crate) fn spend(&self, work: u64) -> Result<(), SourceError> {
        match self.purse().spend(work) {
            true => Ok(()),
            false => Err(ended()),
        }
    }

    /// Checks after loops that end early without an error, or before long calls, that the allowance is not over.
    pub(crate) fn go_on(&self) -> Result<(), SourceError> {
        match self.allowance.as_ref().is_some_and(|a| a.is_over()) {
            true => Err(ended()),
            false => Ok(()),
        }
    }

    /// Returns `true` if time ends the work, however much it is.
    pub(crate) fn is_timed(&self) -> bool {
        self.allowance.as_ref().is_some_and(|a| a.is_timed())
    }
}

/// The error of a loop that ended with its allowance.
fn ended() -> SourceError {
    SourceError::new("source", "the allowance is over; allow more, or give less")
}
