//! The file of a world that is lived in, as JSON.

use std::path::Path;

use anyhow::{Context, bail};
use enfilade::cpg::World;
use serde::{Deserialize, Serialize};

use enfilade_cli::input::read_text;
use enfilade_cli::world::read_world;

/// Version of the format.
pub(crate) const VERSION: u32 = 1;

/// Most people: a picture of them takes ten seconds without a graphics card.
const MOST_PEOPLE: u32 = 20_000;

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

/// Reads a file of a world that is lived in, and the worlds of its lifts.
///
/// # Errors
///
/// If a file cannot be read, or an entry is invalid; the error names the file and the entry.
pub(crate) fn read_living(path: &Path) -> anyhow::Result<(LivingFile, Vec<World>)> {
    let text = read_text("what lives in a world", path)?;
    let file: LivingFile =
        serde_json::from_str(&text).with_context(|| path.display().to_string())?;
    file.check().with_context(|| path.display().to_string())?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let worlds = file.lifts.iter().map(|lift| {
        let world = read_world(&folder.join(&lift.world))?;
        if world.graph.outdoors().is_none() {
            bail!(
                "{}: a lift needs an outdoors, which stands for its surroundings; bake it with its door open",
                lift.world
            );
        }
        Ok(world)
    });
    let worlds = worlds.collect::<anyhow::Result<_>>()?;
    Ok((file, worlds))
}

impl LivingFile {
    fn check(&self) -> anyhow::Result<()> {
        if self.version != VERSION {
            bail!(
                "version {}: this build reads version {VERSION}",
                self.version
            );
        }
        for (i, lift) in self.lifts.iter().enumerate() {
            let is_finite = lift.stops.iter().flatten().all(|x| x.is_finite());
            if lift.stops.len() < 2 || !is_finite {
                bail!("lifts[{i}].stops: at least two points of finite numbers are needed");
            }
            if !(lift.speed > 0.0 && lift.speed.is_finite()) {
                bail!("lifts[{i}].speed {}: above 0 is needed", lift.speed);
            }
            if !(lift.wait >= 3.0 && lift.wait.is_finite()) {
                bail!(
                    "lifts[{i}].wait {}: at least 3 s, in which doors open and shut, is needed",
                    lift.wait
                );
            }
        }
        for (i, lamp) in self.lamps.iter().enumerate() {
            if lamp.lift.is_some_and(|l| l >= self.lifts.len()) {
                bail!("lamps[{i}].lift: there are {} lifts", self.lifts.len());
            }
            let numbers = lamp.at.iter().chain(&lamp.color);
            let is_finite = numbers.chain([&lamp.range]).all(|x| x.is_finite());
            let is_bright = lamp.color.iter().all(|c| *c >= 0.0) && lamp.range > 0.0;
            if !(is_finite && is_bright) {
                bail!(
                    "lamps[{i}]: finite numbers, a color of at least 0 and a range above 0 are needed"
                );
            }
        }
        let people = &self.people;
        if people.count > 0 && people.places.len() < 2 {
            bail!("people.places: at least two are needed");
        }
        let [low, high] = people.stay;
        if people.count > MOST_PEOPLE || !(low >= 0.0 && low <= high && high.is_finite()) {
            bail!("people: at most {MOST_PEOPLE}, and a stay of two ascending numbers, are needed");
        }
        let places = people.places.iter();
        let points = places.chain(self.sounds.iter().map(|s| &s.at));
        if points.flatten().any(|x| !x.is_finite()) {
            bail!("people.places and sounds: finite numbers are needed");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_entries_are_named() {
        let refused = |json: &str| {
            let file: Result<LivingFile, _> = serde_json::from_str(json);
            match file {
                Ok(file) => format!("{:#}", file.check().unwrap_err()),
                Err(e) => e.to_string(),
            }
        };
        for (json, what) in [
            (r#"{"version":2}"#, "version 2"),
            (r#"{"version":1,"lift":[]}"#, "unknown field"),
            (
                r#"{"version":1,"lifts":[{"world":"a.glb","stops":[[0,0,0]]}]}"#,
                "lifts[0].stops",
            ),
            (
                r#"{"version":1,"lifts":[{"world":"a.glb","stops":[[0,0,0],[0,3,0]],"speed":0}]}"#,
                "lifts[0].speed 0",
            ),
            (
                r#"{"version":1,"lamps":[{"at":[0,0,0],"range":-1}]}"#,
                "lamps[0]",
            ),
            (
                r#"{"version":1,"lamps":[{"at":[0,0,0],"lift":0}]}"#,
                "lamps[0].lift",
            ),
            (
                r#"{"version":1,"people":{"count":3,"places":[]}}"#,
                "people.places",
            ),
        ] {
            assert!(refused(json).contains(what), "{json}: {}", refused(json));
        }
    }
}
