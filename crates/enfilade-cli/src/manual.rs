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

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use clap::CommandFactory;

    use super::*;
    use crate::Cli;

    /// Pages of docs by command.
    const PAGES: [(&str, &str); 14] = [
        ("bake", "sources.md"),
        ("decimate", "decimate.md"),
        ("edit", "mirrors.md"),
        ("export", "your-engine.md"),
        ("job", "jobs.md"),
        ("kit", "kits.md"),
        ("assemble", "kits.md"),
        ("generate", "kits.md"),
        ("pack", "packed.md"),
        ("unpack", "packed.md"),
        ("serve", "packed.md"),
        ("rebake", "rebake.md"),
        ("verify", "verify.md"),
        ("view", "editing.md"),
    ];

    const INTRO: &str = "# Commands

Written from `--help` by `ENFILADE_WRITE=1 cargo test -p enfilade-cli commands_page`.

Results go to standard output, progress and messages to standard error. `--json` prints the results as one JSON object on one line (all
commands but `view`, `completions` and `man`). `--quiet` (`-q`, all commands) reduces standard error to errors, and warnings that a result
differs from the request or is probably not what you meant.

";

    fn cell(text: &str) -> String {
        let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
        line.replace('|', "\\|").replace('<', "&lt;")
    }

    /// Adds the section of a command, and of the commands below it.
    fn add_section(out: &mut String, names: &str, command: &mut clap::Command) {
        let about = command.get_long_about().or(command.get_about());
        let about = about.map(ToString::to_string).unwrap_or_default();
        let usage = command.render_usage().to_string();
        let usage = usage.trim_start_matches("Usage: ");
        let _ = writeln!(out, "\n## {names}\n\n{}\n", about.replace('<', "&lt;"));
        let page = PAGES.iter().find(|p| p.0 == names);
        if let Some((_, page)) = page {
            let _ = writeln!(out, "More: [{page}]({page}).\n");
        }
        let _ = writeln!(out, "```sh\n{usage}\n```");
        let shown = |a: &&clap::Arg| {
            !a.is_hide_set() && !["help", "version", "quiet"].contains(&a.get_id().as_str())
        };
        let arguments: Vec<&clap::Arg> = command.get_arguments().filter(shown).collect();
        if !arguments.is_empty() {
            let _ = writeln!(out, "\n| option | does | default |\n| --- | --- | --- |");
        }
        for argument in arguments {
            let help = argument
                .get_help()
                .map(ToString::to_string)
                .unwrap_or_default();
            let defaults = argument
                .get_default_values()
                .iter()
                .map(|d| d.to_string_lossy());
            let default = match argument.get_action().takes_values() {
                true => defaults.collect::<Vec<_>>().join(" "),
                false => String::new(),
            };
            let _ = writeln!(
                out,
                "| `{argument}` | {} | {} |",
                cell(&help),
                cell(&default)
            );
        }
        for below in command.get_subcommands_mut() {
            let name = format!("{names} {}", below.get_name());
            add_section(out, &name, below);
        }
    }

    #[test]
    fn the_commands_page_is_that_of_help() {
        let mut all = Cli::command().disable_help_subcommand(true);
        all.build();
        let mut page = INTRO.to_owned();
        page += "| command | does |\n| --- | --- |\n";
        for command in all.get_subcommands() {
            let (name, about) = (command.get_name(), command.get_about());
            let about = about.map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(page, "| [`{name}`](#{name}) | {} |", cell(&about));
        }
        for command in all.get_subcommands_mut() {
            let name = command.get_name().to_owned();
            add_section(&mut page, &name, command);
        }
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/commands.md");
        if std::env::var_os("ENFILADE_WRITE").is_some() {
            std::fs::write(&path, &page).unwrap();
        }
        let written = std::fs::read_to_string(&path).unwrap();
        assert!(
            written == page,
            "docs/commands.md differs from --help: write it as its head says"
        );
    }
}
