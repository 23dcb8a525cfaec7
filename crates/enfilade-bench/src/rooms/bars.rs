//! Bars of figures.

/// A value that passes.
#[derive(Clone, Copy)]
pub(super) enum Bar {
    Least(f64),
    Most(f64),
    /// No farther from zero.
    Within(f64),
}

/// Shares that differ only by rounding are equal.
const ROUNDING: f64 = 1e-9;

impl Bar {
    pub(super) fn passes(self, value: f64) -> bool {
        match self {
            Self::Least(bar) => value >= bar - ROUNDING,
            Self::Most(bar) => value <= bar + ROUNDING,
            Self::Within(bar) => value.abs() <= bar + ROUNDING,
        }
    }

    pub(super) fn text(self) -> String {
        match self {
            Self::Least(bar) => format!(">= {bar}"),
            Self::Most(bar) => format!("<= {bar}"),
            Self::Within(bar) => format!("within {bar}"),
        }
    }
}
