//! Leftovers: commands killed at any moment, then run once to their end, which must leave what a run without kills leaves.
//!
//! Every command that writes files is killed several times in a folder of its own: half of the times after a random time, half as
//! soon as a file that is written aside appears, which a random time hardly ever hits. The last run finds all of their remains.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::ensure;

use super::figures::Figures;
use super::random::Random;
use crate::process::binary;

/// Default number of kills.
const COUNT: usize = 200;

/// Commands that write files, in this order: later ones read what earlier ones wrote.
const COMMANDS: [&str; 33] = [
    "demo -o demo",
    "bake demo/house.glb -o w.glb --checkpoint kept",
    "bake demo/house.glb -o bsp.glb --method bsp",
    "bake demo/house.glb -o cut.glb --method delaunay",
    "decimate demo/house.glb -o decimated.glb",
    "rebake w.glb --source demo/house.glb -o again.glb",
    "edit w.glb --delete-portal 0 -o edited.glb",
    "simplify w.glb --max-cells 2 -o simple.glb",
    "name w.glb --cell 1 hall -o named.glb",
    "generate maze --rooms 9 -o maze.glb --pieces kit",
    "kit kit -o palette.html",
    "pvs w.glb -o w.pvs --into v.glb --evidence w.ev --statistics w.json --mutual w.txt",
    "pvs maze.glb -o maze.pvs --checkpoint maze.state",
    "pack v.glb -o p.enf --walk",
    "pack v.glb -o one.enf --one-file",
    "unpack p.enf -o unpacked.glb",
    "export w.glb -o cells.csv --cells",
    "export v.glb -o split --split",
    "plan w.glb -o plan.svg",
    "plan w.glb -o plan.png",
    "sound w.glb --listener 2,1.5,2 --source 8,1.5,3 -o w.wav",
    "report w.glb -o report.html --no-pictures --views 5",
    "render w.glb -o seen.png --size 64x64 --eye 2,1.5,2 --look 8,1.5,3 --adapter software",
    "portals w.glb -o w.ptx --side 16 --adapter software",
    "job plan demo/house.glb -o baking",
    "job run baking",
    "job plan demo/house.glb -o other",
    "job merge other baking",
    "job finish baking -o baked.glb",
    "job plan maze.glb -o seeing",
    "job run seeing",
    "job finish seeing -o job.pvs --into job.glb",
    "man man",
];

/// Prints, for each command, files that are there only after kills, and files with other bytes; and how many kills left
/// something, without which the rest shows nothing.
pub(super) fn run(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    let (folder, trial) = (rows.path("leftovers"), rows.path("leftovers-killed"));
    remove(&folder)?;
    fs::create_dir_all(folder.join("tmp"))?;
    let runs = rows.state.runs(COUNT);
    let (mut n_killed, mut n_left) = (0, 0);
    for (i, line) in COMMANDS.iter().enumerate() {
        remove(&trial)?;
        copy(&folder, &trial)?;
        let before = files(&trial)?;
        let start = Instant::now();
        ended(line, &folder)?;
        let time = start.elapsed();
        let clean = files(&folder)?;
        for kill in runs.clone().filter(|kill| kill % COMMANDS.len() == i) {
            let mut random = Random((kill as u64) << 20);
            let is_aside = kill / COMMANDS.len() % 2 == 1;
            n_killed += usize::from(killed(line, &trial, is_aside, time, &mut random)?);
            let is_strange =
                |path: &PathBuf| !before.contains_key(path) && !clean.contains_key(path);
            n_left += usize::from(files(&trial)?.keys().any(is_strange));
        }
        ended(line, &trial)?;
        let found = files(&trial)?;
        let strange: Vec<&PathBuf> = found
            .keys()
            .filter(|path| !clean.contains_key(*path))
            .collect();
        let differ = clean
            .iter()
            .filter(|(path, bytes)| found.get(*path) != Some(bytes));
        for path in &strange {
            eprintln!("leftovers: {line}: {}", path.display());
        }
        rows.at_most("leftovers", line, strange.len() as f64, 0.0, "");
        rows.at_most("leftovers bytes", line, differ.count() as f64, 0.0, "");
    }
    let all = format!("{} kills", runs.len());
    rows.at_least(
        "leftovers killed",
        &all,
        n_killed as f64,
        runs.len() as f64 / 2.0,
        "",
    );
    rows.at_least(
        "leftovers found by the next run",
        &all,
        n_left as f64,
        1.0,
        "",
    );
    Ok(())
}

fn started(line: &str, folder: &Path) -> anyhow::Result<Child> {
    let mut command = Command::new(binary("enfilade"));
    command.args(line.split(' ')).current_dir(folder);
    command.env("TMPDIR", folder.join("tmp"));
    let command = command.stdin(Stdio::null()).stdout(Stdio::null());
    Ok(command.stderr(Stdio::null()).spawn()?)
}

/// Runs a command that must succeed.
fn ended(line: &str, folder: &Path) -> anyhow::Result<()> {
    let end = started(line, folder)?.wait()?;
    ensure!(
        end.success(),
        "enfilade {line} in {}: {end}",
        folder.display()
    );
    Ok(())
}

/// Kills a command after a part of its time, or when a file aside is there; returns `false` if it ended before.
fn killed(
    line: &str,
    folder: &Path,
    is_aside: bool,
    time: Duration,
    random: &mut Random,
) -> anyhow::Result<bool> {
    let before = n_aside(folder);
    let mut child = started(line, folder)?;
    let start = Instant::now();
    let most = time.mul_f64(if is_aside { 3.0 } else { random.next() });
    while start.elapsed() < most && !(is_aside && n_aside(folder) > before) {
        if child.try_wait()?.is_some() {
            return Ok(false);
        }
        std::thread::sleep(Duration::from_micros(50));
    }
    // So that some are killed in the middle of a file.
    std::thread::sleep(Duration::from_micros(random.below(2000) as u64));
    child.kill()?;
    child.wait()?;
    Ok(true)
}

/// Returns the number of entries of a folder, and of its folders, that are named as written aside.
fn n_aside(folder: &Path) -> usize {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let count = |entry: fs::DirEntry| {
        let is_aside = entry.path().extension().is_some_and(|e| e == "tmp");
        usize::from(is_aside) + n_aside(&entry.path())
    };
    entries.map(count).sum()
}

/// Returns the files of a folder, by their paths in it; folders without files, too, as none.
fn files(folder: &Path) -> anyhow::Result<BTreeMap<PathBuf, Option<Vec<u8>>>> {
    let mut found = BTreeMap::new();
    let mut left = vec![folder.to_owned()];
    while let Some(dir) = left.pop() {
        for entry in fs::read_dir(&dir)? {
            let path = entry?.path();
            let name = path.strip_prefix(folder)?.to_owned();
            if path.is_dir() {
                found.insert(name, None);
                left.push(path);
            } else {
                found.insert(name, Some(fs::read(&path)?));
            }
        }
    }
    Ok(found)
}

fn copy(from: &Path, to: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(to)?;
    for (name, bytes) in files(from)? {
        match bytes {
            // Folders come before what is in them.
            None => fs::create_dir_all(to.join(name))?,
            Some(bytes) => fs::write(to.join(name), bytes)?,
        }
    }
    Ok(())
}

fn remove(folder: &Path) -> anyhow::Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder)?;
    }
    Ok(())
}
