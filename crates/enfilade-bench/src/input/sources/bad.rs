//! Bad input of every source, given to the real command: refused with the name of the file, or baked, in time and memory.
//!
//! A case is files and options. The command runs in a folder of the case, with limits of its own, and is killed when it exceeds
//! them by more than it promises. Cases are made by code; what is random is seeded by the number of the case.

mod cases;
mod damaged;
mod fields;
mod heights;
mod pages;
mod patches;
mod scans;

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Context;
use enfilade::cpg::wire::decode_glb;

use crate::process::{binary, target_dir};
use crate::rows::Figure;
use cases::BadSource;

/// The limits of each run, and when it has to be over by the promise of `--max-time`: half as much again and a second; and a
/// second for the start on a busy machine.
const LIMITS: [&str; 4] = ["--max-time", "10", "--max-memory", "1G"];
const PATIENCE: Duration = Duration::from_secs(17);
/// Concurrent runs.
const AT_ONCE: usize = 2;

/// Cases that neither bake nor are refused as they should.
pub(super) fn not_refused(family: &str) -> anyhow::Result<Figure> {
    let cases = of_family(family).with_context(|| format!("no bad input '{family}'"))?;
    let folder = target_dir().join("any-source").join(family);
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    let next = AtomicUsize::new(0);
    let wrong: Mutex<Vec<String>> = Mutex::new(Vec::new());
    let n_baked = AtomicUsize::new(0);
    std::thread::scope(|scope| -> anyhow::Result<()> {
        let work = || -> anyhow::Result<()> {
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                let Some(case) = cases.get(i) else {
                    return Ok(());
                };
                match run(case, &folder.join(i.to_string()))? {
                    End::Baked => _ = n_baked.fetch_add(1, Ordering::Relaxed),
                    End::Refused => {}
                    End::Wrong(why) => {
                        let name = &case.name;
                        eprintln!("bad input: {family}, case {i}, {name}: {why}");
                        let mut wrong = wrong.lock().unwrap_or_else(PoisonError::into_inner);
                        wrong.push(case.name.clone());
                    }
                }
            }
        };
        let workers: Vec<_> = (0..AT_ONCE).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            let done = worker.join();
            done.map_err(|_| anyhow::anyhow!("a worker panicked"))??;
        }
        Ok(())
    })?;
    let wrong = wrong.into_inner().unwrap_or_else(PoisonError::into_inner);
    let note = format!(
        "of {} cases, {} of which are baked; {}",
        cases.len(),
        n_baked.into_inner(),
        wrong.join(", ")
    );
    Ok(Figure::new(wrong.len() as f64, 0.0, note))
}

/// Returns the cases of a family.
fn of_family(family: &str) -> Option<Vec<BadSource>> {
    Some(match family {
        "implicit" => fields::implicit(),
        "volumes" => fields::volumes(),
        "patches" => patches::cases(),
        "heights" => heights::cases(),
        "scans" => scans::cases(),
        "damaged-scans" => damaged::cases(),
        _ => return None,
    })
}

/// How a run ended.
#[derive(Debug, PartialEq)]
enum End {
    Baked,
    Refused,
    Wrong(String),
}

fn run(case: &BadSource, folder: &Path) -> anyhow::Result<End> {
    fs::create_dir_all(folder)?;
    for (name, bytes) in &case.files {
        fs::write(folder.join(name), bytes)?;
    }
    let (said, out) = (folder.join("said"), folder.join("out.glb"));
    let mut child = Command::new(binary("enfilade"))
        .args(["bake", &case.files[0].0, "-o", "out.glb"])
        .args(LIMITS)
        .args(&case.options)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(&said)?)
        .spawn()
        .context("build the command, too: cargo build --release -p enfilade-cli")?;
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break Some(status);
        }
        if start.elapsed() > PATIENCE {
            child.kill()?;
            child.wait()?;
            break None;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let text = String::from_utf8_lossy(&fs::read(&said)?).into_owned();
    let world = fs::read(&out).ok();
    let files = case.files.iter().map(|(name, _)| name.as_str());
    let left: Vec<String> = fs::read_dir(folder)?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name != "said" && name != "out.glb" && !files.clone().any(|f| f == name))
        .collect();
    let end = judged(status, &text, world.as_deref(), &left, &case.files[0].0);
    // A case that went wrong is kept.
    if !matches!(end, End::Wrong(_)) {
        fs::remove_dir_all(folder)?;
    }
    Ok(end)
}

/// Judges a run by its exit code, what it said, its world, and what else it left, given the name of its file.
fn judged(
    status: Option<ExitStatus>,
    said: &str,
    world: Option<&[u8]>,
    left: &[String],
    file: &str,
) -> End {
    let wrong = |why: String| End::Wrong(format!("{why}: {}", said.trim_end()));
    let Some(status) = status else {
        return wrong(format!("killed after {} s", PATIENCE.as_secs()));
    };
    if said.contains("panicked") {
        return wrong("panicked".into());
    }
    if !left.is_empty() {
        return wrong(format!("left {}", left.join(", ")));
    }
    let n_errors = said.lines().filter(|l| l.starts_with("enfilade: ")).count();
    match (status.code(), world.map(decode_glb)) {
        (Some(0), Some(Ok(_))) => End::Baked,
        (Some(0), world) => wrong(format!("done, but its world is {world:?}")),
        (Some(1), None) if n_errors == 1 && said.contains(file) => End::Refused,
        (Some(1), None) => wrong(format!("{n_errors} errors, or the file is not named")),
        (Some(1), Some(_)) => wrong("refused, and left a world".into()),
        _ => wrong(status.to_string()),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt as _;

    #[test]
    fn a_run_is_judged_by_all_that_it_says_and_leaves() {
        let ended = |code: i32| Some(ExitStatus::from_raw(code << 8));
        let good = "enfilade: a.json: surface: is none\n";
        let judged = |status, said, world, left: &[String]| {
            super::judged(status, said, world, left, "a.json")
        };
        assert_eq!(judged(ended(1), good, None, &[]), End::Refused);
        let is_wrong = |end: End| matches!(end, End::Wrong(_));
        assert!(is_wrong(judged(ended(1), "enfilade: is none\n", None, &[])));
        let twice = good.repeat(2);
        assert!(is_wrong(judged(ended(1), &twice, None, &[])));
        assert!(is_wrong(judged(ended(1), good, Some(b"glTF"), &[])));
        assert!(is_wrong(judged(ended(1), good, None, &["out.tmp".into()])));
        assert!(is_wrong(judged(ended(101), "thread panicked", None, &[])));
        assert!(is_wrong(judged(ended(0), "", None, &[])));
        assert!(is_wrong(judged(ended(0), "", Some(b"glTF"), &[])));
        assert!(is_wrong(judged(None, "", None, &[])));
        let killed = ExitStatus::from_raw(6);
        assert!(is_wrong(judged(Some(killed), good, None, &[])));
    }

    #[test]
    fn there_are_cases_of_all_families_and_hundreds_of_damaged_scans() {
        for family in super::super::BAD {
            let cases = of_family(family).expect("a family");
            let least = if *family == "damaged-scans" { 300 } else { 20 };
            assert!(cases.len() >= least, "{family}: {}", cases.len());
            assert!(cases.iter().all(|c| !c.files.is_empty()));
        }
    }
}
