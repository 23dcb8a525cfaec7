//! The error of wrong settings.

/// An option is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{option}: {problem}")]
pub struct BadOption {
    /// The option.
    pub option: &'static str,
    /// The problem with it.
    pub problem: String,
}
