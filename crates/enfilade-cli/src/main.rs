//! The `enfilade` command: arguments → library calls → report.
//!
//! Results go to standard output, progress and messages to standard error; `--quiet` leaves only errors and warnings.
//! `-` is standard input among inputs and standard output among outputs; in the latter case, results go to standard
//! error, too.
//!
//! Exit code 0: done; 1: failed, or a promise is broken (the message says why and what to do); 2: wrong usage.

mod assemble;
mod bake;
mod decimate;
mod demo;
mod edit;
#[cfg(feature = "render")]
mod exact;
#[cfg(not(feature = "render"))]
#[path = "exact_left_out.rs"]
mod exact;
mod export;
mod formats;
mod generate;
mod inspect;
mod job;
mod kit;
mod limits;
#[cfg_attr(
    not(feature = "view"),
    allow(dead_code, reason = "the window shows more of it than pictures")
)]
mod living;
mod locate;
mod manual;
mod name;
mod output;
#[cfg(feature = "pack")]
mod pack;
mod path;
mod pieces;
mod plan;
#[cfg(feature = "render")]
mod portals;
mod progress;
mod progress_lines;
mod pvs;
mod rebake;
#[cfg(feature = "render")]
mod render;
#[cfg(feature = "report")]
mod report;
mod reviewed;
mod screen;
mod see;
#[cfg(feature = "serve")]
mod serve;
mod simplify;
#[cfg(feature = "sound")]
mod sound;
mod specials;
mod verify;
#[cfg(feature = "view")]
mod view;
mod walk;
#[cfg(feature = "report")]
mod walk_page;

use std::io::Write;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use enfilade::geom::shown;
use enfilade::internals::geom::is_hidden;
use enfilade::internals::import::is_panic_caught;
use screen::{Warned, be_quiet, is_broken_pipe};

/// Finds the rooms and doorways of a 3D scene and computes what is visible from where.
#[derive(Parser)]
// The name and version that worlds record as their generator.
#[command(name = "enfilade", version, about)]
struct Cli {
    /// Print only errors and warnings about the result on standard error.
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Assemble(assemble::Assemble),
    Bake(bake::Bake),
    Completions(manual::Completions),
    Decimate(decimate::Decimate),
    Demo(demo::Demo),
    Edit(edit::Edit),
    Export(export::Export),
    Generate(generate::Generate),
    Inspect(inspect::Inspect),
    Job(job::Job),
    Kit(kit::KitCheck),
    Locate(locate::Locate),
    Man(manual::Man),
    Name(name::Name),
    #[cfg(feature = "pack")]
    Pack(pack::Pack),
    Path(path::WalkedPath),
    Plan(plan::Plan),
    #[cfg(feature = "render")]
    Portals(portals::Portals),
    Pvs(pvs::Pvs),
    Rebake(rebake::Rebake),
    #[cfg(feature = "render")]
    Render(render::Render),
    #[cfg(feature = "report")]
    Report(report::Report),
    See(see::See),
    #[cfg(feature = "serve")]
    Serve(serve::Serve),
    Simplify(simplify::Simplify),
    #[cfg(feature = "sound")]
    Sound(sound::Sound),
    #[cfg(feature = "pack")]
    Unpack(pack::Unpack),
    Verify(verify::Verify),
    #[cfg(feature = "view")]
    View(view::View),
}

fn run(cli: Cli) -> anyhow::Result<()> {
    if cli.quiet {
        be_quiet();
    }
    match cli.command {
        Command::Assemble(args) => assemble::run(&args),
        Command::Bake(args) => bake::run(&args),
        Command::Completions(args) => manual::completions(&args, Cli::command()),
        Command::Decimate(args) => decimate::run(&args),
        Command::Demo(args) => demo::run(&args),
        Command::Edit(args) => edit::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Generate(args) => generate::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Job(args) => job::run(&args),
        Command::Kit(args) => kit::run(&args),
        Command::Locate(args) => locate::run(&args),
        Command::Man(args) => manual::man(&args, Cli::command()),
        Command::Name(args) => name::run(&args),
        #[cfg(feature = "pack")]
        Command::Pack(args) => pack::pack(&args),
        Command::Path(args) => path::run(&args),
        Command::Plan(args) => plan::run(&args),
        #[cfg(feature = "render")]
        Command::Portals(args) => portals::run(&args),
        Command::Pvs(args) => pvs::run(&args),
        Command::Rebake(args) => rebake::run(&args),
        #[cfg(feature = "render")]
        Command::Render(args) => render::run(&args),
        #[cfg(feature = "report")]
        Command::Report(args) => report::run(&args),
        Command::See(args) => see::run(&args),
        #[cfg(feature = "serve")]
        Command::Serve(args) => serve::run(&args),
        Command::Simplify(args) => simplify::run(&args),
        #[cfg(feature = "sound")]
        Command::Sound(args) => sound::run(&args),
        #[cfg(feature = "pack")]
        Command::Unpack(args) => pack::unpack_world(&args),
        Command::Verify(args) => verify::run(&args),
        #[cfg(feature = "view")]
        Command::View(args) => view::run(&args),
    }
}

/// Keeps quiet about panics of other people's readers that become errors naming a damaged file; all others are reported.
fn silence_caught_panics() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !is_panic_caught() {
            usual(panic);
        }
    }));
}

fn main() -> ExitCode {
    silence_caught_panics();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => wrong_usage(&error),
    };
    match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        // The reader closed our output early, as in `enfilade inspect X.glb | head`.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(Warned, "enfilade: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Commands that this build leaves out, and the features that have them.
const LEFT_OUT: &[[&str; 2]] = &[
    #[cfg(not(feature = "pack"))]
    ["pack", "pack"],
    #[cfg(not(feature = "render"))]
    ["portals", "render"],
    #[cfg(not(feature = "render"))]
    ["render", "render"],
    #[cfg(not(feature = "report"))]
    ["report", "report"],
    #[cfg(not(feature = "serve"))]
    ["serve", "serve"],
    #[cfg(not(feature = "sound"))]
    ["sound", "sound"],
    #[cfg(not(feature = "pack"))]
    ["unpack", "pack"],
    #[cfg(not(feature = "view"))]
    ["view", "view"],
];

/// Ends with a usage error, or with the requested help. The message repeats arguments, which a shell may make from
/// file names: arguments with hidden characters are shown escaped.
fn wrong_usage(error: &clap::Error) -> ! {
    let asked = std::env::args().nth(1).unwrap_or_default();
    if let Some([_, feature]) = LEFT_OUT.iter().find(|[command, _]| *command == asked) {
        let _ = writeln!(
            Warned,
            "enfilade: this build leaves out `{asked}`; build it with the feature `{feature}`, or take the released binary"
        );
        std::process::exit(error.exit_code());
    }
    let args = || std::env::args_os().map(|a| a.to_string_lossy().into_owned());
    if args().any(|a| a.contains(is_hidden)) {
        let args = args().map(|a| shown(a).to_string());
        match Cli::try_parse_from(args) {
            Err(error) => error.exit(),
            Ok(_) => {
                let _ = writeln!(Warned, "{}", error.render());
                std::process::exit(error.exit_code());
            }
        }
    }
    error.exit()
}
