//! Checks of dependencies against `deny.toml`: licenses, sources, and duplicate versions.
//!
//! `cargo deny` reads the same file and checks more (license texts, advisories), but takes minutes to build. So the
//! gate runs it only where it is installed, and these checks, which need only cargo, everywhere.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, bail};
use serde_json::Value;

use crate::{cargo, output_of, root, run_to_end};

/// The only allowed source of other people's packages.
const REGISTRY: &str = "registry+https://github.com/rust-lang/crates.io-index";

/// Most packages of the command without features, our own included.
const MOST_OF_SMALLEST: usize = 110;

/// Fails with a line for each problem.
pub(crate) fn run() -> anyhow::Result<()> {
    let text = std::fs::read_to_string(root().join("deny.toml")).context("deny.toml")?;
    let rules = Rules::parse(&text)?;
    let metadata = cargo(&[
        "metadata",
        "--format-version=1",
        "--locked",
        "--all-features",
    ]);
    let ours = packages(&serde_json::from_str(&output_of(&mut { metadata })?)?);
    let mut problems = rules.problems(&ours);
    // A workspace of its own, whose versions differ from ours: what goes into the wheel needs a license all the same.
    let mut metadata = cargo(&["metadata", "--format-version=1", "--locked"]);
    metadata.arg("--manifest-path=integrations/python/Cargo.toml");
    let of_wheel = packages(&serde_json::from_str(&output_of(&mut metadata)?)?);
    problems.extend(rules.unlicensed(&of_wheel));
    if !problems.is_empty() {
        bail!("{}", problems.join("\n"));
    }
    println!("{} packages keep to deny.toml", ours.len());
    smallest_build()
}

/// Fails if the command without features has come to need many packages.
fn smallest_build() -> anyhow::Result<()> {
    let tree = output_of(&mut cargo(&[
        "tree",
        "--locked",
        "--package=enfilade-cli",
        "--no-default-features",
        "--edges=normal,build",
        "--prefix=none",
        "--format={p}",
        "--no-dedupe",
    ]))?;
    let needed: BTreeSet<&str> = tree.lines().filter(|line| !line.is_empty()).collect();
    let n = needed.len();
    anyhow::ensure!(
        n <= MOST_OF_SMALLEST,
        "the command without features needs {n} packages, {MOST_OF_SMALLEST} at most: put the new ones behind a feature"
    );
    println!("the command without features needs {n} packages, all ours included");
    Ok(())
}

/// Same as [`run`], plus `cargo deny` if it is installed; without advisories, which need the network.
pub(crate) fn run_with_tool() -> anyhow::Result<()> {
    run()?;
    let version = cargo(&["deny", "--version"]).output();
    if !version.is_ok_and(|done| done.status.success()) {
        println!("skipped: cargo-deny is not installed (cargo install --locked cargo-deny)");
        return Ok(());
    }
    run_to_end(&mut cargo(&[
        "deny", "check", "licenses", "bans", "sources",
    ]))
}

#[derive(Clone)]
struct Package {
    name: String,
    version: String,
    license: String,
    /// `None` for our own packages.
    source: Option<String>,
}

fn packages(metadata: &Value) -> Vec<Package> {
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let all = metadata["packages"].as_array().into_iter().flatten();
    all.map(|p| Package {
        name: text(&p["name"]).unwrap_or_default(),
        version: text(&p["version"]).unwrap_or_default(),
        license: text(&p["license"]).unwrap_or_default(),
        source: text(&p["source"]),
    })
    .collect()
}

/// The rules of `deny.toml`.
struct Rules {
    licenses: BTreeSet<String>,
    /// Names and beginnings of versions that may exist beside another.
    skipped: Vec<(String, String)>,
}

impl Rules {
    fn parse(text: &str) -> anyhow::Result<Self> {
        let file: toml::Table = text.parse().context("deny.toml")?;
        let list = |section: &str, key: &str| {
            let list = file.get(section).and_then(|s| s.get(key)?.as_array());
            list.with_context(|| format!("deny.toml: no list `{key}` in [{section}]"))
        };
        let licenses = list("licenses", "allow")?.iter().map(|l| {
            let id = l.as_str().context("deny.toml: a license is not a string")?;
            Ok(id.to_owned())
        });
        let skipped = list("bans", "skip")?.iter().map(|entry| {
            let key = |key: &str| entry.get(key).and_then(toml::Value::as_str);
            let parts = key("crate").and_then(|c| c.split_once(':'));
            let (name, version) = parts.filter(|_| key("reason").is_some()).with_context(|| {
                format!(
                    "deny.toml: {entry:?}: write {{ crate = \"name:version\", reason = \"…\" }}"
                )
            })?;
            Ok((name.to_owned(), version.to_owned()))
        });
        Ok(Self {
            licenses: licenses.collect::<anyhow::Result<_>>()?,
            skipped: skipped.collect::<anyhow::Result<_>>()?,
        })
    }

    /// Returns packages without an allowed license, or not from the registry.
    fn unlicensed(&self, packages: &[Package]) -> Vec<String> {
        let mut problems = Vec::new();
        for p in packages {
            let Package {
                name,
                version,
                license,
                source,
            } = p;
            if !is_allowed(license, &self.licenses) {
                problems.push(format!(
                    "{name} {version}: its license, `{license}`, is not in deny.toml"
                ));
            }
            if source.as_deref().is_some_and(|s| s != REGISTRY) {
                problems.push(format!("{name} {version} is not from crates.io"));
            }
        }
        problems
    }

    fn problems(&self, packages: &[Package]) -> Vec<String> {
        let mut problems = self.unlicensed(packages);
        let mut versions: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for p in packages {
            versions.entry(&p.name).or_default().push(&p.version);
        }
        for (name, found) in &versions {
            let is_skipped = |v: &&str| {
                let fits = |s: &&(String, String)| s.0 == *name && begins(v, &s.1);
                self.skipped.iter().any(|s| fits(&s))
            };
            let left = found.iter().filter(|v| !is_skipped(v)).count();
            if left > 1 {
                problems.push(format!(
                    "{name} has several versions, {}: update, or skip one with a reason in deny.toml",
                    found.join(" and ")
                ));
            }
        }
        for (name, version) in &self.skipped {
            let found = versions.get(name.as_str()).map_or(&[][..], Vec::as_slice);
            if found.len() < 2 || !found.iter().any(|v| begins(v, version)) {
                problems.push(format!("deny.toml: {name}:{version} need not be skipped"));
            }
        }
        problems
    }
}

/// Returns `true` if `version` begins with the parts of `beginning`: `0.38` for `0.38.44`.
fn begins(version: &str, beginning: &str) -> bool {
    let rest = version.strip_prefix(beginning);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// Returns `true` if these licenses can satisfy an SPDX expression. A slash is an old form of OR.
fn is_allowed(expression: &str, licenses: &BTreeSet<String>) -> bool {
    let spaced = expression
        .replace('(', " ( ")
        .replace(')', " ) ")
        .replace('/', " OR ");
    let mut words: Vec<&str> = spaced.split_whitespace().rev().collect();
    let is_met = any(&mut words, licenses);
    is_met == Some(true) && words.is_empty()
}

/// Evaluates terms joined by OR, the last of `words` first; `None` if they are not an expression.
fn any(words: &mut Vec<&str>, licenses: &BTreeSet<String>) -> Option<bool> {
    let mut is_met = all(words, licenses)?;
    while words.last() == Some(&"OR") {
        words.pop();
        is_met |= all(words, licenses)?;
    }
    Some(is_met)
}

/// Evaluates terms joined by AND.
fn all(words: &mut Vec<&str>, licenses: &BTreeSet<String>) -> Option<bool> {
    let mut is_met = term(words, licenses)?;
    while words.last() == Some(&"AND") {
        words.pop();
        is_met &= term(words, licenses)?;
    }
    Some(is_met)
}

fn term(words: &mut Vec<&str>, licenses: &BTreeSet<String>) -> Option<bool> {
    let word = words.pop()?;
    if word == "(" {
        let is_met = any(words, licenses)?;
        return (words.pop()? == ")").then_some(is_met);
    }
    if words.last() == Some(&"WITH") {
        words.pop();
        let exception = words.pop()?;
        return Some(licenses.contains(&format!("{word} WITH {exception}")));
    }
    Some(licenses.contains(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULES: &str = r#"
        [licenses]
        allow = ["MIT", "Zlib"]
        [bans]
        skip = [{ crate = "old:0.3", reason = "someone" }]
    "#;

    fn package(name: &str, version: &str, license: &str) -> Package {
        Package {
            name: name.to_owned(),
            version: version.to_owned(),
            license: license.to_owned(),
            source: Some(REGISTRY.to_owned()),
        }
    }

    #[test]
    fn a_license_expression_is_met_by_what_is_allowed() {
        let licenses = BTreeSet::from(["MIT", "Zlib", "A WITH B"].map(str::to_owned));
        for (expression, ok) in [
            ("MIT", true),
            ("GPL-3.0", false),
            ("", false),
            ("GPL-3.0 OR MIT", true),
            ("GPL-3.0/MIT", true),
            ("MIT AND GPL-3.0", false),
            ("GPL-3.0 OR MIT AND Zlib", true),
            ("(GPL-3.0 OR MIT) AND Zlib", true),
            ("(GPL-3.0 OR MIT) AND ISC", false),
            ("A WITH B", true),
            ("MIT WITH B", false),
            ("(MIT", false),
            ("MIT MIT", false),
        ] {
            assert_eq!(is_allowed(expression, &licenses), ok, "{expression}");
        }
    }

    #[test]
    fn a_second_version_needs_a_reason_and_a_reason_a_second_version() {
        let rules = Rules::parse(RULES).expect("rules");
        let two = [
            package("old", "0.3.9", "MIT"),
            package("old", "0.30.0", "MIT"),
        ];
        assert!(rules.problems(&two).is_empty());
        assert_eq!(
            rules.problems(&two[1..]),
            ["deny.toml: old:0.3 need not be skipped"]
        );
        let three = [&two[..], &[package("old", "1.0.0", "MIT")]];
        assert!(rules.problems(&three.concat())[0].starts_with("old has several versions"));
        assert!(Rules::parse(&RULES.replace(", reason = \"someone\"", "")).is_err());
    }

    #[test]
    fn licenses_and_sources_are_looked_at() {
        let rules =
            Rules::parse(&RULES.replace("{ crate = \"old:0.3\", reason = \"someone\" }", ""));
        let rules = rules.expect("rules");
        assert_eq!(
            rules.problems(&[package("a", "1.0.0", "GPL-3.0")]),
            ["a 1.0.0: its license, `GPL-3.0`, is not in deny.toml"]
        );
        let mut other = package("a", "1.0.0", "MIT");
        other.source = Some("git+https://example.org/a".to_owned());
        assert_eq!(rules.problems(&[other]), ["a 1.0.0 is not from crates.io"]);
    }
}
