//! Checks beyond lints: dependencies between crates, circles of imports, lengths of files and functions,
//! names of types, packed parameters, wording of comments, forbidden strings, links.
//!
//! The table here is the "may not" column of ARCHITECTURE.md; change both together.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use anyhow::bail;
use serde_json::Value;

use crate::{cargo, lengths, mutual, names, output_of, parameters, root, words};

/// Permitted dependencies of one crate. Dependencies of its tests are exempt.
struct Fence {
    name: &'static str,
    /// Siblings it may depend on.
    siblings: &'static [&'static str],
    /// Crates of others that it must not depend on.
    not: &'static [&'static str],
    /// Words that its sources must not contain, outside comments.
    words: &'static [&'static str],
}

const PRINT: &[&str] = &["println!", "eprintln!", "print!(", "eprint!("];
/// Ways around the command's writers, which escape printed text.
const RAW: &[&str] = &[
    "println!",
    "eprintln!",
    "print!(",
    "eprint!(",
    "stdout()",
    "stderr()",
];
/// Parsers of formats and front ends, which have their own crates.
const FORMATS: &[&str] = &["serde_json", "toml", "base64", "png", "clap", "anyhow"];

const FENCES: [Fence; 25] = [
    Fence {
        name: "enfilade-geom",
        siblings: &[],
        not: &["rayon", "serde", "serde_json", "log", "tracing", "anyhow"],
        words: &["std::fs", "std::thread", "std::io"],
    },
    Fence {
        name: "enfilade-cpg",
        siblings: &["enfilade-geom"],
        not: &["rayon", "anyhow"],
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-prepare",
        siblings: &["enfilade-geom"],
        not: FORMATS,
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-import",
        siblings: &["enfilade-geom", "enfilade-prepare", "enfilade-source"],
        not: &["rayon", "anyhow"],
        // Waits for a converter, and so may sleep.
        words: &["thread::spawn", "thread::scope", "thread::Builder"],
    },
    Fence {
        name: "enfilade-source",
        siblings: &["enfilade-geom"],
        not: &["anyhow", "clap"],
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-voxel",
        siblings: &["enfilade-geom"],
        not: FORMATS,
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-complex",
        siblings: &["enfilade-geom", "enfilade-cpg"],
        not: FORMATS,
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-bake",
        siblings: &[
            "enfilade-geom",
            "enfilade-cpg",
            "enfilade-voxel",
            "enfilade-complex",
        ],
        not: FORMATS,
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-settings",
        siblings: &["enfilade-geom", "enfilade-import", "enfilade-bake"],
        not: &["rayon", "serde_json", "clap", "anyhow"],
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-vis",
        siblings: &["enfilade-geom", "enfilade-cpg"],
        not: FORMATS,
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-runtime",
        siblings: &["enfilade-geom", "enfilade-cpg"],
        not: &["rayon", "anyhow", "serde_json"],
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-world",
        siblings: &["enfilade-geom", "enfilade-cpg", "enfilade-runtime"],
        not: &["rayon", "anyhow", "serde_json"],
        words: &["std::fs", "std::thread", "std::time"],
    },
    Fence {
        name: "enfilade-kit",
        siblings: &["enfilade-geom", "enfilade-cpg", "enfilade-world"],
        not: &["rayon", "anyhow", "serde_json", "toml"],
        words: &["std::fs", "std::thread", "std::time"],
    },
    Fence {
        name: "enfilade-edit",
        siblings: &[
            "enfilade-geom",
            "enfilade-cpg",
            "enfilade-bake",
            "enfilade-kit",
            "enfilade-world",
        ],
        not: &["rayon", "anyhow", "serde_json", "toml"],
        words: &["std::thread", "std::time"],
    },
    Fence {
        name: "enfilade-stream",
        siblings: &["enfilade-geom", "enfilade-cpg", "enfilade-runtime"],
        not: &["rayon", "anyhow"],
        words: &["std::time::Instant"],
    },
    Fence {
        name: "enfilade-verify",
        siblings: &["enfilade-geom", "enfilade-cpg"],
        not: &["anyhow"],
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-render",
        siblings: &[
            "enfilade-geom",
            "enfilade-cpg",
            "enfilade-runtime",
            "enfilade-world",
        ],
        not: &["rayon", "anyhow", "clap", "winit"],
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-report",
        siblings: &["enfilade-geom", "enfilade-cpg"],
        not: &["rayon", "anyhow"],
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade-export",
        siblings: &["enfilade-geom", "enfilade-cpg"],
        not: &["rayon", "anyhow", "clap"],
        words: &["std::fs", "std::thread"],
    },
    Fence {
        name: "enfilade",
        siblings: &[
            "enfilade-geom",
            "enfilade-cpg",
            "enfilade-import",
            "enfilade-bake",
            "enfilade-edit",
            "enfilade-kit",
            "enfilade-runtime",
            "enfilade-render",
            "enfilade-stream",
            "enfilade-verify",
            "enfilade-vis",
            "enfilade-world",
        ],
        not: &["anyhow", "clap", "rayon"],
        words: &["std::thread"],
    },
    Fence {
        name: "enfilade-demo",
        siblings: &["enfilade-geom"],
        not: &["rayon"],
        words: &["std::fs"],
    },
    Fence {
        name: "enfilade-testkit",
        siblings: &["enfilade-geom", "enfilade-cpg", "enfilade-demo"],
        not: &["rayon"],
        words: &["std::fs"],
    },
    Fence {
        name: "enfilade-cli",
        siblings: &[
            "enfilade",
            "enfilade-demo",
            "enfilade-export",
            "enfilade-render",
            "enfilade-report",
            "enfilade-verify",
            "enfilade-settings",
        ],
        not: &[],
        words: &[],
    },
    Fence {
        name: "enfilade-bench",
        siblings: &[
            "enfilade",
            "enfilade-cli",
            "enfilade-export",
            "enfilade-render",
            "enfilade-report",
            "enfilade-verify",
            "enfilade-testkit",
        ],
        not: &[],
        words: &[],
    },
    Fence {
        name: "xtask",
        siblings: &[],
        not: &[],
        words: &[],
    },
];

/// Linked by every program that uses the façade; all other crates are behind a feature.
const FACADE_ALWAYS: [&str; 3] = ["enfilade-geom", "enfilade-cpg", "enfilade-runtime"];

/// Finds all problems, and fails with one line for each.
pub(crate) fn run() -> anyhow::Result<()> {
    let listed = output_of(Command::new("git").current_dir(root()).args([
        "ls-files",
        "--cached",
        "--others",
        "--exclude-standard",
    ]))?;
    let said = output_of(&mut cargo(&[
        "metadata",
        "--format-version",
        "1",
        "--no-deps",
    ]))?;
    let mut problems = dependency_problems(&serde_json::from_str(&said)?);
    problems.extend(crate::fuzzed::problems()?);
    let mut n_files = 0;
    let mut sources = BTreeMap::new();
    for file in listed.lines() {
        // Skip files that are not text (images, fuzz seeds), or are deleted but not yet committed.
        let Ok(text) = std::fs::read_to_string(root().join(file)) else {
            continue;
        };
        n_files += 1;
        problems.extend(text_problems(file, &text));
        problems.extend(fence_problems(file, &text));
        if Path::new(file).extension().is_some_and(|e| e == "md") {
            problems.extend(link_problems(file, &text, &|path| {
                root().join(path).exists()
            }));
            if file.starts_with("docs/benchmarks/") && !text.contains("Figures as of commit `") {
                problems.push(format!(
                    "{file}: does not say of which build its figures are: \"Figures as of commit `…`\", and why not of this one"
                ));
            }
        } else if file.ends_with(".rs") {
            sources.insert(file.to_owned(), text);
        }
    }
    problems.extend(mutual::problems(&sources));
    problems.extend(lengths::problems(&sources));
    problems.extend(names::problems(&sources));
    problems.extend(parameters::problems(&sources));
    problems.extend(words::problems(&sources));
    if !problems.is_empty() {
        bail!("{}", problems.join("\n"));
    }
    println!("{n_files} files");
    Ok(())
}

fn dependency_problems(metadata: &Value) -> Vec<String> {
    let mut problems = Vec::new();
    for package in metadata["packages"].as_array().into_iter().flatten() {
        let name = package["name"].as_str().unwrap_or_default();
        let Some(fence) = FENCES.iter().find(|f| f.name == name) else {
            problems.push(format!(
                "{name}: a crate without a row in xtask/src/tidy.rs"
            ));
            continue;
        };
        for d in package["dependencies"].as_array().into_iter().flatten() {
            let dependency = d["name"].as_str().unwrap_or_default();
            if d["kind"] == "dev" {
                continue;
            }
            let is_ours = dependency.starts_with("enfilade");
            // A feature that is off by default costs nobody anything.
            let is_optional = d["optional"] == true;
            let is_fenced = !is_optional && fence.not.contains(&dependency);
            if (is_ours && !fence.siblings.contains(&dependency)) || is_fenced {
                problems.push(format!("{name} may not depend on {dependency}"));
            }
            let is_small = FACADE_ALWAYS.contains(&dependency) || !is_ours;
            if name == "enfilade" && !is_small && d["optional"] != true {
                problems.push(format!("{name}: {dependency} must be behind a feature"));
            }
        }
    }
    problems
}

/// Returns forbidden strings in a file.
fn text_problems(file: &str, text: &str) -> Vec<String> {
    let mut problems = Vec::new();
    // Concatenated here, so that this file does not contain them. The first are absolute paths of some machine.
    let forbidden = [
        ["/work", "/"].concat(),
        ["/ho", "me/"].concat(),
        ["/Us", "ers/"].concat(),
        ["/tm", "p/"].concat(),
        ["C:", "\\Users"].concat(),
        ["tod", "o!("].concat(),
        ["#[ign", "ore"].concat(),
        ["<<<<", "<<< "].concat(),
    ];
    for (i, line) in text.lines().enumerate() {
        for bad in &forbidden {
            if line.contains(bad.as_str()) {
                problems.push(format!("{file}:{}: contains {bad}", i + 1));
            }
        }
    }
    problems
}

/// Returns forbidden words in the sources of a fenced crate.
fn fence_problems(file: &str, text: &str) -> Vec<String> {
    let Some((name, rest)) = file
        .strip_prefix("crates/")
        .and_then(|rest| rest.split_once('/'))
    else {
        return Vec::new();
    };
    let Some(fence) = FENCES.iter().find(|f| f.name == name) else {
        return Vec::new();
    };
    if !rest.starts_with("src/") || !file.ends_with(".rs") || file.ends_with("tests.rs") {
        return Vec::new();
    }
    // Libraries print nothing; the benchmarks print, and so does the command, through one file that escapes its text.
    let print = match name {
        "enfilade-bench" => &[],
        "enfilade-cli" if rest == "src/screen.rs" => &[],
        "enfilade-cli" => RAW,
        _ => PRINT,
    };
    // Unit tests stand at the end of the file.
    let end = text.find("\n#[cfg(test)]\nmod tests {");
    let mut problems = Vec::new();
    for (i, line) in text[..end.unwrap_or(text.len())].lines().enumerate() {
        let code = line.split("//").next().unwrap_or_default();
        for word in print.iter().chain(fence.words) {
            if code.contains(word) {
                problems.push(format!("{file}:{}: {name} may not use {word}", i + 1));
            }
        }
    }
    problems
}

/// Returns links from a page to missing files of the repository.
fn link_problems(file: &str, text: &str, exists: &dyn Fn(&Path) -> bool) -> Vec<String> {
    let folder = Path::new(file).parent().unwrap_or(Path::new(""));
    text.match_indices("](")
        .filter_map(|(at, open)| {
            let target = &text[at + open.len()..];
            let target = &target[..target.find([')', '\n'])?];
            let path = target.split('#').next().unwrap_or_default();
            let is_local = !path.is_empty() && !path.contains("://") && !path.contains(' ');
            (is_local && !exists(&folder.join(path)))
                .then(|| format!("{file}: links to {target}, which is not there"))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn metadata(name: &str, dependency: &str, kind: Option<&str>) -> Value {
        serde_json::json!({"packages": [
            {"name": name, "dependencies": [{"name": dependency, "kind": kind}]}
        ]})
    }

    #[test]
    fn bake_may_use_the_graph_but_no_reader_of_files() {
        let problems = |d| dependency_problems(&metadata("enfilade-bake", d, None));
        assert!(problems("enfilade-cpg").is_empty());
        assert!(problems("rayon").is_empty());
        assert_eq!(
            problems("enfilade-import"),
            ["enfilade-bake may not depend on enfilade-import"]
        );
        assert_eq!(
            problems("serde_json"),
            ["enfilade-bake may not depend on serde_json"]
        );
    }

    #[test]
    fn dependencies_of_tests_are_free_and_those_of_build_scripts_are_not() {
        let problems =
            |kind| dependency_problems(&metadata("enfilade-geom", "enfilade-testkit", Some(kind)));
        assert!(problems("dev").is_empty());
        assert_eq!(problems("build").len(), 1);
    }

    #[test]
    fn the_facade_makes_nobody_link_a_builder() {
        let problems = |dependency: &str, optional: bool| {
            dependency_problems(&serde_json::json!({"packages": [{"name": "enfilade",
                "dependencies": [{"name": dependency, "kind": null, "optional": optional}]}]}))
        };
        assert!(problems("enfilade-cpg", false).is_empty());
        assert!(problems("enfilade-bake", true).is_empty());
        assert_eq!(
            problems("enfilade-bake", false),
            ["enfilade: enfilade-bake must be behind a feature"]
        );
    }

    #[test]
    fn a_crate_without_a_row_is_a_problem() {
        assert_eq!(
            dependency_problems(&metadata("enfilade-new", "glam", None)).len(),
            1
        );
    }

    #[test]
    fn libraries_neither_print_nor_touch_files() {
        let problems = |text| fence_problems("crates/enfilade-cpg/src/graph.rs", text);
        assert!(problems("// std::fs is not for us\nuse std::fmt;\n").is_empty());
        assert_eq!(problems("use std::fs::File;\n").len(), 1);
        assert_eq!(problems("fn f() {\n    println!(\"x\");\n}\n").len(), 1);
        assert!(problems("\n#[cfg(test)]\nmod tests { use std::fs; }\n").is_empty());
        assert_eq!(
            problems("\n#[cfg(test)]\nmod tests;\nuse std::fs;\n").len(),
            1
        );
        assert!(fence_problems("crates/enfilade-cpg/tests/x.rs", "use std::fs;").is_empty());
        assert!(fence_problems("crates/enfilade-bench/src/x.rs", "println!();").is_empty());
    }

    #[test]
    fn the_command_prints_by_what_escapes() {
        let problems = |file| {
            let text = "println!();\nio::stdout().lock();\nlet e = stderr();\n";
            fence_problems(&format!("crates/enfilade-cli/src/{file}"), text).len()
        };
        assert_eq!(problems("x.rs"), 3);
        assert_eq!(problems("view/x.rs"), 3);
        assert_eq!(problems("screen.rs"), 0);
    }

    #[test]
    fn paths_of_a_machine_are_found() {
        let path = ["see /ho", "me/me/x"].concat();
        assert_eq!(
            text_problems("a.md", &format!("\n{path}\n")),
            [["a.md:2: contains /ho", "me/"].concat()]
        );
    }

    #[test]
    fn links_to_what_is_not_there_are_found() {
        let exists = |path: &Path| path == Path::new("docs/here.md");
        let text = "[a](here.md#part) [b](gone.md) [c](https://example.org/x.md) [d](#part)";
        assert_eq!(
            link_problems("docs/README.md", text, &exists),
            ["docs/README.md: links to gone.md, which is not there"]
        );
    }
}
