//! `enfilade completions` and `enfilade man`: shell completions and manual pages, generated from the commands.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap_complete::Shell;

use crate::formats::Format;
use crate::output::{Outputs, make_folder, write_unnamed};
use crate::screen::pass_on;

/// Prints a script that makes a shell complete commands and options.
#[derive(clap::Args)]
pub(crate) struct Completions {
    /// The shell; e.g. `enfilade completions bash > ~/.local/share/bash-completion/completions/enfilade`.
    shell: Shell,
}

/// Writes manual pages, one for each command; overwrites its own earlier pages, and no other file.
#[derive(clap::Args)]
pub(crate) struct Man {
    /// Folder for `enfilade.1`, `enfilade-bake.1` and so on; created if missing.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub(crate) fn completions(args: &Completions, mut command: clap::Command) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "enfilade", &mut script);
    // Written here: the generator ends the program if the reader has gone away.
    pass_on(|out| Ok(out.write_all(&script)?)).context("cannot write to standard output")
}

pub(crate) fn man(args: &Man, command: clap::Command) -> anyhow::Result<()> {
    make_folder("DIR", &args.folder)?;
    let mut command = command.disable_help_subcommand(true);
    command.build();
    let all = [&command].into_iter().chain(command.get_subcommands());
    let pages: Vec<clap_mangen::Man> = all.cloned().map(clap_mangen::Man::new).collect();
    let paths: Vec<PathBuf> = pages
        .iter()
        .map(|page| args.folder.join(page.get_filename()))
        .collect();
    Outputs::default().write_all("DIR", Format::Manual, &paths)?;
    let texts = pages.iter().map(|page| {
        let mut text = Vec::new();
        page.render(&mut text).map(|()| text)
    });
    let texts = texts.collect::<Result<Vec<_>, _>>()?;
    let files: Vec<(PathBuf, Vec<u8>)> = paths.into_iter().zip(texts).collect();
    write_unnamed("DIR", &files, is_page)
}

/// Returns `true` if a file is a manual page of this program, of any version.
fn is_page(path: &Path, bytes: &[u8]) -> bool {
    let title = format!(".TH {} 1", path.file_stem().unwrap_or_default().display());
    let mut lines = bytes.split(|&b| b == b'\n');
    lines.any(|line| line.starts_with(title.as_bytes()))
}
