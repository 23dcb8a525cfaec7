//! Settings of bakes as people write them: the settings file, and the values of options, for the command and for
//! scripts alike.
//!
//! Each value is checked where it is read, so that an error names its place.
//!
//! ```
//! use enfilade_settings::{Settings, parse_toml};
//!
//! let settings: Settings = parse_toml("min_opening = 0.4\nunit = \"mm\"")?;
//! assert_eq!(settings.import_options().unit, Some(0.001));
//! let resolved = settings.resolve()?;
//! assert_eq!(resolved.config.min_opening, 0.4);
//! # Ok::<(), enfilade_settings::SettingsError>(())
//! ```

mod file;
mod resolve;
mod values;

pub use file::{BspTable, DecisionTable, Given, MergeTable, Settings, SplitHeuristic, UpAxis};
pub use resolve::Resolved;
pub use values::{parse_hole, parse_length, parse_point, parse_toml, parse_unit, parse_weld};

/// The reason why settings are refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// The text is not understood.
    #[error("{0}")]
    Text(String),
    /// The bounds of the costs of cells contradict each other.
    #[error("max_cost {max} is below min_cost {min}; no cell can be within both")]
    Costs {
        /// The upper bound.
        max: f64,
        /// The lower bound.
        min: f64,
    },
    /// The normal of a plane has no direction.
    #[error("a plane of [bsp] has no normal: give x, y, z, nx, ny, nz")]
    Normal,
}
