//! Damaged files of every kind, given to every command that reads them: each run succeeds or is rejected, in time.
//!
//! Random numbers seeded by `i` alone choose and damage the file of run `i`, so any run can be repeated. Each runs
//! with little memory in a folder of its own; the file and the output of a run that ended badly are kept.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};

use super::figures::Figures;
use super::inputs::{INPUTS, Input, MADE, write};
use super::mutate::mutated;
use super::random::Random;
use crate::process::binary;

/// Default number of runs.
const COUNT: usize = 20_000;

/// Limit of processor time of a run with one thread, which a busy machine does not increase. [Units: s]
const LIMIT: u64 = 20;

/// Limit of wall time, for a run that waits for something. [Units: s]
const PATIENCE: u64 = 300;

/// Address space of a run. [Units: KiB]
const MEMORY: u64 = 4 << 20;

/// Concurrent runs.
const AT_ONCE: usize = 2;

/// Bad ends of a run; the last: an error that the command calls a bug, or a world that it cannot decode again.
const ENDS: [&str; 4] = ["panics", "aborts", "hangs", "bugs"];

pub(super) fn run(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    if !cfg!(unix) {
        rows.print("mutated", "all", None, "= 0", None, "");
        return Ok(());
    }
    let folder = rows.path("mutated");
    let clean = folder.join("clean");
    let finds = folder.join("finds");
    for dir in [&clean, &finds] {
        std::fs::create_dir_all(dir)?;
    }
    prepare(&clean)?;
    let runs = rows.state.runs(COUNT);
    let next = AtomicUsize::new(runs.start);
    let found = Mutex::new(Vec::new());
    std::thread::scope(|scope| -> anyhow::Result<()> {
        let workers: Vec<_> = (0..AT_ONCE)
            .map(|number| {
                let worker = Worker {
                    clean: &clean,
                    finds: &finds,
                    folder: folder.join(number.to_string()),
                };
                let (next, found, end) = (&next, &found, runs.end);
                scope.spawn(move || worker.work(next, end, found))
            })
            .collect();
        for worker in workers {
            worker
                .join()
                .map_err(|_| anyhow::anyhow!("a worker panicked"))??;
        }
        Ok(())
    })?;
    let found = found.into_inner().unwrap_or_default();
    let all = format!("{} files", runs.len());
    for (end, name) in ENDS.iter().enumerate() {
        let n = found.iter().filter(|&&e| e == end).count();
        rows.print(
            &format!("mutated {name}"),
            &all,
            Some(n as f64),
            "= 0",
            Some(n == 0),
            "",
        );
    }
    Ok(())
}

/// Makes the files to damage, and checks that every command accepts them undamaged.
fn prepare(clean: &Path) -> anyhow::Result<()> {
    write(clean)?;
    let pass = |line: &str, file: &str| -> anyhow::Result<()> {
        let (end, said) = command(clean, line, file)?;
        if !end.is_some_and(|status| status.success()) {
            bail!("`enfilade {line}` of {file}, which is not damaged: {end:?}\n{said}");
        }
        Ok(())
    };
    for line in MADE {
        pass(line, "")?;
    }
    let search = std::fs::read(clean.join("grid.search"))?;
    for Input { file, commands, .. } in &INPUTS {
        for line in *commands {
            pass(line, file)?;
            // A finished search removes it.
            std::fs::write(clean.join("grid.search"), &search)?;
        }
    }
    Ok(())
}

/// A worker that runs commands in a folder of its own.
struct Worker<'a> {
    clean: &'a Path,
    finds: &'a Path,
    folder: PathBuf,
}

impl Worker<'_> {
    fn work(
        &self,
        next: &AtomicUsize,
        end: usize,
        found: &Mutex<Vec<usize>>,
    ) -> anyhow::Result<()> {
        std::fs::create_dir_all(&self.folder)?;
        for entry in std::fs::read_dir(self.clean)? {
            let entry = entry?;
            std::fs::copy(entry.path(), self.folder.join(entry.file_name()))?;
        }
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            if i >= end {
                return Ok(());
            }
            if i.is_multiple_of(1000) {
                eprintln!("mutated: run {i}");
            }
            let (input, line, bytes) = choose(self.clean, i)?;
            let path = self.folder.join(input.file);
            std::fs::write(&path, &bytes)?;
            if let Some((end, said)) = self.judged(line, input.file)? {
                let name = format!("{i}-{}-{}", ENDS[end], input.file);
                eprintln!(
                    "mutated: {}: enfilade {line}",
                    self.finds.join(&name).display()
                );
                std::fs::write(self.finds.join(&name), &bytes)?;
                let said = format!("enfilade {line}\n{said}\n");
                std::fs::write(self.finds.join(format!("{name}.said")), said)?;
                if let Ok(mut found) = found.lock() {
                    found.push(end);
                }
            }
            std::fs::copy(self.clean.join(input.file), &path)?;
        }
    }

    /// Returns how a run ended badly, with its output; `None` if it ended well.
    fn judged(&self, line: &str, file: &str) -> anyhow::Result<Option<(usize, String)>> {
        let out = self.folder.join("out.glb");
        if out.exists() {
            std::fs::remove_file(&out)?;
        }
        let (end, said) = command(&self.folder, line, file)?;
        let bad = |name: &str| ENDS.iter().position(|e| *e == name);
        let kind = match end.map(|status| status.code()) {
            None => bad("hangs"),
            Some(None) if end.is_some_and(|status| is_out_of_time(&status)) => bad("hangs"),
            Some(None) => bad("aborts"),
            Some(Some(101)) => bad("panics"),
            Some(Some(_)) if said.contains("(a bug)") => bad("bugs"),
            // A shell's exit code after a signal.
            Some(Some(code)) if code > 128 => bad("aborts"),
            Some(Some(0)) if out.exists() => {
                let (read, why) = command(&self.folder, "inspect out.glb", "")?;
                let ok = read.is_some_and(|status| status.success());
                return Ok((!ok).then(|| (ENDS.len() - 1, why)));
            }
            Some(Some(_)) => None,
        };
        Ok(kind.map(|end| (end, said)))
    }
}

/// Returns `true` if a process was killed for exceeding its processor time.
#[cfg(unix)]
fn is_out_of_time(status: &ExitStatus) -> bool {
    use std::os::unix::process::ExitStatusExt as _;
    // SIGKILL and SIGXCPU, the same number on all systems.
    matches!(status.signal(), Some(9 | 24))
}

#[cfg(not(unix))]
fn is_out_of_time(_: &ExitStatus) -> bool {
    false
}

/// Returns the input, command and damaged bytes of run `i`.
fn choose(clean: &Path, i: usize) -> anyhow::Result<(&'static Input, &'static str, Vec<u8>)> {
    let mut random = Random((i as u64) << 20);
    let mut left = random.below(INPUTS.iter().map(|input| input.weight).sum());
    let mut all = INPUTS.iter();
    let input = loop {
        let input = all.next().context("weights")?;
        if left < input.weight {
            break input;
        }
        left -= input.weight;
    };
    let line = random.one_of(input.commands);
    let bytes = std::fs::read(clean.join(input.file))?;
    Ok((input, line, mutated(&bytes, &mut random)))
}

/// Runs the command; `None` if it took too long and was killed.
fn command(folder: &Path, line: &str, file: &str) -> anyhow::Result<(Option<ExitStatus>, String)> {
    let line = line.replace('@', file);
    let (args, input) = match line.split_once(" < ") {
        Some((args, input)) => (args, File::open(folder.join(input))?.into()),
        None => (line.as_str(), Stdio::null()),
    };
    let said = folder.join("said");
    let mut child = Command::new("sh")
        .args([
            "-c",
            &format!("ulimit -v {MEMORY}; ulimit -t {LIMIT}; ulimit -c 0; exec \"$@\""),
            "sh",
        ])
        .arg(binary("enfilade"))
        .args(args.split_whitespace())
        .current_dir(folder)
        .env("RAYON_NUM_THREADS", "1")
        .stdin(input)
        .stdout(Stdio::null())
        .stderr(File::create(&said)?)
        .spawn()?;
    let start = Instant::now();
    let end = loop {
        if let Some(end) = child.try_wait()? {
            break Some(end);
        }
        if start.elapsed() > Duration::from_secs(PATIENCE) {
            child.kill()?;
            child.wait()?;
            break None;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let said = String::from_utf8_lossy(&std::fs::read(said)?).into_owned();
    Ok((end, said))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_input_is_chosen_and_a_run_repeats() {
        let folder = crate::process::target_dir()
            .join("tmp")
            .join("mutated-inputs");
        std::fs::create_dir_all(&folder).expect("a folder");
        write(&folder).expect("files");
        for made in ["world.glb", "world.ev", "grid.ev", "grid.search"] {
            std::fs::write(folder.join(made), "12 34\n").expect("a file");
        }
        let mut files: Vec<&str> = Vec::new();
        for i in 0..1000 {
            let (input, line, bytes) = choose(&folder, i).expect("a run");
            assert_eq!(choose(&folder, i).expect("a run").2, bytes);
            assert!(
                line.contains('@') || line.starts_with("bake two."),
                "{line}"
            );
            files.push(input.file);
        }
        assert!(INPUTS.iter().all(|input| files.contains(&input.file)));
    }
}
