//! What no lint checks: who may depend on whom, file lengths, strings that must not be there.

use std::path::Path;
use std::process::Command;

use anyhow::bail;
use serde_json::Value;

use crate::{cargo, output_of, root};

/// Normal dependencies of ours that each crate may have.
const MAY_USE: [(&str, &[&str]); 9] = [
    ("enfilade-geom", &[]),
    ("enfilade-cpg", &["enfilade-geom"]),
    ("enfilade-import", &["enfilade-geom"]),
    ("enfilade-bake", &["enfilade-geom", "enfilade-cpg"]),
    ("enfilade-runtime", &["enfilade-geom", "enfilade-cpg"]),
    ("enfilade-verify", &["enfilade-geom", "enfilade-cpg"]),
    ("enfilade-report", &["enfilade-geom", "enfilade-cpg"]),
    ("enfilade-testkit", &["enfilade-geom", "enfilade-cpg"]),
    (
        "enfilade",
        &[
            "enfilade-geom",
            "enfilade-cpg",
            "enfilade-import",
            "enfilade-bake",
            "enfilade-runtime",
        ],
    ),
];

/// Lines a source file may have.
const MAX_LINES: usize = 850;

pub(crate) fn run() -> anyhow::Result<()> {
    let mut problems = dependencies()?;
    let listed = output_of(
        Command::new("git")
            .current_dir(root())
            .args(["ls-files", "*.rs", "*.md", "*.mjs", "*.py"]),
        None,
    )?;
    for file in listed.lines() {
        let Ok(text) = std::fs::read_to_string(root().join(file)) else {
            continue;
        };
        if Path::new(file).extension().is_some_and(|e| e == "rs") {
            let n = text.lines().count();
            if n > MAX_LINES {
                problems.push(format!("{file}: {n} lines, more than {MAX_LINES}"));
            }
        }
        // Put together here, so that this file does not find itself.
        for bad in [
            ["/work", "/main"].concat(),
            ["/tmp/", "target-"].concat(),
            ["tod", "o!("].concat(),
        ] {
            if text.contains(&bad) {
                problems.push(format!("{file}: contains {bad}"));
            }
        }
    }
    if !problems.is_empty() {
        bail!("{}", problems.join("\n"));
    }
    Ok(())
}

fn dependencies() -> anyhow::Result<Vec<String>> {
    let said = output_of(
        &mut cargo(&["metadata", "--format-version", "1", "--no-deps"]),
        None,
    )?;
    let metadata: Value = serde_json::from_str(&said)?;
    let mut problems = Vec::new();
    for package in metadata["packages"].as_array().into_iter().flatten() {
        let name = package["name"].as_str().unwrap_or_default();
        let Some((_, allowed)) = MAY_USE.iter().find(|m| m.0 == name) else {
            continue;
        };
        for d in package["dependencies"].as_array().into_iter().flatten() {
            let dependency = d["name"].as_str().unwrap_or_default();
            let is_ours = dependency.starts_with("enfilade");
            if is_ours && d["kind"].is_null() && !allowed.contains(&dependency) {
                problems.push(format!("{name} may not depend on {dependency}"));
            }
        }
    }
    Ok(problems)
}
