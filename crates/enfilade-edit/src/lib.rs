//! Editing sessions: worlds put together and changed by hand, operation by operation.
//!
//! An [`EditSession`] starts from nothing, from a piece of a kit, or from a finished world. Its operations place, take away and
//! move pieces ([`enfilade_kit`]), and make changes by hand: portals drawn and deleted, doors, mirrors, lamps, crates
//! ([`HandEdit`]). All of them are undone and redone without limit, and a world after an undo has the same bytes as before.
//!
//! ```
//! use enfilade_edit::{EditGround, EditOperation, EditSession};
//! use enfilade_kit::Kit;
//! use enfilade_world::Pose;
//!
//! fn row(kit: Kit) -> Result<(), Box<dyn std::error::Error>> {
//!     let mut session = EditSession::new(kit.into(), EditGround::Open)?;
//!     let at = Pose::IDENTITY;
//!     session.apply(EditOperation::put("chamber", None, at))?;
//!     session.undo()?;
//!     session.redo()?;
//!     println!("{} cells", session.world()?.world.graph.cells.len());
//!     Ok(())
//! }
//! ```
//!
//! # The journal
//!
//! [`EditSession::open`] keeps a journal: a text file with a line for each operation, undo and redo, written before the call
//! returns. A process that is killed loses at most the operation that it was about to write. Opening the journal again makes all
//! of it again, the history for undo included; a last line without its end is cut off, and told.
//! There are no checkpoints: 100,000 operations take less than two seconds to make again.
//!
//! # Changes by hand move with their rooms
//!
//! A change by hand is held in the frame of the instance that it is in. Where its instance is gone, or what it changes is not
//! there, such as a doorway that is walled up, it rests: [`EditedWorld::resting`] tells why.

mod followed;
mod hand;
mod journal;
mod operation;
mod own;
pub mod random;
mod session;

pub use followed::EditedSpace;
pub use hand::{HandEdit, HandEditError, HandEditKind};
pub use journal::{JournalError, journal_of};
pub use operation::EditOperation;
pub use own::OwnWorlds;
pub use session::{EditError, EditGround, EditSession, EditedWorld, Resumed};
