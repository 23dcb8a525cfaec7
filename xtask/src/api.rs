//! The list of all that the façade promises, `crates/enfilade/api.txt`, made from rustdoc's JSON.
//!
//! The format is not stable, and so its writer must be the pinned compiler: this program passes itself to cargo as rustdoc, and
//! starts the real one with its unstable options. Cargo and build scripts see no other environment, so that nothing is built again.

mod signature;
mod surface;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

use anyhow::{Context, bail};

use crate::{GATE, root, run_to_end, target_dir};
use surface::Docs;

/// Arguments with which the gate documents, as pages and as JSON: all of the workspace, so that the same dependencies serve both.
pub(crate) const DOC: [&str; 3] = ["--workspace", "--all-features", "--no-deps"];

/// Set for rustdoc: the program to start.
const RUSTDOC: &str = "ENFILADE_XTASK_RUSTDOC";

/// Crates that the façade does not reach, of which no JSON is made.
const OUT_OF_REACH: [&str; 8] = [
    "enfilade_bench",
    "enfilade_cli",
    "enfilade_demo",
    "enfilade_report",
    "enfilade_settings",
    "enfilade_testkit",
    "enfilade_voxel",
    "xtask",
];

/// Takes the place of rustdoc, if cargo started this program as such.
pub(crate) fn as_rustdoc(args: &[String]) -> Option<ExitCode> {
    let program = std::env::var_os(RUSTDOC)?;
    let mut names = args.windows(2).filter(|pair| pair[0] == "--crate-name");
    if names.any(|pair| OUT_OF_REACH.contains(&pair[1].as_str())) {
        return Some(ExitCode::SUCCESS);
    }
    let mut rustdoc = Command::new(program);
    let done = rustdoc.args(args).env("RUSTC_BOOTSTRAP", "1").status();
    Some(if done.is_ok_and(|status| status.success()) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Compares the list with the façade, or writes it.
pub(crate) fn run(is_write: bool) -> anyhow::Result<()> {
    let lines = lines()?;
    let path = list();
    if is_write {
        return Ok(std::fs::write(path, lines.join("\n") + "\n")?);
    }
    let listed = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let differences = differences(&listed.lines().collect::<Vec<_>>(), &lines);
    if !differences.is_empty() {
        bail!(
            "the façade differs from crates/enfilade/api.txt (- listed, + there):\n{}\n\
             If that is meant, run `cargo xtask api --write`, and tell users in CHANGELOG.md; a line that is gone or \
             changed breaks their code and needs a new minor version",
            differences.join("\n")
        );
    }
    let n_functions = lines.iter().filter(|line| is_function(line)).count();
    println!("{} items, {n_functions} of them functions", lines.len());
    Ok(())
}

fn is_function(line: &str) -> bool {
    line.split_once(": ")
        .is_some_and(|(_, text)| text.trim_start_matches("const ").starts_with("fn"))
}

fn list() -> PathBuf {
    root().join("crates/enfilade/api.txt")
}

/// Returns the sorted lines of the façade, or an error that names each fault in it.
fn lines() -> anyhow::Result<Vec<String>> {
    let mut doc = GATE.cargo("doc", &DOC);
    doc.arg("--quiet");
    doc.env("RUSTDOC", std::env::current_exe()?)
        .env(
            RUSTDOC,
            std::env::var_os("RUSTDOC").unwrap_or("rustdoc".into()),
        )
        .env(
            "RUSTDOCFLAGS",
            "-Zunstable-options --output-format=json --cap-lints=allow",
        );
    run_to_end(&mut doc)?;
    let mut crates = BTreeMap::new();
    for entry in std::fs::read_dir(target_dir().join("doc"))? {
        let path = entry?.path();
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        if name.starts_with("enfilade") && path.extension().is_some_and(|e| e == "json") {
            let json = serde_json::from_slice(&std::fs::read(&path)?)?;
            crates.insert(name.into_owned(), json);
        }
    }
    let (lines, mut faults) = Docs::new(crates).surface("enfilade")?;
    faults.extend(double_names(&lines));
    if !faults.is_empty() {
        bail!("{}", faults.join("\n"));
    }
    Ok(lines)
}

/// Returns a fault for each name that two types of the façade have: a reader of code would take one for the other.
fn double_names(lines: &[String]) -> Vec<String> {
    let kinds = ["enum", "struct", "trait", "type", "union"];
    let mut places: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for line in lines {
        let Some((path, text)) = line.split_once(": ") else {
            continue;
        };
        let kind = text.split(|c: char| !c.is_alphanumeric()).next();
        // An associated type is told by its owner, as a field is.
        let is_own = |path: &str| {
            let owners = path.rsplit_once("::").map_or("", |(owners, _)| owners);
            let mut owners = owners.split("::");
            owners.all(|owner| !owner.starts_with(char::is_uppercase))
        };
        if kind.is_some_and(|kind| kinds.contains(&kind)) && is_own(path) {
            let name = path.rsplit("::").next().unwrap_or(path);
            places.entry(name).or_default().push(path);
        }
    }
    let double = places.values().filter(|at| at.len() > 1);
    double
        .map(|at| format!("types of one name: {}", at.join(", ")))
        .collect()
}

/// Returns the lines of only one of two sorted lists.
fn differences(listed: &[&str], there: &[String]) -> Vec<String> {
    let gone = listed.iter().filter(|l| !there.iter().any(|t| t == *l));
    let new = there.iter().filter(|t| !listed.contains(&t.as_str()));
    let mut out: Vec<(&str, char)> = gone.map(|l| (*l, '-')).collect();
    out.extend(new.map(|t| (t.as_str(), '+')));
    out.sort_unstable();
    out.iter().map(|(l, sign)| format!("{sign} {l}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_only_one_side_differ() {
        let there = ["a: fn()", "c: u8", "d: u8"].map(str::to_owned);
        let found = differences(&["a: fn()", "b: u8", "c: u16"], &there);
        assert_eq!(found, ["- b: u8", "- c: u16", "+ c: u8", "+ d: u8"]);
        assert!(differences(&["a: fn()", "c: u8", "d: u8"], &there).is_empty());
    }

    #[test]
    fn two_types_of_one_name_are_a_fault() {
        let lines = [
            "cpg::Place: struct: Clone",
            "world::Place: enum",
            "a::B::Place: type = u8",
            "a::B::c: struct",
        ];
        let found = double_names(&lines.map(str::to_owned));
        assert_eq!(found, ["types of one name: cpg::Place, world::Place"]);
    }

    #[test]
    fn functions_are_told_from_the_rest() {
        for line in ["a: fn(&self)", "a: const fn() -> Self", "a: fn<T>(t: T)"] {
            assert!(is_function(line), "{line}");
        }
        for line in ["a: type = fn() -> u64", "b::fn: u8", "c: struct: Clone"] {
            assert!(!is_function(line), "{line}");
        }
    }
}
