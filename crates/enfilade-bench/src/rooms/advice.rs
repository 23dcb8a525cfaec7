//! Rows `levels: advice`: each option that the bake of a case, a level or a small scene proposes, followed; none may lead to a world
//! that deserves less trust.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::cases::cases;
use super::score::list;
use super::worlds::RoomRows;
use crate::measure;
use crate::process::{bake_command, target_dir};

/// Largest scene that is tried. [Units: bytes]
const SMALL: u64 = 3 << 20;
/// The longest bake. [Units: s]
const LONGEST: &str = "120";
/// Trust in words, the least first.
const TRUST: [&str; 4] = ["none", "low", "fair", "good"];

/// The trust that a world deserves, its doubt, and the options that its bake proposes.
struct Advised {
    trust: usize,
    doubt: f64,
    options: Vec<String>,
}

impl Advised {
    fn of(scene: &Path, given: &[&str], option: &str) -> anyhow::Result<Self> {
        let mut baking = bake_command(scene, &target_dir().join("advice.glb"));
        baking.args(given).args(option.split_whitespace());
        let done = baking.args(["--json", "--max-time", LONGEST]).output()?;
        let report: Value = serde_json::from_slice(&done.stdout).unwrap_or(Value::Null);
        let verdict = &report["verdict"];
        let word = verdict["trust"].as_str().unwrap_or("none");
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        let mut options = proposed(&said);
        for reason in list(&verdict["reasons"]) {
            options.extend(
                list(&reason["options"])
                    .iter()
                    .filter_map(|o| o.as_str().map(str::to_owned)),
            );
            options.extend(proposed(reason["text"].as_str().unwrap_or_default()));
        }
        options.sort();
        options.dedup();
        Ok(Self {
            trust: TRUST.iter().position(|t| *t == word).unwrap_or(0),
            doubt: verdict["doubt"].as_f64().unwrap_or(1.0),
            options: options.into_iter().filter(|o| can_be_followed(o)).collect(),
        })
    }
}

/// Returns the options about unit and axis in a text, but for those that keep the scene as it is.
fn proposed(text: &str) -> Vec<String> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let clean = |word: &str| {
        word.trim_matches(|c: char| !c.is_alphanumeric() && c != '-')
            .to_owned()
    };
    let pairs = words.windows(2).map(|w| [clean(w[0]), clean(w[1])]);
    let named = pairs.filter(|[name, value]| {
        ["--unit", "--up"].contains(&name.as_str()) && !["m", "y"].contains(&value.as_str())
    });
    named
        .map(|[name, value]| format!("{name} {value}"))
        .collect()
}

/// Returns `true` for an option that has no place to be filled in by a person.
fn can_be_followed(option: &str) -> bool {
    !option.contains("'")
        && !option.chars().any(|c| c.is_ascii_uppercase())
        && option != "--leak-path"
}

/// Prints a row for each file whose bake proposes something, and their sum.
pub(super) fn run(out: &mut RoomRows<'_>) -> anyhow::Result<()> {
    if !out.chosen.has_row("levels: advice") {
        return Ok(());
    }
    let given = cases().map(|(case, file)| (file, case.given));
    let is_small =
        |dir: &PathBuf| std::fs::metadata(dir.join("scene.glb")).is_ok_and(|m| m.len() <= SMALL);
    let scenes = out.buildings().into_iter().filter(is_small);
    let levels = super::levels::files().into_iter().map(|(_, file)| file);
    let others = scenes.chain(levels).map(|file| (file, &[][..]));
    let (mut n, mut n_wrong) = (0, 0);
    for (file, given) in given
        .chain(others)
        .filter(|(f, _)| out.chosen.has_scene(&measure::name(f)))
    {
        let first = Advised::of(&file, given, "")?;
        for option in &first.options {
            let then = Advised::of(&file, given, option)?;
            let is_worse =
                then.trust < first.trust || then.trust == first.trust && then.doubt > first.doubt;
            (n, n_wrong) = (n + 1, n_wrong + usize::from(is_worse));
            let note = format!(
                "{option}: {} becomes {}",
                TRUST[first.trust], TRUST[then.trust]
            );
            let value = Some(f64::from(u8::from(!is_worse)));
            out.print(
                "levels: advice",
                &measure::name(&file),
                value,
                "1",
                Some(!is_worse),
                &note,
            );
        }
    }
    let note = format!("of {n} options that were proposed and followed");
    out.print(
        "levels: wrong advice",
        "all",
        Some(n_wrong as f64),
        "0",
        Some(n_wrong == 0),
        &note,
    );
    Ok(())
}
