//! Rows on the size of the bake: lines of code, numbers, labellings.

use std::path::{Path, PathBuf};

use crate::measure::file_name;
use crate::process::root;
use crate::rows::RowPrinter;

/// Prints the rows that read the sources.
pub(super) fn run(out: &mut RowPrinter<'_>) -> anyhow::Result<()> {
    let bake = sources(&root().join("crates/enfilade-bake/src"))?;
    let roles = sources(&root().join("crates/enfilade-prepare/src/auto_roles"))?;
    let mut print = |row: &str, value: usize, most: usize| {
        if out.chosen.has_row(row) {
            out.at_most(row, "", value as f64, most as f64, "");
        }
    };
    let realize = bake.iter().filter(|(path, _)| path.ends_with("realize.rs"));
    let n_labels = realize.map(|(_, text)| text.matches("complex.label(").count());
    print("one labelling", n_labels.sum(), 1);
    let all = || bake.iter().chain(&roles);
    print(
        "numbers",
        all().map(|(_, text)| n_constants(text)).sum(),
        200,
    );
    print(
        "code",
        bake.iter().map(|(_, text)| n_lines(text)).sum(),
        19_500,
    );
    Ok(())
}

/// Returns the sources below a folder, without those of tests, each up to its own tests.
fn sources(dir: &Path) -> anyhow::Result<Vec<(PathBuf, String)>> {
    let mut out = Vec::new();
    for entry in std::fs::read_dir(dir)? {
        let path = entry?.path();
        let name = file_name(&path);
        if path.is_dir() {
            out.extend(sources(&path)?);
        } else if name.ends_with(".rs") && !name.contains("tests") {
            let text = std::fs::read_to_string(&path)?;
            let own = text
                .split("#[cfg(test)]\nmod tests {")
                .next()
                .unwrap_or_default();
            out.push((path, own.to_owned()));
        }
    }
    Ok(out)
}

/// Returns the number of lines that are neither blank nor comments.
fn n_lines(text: &str) -> usize {
    let lines = text.lines().map(str::trim);
    lines
        .filter(|line| !line.is_empty() && !line.starts_with("//"))
        .count()
}

/// Returns the number of named numbers.
fn n_constants(text: &str) -> usize {
    let is_number = |kind: &str| {
        [
            "f32", "f64", "usize", "u64", "u32", "i64", "i32", "u16", "u8",
        ]
        .iter()
        .any(|n| kind.contains(n))
    };
    let named = text.lines().filter_map(|line| {
        let (before, rest) = line.split_once("const ")?;
        let (name, kind) = rest.split_once(':')?;
        let is_name = name
            .chars()
            .all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_');
        let kind = kind.split('=').next()?;
        (!before.contains("//") && is_name && is_number(kind)).then_some(())
    });
    named.count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_numbers_and_lines_are_counted_without_comments() {
        let text = "/// A width.\nconst WIDTH: f64 = 0.4;\n\n// const OLD: f64 = 1.0;\npub(crate) const SIZES: [usize; 2] = [1, 2];\nconst NAME: &str = \"\";\nconst fn half(x: f64) -> f64 { x }\n";
        assert_eq!(n_constants(text), 2);
        assert_eq!(n_lines(text), 4);
    }
}
