//! Settings of a check.

/// Extent of a check.
#[derive(Clone, Debug)]
pub struct VerifyOptions {
    /// Segments for *sealed*, besides those across faces of the locator's leaves, and rays for *complete*.
    pub rays: u64,
    /// Seed of the random sequences; equal seeds give equal reports.
    pub seed: u64,
    /// `eps` of the [crate page](crate); `None` for [`tolerance`](crate::tolerance) of the triangles. [Units: wu]
    pub tolerance: Option<f64>,
    /// Most kinds of failure listed, the most frequent first.
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
