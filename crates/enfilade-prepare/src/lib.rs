//! Prepares a [`Scene`](enfilade_geom::scene::Scene) for a bake: counts defects of its surface, repairs them on request,
//! and decides between structure and detail. No file format is known here: `enfilade-import` calls it for what it reads.

mod auto_roles;
mod clean;
mod copies;
mod crossing;
mod error;
mod filling;
mod finding;
mod glob;
mod helpers;
mod repair;
mod roles;
mod shells;
mod sky;
mod tjunction;
mod tools;
mod upward;
mod words;

pub use auto_roles::decide as decide_undecided;
pub use clean::{CleaningOptions, CleaningReport, ShellCounts, cleaning_report};
pub use copies::{collision_copies, lower_levels};
pub use error::BadOption;
pub use finding::{Example, Finding};
pub use glob::{Glob, GlobState, is_match};
pub use helpers::unnamed_helpers;
pub use repair::{GridSteps, RepairOptions, RepairReport, put_back, repair, weld_quantized};
pub use roles::{RoleFacts, RoleRules, RoleVerdict, drops_subtree, ifc_classes, marked_portal};
pub use sky::{is_sky_around, skies};
pub use tools::{TextureMatter, texture_matter};
pub use upward::{Upward, find_up};
pub use words::words;
