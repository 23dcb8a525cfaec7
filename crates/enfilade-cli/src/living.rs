//! Worlds that are lived in: a file says which lifts, lamps, people and sounds a world has, and [`Lived`] plays it.

mod doors;
mod file;
mod lift;
mod lived;
mod people;
mod radar;

pub(crate) use file::{LampEntry, LiftEntry, LivingFile, PeopleEntry, SoundEntry};
pub(crate) use lived::{Lived, Player, STEP};
pub(crate) use radar::{Blip, BlipKind, RADAR_REACH, radar_words};
