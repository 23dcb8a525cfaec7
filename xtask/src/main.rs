//! The project's chores: `cargo xtask test | score | bench`.
//!
//! `test` is what decides whether a change may land; `score` and `bench` print the tables of
//! `docs/benchmarks/`.

mod bench;
mod check;
mod score;
mod tidy;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, bail};

const USAGE: &str = "usage: cargo xtask test | score [--write] [SCENE_DIR...] | bench [--write]

  test    checks tools, formats, lints, tests, docs; bakes, validates and verifies scenes
  score   rooms and doors found, against the rooms that architects modeled
  bench   growth of time and memory with the size of an office tower

Real scenes are looked for in $ENFILADE_SCENES, then in ../shared/scenes.";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let result = match args.first().map(String::as_str) {
        Some("test") => check::run(),
        Some("score") => score::run(&args[1..]),
        Some("bench") => bench::run(&args[1..]),
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// The workspace's root.
fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}

/// Where builds go.
fn target_dir() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

/// The release binary `name`.
fn binary(name: &str) -> PathBuf {
    target_dir()
        .join("release")
        .join(name)
        .with_extension(std::env::consts::EXE_EXTENSION)
}

/// The folder of real scenes, where there is one.
fn scenes_dir() -> Option<PathBuf> {
    let dir = std::env::var_os("ENFILADE_SCENES")
        .map_or_else(|| root().join("../shared/scenes"), PathBuf::from);
    dir.is_dir().then_some(dir)
}

/// The real scenes (folders with a `scene.glb`), by name.
fn scenes() -> Vec<PathBuf> {
    let Some(dir) = scenes_dir() else {
        return Vec::new();
    };
    let Ok(entries) = std::fs::read_dir(dir) else {
        return Vec::new();
    };
    let mut found: Vec<PathBuf> = entries
        .flatten()
        .map(|e| e.path())
        .filter(|p| p.join("scene.glb").is_file())
        .collect();
    found.sort();
    found
}

/// A cargo command in the root.
fn cargo(args: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root()).args(args);
    command
}

/// Runs to the end; an error names the command.
fn run_to_end(command: &mut Command) -> anyhow::Result<()> {
    let status = command
        .status()
        .with_context(|| format!("cannot start {command:?}"))?;
    if !status.success() {
        bail!("{command:?} failed: {status}");
    }
    Ok(())
}

/// The bake of a scene folder with default settings.
fn bake_command(scene: &Path, world: &Path) -> Command {
    let mut command = Command::new(binary("enfilade"));
    command.arg("bake").arg(scene.join("scene.glb"));
    let detail = scene.join("detail.glb");
    if detail.is_file() {
        command.arg("--detail").arg(detail);
    }
    command.arg("-o").arg(world);
    command
}

/// Standard output of a command that must succeed; what it says goes into the error.
fn output_of(command: &mut Command, input: Option<&str>) -> anyhow::Result<String> {
    use std::io::Write as _;
    use std::process::Stdio;
    command.stdin(if input.is_some() {
        Stdio::piped()
    } else {
        Stdio::null()
    });
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("cannot start {command:?}"))?;
    if let (Some(text), Some(mut stdin)) = (input, child.stdin.take()) {
        let text = text.to_owned();
        // In a thread of its own: the child may fill its output before it has read all.
        std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    }
    let done = child.wait_with_output()?;
    if !done.status.success() {
        bail!(
            "{command:?}: {}\n{}",
            done.status,
            String::from_utf8_lossy(&done.stderr)
        );
    }
    Ok(String::from_utf8(done.stdout)?)
}
