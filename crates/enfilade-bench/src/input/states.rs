//! States on disk: each of another scene, of other settings, cut off, or with a wrong bit, under the name of the right one. It is
//! refused, or what was asked for is made without it, with the same bytes.
//!
//! Others have tests: textures of portals (`portal_textures/file.rs` and `portal_textures_ahead.rs` of `enfilade-render`), journals of
//! editing (`enfilade-edit/tests/all/sessions.rs`), saved worlds (`enfilade-world/tests/all/saved.rs`) and skeletons
//! (`enfilade-runtime/tests/all/hollow.rs`).

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use anyhow::{Context as _, ensure};

use super::figures::Figures;
use crate::process::binary;

/// Places at which a file is cut off, and at which a bit is wrong beside those of its first bytes.
const PLACES: usize = 20;
const FIRST: usize = 16;

/// Most files of a folder that are spoilt.
const MOST_FILES: usize = 6;

/// Bytes by path.
type Files = BTreeMap<PathBuf, Vec<u8>>;

struct State {
    name: &'static str,
    /// Commands that make it. A `%` is where [`State::other`] goes.
    make: &'static [&'static str],
    /// Options for a state that does not fit; none if any options fit.
    other: Option<&'static str>,
    /// The state: a file, or all files of a folder.
    path: &'static str,
    /// Commands that go on from it; they write `out`, or their output counts, or nothing: then all of them must be refused.
    uses: &'static [&'static str],
    out: Out,
}

#[derive(Clone, Copy, PartialEq)]
enum Out {
    File,
    /// The same, and the state stands for itself: one of another scene is as good.
    Alone,
    Printed,
    Refusal,
}

const STATES: [State; 10] = [
    State {
        name: "checkpoint of a bake",
        // No world can be written there, so the pieces stay.
        make: &["bake house.glb -o /dev/full --checkpoint kept%"],
        other: Some(" --min-opening 0.6"),
        path: "kept",
        uses: &["bake house.glb -o out --checkpoint kept"],
        out: Out::File,
    },
    State {
        name: "shards of a bake",
        make: &["job plan house.glb -o job%", "job run job"],
        other: Some(" -- --min-opening 0.6"),
        path: "job/shards",
        uses: &["job run job", "job finish job -o out"],
        out: Out::File,
    },
    State {
        name: "manifest of a bake",
        make: &[],
        other: None,
        path: "job/manifest.json",
        uses: &["job run job", "job finish job -o out"],
        out: Out::File,
    },
    State {
        name: "shards of visibility",
        make: &["job plan w.glb -o seen%", "job run seen"],
        other: Some(" --far 4"),
        path: "seen/shards",
        uses: &["job run seen", "job finish seen -o out"],
        out: Out::File,
    },
    State {
        name: "manifest of visibility",
        make: &[],
        other: None,
        path: "seen/manifest.json",
        uses: &["job run seen", "job finish seen -o out"],
        out: Out::File,
    },
    State {
        name: "checkpoint of a search",
        make: &["pvs w.glb -o w.pvs --checkpoint state --budget 0%"],
        other: Some(" --far 4"),
        path: "state",
        uses: &["pvs w.glb -o out --checkpoint state"],
        out: Out::File,
    },
    State {
        name: "evidence",
        make: &["pvs w.glb -o w.pvs --evidence w.ev"],
        other: None,
        path: "w.ev",
        uses: &["verify w.glb --evidence w.ev"],
        out: Out::Refusal,
    },
    State {
        name: "map of floors",
        make: &["path w.glb --from 2,1,2 --to 8,1,3 --no-objects --keep%"],
        other: Some(" --radius 0.2"),
        path: "w.walk",
        uses: &["path w.glb --from 2,1,2 --to 8,1,3 --no-objects --json"],
        out: Out::Printed,
    },
    State {
        name: "packed world",
        make: &["pack w.glb -o p.enf"],
        other: None,
        path: "p.enf",
        uses: &["unpack p.enf -o out"],
        out: Out::File,
    },
    State {
        name: "packed world in a file",
        make: &["pack w.glb -o one.enf --one-file"],
        other: None,
        path: "one.enf",
        uses: &["unpack one.enf -o out"],
        out: Out::Alone,
    },
];

/// Prints, for each state, how many runs ended in another way than a refusal or the same bytes.
pub(super) fn run(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    let folders = ["own", "foreign", "other"].map(|name| rows.path("states").join(name));
    for (folder, line) in folders.iter().zip([
        "demo -o .",
        "generate dungeon --rooms 8 -o house.glb",
        "demo -o .",
    ]) {
        let _ = fs::remove_dir_all(folder);
        fs::create_dir_all(folder)?;
        ended(folder, line)?;
        ended(folder, "bake house.glb -o w.glb")?;
    }
    for state in &STATES {
        let other = state.other.unwrap_or_default();
        for (folder, options) in folders.iter().zip(["", "", other]) {
            for line in state.make {
                // One that has no place for its output, or finds no way in another scene, fails after its state is written.
                enfilade(folder, &line.replace('%', options))?;
            }
        }
        let [own, foreign, other] = [0, 1, 2].map(|i| files(&folders[i], state.path));
        let (own, other) = (
            own?,
            state.other.map_or_else(|| Ok(BTreeMap::new()), |_| other)?,
        );
        let foreign: Vec<_> = foreign?.into_values().chain(other.into_values()).collect();
        let asked = used(&folders[0], state)?;
        let asked = asked.with_context(|| format!("{}: refused unspoilt", state.name))?;
        ensure!(
            !foreign.is_empty(),
            "{}: no state of another scene",
            state.name
        );
        let is_alone = state.out == Out::Alone;
        let foreign = if is_alone { Vec::new() } else { foreign };
        let (mut n, mut wrong) = (0, 0.0);
        for (path, how, bytes) in wrong_states(&own, &foreign) {
            restore(&own)?;
            fs::write(&path, bytes)?;
            n += 1;
            let found = used(&folders[0], state);
            let ok = match &found {
                Ok(Some(out)) => state.out != Out::Refusal && *out == asked,
                Ok(None) => true,
                Err(_) => false,
            };
            if !ok {
                let why = found.map_or_else(|e| e.to_string(), |_| "another result".to_owned());
                eprintln!("states: {}: {} {how}: {why}", state.name, path.display());
                wrong += 1.0;
            }
        }
        restore(&own)?;
        rows.at_most("states", &format!("{} of {n}", state.name), wrong, 0.0, "");
    }
    Ok(())
}

/// Returns what stands wrongly in place of a file of a state, each with words for it.
fn wrong_states(own: &Files, foreign: &[Vec<u8>]) -> Vec<(PathBuf, String, Vec<u8>)> {
    let mut all = Vec::new();
    let step = own.len().div_ceil(MOST_FILES).max(1);
    for (path, bytes) in own.iter().step_by(step) {
        let add = |(how, bytes): (String, Vec<u8>)| (path.clone(), how, bytes);
        all.extend(spoilt(bytes).into_iter().map(add));
        // Also a part of the same state under the name of another.
        let others = foreign.iter().chain(own.values().filter(|b| *b != bytes));
        let others = others
            .enumerate()
            .map(|(k, b)| (format!("other {k}"), b.clone()));
        all.extend(others.map(add));
    }
    all
}

fn restore(own: &Files) -> anyhow::Result<()> {
    for (path, bytes) in own {
        fs::create_dir_all(path.parent().unwrap_or(path))?;
        fs::write(path, bytes)?;
    }
    Ok(())
}

/// Returns what the commands that use a state make; `None` if one of them refuses; an error if one panics.
fn used(folder: &Path, state: &State) -> anyhow::Result<Option<Vec<u8>>> {
    let _ = fs::remove_file(folder.join("out"));
    let mut printed = Vec::new();
    for line in state.uses {
        let done = enfilade(folder, line)?;
        let said = String::from_utf8_lossy(&done.stderr);
        let code = done.status.code();
        ensure!(
            matches!(code, Some(0 | 1)) && !said.contains("(a bug)"),
            "{line}: {code:?}: {said}"
        );
        if code == Some(1) {
            ensure!(
                !said.trim().is_empty() || !done.stdout.is_empty(),
                "{line}: refused without a word"
            );
            return Ok(None);
        }
        printed = done.stdout;
    }
    Ok(Some(match state.out {
        Out::File | Out::Alone => fs::read(folder.join("out"))?,
        Out::Printed => printed,
        Out::Refusal => Vec::new(),
    }))
}

/// Returns a file cut off, with a wrong bit, and empty, each with words for it.
fn spoilt(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let n = bytes.len();
    let at = |i: usize| i * n / PLACES;
    let cut = (0..PLACES).map(|i| (format!("cut at {}", at(i)), bytes[..at(i)].to_vec()));
    let places = (0..FIRST.min(n)).chain((0..PLACES).map(|i| at(i) + n / PLACES / 2));
    let flipped = places.filter(|&i| i < n).map(|i| {
        let mut out = bytes.to_vec();
        out[i] ^= 1 << (i % 8);
        (format!("bit {} of byte {i}", i % 8), out)
    });
    cut.chain(flipped).collect()
}

/// Returns the file, or those of a folder, by their paths.
fn files(folder: &Path, path: &str) -> anyhow::Result<Files> {
    let path = folder.join(path);
    let mut all = BTreeMap::new();
    if path.is_dir() {
        for entry in fs::read_dir(&path)? {
            let path = entry?.path();
            if path.is_file() {
                all.insert(path.clone(), fs::read(&path)?);
            }
        }
    } else if path.exists() {
        all.insert(path.clone(), fs::read(&path)?);
    }
    Ok(all)
}

fn enfilade(folder: &Path, line: &str) -> anyhow::Result<Output> {
    let mut command = Command::new(binary("enfilade"));
    command.args(line.split_whitespace()).current_dir(folder);
    Ok(command.output()?)
}

fn ended(folder: &Path, line: &str) -> anyhow::Result<()> {
    let done = enfilade(folder, line)?;
    let said = String::from_utf8_lossy(&done.stderr);
    ensure!(done.status.success(), "enfilade {line}: {said}");
    Ok(())
}
