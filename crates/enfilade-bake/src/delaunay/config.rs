//! What only tetrahedra ask.

use super::decimate::{Choices, Weight};

/// What only tetrahedra ask.
#[derive(Clone, Debug, Default)]
pub struct DelaunayConfig {
    /// How portals are weighed.
    pub weight: Weight,
    /// The weight at which decimation stops; `None` for the weight's own. [Limit: above 0]
    pub stop: Option<f64>,
    /// What a person decided.
    pub choices: Choices,
}

impl DelaunayConfig {
    /// Whether a person decided anything.
    pub(crate) fn has_choices(&self) -> bool {
        self.choices != Choices::default()
    }
}
