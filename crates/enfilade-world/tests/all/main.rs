//! Tests of the crate, in one program: each file alone would be linked with all of it.

#[path = "../cone/mod.rs"]
mod cone;

mod casts;
mod crossing;
mod geodesics;
mod hollow;
mod hops;
mod journeys;
mod layout;
mod lights;
mod passing;
mod paths;
mod rooms;
mod saved;
mod search;
mod sound;
mod specials;
mod sweep;
mod taut;
mod things;
mod trace;
mod withdrawn;
