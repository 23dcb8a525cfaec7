//! Options of the rows about hostile and huge input, the folder of their files, and timed runs of the command.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context;

use crate::process::{binary, target_dir};
use crate::rows::RowPrinter;

/// The choices and the folder that the rows share.
#[derive(Clone, clap::Args)]
pub(crate) struct Trust {
    /// Number of damaged files of `mutated`, of shuffles of each scene of `order`, and of kills of `leftovers`; 20,000, 20 and
    /// 200 by default.
    #[arg(long)]
    count: Option<usize>,
    /// Index of the first of them.
    #[arg(long, default_value_t = 0)]
    from: usize,
    /// Folder of inputs and outputs.
    #[arg(skip)]
    pub(super) folder: PathBuf,
}

impl Trust {
    /// Returns the same with a folder that is there.
    pub(crate) fn begin(&self) -> anyhow::Result<Self> {
        let folder = target_dir().join("trust");
        std::fs::create_dir_all(&folder)?;
        Ok(Self {
            folder,
            ..self.clone()
        })
    }

    /// Returns the indices of damaged files or shuffles to try, given their default number.
    pub(super) fn runs(&self, n: usize) -> Range<usize> {
        self.from..self.from.saturating_add(self.count.unwrap_or(n))
    }
}

/// The printed figures.
pub(super) type Figures<'a> = RowPrinter<'a, Trust>;

impl Figures<'_> {
    /// Runs the command `enfilade` under GNU time, for at most `most` seconds.
    pub(super) fn enfilade(&self, args: &[&str], most: u32) -> anyhow::Result<Ran> {
        let mut timed = Command::new("/usr/bin/time");
        timed.args(["-f", "%e %M", "timeout", &most.to_string()]);
        timed.arg(binary("enfilade")).args(args);
        let done = timed
            .current_dir(&self.state.folder)
            .output()
            .context("needs GNU time as /usr/bin/time (`apt-get install time`)")?;
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        let figures = said.lines().rev().find_map(|line| {
            let (seconds, kilobytes) = line.split_once(' ')?;
            Some((seconds.parse().ok()?, kilobytes.parse::<f64>().ok()?))
        });
        let (seconds, kilobytes) = figures.context("time printed no figures")?;
        Ok(Ran {
            code: done.status.code(),
            seconds,
            gigabytes: kilobytes / f64::from(1 << 20),
            said,
        })
    }

    pub(super) fn write(&self, name: &str, text: &str) -> anyhow::Result<()> {
        std::fs::write(self.state.folder.join(name), text).with_context(|| name.to_owned())
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.state.folder.join(name)
    }
}

/// The result of a command.
pub(super) struct Ran {
    pub(super) code: Option<i32>,
    pub(super) seconds: f64,
    /// Peak of resident memory. [Units: GiB]
    pub(super) gigabytes: f64,
    pub(super) said: String,
}

/// Returns `true` if a file has these bytes.
pub(super) fn holds(path: &Path, bytes: &[u8]) -> bool {
    std::fs::read(path).is_ok_and(|found| found == bytes)
}
