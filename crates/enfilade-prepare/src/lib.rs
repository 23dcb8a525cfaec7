//! Prepares a [`Scene`](enfilade_geom::scene::Scene) for a bake: counts defects of its surface, repairs them on request,
//! and decides between structure and detail. No file format is known here: `enfilade-import` calls it for what it reads.

mod auto_roles;
mod clean;
mod crossing;
mod error;
mod filling;
mod finding;
mod glob;
mod repair;
mod roles;
mod shells;
mod tjunction;
mod upward;

pub use auto_roles::judge as judge_undecided;
pub use clean::{CleaningOptions, CleaningReport, ShellCounts, cleaning_report};
pub use error::BadOption;
pub use finding::{Example, Finding};
pub use glob::{Glob, GlobState, is_match};
pub use repair::{GridSteps, RepairOptions, RepairReport, repair, weld_quantized};
pub use roles::{
    RoleFacts, RoleRules, RoleVerdict, drops_subtree, ifc_classes, marked_portal, words,
};
pub use upward::{Upward, judge_up};
