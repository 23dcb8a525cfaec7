//! Programs of this workspace as processes, and the folders of their input and output.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, bail};
use serde_json::Value;

use crate::measure::files_of;

/// Returns the workspace's root: above the folder of the manifest with which cargo started this program or `xtask`.
pub(crate) fn root() -> PathBuf {
    let here = std::env::var_os("CARGO_MANIFEST_DIR")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
    let mut above = here.ancestors();
    let root = above.find(|dir| dir.join("Cargo.lock").is_file());
    root.unwrap_or(&here).to_path_buf()
}

/// Returns the path of a program or example that was built with the same profile as this program.
pub(crate) fn binary(name: &str) -> PathBuf {
    let here = std::env::current_exe().unwrap_or_default();
    here.with_file_name(name)
        .with_extension(std::env::consts::EXE_EXTENSION)
}

/// Returns the Python that has the clients of exports, `ENFILADE_PYTHON`.
pub(crate) fn python() -> String {
    std::env::var("ENFILADE_PYTHON").unwrap_or_else(|_| "python3".into())
}

/// Returns the folder of builds.
pub(crate) fn target_dir() -> PathBuf {
    let here = std::env::current_exe().unwrap_or_default();
    here.ancestors().nth(2).unwrap_or(&here).to_path_buf()
}

/// Returns the bake of a scene folder with default settings.
pub(crate) fn bake_command(scene: &Path, world: &Path) -> Command {
    let mut command = Command::new(binary("enfilade"));
    command.arg("bake");
    add_scene_files(&mut command, scene, None);
    command.arg("-o").arg(world);
    command
}

/// Adds the files of a scene folder to a command, the structure after the option `name` if given.
pub(crate) fn add_scene_files(command: &mut Command, scene: &Path, name: Option<&str>) {
    let (files, details) = files_of(scene);
    command.args(name).args(files);
    details.iter().for_each(|file| {
        command.arg("--detail").arg(file);
    });
}

/// Returns the folder of real scenes, if there is one.
pub(crate) fn scenes_dir() -> Option<PathBuf> {
    let dir = std::env::var_os("ENFILADE_SCENES")
        .map_or_else(|| root().join("../shared/scenes"), PathBuf::from);
    dir.is_dir().then_some(dir)
}

/// Returns the real scenes, by name.
pub(crate) fn scenes() -> Vec<PathBuf> {
    scenes_dir().map_or_else(Vec::new, |dir| scenes_in(&dir))
}

/// Returns the real scenes, and those in folders of these names beside them.
pub(crate) fn scenes_and(beside: &[&str]) -> Vec<PathBuf> {
    let dir = scenes_dir();
    let beside = beside.iter().filter_map(|name| beside_scenes(name));
    let all = dir.iter().cloned().chain(beside);
    all.flat_map(|dir| scenes_in(&dir)).collect()
}

/// Returns the path of a file or folder beside the folder of real scenes, if there is one.
pub(crate) fn beside_scenes(name: &str) -> Option<PathBuf> {
    scenes_dir().map(|dir| dir.with_file_name(name))
}

/// Returns the folders with a `scene.glb` in `dir`, by name.
pub(crate) fn scenes_in(dir: &Path) -> Vec<PathBuf> {
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

/// Runs the test kit's `generate`.
pub(crate) fn generate(args: &[&str], to: &Path) -> anyhow::Result<()> {
    let example = binary("examples/generate");
    output_of(Command::new(example).args(args).arg("-o").arg(to), None).map(drop)
}

/// Returns a bake of one file, with these arguments.
pub(crate) fn bake_file(file: &Path, args: &[&str], world: &Path) -> Command {
    let mut command = Command::new(binary("enfilade"));
    command.arg("bake").arg(file).args(args);
    command.arg("-o").arg(world);
    command
}

/// Writes `text` between the two marks of a page of `docs/benchmarks/`; text around it stays.
pub(crate) fn write_between_marks(page: &str, text: &str) -> anyhow::Result<()> {
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

/// Runs a hidden command of this program in a process of its own, as its memory counts; returns the JSON that it prints, if any.
pub(crate) fn step(args: &[&str]) -> anyhow::Result<Value> {
    let program = std::env::current_exe().context("this program has no path")?;
    let said = output_of(Command::new(program).args(args), None)?;
    if said.is_empty() {
        return Ok(Value::Null);
    }
    serde_json::from_str(&said).context("a step that prints JSON")
}

/// Returns the standard output of a command that must succeed; an error contains its standard error.
pub(crate) fn output_of(command: &mut Command, input: Option<&str>) -> anyhow::Result<String> {
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
