//! Levels put together from baked pieces.
//!
//! A [`Kit`] of one [`Piece`], and an [`Assembly`] of two instances, door to door:
//!
//! ```
//! use enfilade::kit::{Assembly, Choice, End, Kit, Piece, PlaceOptions};
//! use enfilade::world::Pose;
//! # let chamber = enfilade_testkit::chamber(enfilade::geom::DVec3::new(4.0, 3.0, 4.0), [1.5, 2.5], 2.0);
//!
//! let kit = Kit::new(vec![Piece::new("chamber", chamber, &Choice::Doorways)?])?;
//! let mut level = Assembly::new(kit);
//! let options = PlaceOptions::default();
//! let first = level.put(0, Pose::IDENTITY, &options)?;
//! level.place(0, 0, End { instance: first, attachment: 0 }, &options)?;
//! assert_eq!((level.len(), level.open_ends().count()), (2, 0));
//! let world = level.flattened()?; // one world
//! assert_eq!(world.graph.indoor_cells().count(), 2);
//! assert!(level.undo() && level.len() == 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A refusal is a [`PlaceError`] that says what is in the way; [`Assembly::fits`] asks before:
//!
//! ```
//! use enfilade::kit::{Assembly, Choice, Kit, Piece, PlaceOptions};
//! use enfilade::world::Pose;
//! # let chamber = enfilade_testkit::chamber(enfilade::geom::DVec3::new(4.0, 3.0, 4.0), [1.5, 2.5], 2.0);
//!
//! let kit = Kit::new(vec![Piece::new("chamber", chamber, &Choice::Doorways)?])?;
//! assert!(kit.named("chamber") == Some(0) && kit.named("hall").is_none());
//! let mut level = Assembly::new(kit);
//! level.put(0, Pose::IDENTITY, &PlaceOptions::default())?;
//! let taken = level.fits(0, &Pose::IDENTITY, &PlaceOptions::default());
//! println!("{}", taken.unwrap_err());
//! # let there = Pose::from_translation(enfilade::geom::DVec3::X * 50.0);
//! # assert!(level.fits(0, &there, &PlaceOptions::default()).is_ok());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`LevelSpace`] is the level as a space, whose parts share their pieces:
//!
//! ```
//! use enfilade::kit::{Assembly, Choice, Kit, Piece, PlaceOptions};
//! use enfilade::world::Pose;
//! # let chamber = enfilade_testkit::chamber(enfilade::geom::DVec3::new(4.0, 3.0, 4.0), [1.5, 2.5], 2.0);
//!
//! let kit = Kit::new(vec![Piece::new("chamber", chamber, &Choice::Doorways)?])?;
//! let mut level = Assembly::new(kit);
//! let id = level.put(0, Pose::IDENTITY, &PlaceOptions::default())?;
//! let live = level.space()?;
//! let part = live.parts.part_of(id).expect("it stands");
//! assert_eq!(live.parts.instance_of(part), Some(id));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use enfilade_kit::{
    Assembly, Attachment, Choice, Chosen, DEFAULT_TOLERANCE, End, FlattenError, Instance,
    InstanceId, Kit, KitFault, LevelParts, LevelSpace, Link, Mouth, Piece, PieceError,
    PieceNamedTwice, PlaceError, PlaceOptions, Spot, open_air,
};

/// Levels made at random.
pub mod generate {
    pub use enfilade_kit::generate::{dungeon, maze, office};
}
