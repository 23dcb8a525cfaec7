//! Reads the file of a world that is lived in, and checks it.

use std::path::Path;

use anyhow::{Context, bail};
use enfilade::cpg::World;

use super::file::LivingFile;
use enfilade_cli::input::read_text;
use enfilade_cli::world::read_world;

/// Version of the format.
const VERSION: u32 = 1;

/// Most people: a picture of them takes ten seconds without a graphics card.
const MOST_PEOPLE: u32 = 20_000;

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
