//! The project's chores: `cargo xtask test | tidy | score | bench`.
//!
//! `test` decides whether a change may land; `score` and `bench` print the tables of `docs/benchmarks/`.

mod apt;
mod bench;
mod check;
mod dependencies;
mod features;
mod floors;
mod lengths;
mod messy;
mod mutual;
mod names;
mod score;
mod tidy;
mod trust;
mod words;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, bail};

const USAGE: &str = "\
usage: cargo xtask test
       cargo xtask tidy
       cargo xtask score [--write] [--scenes DIR] [SCENE_DIR...]
       cargo xtask bench [--write] [--peers DIR]
       cargo xtask bench messy [--json] [--rows ROW,...] [--scenes SCENE,...] [--rays N]
       cargo xtask bench trust [--json] [--rows ROW,...] [--scenes SCENE,...] [--count N] [--from I]
       cargo xtask bench NAME [--json] [OPTION...]

  test    checks tools, format, lints, tests, docs; bakes, validates and verifies scenes
  tidy    the checks of these that need no build: dependencies between crates, lengths, wording, links,
          licenses and versions of dependencies, features that tests name
  score   rooms and doors found, compared with those that architects modeled
  bench   growth of time and memory with the size of an office tower; with --peers, the voxel
          kernels beside other implementations too (scripts/bench_kernels.py);
          messy: robustness of rooms and doors against disturbed models, a row per figure; --rows
          (moved, missing, quantized, unnamed, exact, undisturbed, fault, foreign) and --scenes
          select by beginnings of names;
          trust: hostile and huge input, a row per figure; --rows (bound, case, commands, estimate, gate, habits, large,
          mutated, nasty, order, tampered, tight) selects; --count and --from select the damaged files of `mutated` and
          the shuffles of `order`, --scenes its scenes;
          any other NAME (bring, bsp, builders, simplify, see, facade, tight, maze, walkthrough, los): a table of
          docs/benchmarks/; `cargo xtask bench --help` lists them, `bench NAME --help` their options

--write writes the table to docs/benchmarks/. Real scenes (folders with a scene.glb) are searched in
$ENFILADE_SCENES, then in ../shared/scenes.";

fn main() -> ExitCode {
    let Some(task) = Task::parse(std::env::args().skip(1)) else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    let result = match task {
        Task::Test => check::run(),
        Task::Tidy => tidy::run()
            .and_then(|()| dependencies::run())
            .and_then(|()| features::run()),
        Task::Score { is_written, dirs } => {
            score::run(RELEASE, &dirs, is_written).and_then(|rows| floors::check(&rows))
        }
        Task::Messy(options) => messy::run(&options),
        Task::Trust(options) => trust::run(&options),
        Task::Bench { is_written, peers } => bench::run(peers.as_deref(), is_written),
        Task::Measure(args) => return bench::measure(&args),
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
enum Task {
    Test,
    Tidy,
    Score {
        is_written: bool,
        dirs: Vec<PathBuf>,
    },
    Bench {
        is_written: bool,
        peers: Option<PathBuf>,
    },
    Messy(messy::Options),
    Trust(trust::TrustOptions),
    /// Arguments of `enfilade-bench`.
    Measure(Vec<String>),
}

impl Task {
    /// Returns `None` for invalid arguments.
    fn parse(mut args: impl Iterator<Item = String>) -> Option<Self> {
        let name = args.next()?;
        let (mut is_written, mut dirs, mut peers) = (false, Vec::new(), None);
        let mut messy: Option<messy::Options> = None;
        while let Some(arg) = args.next() {
            if name == "bench" && arg == "trust" && messy.is_none() {
                return Self::trust(args);
            }
            let is_name = arg != "messy" && !arg.starts_with('-');
            let asks_help = ["--help", "-h"].contains(&arg.as_str());
            if name == "bench" && messy.is_none() && (is_name || asks_help) {
                // Options of growth and kernels must not precede the name.
                let is_first = !is_written && peers.is_none();
                return is_first.then(|| Self::Measure([arg].into_iter().chain(args).collect()));
            }
            match (name.as_str(), arg.as_str()) {
                ("bench", "messy") => messy = Some(messy::Options::default()),
                ("bench", option) if messy.is_some() => {
                    let options = messy.as_mut()?;
                    let names = |list: String| list.split(',').map(str::to_owned).collect();
                    match option {
                        "--json" => options.is_json = true,
                        "--rows" => options.rows = names(args.next()?),
                        "--scenes" => options.scenes = names(args.next()?),
                        "--rays" => options.rays = Some(args.next()?.parse().ok()?),
                        _ => return None,
                    }
                }
                ("score" | "bench", "--write") => is_written = true,
                ("score", "--scenes") => dirs.extend(scenes_in(Path::new(&args.next()?))),
                ("bench", "--peers") => peers = Some(PathBuf::from(args.next()?)),
                ("score", dir) if !dir.starts_with('-') => dirs.push(PathBuf::from(dir)),
                _ => return None,
            }
        }
        match name.as_str() {
            "test" => Some(Self::Test),
            "tidy" => Some(Self::Tidy),
            "score" => Some(Self::Score { is_written, dirs }),
            "bench" if messy.is_some() => messy.map(Self::Messy),
            "bench" => Some(Self::Bench { is_written, peers }),
            _ => None,
        }
    }
}

impl Task {
    fn trust(mut args: impl Iterator<Item = String>) -> Option<Self> {
        let mut options = trust::TrustOptions::default();
        let (mut from, mut n) = (0, None);
        while let Some(arg) = args.next() {
            match arg.as_str() {
                "--json" => options.is_json = true,
                "--rows" => options.rows = args.next()?.split(',').map(str::to_owned).collect(),
                "--scenes" => options.scenes = args.next()?.split(',').map(str::to_owned).collect(),
                "--count" => n = Some(args.next()?.parse().ok()?),
                "--from" => from = args.next()?.parse().ok()?,
                _ => return None,
            }
        }
        options.runs = trust::runs(from, n);
        options.shuffles = trust::shuffles(from, n);
        Some(Self::Trust(options))
    }
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

/// Returns the folder of real scenes, if there is one.
fn scenes_dir() -> Option<PathBuf> {
    let dir = std::env::var_os("ENFILADE_SCENES")
        .map_or_else(|| root().join("../shared/scenes"), PathBuf::from);
    dir.is_dir().then_some(dir)
}

/// Returns the real scenes, by name.
fn scenes() -> Vec<PathBuf> {
    scenes_dir().map_or_else(Vec::new, |dir| scenes_in(&dir))
}

/// Returns the folders with a `scene.glb` in `dir`, by name.
fn scenes_in(dir: &Path) -> Vec<PathBuf> {
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

/// Returns a cargo command in the root.
fn cargo(args: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root()).args(args);
    command
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

/// Writes `text` between the two marks of a page of `docs/benchmarks/`; text around it stays.
fn write_between_marks(page: &str, text: &str) -> anyhow::Result<()> {
    const BEGIN: &str = "<!-- written by `cargo xtask";
    const END: &str = "<!-- end -->";
    let path = root().join("docs/benchmarks").join(page);
    let old = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let marks = || {
        let begin = old.find(BEGIN)?;
        let begin = begin + old[begin..].find('\n')? + 1;
        Some((begin, begin + old[begin..].find(END)?))
    };
    let (begin, end) = marks().with_context(|| format!("{page} has lost its marks"))?;
    let new = format!("{}\n{}\n\n{}", &old[..begin], text.trim_end(), &old[end..]);
    std::fs::write(&path, new).with_context(|| path.display().to_string())
}

/// Returns the standard output of a command that must succeed; an error contains its standard error.
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
        // In its own thread: the child may fill its output before it has read all input.
        std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    }
    let done = child.wait_with_output()?;
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
    fn messy_has_options_of_its_own() {
        let parse = |line: &str| Task::parse(line.split(' ').map(str::to_owned));
        let Some(Task::Messy(options)) =
            parse("bench messy --json --rows moved,fault --scenes house --rays 100")
        else {
            panic!("not understood");
        };
        assert!(options.is_json);
        assert_eq!(options.rows, ["moved", "fault"]);
        assert_eq!(options.scenes, ["house"]);
        assert_eq!(options.rays, Some(100));
        assert!(matches!(parse("bench --write"), Some(Task::Bench { .. })));
        assert!(parse("bench messy --write").is_none());
        assert!(parse("bench --json").is_none());
        assert!(parse("score messy --json").is_none());
    }

    #[test]
    fn other_benches_get_their_arguments_as_they_are() {
        let parse = |line: &str| Task::parse(line.split(' ').map(str::to_owned));
        let Some(Task::Measure(args)) = parse("bench see a.glb --rooms 100 --json") else {
            panic!("not understood");
        };
        assert_eq!(args, ["see", "a.glb", "--rooms", "100", "--json"]);
        assert!(matches!(parse("bench --help"), Some(Task::Measure(_))));
        assert!(parse("bench --write see").is_none());
    }
}
