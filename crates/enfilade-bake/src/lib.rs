//! Finds the rooms and doorways of a scene.
//!
//! Start with [`bake()`]: a method *proposes* rooms and their openings, and the exact cell complex *realizes* the
//! proposal, so that the guarantees hold even where the method missed something.
//!
//! | module | purpose |
//! | --- | --- |
//! | `structure` | the input: walls, stairs, door leaves and panes, slabs; which openings are a pinch |
//! | [`watershed`], [`bsp`], [`delaunay`] | a division of the air: three methods, independent of each other |
//! | `pieces`, `shards` | pieces that are kept: for bakes that go on after they were ended, and for several machines |
//! | `tubes` | where tubes of one width meet |
//! | `rooms` | where rooms end: which parts are one room, and the openings between rooms, by one rule for all methods |
//! | [`complex`] | which space is open: convex leaves and the facets between them, exactly |
//! | `land` | open land as cells, if that is wanted |
//! | `realize`, `assemble` | the world: which leaves form a cell, which geometry each cell sees |
//! | [`simplify`], [`bound`], [`edit`], [`names`] | changes to a finished world |
//! | [`leak`] | where a model is open that should be closed |

mod assemble;
mod bake;
pub mod bound;
pub mod bsp;
mod budget;
pub use enfilade_complex as complex;
mod config;
mod context;
mod decided;
pub mod delaunay;
pub mod edit;
mod error;
mod given;
mod join;
mod judge;
mod land;
mod layout;
pub mod leak;
mod marked;
mod method;
pub mod names;
mod output;
mod pieces;
mod proposal;
mod realize;
pub mod rebake;
mod rooms;
mod shards;
pub mod simplify;
mod specials;
mod stage;
mod structure;
mod subset;
mod tubes;
mod vessel;
mod void;
pub use enfilade_voxel as voxel;
pub mod watershed;

pub use bake::{bake, bake_session};
pub use budget::Budget;
pub use config::{BakeConfig, MergeSettings, Outdoors, RoomAnswer, RoomDecision, SmallestHole};
pub use context::{BakeContext, Progress, Silent};
pub use error::BakeError;
pub use method::Method;
pub use output::{BakeOutput, Resolution};
pub use pieces::Pieces;
pub use shards::{bake_pieces, is_piece, piece_keys};
pub use stage::Stage;
