//! Limits of a command's time and memory, set by the user.
//!
//! Loops that can end early spend from an [`Allowance`]; work out of all proportion to a scene or an argument is
//! refused beforehand, whatever the limits. Beyond both, a thread watches the clock and the memory, so that the
//! limits also hold for code that checks neither: decoders, drivers of graphics cards. It ends the process, but not
//! in the middle of an output.

use std::io::Write;
use std::sync::TryLockError;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use enfilade::internals::geom::{Allowance, PROGRAM};

use crate::output::WRITING;
use crate::screen::Warned;
use enfilade_cli::values::{memory_limit, seconds};

/// Options of all commands that can take long.
#[derive(clap::Args, Clone, Copy, Default)]
pub(crate) struct Limits {
    /// End without a result after this long.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    max_time: Option<Duration>,
    /// End without a result rather than use more memory: a number and K, M, G or T; 0 for no limit, not even on files that unpack
    /// to hundreds of times their size.
    #[arg(long, value_name = "BYTES", value_parser = memory_limit)]
    max_memory: Option<u64>,
}

/// Time between two checks: memory grows by at most about 10 MB meanwhile.
const PAUSE: Duration = Duration::from_millis(5);
/// Returns the time after which a command that does not end by itself is ended: the promise is half as much again and
/// a second.
fn with_grace(time: Duration) -> Duration {
    (time.saturating_add(time / 5)).saturating_add(Duration::from_millis(400))
}

/// Longest wait for an output that is being written.
const WRITING_TIME: Duration = Duration::from_secs(1);

impl Limits {
    /// Starts enforcing the limits; returns the allowance for loops.
    pub(crate) fn begin(&self) -> anyhow::Result<Allowance> {
        watch(self.max_time, self.max_memory)?;
        Ok(self.allowance())
    }

    fn allowance(&self) -> Allowance {
        // A time too long for the clock is not a bound.
        let end = self.max_time.and_then(|t| Instant::now().checked_add(t));
        Allowance::new(u64::MAX, end)
    }

    pub(crate) fn max_time(&self) -> Option<Duration> {
        self.max_time
    }

    pub(crate) fn max_memory(&self) -> Option<u64> {
        self.max_memory
    }

    /// The error of a loop that ended because the time was up.
    #[cfg(feature = "sound")]
    pub(crate) fn time_is_up(&self) -> anyhow::Error {
        anyhow::Error::msg(late(self.max_time.unwrap_or_default()))
    }
}

fn late(time: Duration) -> String {
    format!(
        "not done within {} s (--max-time); raise the limit or reduce the work",
        time.as_secs_f64()
    )
}

/// Ends the process of a bake of `scene` once it exceeds a limit by more than its own looks at clock and memory let it.
pub(crate) fn watch_bake(
    scene: &str,
    max_time: Option<Duration>,
    max_memory: Option<u64>,
) -> anyhow::Result<()> {
    // A bake may hold its memory beside that of the program; a tenth for what is taken between two looks.
    let hard = max_memory.map(|bytes| bytes.saturating_add(PROGRAM));
    let hard = hard.map(|bytes| bytes.saturating_add(bytes / 10));
    // Where the memory of a process is unknown, that of a bake is estimated alone.
    watch_over(
        format!("{scene}: "),
        max_time,
        hard.filter(|_| memory().is_some()),
    )
}

/// Ends the process once it exceeds a limit.
pub(crate) fn watch(max_time: Option<Duration>, max_memory: Option<u64>) -> anyhow::Result<()> {
    watch_over(String::new(), max_time, max_memory)
}

/// Works as [`watch`]; messages begin with `subject`.
fn watch_over(
    subject: String,
    max_time: Option<Duration>,
    max_memory: Option<u64>,
) -> anyhow::Result<()> {
    if max_memory.is_some() && memory().is_none() {
        bail!("--max-memory: this system does not report the memory of a process");
    }
    if max_time.is_none() && max_memory.is_none() {
        return Ok(());
    }
    let start = Instant::now();
    let hard = max_time.map(with_grace);
    let look = move || loop {
        if hard.is_some_and(|t| start.elapsed() >= t) {
            end(&format!("{subject}{}", late(max_time.unwrap_or_default())));
        }
        if let Some((taken, most)) = memory()
            .zip(max_memory)
            .filter(|(taken, most)| taken > most)
        {
            let [taken, most] = [taken, most].map(|b| b as f64 / f64::from(1 << 20));
            end(&format!(
                "{subject}uses {taken:.0} MiB, and {most:.0} MiB were allowed (--max-memory); raise the limit or reduce the work"
            ));
        }
        // Without a bound on memory, there is nothing to check before the time is up.
        let left = hard.map_or(Duration::MAX, |t| t.saturating_sub(start.elapsed()));
        let pause = if max_memory.is_some() {
            PAUSE.min(left)
        } else {
            left
        };
        thread::sleep(pause.max(Duration::from_millis(1)));
    };
    thread::Builder::new()
        .name("limits".into())
        .spawn(look)
        .context("cannot watch over time and memory")?;
    Ok(())
}

/// Reports the reason, and ends the process as soon as no output is being written.
fn end(why: &str) -> ! {
    let start = Instant::now();
    // Held to the end, so that no output begins.
    let _none_is_written = loop {
        match WRITING.try_lock() {
            Err(TryLockError::WouldBlock) if start.elapsed() < WRITING_TIME => {
                thread::sleep(Duration::from_millis(1));
            }
            lock => break lock,
        }
    };
    let _ = writeln!(Warned, "enfilade: {why}");
    // Skips the exit handlers of drivers, which would free memory that their threads still use.
    signal_hook::low_level::exit(1);
}

/// Resident memory. [Units: bytes]
fn memory() -> Option<u64> {
    Some(memory_stats::memory_stats()?.physical_mem as u64)
}
