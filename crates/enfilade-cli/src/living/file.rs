//! The file of a world that is lived in, as JSON.

use serde::{Deserialize, Serialize};

/// Contents of a world that is lived in. Coordinates are those of the world, or of the lift that an entry names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LivingFile {
    /// Version of the format: 1.
    pub(crate) version: u32,
    #[serde(default)]
    pub(crate) lifts: Vec<LiftEntry>,
    #[serde(default)]
    pub(crate) lamps: Vec<LampEntry>,
    #[serde(default)]
    pub(crate) people: PeopleEntry,
    #[serde(default)]
    pub(crate) sounds: Vec<SoundEntry>,
}

/// A world that moves up and down between stops.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LiftEntry {
    /// File of its world, relative to the folder of this file.
    pub(crate) world: String,
    /// Displacements of its world at the stops, in order; at least two. [Units: wu]
    pub(crate) stops: Vec<[f64; 3]>,
    /// [Units: wu/s]
    #[serde(default = "one")]
    pub(crate) speed: f64,
    /// Time at each stop. [Units: s]
    #[serde(default = "eight")]
    pub(crate) wait: f64,
}

/// A lamp that shines in all directions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LampEntry {
    /// Index of the lift that it hangs in; none for the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) lift: Option<usize>,
    /// [Units: wu]
    pub(crate) at: [f32; 3],
    /// Linear light on a surface 1 m away; 1 is as bright as an outdoor surface in the shade.
    #[serde(default = "warm")]
    pub(crate) color: [f32; 3],
    /// [Units: wu]
    #[serde(default = "range")]
    pub(crate) range: f32,
}

/// People on errands from place to place.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PeopleEntry {
    pub(crate) count: u32,
    /// Seed of their errands.
    #[serde(default)]
    pub(crate) seed: u64,
    /// Points on floors that they walk to; at least two if there are people. [Units: wu]
    pub(crate) places: Vec<[f64; 3]>,
    /// Minimum and maximum stay at a place. [Units: s]
    #[serde(default = "stay")]
    pub(crate) stay: [f64; 2],
}

/// A source of sound.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SoundEntry {
    pub(crate) name: String,
    /// [Units: wu]
    pub(crate) at: [f64; 3],
}

fn one() -> f64 {
    1.0
}

fn eight() -> f64 {
    8.0
}

fn warm() -> [f32; 3] {
    [1.6, 1.35, 1.0]
}

fn range() -> f32 {
    7.0
}

fn stay() -> [f64; 2] {
    [5.0, 40.0]
}
