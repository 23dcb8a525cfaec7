//! Settings of a check.

/// What to try, and how hard.
#[derive(Clone, Debug)]
pub struct VerifyOptions {
    /// Segments tried for *sealed*, and as many rays for *complete*.
    pub rays: u64,
    /// Tries short segments for *sealed* across every face at which the locator's answer changes, too: a slit is found however small it is. On models
    /// whose triangles miss each other by micrometers it finds openings of their size that a bake leaves.
    pub faces: bool,
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
            faces: false,
            seed: 1,
            tolerance: None,
            max_listed: 20,
        }
    }
}
