//! Tampered worlds: each kind of tampering at three places of four scenes, and the rate at which `verify` finds it.
//!
//! Kinds and places come from the test kit (`tamper`), as in tests; the benchmarks apply them.

use std::process::Command;

use anyhow::Context;
use serde_json::Value;

use super::Figures;
use crate::process::{binary, output_of, scenes};

/// Real buildings, from three programs.
const SCENES: [&str; 3] = ["samplehouse4", "duplex", "fzk-haus"];

/// Prints a row per kind and scene: places at which it is found, all of them if `ok`; unknown if a scene has no such
/// place.
pub(super) fn run(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    let mut command = Command::new(binary("enfilade-bench"));
    command.arg("tampered");
    for scene in SCENES {
        let found = scenes().into_iter().find(|dir| dir.ends_with(scene));
        match found {
            Some(dir) => {
                command.arg(dir);
            }
            None => rows.print("tampered", scene, None, "= places", None),
        }
    }
    let mut kinds = std::collections::BTreeSet::new();
    for line in output_of(&mut command, None)?.lines() {
        let row: Value = serde_json::from_str(line).context("a row of the benchmarks")?;
        let text = |key: &str| row[key].as_str().unwrap_or_default().to_owned();
        let number = |key: &str| row[key].as_f64().unwrap_or_default();
        let (found, places) = (number("found"), number("places"));
        kinds.insert(text("kind"));
        let name = match text("by").as_str() {
            "source" => format!("tampered --source: {}", text("kind")),
            _ => format!("tampered: {}", text("kind")),
        };
        let bar = format!("= {places}");
        let ok = (places > 0.0).then_some(found == places);
        rows.print(
            &name,
            &text("scene"),
            (places > 0.0).then_some(found),
            &bar,
            ok,
        );
    }
    let n = kinds.len() as f64;
    rows.print("tampered kinds", "all", Some(n), ">= 60", Some(n >= 60.0));
    Ok(())
}
