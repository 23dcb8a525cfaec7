//! The project's chores: `cargo xtask test | tidy | api | score | bench`.
//!
//! `test` decides whether a change may land; `score` and `bench` start `enfilade-bench`, which prints tables.

mod api;
mod apt;
mod check;
mod dependencies;
mod engines;
mod features;
mod fuzzed;
mod installed;
mod lengths;
mod mutual;
mod names;
mod parameters;
mod python;
mod steps;
mod suites;
mod tidy;
mod words;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, bail};

const USAGE: &str = "\
usage: cargo xtask test [--engines]
       cargo xtask tidy
       cargo xtask api [--write]
       cargo xtask score [OPTION...] [SCENE_DIR...]
       cargo xtask bench [--write] [--peers DIR]
       cargo xtask bench NAME [--json] [OPTION...]
       cargo xtask bench engines [--json]
       cargo xtask bench web [--json] [ROW...]

  test    checks tools, format, lints, tests, docs; bakes, validates and verifies scenes; tests the integrations with
          engines, but for Bevy; with --engines, the integrations only, and Bevy
  tidy    the checks of these that need no build: dependencies between crates, lengths, wording, links,
          licenses and versions of dependencies, features that tests name
  api     compares the façade with crates/enfilade/api.txt, the list of all that users may build on; --write writes it
  score   rooms and doors found, compared with those that architects modeled; --help tells the options
  bench   a table of docs/benchmarks/: `cargo xtask bench --help` lists them, `bench NAME --help` their options;
          without NAME, growth of time and memory with the size of an office tower

Real scenes (folders with a scene.glb) are searched in $ENFILADE_SCENES, then in ../shared/scenes.";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if let Some(code) = api::as_rustdoc(&args) {
        return code;
    }
    let Some(task) = Task::parse(&args) else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    let result = match task {
        Task::Test(checks) => check::run(checks),
        Task::Tidy => tidy::run()
            .and_then(|()| dependencies::run())
            .and_then(|()| features::run()),
        Task::Api { is_write } => api::run(is_write),
        Task::BenchEngines(args) => engines::bench(&args),
        Task::BenchWeb(args) => engines::bench_web(&args),
        Task::Bench(args) => return bench(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// A parsed task.
#[derive(Debug, PartialEq)]
enum Task {
    Test(check::Checks),
    Tidy,
    Api {
        is_write: bool,
    },
    /// Arguments after `bench engines`.
    BenchEngines(Vec<String>),
    /// Arguments after `bench web`.
    BenchWeb(Vec<String>),
    /// Arguments of `enfilade-bench`.
    Bench(Vec<String>),
}

impl Task {
    /// Returns `None` for invalid arguments.
    fn parse(args: &[String]) -> Option<Self> {
        let (name, rest) = args.split_first()?;
        match (name.as_str(), rest.first().map(String::as_str)) {
            ("test", None) => Some(Self::Test(check::Checks::All)),
            ("test", Some("--engines")) if rest.len() == 1 => {
                Some(Self::Test(check::Checks::Engines))
            }
            ("tidy", None) => Some(Self::Tidy),
            ("api", None) => Some(Self::Api { is_write: false }),
            ("api", Some("--write")) if rest.len() == 1 => Some(Self::Api { is_write: true }),
            ("score", _) => Some(Self::Bench(args.to_vec())),
            ("bench", None | Some("--write" | "--peers")) => {
                Some(Self::Bench([&["growth".to_owned()], rest].concat()))
            }
            ("bench", Some("engines")) => Some(Self::BenchEngines(rest[1..].to_vec())),
            ("bench", Some("web")) => Some(Self::BenchWeb(rest[1..].to_vec())),
            ("bench", _) => Some(Self::Bench(rest.to_vec())),
            _ => None,
        }
    }
}

/// Builds the benchmarks and what they start, and runs them; returns their exit code.
fn bench(args: &[String]) -> ExitCode {
    let packages = [
        "enfilade-bench",
        "enfilade-cli",
        "enfilade-testkit",
        "enfilade-voxel",
    ];
    let run = || {
        let mut build = RELEASE.cargo(
            "build",
            &["--bins", "--example=generate", "--example=kernel_bench"],
        );
        run_to_end(build.args(packages.iter().flat_map(|package| ["-p", package])))?;
        let status = Command::new(RELEASE.binary("enfilade-bench"))
            .args(args)
            .status()?;
        anyhow::Ok(u8::try_from(status.code().unwrap_or(1)).unwrap_or(1))
    };
    run().map_or_else(
        |error| {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        },
        ExitCode::from,
    )
}

/// Returns the workspace's root: that of the checkout in which `cargo xtask` was called, even if the binary was built
/// in another one that shares its target folder.
fn root() -> PathBuf {
    let here = std::env::var_os("CARGO_MANIFEST_DIR")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
    here.parent().unwrap_or(&here).to_path_buf()
}

/// Returns the folder of builds. A relative `CARGO_TARGET_DIR` starts at the root, where cargo runs.
fn target_dir() -> PathBuf {
    root().join(std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into()))
}

/// Returns the folder of builds of all integrations, which have much in common.
fn engine_builds() -> PathBuf {
    target_dir().join("engines")
}

/// Returns the folder of an integration.
fn integration(name: &str) -> PathBuf {
    root().join("integrations").join(name)
}

/// Returns the folder of packages of node and Python.
fn tools_dir() -> PathBuf {
    target_dir().join("tools")
}

/// Returns the folder of node packages that tests need.
fn node_path() -> PathBuf {
    tools_dir().join("node_modules")
}

/// A profile of `Cargo.toml` with which commands are built.
#[derive(Clone, Copy)]
struct Profile(&'static str);

/// For users, and for measurements.
const RELEASE: Profile = Profile("release");
/// A release that aborts where a `debug_assert!` fails or an integer overflows: for the gate, all of which uses it,
/// so that nothing is built twice.
const GATE: Profile = Profile("gate");

impl Profile {
    /// Returns the path of the binary `name`.
    fn binary(self, name: &str) -> PathBuf {
        target_dir()
            .join(self.0)
            .join(name)
            .with_extension(std::env::consts::EXE_EXTENSION)
    }

    /// Returns `cargo COMMAND --profile SELF ARGS`, in the root.
    fn cargo(self, command: &str, args: &[&str]) -> Command {
        cargo(&[&[command, "--profile", self.0], args].concat())
    }

    /// Returns `cargo COMMAND --profile SELF ARGS`, which lints what it compiles of ours; a warning is an error.
    fn linted(self, command: &str, args: &[&str]) -> Command {
        let mut command = self.cargo(command, args);
        lint(&mut command);
        command
    }

    /// Returns the bake of a scene folder with default settings.
    fn bake_command(self, scene: &Path, world: &Path) -> Command {
        let mut command = Command::new(self.binary("enfilade"));
        command.arg("bake");
        add_scene_files(&mut command, scene, None);
        command.arg("-o").arg(world);
        command
    }
}

/// Adds the files of a scene folder to a command, the structure after the option `name` if given.
fn add_scene_files(command: &mut Command, scene: &Path, name: Option<&str>) {
    command.args(name).arg(scene.join("scene.glb"));
    let detail = scene.join("detail.glb");
    if detail.is_file() {
        command.arg("--detail").arg(detail);
    }
}

/// Returns the real scenes, by name.
fn scenes() -> Vec<PathBuf> {
    let dir = std::env::var_os("ENFILADE_SCENES")
        .map_or_else(|| root().join("../shared/scenes"), PathBuf::from);
    let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = entries
        .map(|e| e.path())
        .filter(|p| p.join("scene.glb").is_file())
        .collect();
    found.sort();
    found
}

/// Returns the name of a scene, that of its folder.
fn name_of(scene: &Path) -> String {
    let name = scene.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Returns the path of the world baked from the scene `name`.
fn world_of(name: &str) -> PathBuf {
    target_dir().join("scenes").join(name).with_extension("glb")
}

/// Returns a cargo command in the root.
fn cargo(args: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root()).args(args);
    command
}

/// Makes a build lint what it compiles of ours, as `cargo clippy -- -D warnings` does: that would check everything, the code of
/// others, too, before the build compiles it once more.
fn lint(build: &mut Command) {
    build.env("RUSTC_WORKSPACE_WRAPPER", "clippy-driver");
    build.env("CLIPPY_ARGS", "-Dwarnings__CLIPPY_HACKERY__");
}

/// Runs a command to its end; an error contains the command.
fn run_to_end(command: &mut Command) -> anyhow::Result<()> {
    let status = command
        .status()
        .with_context(|| format!("cannot start {command:?}"))?;
    if !status.success() {
        bail!("{command:?} failed: {status}");
    }
    Ok(())
}

/// Returns the standard output of a command that must succeed; an error contains its standard error.
fn output_of(command: &mut Command) -> anyhow::Result<String> {
    let done = command
        .output()
        .with_context(|| format!("cannot start {command:?}"))?;
    if !done.status.success() {
        // `verify` and the validator print their reports to standard output.
        bail!(
            "{command:?}: {}\n{}{}",
            done.status,
            String::from_utf8_lossy(&done.stdout),
            String::from_utf8_lossy(&done.stderr)
        );
    }
    Ok(String::from_utf8(done.stdout)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn benches_get_their_arguments_as_they_are_and_growth_has_no_name() {
        let parse =
            |line: &str| Task::parse(&line.split(' ').map(str::to_owned).collect::<Vec<_>>());
        for (line, expected) in [
            (
                "bench see a.glb --rooms 100 --json",
                "see a.glb --rooms 100 --json",
            ),
            (
                "bench messy --json --rows moved,fault",
                "messy --json --rows moved,fault",
            ),
            ("bench --help", "--help"),
            ("bench --write", "growth --write"),
            ("bench --peers scripts", "growth --peers scripts"),
            ("bench", "growth"),
            ("score --write house", "score --write house"),
        ] {
            let args = expected.split(' ').map(str::to_owned).collect();
            assert_eq!(parse(line), Some(Task::Bench(args)), "{line}");
        }
        assert_eq!(parse("test"), Some(Task::Test(check::Checks::All)));
        assert_eq!(
            parse("test --engines"),
            Some(Task::Test(check::Checks::Engines))
        );
        assert_eq!(parse("test --engines abi"), None);
        let engines = Task::BenchEngines(vec!["--json".to_owned()]);
        assert_eq!(parse("bench engines --json"), Some(engines));
        assert_eq!(parse("api"), Some(Task::Api { is_write: false }));
        assert_eq!(parse("api --write"), Some(Task::Api { is_write: true }));
        assert_eq!(parse("api --json"), None);
        assert_eq!(parse("test --json"), None);
        assert_eq!(parse("nothing"), None);
    }
}
