//! Editing sessions: pieces, changes by hand, undo, a journal.
//!
//! An [`EditSession`] applies an [`EditOperation`], takes it back and does it again:
//!
//! ```
//! use enfilade::edit::{EditGround, EditOperation, EditSession};
//! use enfilade::kit::{Choice, Kit, Piece};
//! use enfilade::world::Pose;
//! # let chamber = enfilade_testkit::chamber(enfilade::geom::DVec3::new(4.0, 3.0, 4.0), [1.5, 2.5], 2.0);
//!
//! let kit = Kit::new(vec![Piece::new("chamber", chamber, &Choice::Doorways)?])?;
//! let mut session = EditSession::new(kit.into(), EditGround::Open)?;
//! let put = EditOperation::put("chamber", None, Pose::IDENTITY);
//! session.check(&put)?; // changes nothing
//! session.apply(put)?;
//! assert_eq!(session.world()?.world.graph.rooms().count(), 1);
//! assert!(session.undo()? && session.level().is_empty());
//! assert!(session.redo()? && !session.redo()?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! With a journal, a session that was killed goes on; [`Resumed`] tells from where:
//!
//! ```
//! use std::sync::Arc;
//!
//! use enfilade::edit::{EditGround, EditOperation, EditSession};
//! use enfilade::kit::{Choice, DEFAULT_TOLERANCE, Kit, Piece};
//! use enfilade::world::Pose;
//! # let chamber = enfilade_testkit::chamber(enfilade::geom::DVec3::new(4.0, 3.0, 4.0), [1.5, 2.5], 2.0);
//!
//! let kit = Arc::new(Kit::new(vec![Piece::new("chamber", chamber, &Choice::Doorways)?])?);
//! let journal = std::env::temp_dir().join(format!("enfilade-journal-{}", std::process::id()));
//! # let _ = std::fs::remove_file(&journal);
//! let open = || EditSession::open(&journal, kit.clone(), EditGround::Open, "level 1", DEFAULT_TOLERANCE);
//! let (mut session, _) = open()?;
//! session.apply(EditOperation::put("chamber", None, Pose::IDENTITY))?;
//! drop(session);
//! let (session, _resumed) = open()?;
//! assert_eq!(session.level().len(), 1);
//! # std::fs::remove_file(&journal)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use enfilade_edit::{
    EditError, EditGround, EditOperation, EditSession, EditedSpace, EditedWorld, HandEdit,
    HandEditError, HandEditKind, JournalError, OwnWorlds, Resumed,
};
