//! Delaunay-only settings.

use super::decimate::{Choices, Weight};

/// Delaunay-only settings.
#[derive(Clone, Debug, Default)]
pub struct DelaunayConfig {
    /// The measure of portals.
    pub weight: Weight,
    /// The weight at which decimation stops; `None` for the weight's own. [Limit: above 0]
    pub stop: Option<f64>,
    /// Decisions of the user.
    pub choices: Choices,
}

impl DelaunayConfig {
    /// Returns `true` if the user decided anything.
    pub(crate) fn has_choices(&self) -> bool {
        self.choices != Choices::default()
    }
}
