//! Fuzz targets: listed in one place, `fuzz/Cargo.toml`, from which the workflow makes its matrix, and one for each reader.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::root;

/// Readers without a target, and why.
const ELSEWHERE: [(&str, &str); 2] = [
    (
        "restored",
        "a map of floors has a sum, which mutants do not get past; its tests forge bytes and refit it",
    ),
    ("read_all", "reads a head and pieces, which have targets"),
];

/// Crates whose readers are for tests and measurements.
const INNER: [&str; 3] = ["enfilade-testkit", "enfilade-bench", "enfilade-cli"];

/// Part of the workflow that takes the targets from the list.
const MATRIX: &str = "target: ${{ fromJSON(needs.targets.outputs.all) }}";

/// Returns the problems, a line each.
pub(crate) fn problems() -> anyhow::Result<Vec<String>> {
    let read = |path: &str| fs::read_to_string(root().join(path)).with_context(|| path.to_owned());
    let mut problems = Vec::new();
    let listed = listed(&read("fuzz/Cargo.toml")?)?;
    let mut there = BTreeSet::new();
    for entry in fs::read_dir(root().join("fuzz/fuzz_targets"))? {
        let path = entry?.path();
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        there.insert(name.into_owned());
    }
    for name in listed.symmetric_difference(&there) {
        problems.push(format!(
            "fuzz target {name}: is in only one of fuzz/Cargo.toml and fuzz/fuzz_targets"
        ));
    }
    if !read(".github/workflows/gate.yml")?.contains(MATRIX) {
        problems.push(format!(
            "gate.yml: the matrix of the fuzzers is not made from the list: {MATRIX}"
        ));
    }
    let fuzzed = texts(&root().join("fuzz/src"))?.concat();
    // Public functions are called by targets, or make seeds.
    let callers = [
        texts(&root().join("fuzz/fuzz_targets"))?,
        texts(&root().join("fuzz/examples"))?,
    ];
    let callers = callers.concat().concat();
    for name in public_functions(&fuzzed) {
        if !calls(&callers, name) {
            problems.push(format!("fuzz/src: {name} is in no target"));
        }
    }
    for folder in fs::read_dir(root().join("crates"))? {
        let folder = folder?.path();
        if INNER.iter().any(|name| folder.ends_with(name)) {
            continue;
        }
        for text in texts(&folder.join("src"))? {
            problems.extend(unfuzzed(&text, &fuzzed));
        }
    }
    Ok(problems)
}

/// Returns the targets that a manifest lists.
fn listed(manifest: &str) -> anyhow::Result<BTreeSet<String>> {
    let manifest: toml::Table = manifest.parse().context("fuzz/Cargo.toml")?;
    let bins = manifest.get("bin").and_then(toml::Value::as_array);
    let names = bins.into_iter().flatten().filter_map(|bin| bin.get("name"));
    Ok(names
        .filter_map(|n| n.as_str().map(str::to_owned))
        .collect())
}

/// Returns the texts of all sources in a folder.
fn texts(folder: &Path) -> anyhow::Result<Vec<String>> {
    let mut texts = Vec::new();
    let mut left: Vec<PathBuf> = vec![folder.to_owned()];
    while let Some(path) = left.pop() {
        if path.is_dir() {
            for entry in fs::read_dir(&path)? {
                left.push(entry?.path());
            }
        } else if path.extension().is_some_and(|e| e == "rs") {
            texts.push(fs::read_to_string(&path)?);
        }
    }
    Ok(texts)
}

/// Returns the names of the public functions of a source.
fn public_functions(text: &str) -> impl Iterator<Item = &str> {
    let after = text.lines().filter_map(|l| l.strip_prefix("pub fn "));
    after.filter_map(|l| l.split(['(', '<']).next())
}

/// Returns `true` if a source calls or imports a function.
fn calls(text: &str, name: &str) -> bool {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(name).any(|(at, _)| {
        let after = &text[at + name.len()..];
        !text[..at].ends_with(is_word) && !after.starts_with(is_word)
    })
}

/// Returns a line for each reader of bytes or text in a source that no target calls: what is called `decode`, `read` and
/// `restored`.
fn unfuzzed(text: &str, fuzzed: &str) -> Vec<String> {
    let mut problems = Vec::new();
    for part in text.split("pub fn ").skip(1) {
        let Some((name, rest)) = part.split_once('(') else {
            continue;
        };
        let arguments = rest.split(')').next().unwrap_or_default();
        let is_reader =
            name.starts_with("decode") || name.starts_with("read_") || name == "restored";
        let takes = arguments.contains("&[u8]") || arguments.contains(": &str");
        let is_known = ELSEWHERE.iter().any(|e| e.0 == name);
        if is_reader && takes && !is_known && !calls(fuzzed, name) {
            problems.push(format!(
                "{name}: no fuzz target reads with it; add one, or say why in xtask/src/fuzzed.rs"
            ));
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reader_has_a_target_in_one_list() {
        assert_eq!(problems().unwrap(), [""; 0]);
    }

    #[test]
    fn a_reader_without_a_target_is_named() {
        let text = "pub fn decode_new(bytes: &[u8]) {}\npub fn decode_old(\n    bytes: &[u8],\n) {}\n\
            pub fn read_words(text: &str) {}\npub fn read_file(path: &Path) {}\nfn decode_own(b: &[u8]) {}";
        let found = unfuzzed(text, "use x::decode_old; decode_newer(b);");
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].starts_with("decode_new:") && found[1].starts_with("read_words:"));
        let list = "[[bin]]\nname = \"a\"\n[[bin]]\nname = \"b\"\n";
        assert!(listed(list).unwrap().into_iter().eq(["a", "b"]));
    }
}
