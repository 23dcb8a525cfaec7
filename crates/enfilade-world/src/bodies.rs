//! Contact of bodies with walls, objects and shut doors, only in the cells that they reach.
//!
//! Candidates are found by flooding (Gjørup 1999, section 3.3.4): from the body's cell through each portal that it touches, with
//! a stamp per cell so that none is visited twice. Gjørup tests portals against the bounding sphere; here the body itself is
//! tested against the pieces of the opening, grown by the layout's tolerance, so that rounding errs to "touches".
//!
//! | file | holds |
//! | --- | --- |
//! | `agent.rs` | the size of walkers |
//! | `body.rs` | spheres, capsules, boxes |
//! | `kernel.rs` | one body, one triangle: contact, and time of first contact |
//! | `flood.rs` | the cells and triangles on a body's way |
//! | `carve.rs` | obstacles around special portals |
//! | `images.rs`, `moving.rs` | a body beyond special portals, and in other frames |
//! | `caster.rs` | casts and contacts |
//! | `pairs.rs` | bodies that may touch each other |
//! | `room.rs` | room for a walker, for maps of paths |
//! | `walker.rs` | a walker with gravity and steps |

mod agent;
mod body;
mod carve;
mod caster;
mod flood;
mod images;
mod kernel;
mod moving;
mod pairs;
mod room;
#[cfg(test)]
mod tests;
mod walker;

pub use agent::Agent;
pub use body::Body;
pub use caster::{Cast, Caster, Contact, Impact};
pub use flood::CastCounts;
pub use pairs::Pairs;
pub(crate) use room::{WalkerRoom, is_free_between};
pub use walker::Walker;
