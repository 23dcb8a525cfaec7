//! Worlds that are lived in: a file says which lifts, lamps, people and sounds a world has, and [`Lived`] plays it.

#[cfg(feature = "render")]
mod doors;
mod file;
#[cfg(feature = "render")]
mod lift;
#[cfg(feature = "render")]
mod lived;
#[cfg(feature = "render")]
mod people;
#[cfg(feature = "render")]
mod radar;
#[cfg(feature = "render")]
mod read;

pub(crate) use file::{LampEntry, LiftEntry, LivingFile, PeopleEntry, SoundEntry};
#[cfg(feature = "render")]
pub(crate) use lived::{Lived, Player, STEP};
#[cfg(feature = "view")]
pub(crate) use radar::{Blip, BlipKind, RADAR_REACH, radar_words};
