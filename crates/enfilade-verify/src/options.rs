//! Settings of a check.

/// Extent of a check.
#[derive(Clone, Debug)]
pub struct VerifyOptions {
    /// Segments for *sealed*, and as many rays for *complete*.
    pub rays: u64,
    /// True to also try short segments for *sealed* across every face at which the locator's answer changes, which
    /// find a slit however small. On models whose triangles miss each other by micrometers they find openings of that
    /// size that a bake leaves.
    pub faces: bool,
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
            faces: false,
            seed: 1,
            tolerance: None,
            max_listed: 20,
        }
    }
}
