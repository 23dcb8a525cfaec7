//! Settings of a check.

/// What to try, and how hard.
#[derive(Clone, Debug)]
pub struct VerifyOptions {
    /// Segments tried for *sealed*, and as many rays for *complete*.
    pub rays: u64,
    /// Start of the random sequences; equal seeds give equal reports.
    pub seed: u64,
    /// `eps` of the [crate page](crate); `None` for [`tolerance`](crate::tolerance) of the triangles. [Units: wu]
    pub tolerance: Option<f64>,
    /// Kinds of failure listed at most, the most frequent first.
    pub max_listed: usize,
}

impl Default for VerifyOptions {
    fn default() -> Self {
        Self {
            rays: 1_000_000,
            seed: 1,
            tolerance: None,
            max_listed: 20,
        }
    }
}
