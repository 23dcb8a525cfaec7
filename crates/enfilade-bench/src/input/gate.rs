//! Tests that drive a window, a browser, pipes or a clock, on a busy machine: load must not make them fail.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use serde_json::Value;

use super::figures::Figures;
use crate::process::{output_of, root, target_dir};

/// Runs of each test.
const RUNS: u32 = 10;

/// Busy loops running at the same time.
const LOOPS: usize = 4;

/// A crate, and its tests that wait for something outside of them.
const WAITING: [(&str, &[&str]); 2] = [
    (
        "enfilade-cli",
        &["window", "report_page", "streams", "budgets", "enfilade"],
    ),
    ("enfilade-geom", &["enfilade_geom"]),
];

/// Counts the runs out of ten that pass, for each test, beside four busy loops.
pub(super) fn run(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    for (package, targets) in WAITING {
        let built = test_binaries(package)?;
        for target in targets {
            let binary = built.iter().find(|(name, _)| name == target);
            let (_, binary) = binary.with_context(|| format!("{package} has no test {target}"))?;
            let passed = beside_load(|| (0..RUNS).filter(|_| passes(package, binary)).count());
            rows.at_least("gate", target, passed as f64, f64::from(RUNS), "");
        }
    }
    Ok(())
}

/// Returns names and paths of a crate's test binaries, built as in the gate.
fn test_binaries(package: &str) -> anyhow::Result<Vec<(String, PathBuf)>> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo
        .current_dir(root())
        .args(["test", "--profile", "gate"]);
    cargo.args(["-p", package, "--no-run", "--message-format=json"]);
    let told = output_of(&mut cargo, None)?;
    let messages = told.lines().filter_map(|l| serde_json::from_str(l).ok());
    let binary = |message: Value| {
        let name = message["target"]["name"].as_str()?.to_owned();
        let is_test = message["profile"]["test"] == true;
        let path = message["executable"].as_str().filter(|_| is_test)?;
        Some((name, path.into()))
    };
    Ok(messages.filter_map(binary).collect())
}

fn passes(package: &str, binary: &Path) -> bool {
    let done = Command::new(binary)
        .current_dir(root().join("crates").join(package))
        .env("NODE_PATH", target_dir().join("tools/node_modules"))
        .env("ENFILADE_NEEDS_WINDOW", "1")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    done.is_ok_and(|status| status.success())
}

/// Runs `work` while other threads keep all processors busy.
fn beside_load<T>(work: impl FnOnce() -> T) -> T {
    let is_done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..LOOPS {
            scope.spawn(|| {
                while !is_done.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let result = work();
        is_done.store(true, Ordering::Relaxed);
        result
    })
}
