//! Levels from pieces: baked worlds whose doorways snap, put together without a bake (Gjørup 1999, section 3.3.3).
//!
//! A [`Piece`] is a baked world, such as a room, a corridor or a whole house. Its *attachments* are openings to its outdoors, each with
//! a frame and an outline. A [`Kit`] is a set of pieces. An [`Assembly`] places instances of them, opening to opening, or
//! says why it cannot. It becomes either of two things:
//!
//! - one [`World`](enfilade_cpg::World), like any other ([`Assembly::flattened`]), or
//! - a [`Space`](enfilade_world::Space) of instances that share their pieces ([`Assembly::space`]).
//!
//! ```
//! use enfilade_cpg::World;
//! use enfilade_kit::{Assembly, Choice, End, Kit, Piece, PlaceOptions};
//! use enfilade_world::Pose;
//!
//! fn row(chamber: World, corridor: World) -> Result<World, Box<dyn std::error::Error>> {
//!     let kit = Kit::new(vec![
//!         Piece::new("chamber", chamber, &Choice::Doorways)?,
//!         Piece::new("corridor", corridor, &Choice::Doorways)?,
//!     ])?;
//!     let mut level = Assembly::new(kit);
//!     let options = PlaceOptions::default();
//!     let start = level.put(0, Pose::IDENTITY, &options)?;
//!     let onto = End { instance: start, attachment: 0 };
//!     if let Err(refusal) = level.place(1, 0, onto, &options) {
//!         println!("{refusal}"); // e.g. by how much the openings differ, or what is in the way
//!     }
//!     Ok(level.flattened()?)
//! }
//! ```
//!
//! # Where the work is done
//!
//! [`Piece::new`] prepares a piece once: it moves the portals of attachments to the outer faces of their walls, and collects the
//! convex parts of its air and matter. Placing compares these with those of the instances beside it, and nothing else, so it
//! takes the same time in a level of ten instances and of thousands.
//!
//! # Limits
//!
//! Pieces have no special portals, and stand in the open: what is attached must have an outdoors. Walls of different instances
//! may lie in each other, but rooms may not contain walls or rooms of others.

mod assembly;
mod body;
mod error;
mod fit;
mod flatten;
pub mod generate;
mod instance;
mod kit;
mod meet;
mod piece;
mod prepare;
mod region;
mod shape;
mod space;
mod state;
mod tree;
mod tunnel;

pub use assembly::Assembly;
pub use error::PlaceError;
pub use fit::Mouth;
pub use flatten::FlattenError;
pub use instance::{End, Instance, InstanceId, Link, PlaceOptions};
pub use kit::{DEFAULT_TOLERANCE, Kit, KitFault, PieceNamedTwice};
pub use piece::{Choice, Chosen, Piece, PieceError, Spot};
pub use shape::Attachment;
pub use space::{LevelParts, LevelSpace, open_air};
