//! Runs the workspace's tests: all binaries of tests, several at once, and to their ends, so that one run names all
//! failures.
//!
//! Cargo runs one binary after the other, and many end with one long test while the other cores wait.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Instant;

use anyhow::{Context, bail};
use serde_json::Value;

use crate::{GATE, node_path, output_of, root, run_to_end};

/// A binary of tests.
#[derive(Debug, PartialEq)]
struct Suite {
    /// Package and target, for people.
    name: String,
    program: PathBuf,
    /// Folder of its package, in which it runs.
    package: PathBuf,
}

/// Builds, lints and runs all tests, then those in documentation.
pub(crate) fn run() -> anyhow::Result<()> {
    // The first build prints what it does; the second, which builds nothing, lists the binaries.
    let args = ["--workspace", "--no-run"];
    run_to_end(&mut GATE.linted("test", &args))?;
    let listed = output_of(GATE.linted("test", &args).arg("--message-format=json"))?;
    let suites = listed_suites(&listed)?;
    let (next, failed) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let n_workers = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..n_workers {
            scope.spawn(|| {
                while let Some(suite) = suites.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if !run_suite(suite) {
                        failed.lock().expect("no panics").push(&suite.name);
                    }
                }
            });
        }
    });
    let failed = failed.into_inner().expect("no panics");
    if !failed.is_empty() {
        bail!("tests failed in {failed:?}");
    }
    run_to_end(&mut GATE.linted("test", &["--workspace", "--doc"]))
}

/// Runs a binary and prints its last line, or all that it printed if it failed. Returns `true` if it passed.
fn run_suite(suite: &Suite) -> bool {
    let start = Instant::now();
    let seed = std::env::var("PROPTEST_RNG_SEED").unwrap_or_else(|_| "1".into());
    let mut command = Command::new(&suite.program);
    command
        .current_dir(&suite.package)
        .env("CARGO_MANIFEST_DIR", &suite.package)
        .env("NODE_PATH", node_path())
        // Equal cases for equal code, so that a change is not refused for what it did not touch; the weekly job draws others.
        .env("PROPTEST_RNG_SEED", seed)
        // The window's test skips itself without a display, but not here.
        .env("ENFILADE_NEEDS_WINDOW", "1");
    let (is_passed, said) = match command.output() {
        Ok(done) => {
            let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
            (
                done.status.success(),
                text(&done.stdout) + &text(&done.stderr),
            )
        }
        Err(error) => (false, format!("{}: {error}", suite.program.display())),
    };
    let result = said.lines().rfind(|l| l.starts_with("test result"));
    let seconds = start.elapsed().as_secs_f64();
    // One call each, so that lines of several do not mix.
    if is_passed {
        println!(
            "{:<40} {seconds:6.1} s  {}",
            suite.name,
            result.unwrap_or_default()
        );
    } else {
        println!("{} failed after {seconds:.1} s\n{said}", suite.name);
    }
    is_passed
}

/// Returns the binaries of tests that cargo lists as JSON lines.
fn listed_suites(json: &str) -> anyhow::Result<Vec<Suite>> {
    let mut suites = Vec::new();
    for line in json.lines() {
        let message: Value = serde_json::from_str(line).context("cargo's list is not JSON")?;
        let (Some(program), true) = (
            message["executable"].as_str(),
            message["profile"]["test"] == true,
        ) else {
            continue;
        };
        let manifest = message["manifest_path"].as_str().unwrap_or_default();
        let package = Path::new(manifest).parent().unwrap_or(Path::new(""));
        let target = message["target"]["name"].as_str().unwrap_or_default();
        let at = package.strip_prefix(root()).unwrap_or(package);
        suites.push(Suite {
            name: format!("{} {target}", at.display()),
            program: program.into(),
            package: package.to_owned(),
        });
    }
    if suites.is_empty() {
        bail!("cargo lists no tests");
    }
    Ok(suites)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_executables_of_tests_are_suites() {
        let line = |test: bool, executable: &str| {
            format!(
                r#"{{"reason":"compiler-artifact","manifest_path":"/w/crates/a/Cargo.toml","target":{{"name":"wide"}},"profile":{{"test":{test}}},"executable":{executable}}}"#
            )
        };
        let list = [
            line(true, "\"/t/wide-1\""),
            line(false, "\"/t/a\""),
            line(true, "null"),
            r#"{"reason":"build-finished","success":true}"#.to_owned(),
        ];
        let suites = listed_suites(&list.join("\n")).unwrap();
        let suite = Suite {
            name: "/w/crates/a wide".to_owned(),
            program: "/t/wide-1".into(),
            package: "/w/crates/a".into(),
        };
        assert_eq!(suites, [suite]);
        assert!(listed_suites(&list[3]).is_err());
    }

    #[test]
    fn a_failing_program_fails_and_a_missing_one_too() {
        let suite = |program: &str| Suite {
            name: String::new(),
            program: program.into(),
            package: ".".into(),
        };
        assert!(run_suite(&suite("true")));
        assert!(!run_suite(&suite("false")));
        assert!(!run_suite(&suite("/nowhere/to/be/found")));
    }
}
