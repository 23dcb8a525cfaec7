//! Finds the rooms and doorways of a scene.
//!
//! Start with [`bake()`]: a method *proposes* where rooms and their openings are, and the exact cell complex *realizes* the
//! proposal, so that the promises hold whatever the method missed.
//!
//! | room | question |
//! | --- | --- |
//! | `structure` | what is there: walls, stairs, door leaves and panes, slabs; where an opening is a pinch |
//! | [`watershed`], [`bsp`], [`delaunay`] | where do rooms end: three methods, none of which knows another |
//! | [`complex`] | what is open: convex leaves and the facets between them, exactly |
//! | `realize`, `assemble` | which leaves are a cell, what each cell sees: the world |
//! | [`simplify`], [`bound`], [`edit`] | a world, changed |
//! | [`leak`] | where a model is open that should be closed |

mod assemble;
mod bake;
pub mod bound;
pub mod bsp;
mod budget;
pub use enfilade_complex as complex;
mod config;
mod context;
pub mod delaunay;
pub mod edit;
mod error;
mod join;
mod layout;
pub mod leak;
mod method;
mod output;
mod proposal;
mod realize;
pub mod simplify;
mod stage;
mod structure;
mod subset;
mod vessel;
pub use enfilade_voxel as voxel;
pub mod watershed;

pub use bake::bake;
pub use budget::Budget;
pub use config::{BakeConfig, SmallestHole};
pub use context::{BakeContext, Progress, Silent};
pub use error::BakeError;
pub use method::Method;
pub use output::{BakeOutput, Resolution};
pub use stage::Stage;
pub use structure::MergeSettings;
