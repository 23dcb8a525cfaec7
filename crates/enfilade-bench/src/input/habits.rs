//! Habits that users rely on: names are data, no file is lost, an extension determines the format, half a file is a
//! failure, and the same input gives the same bytes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use anyhow::Context;
use enfilade_testkit::glb;

use super::figures::{Figures, holds};
use crate::process::binary;

/// A name that sets a terminal's title, clears the screen, begins a line and reverses text.
const NAME: &str = "odd\u{1b}]0;owned\u{7}\u{1b}[2J\nwrote all\u{9b}31m\u{202e}gnp\u{2066}";

/// Real buildings, if available.
const BUILDINGS: [&str; 3] = ["duplex", "fzk-haus", "samplehouse4"];

pub(super) fn run(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    let folder = rows.path("habits");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder)?;
    names(rows, &folder)?;
    kept(rows, &folder)?;
    extensions(rows, &folder)?;
    streams(rows, &folder)?;
    same(rows, &folder)
}

fn enfilade(folder: &Path, args: &[&str]) -> anyhow::Result<Output> {
    let mut command = Command::new(binary("enfilade"));
    command.args(args).current_dir(folder).stdin(Stdio::null());
    command.output().context("cannot start the command")
}

/// Counts characters that a terminal would obey, by an independent list.
fn n_hidden(done: &Output) -> usize {
    let text = String::from_utf8_lossy(&done.stdout) + String::from_utf8_lossy(&done.stderr);
    let is_hidden = |c: &char| {
        (c.is_control() && *c != '\n')
            || ('\u{202a}'..='\u{202e}').contains(c)
            || ('\u{2066}'..='\u{2069}').contains(c)
    };
    let lines = text.lines().filter(|line| line.starts_with("wrote all"));
    text.chars().filter(is_hidden).count() + lines.count()
}

/// Objects, materials and files with odd names, through the commands that print them.
fn names(rows: &mut Figures<'_>, folder: &Path) -> anyhow::Result<()> {
    let name = serde_json::to_string(NAME)?;
    let done = enfilade(folder, &["demo", "-o", "."])?;
    anyhow::ensure!(done.status.success(), "{done:?}");
    let (scene, world) = (format!("{NAME}.glb"), format!("{NAME}-world.glb"));
    let house = std::fs::read(folder.join("house.glb"))?;
    std::fs::write(folder.join(&scene), renamed(&house, &name)?)?;
    let (scene, world) = (scene.as_str(), world.as_str());
    for (row, args) in [
        ("bake", &["bake", scene, "-v", "-o", world][..]),
        ("bake --json", &["bake", scene, "--json", "-o", world]),
        ("inspect", &["inspect", world, "--objects", "0"]),
        (
            "inspect --json",
            &["inspect", world, "--objects", "0", "--json"],
        ),
        ("see", &["see", world, "--eye", "2,1,2", "--look", "8,1,3"]),
        ("path", &["path", world, "--from", "2,1,2", "--to", "8,1,3"]),
        ("plan", &["plan", world, "-o", "-"]),
        (
            "report",
            &["report", world, "--no-pictures", "--views", "2", "-o", "-"],
        ),
        (
            "verify",
            &[
                "verify", world, "--source", scene, "--rays", "1000", "--sight", "10",
            ],
        ),
        ("locate", &["locate", world, "--object", NAME]),
        ("no such file", &["inspect", NAME]),
        ("wrong usage", &["inspect", world, NAME]),
    ] {
        let hidden = n_hidden(&enfilade(folder, args)?);
        rows.at_most("habits names", row, hidden as f64, 0.0, "");
    }
    Ok(())
}

/// Returns a GLB with all its names replaced by an odd one.
fn renamed(file: &[u8], name: &str) -> anyhow::Result<Vec<u8>> {
    let n = u32::from_le_bytes(file[12..16].try_into()?) as usize;
    let json = std::str::from_utf8(&file[20..20 + n])?.trim_end();
    let name = name.trim_matches('"');
    let json = json.replace("\"name\":\"", &format!("\"name\":\"{name}"));
    Ok(glb(&json, &file[28 + n..]))
}

/// Files not named as output are not overwritten, nor the targets of links.
fn kept(rows: &mut Figures<'_>, folder: &Path) -> anyhow::Result<()> {
    for (command, file) in [
        ("demo -o", "house.glb"),
        ("demo -o", "world.glb"),
        ("man", "enfilade.1"),
    ] {
        let dir = folder.join("kept");
        let _ = std::fs::remove_dir_all(&dir);
        std::fs::create_dir_all(&dir)?;
        std::fs::write(dir.join(file), "mine")?;
        let mut args: Vec<&str> = command.split(' ').collect();
        args.push("kept");
        let row = format!("{command} {file}");
        let done = enfilade(folder, &args)?;
        let is_alone = std::fs::read_dir(&dir)?.count() == 1;
        let ok = !done.status.success() && is_alone && holds(&dir.join(file), b"mine");
        rows.is("habits kept", &row, ok);
        #[cfg(unix)]
        {
            std::fs::rename(dir.join(file), folder.join("mine"))?;
            std::os::unix::fs::symlink("../mine", dir.join(file))?;
            let done = enfilade(folder, &args)?;
            let ok = !done.status.success() && holds(&folder.join("mine"), b"mine");
            rows.is("habits kept link", &row, ok);
        }
        std::fs::remove_dir_all(&dir)?;
        let twice = [enfilade(folder, &args)?, enfilade(folder, &args)?];
        rows.is(
            "habits twice",
            &row,
            twice.iter().all(|d| d.status.success()),
        );
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("y2", folder.join("l2"))?;
        let args = [
            "pvs",
            "world.glb",
            "-o",
            "y1",
            "--evidence",
            "y2",
            "--mutual",
            "l2",
        ];
        let done = enfilade(folder, &args)?;
        let ok = !done.status.success() && !folder.join("y2").exists();
        rows.is("habits two outputs", "link to no file", ok);
    }
    Ok(())
}

fn extensions(rows: &mut Figures<'_>, folder: &Path) -> anyhow::Result<()> {
    for (command, file) in [
        (
            "sound world.glb --listener 2,1,2 --source 3,1,2 -o",
            "x.mp3",
        ),
        ("report world.glb --no-pictures --views 2 -o", "x.mp3"),
        ("pvs world.glb --mode fast -o", "x.mp3"),
        (
            "sound world.glb --listener 2,1,2 --source 3,1,2 -o",
            "x.flac",
        ),
        ("report world.glb --no-pictures --views 2 -o", "x.docx"),
    ] {
        let mut args: Vec<&str> = command.split(' ').collect();
        args.push(file);
        let done = enfilade(folder, &args)?;
        let says = String::from_utf8_lossy(&done.stderr).contains(" fits");
        let ok = done.status.code() == Some(1) && says && !folder.join(file).exists();
        rows.is("habits extension", &format!("{} {file}", args[0]), ok);
    }
    Ok(())
}

/// Pipes that end early, and pipes that never end.
fn streams(rows: &mut Figures<'_>, folder: &Path) -> anyhow::Result<()> {
    let mut command = Command::new(binary("enfilade"));
    command
        .args(["bake", "house.glb", "-o", "-"])
        .current_dir(folder);
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()?;
    drop(child.stdout.take());
    rows.is("habits cut", "bake", child.wait()?.code() == Some(1));
    let binary = binary("enfilade").to_string_lossy().into_owned();
    for line in [
        "bake - -o x.glb",
        "pvs - -o x.pvs",
        "simplify - -o x.glb --max-cells 2",
    ] {
        // Enough memory for the program and its threads, but not gigabytes.
        let shell = format!("ulimit -v 2097152; exec \"{binary}\" {line} </dev/zero");
        let done = Command::new("sh")
            .args(["-c", &shell])
            .current_dir(folder)
            .output()?;
        let says = String::from_utf8_lossy(&done.stderr).contains("not a ");
        let is_refused = done.status.code() == Some(1);
        let ok = is_refused && (says || !line.starts_with("bake"));
        rows.is("habits endless", line, ok);
    }
    Ok(())
}

/// Compares two reports on one world, byte by byte.
fn same(rows: &mut Figures<'_>, folder: &Path) -> anyhow::Result<()> {
    let scenes = crate::process::scenes();
    let scene_of = |name: &str| {
        scenes
            .iter()
            .find(|dir| dir.ends_with(name))
            .map(|dir| dir.join("scene.glb"))
    };
    let mut worlds: Vec<(&str, Option<PathBuf>)> = vec![("demo", Some(folder.join("house.glb")))];
    worlds.extend(BUILDINGS.map(|name| (name, scene_of(name))));
    for (name, scene) in worlds {
        let Some(scene) = scene else {
            rows.print("habits same bytes", name, None, "= 0", None, "");
            continue;
        };
        let scene = scene.canonicalize()?;
        let done = enfilade(
            folder,
            &["bake", &scene.to_string_lossy(), "-o", "same.glb"],
        )?;
        anyhow::ensure!(done.status.success(), "{done:?}");
        let mut pages = Vec::new();
        for threads in ["1", "2"] {
            let mut command = Command::new(binary("enfilade"));
            command.args(["report", "same.glb", "--no-pictures", "-o", "-"]);
            let command = command
                .current_dir(folder)
                .env("RAYON_NUM_THREADS", threads);
            pages.push(command.output()?.stdout);
        }
        let n = pages[0]
            .iter()
            .zip(&pages[1])
            .filter(|(a, b)| a != b)
            .count();
        let n = n + pages[0].len().abs_diff(pages[1].len());
        let ok = n == 0 && !pages[0].is_empty();
        rows.print(
            "habits same bytes",
            name,
            Some(n as f64),
            "= 0",
            Some(ok),
            "",
        );
    }
    Ok(())
}
