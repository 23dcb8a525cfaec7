//! `enfilade assemble`: puts a level together from a kit.

use std::path::{Path, PathBuf};

use anyhow::Context;
use enfilade::kit::Assembly;

use crate::formats::Format;
use crate::kit::{build_level, read_kit, read_level, write_level};
use crate::limits::Limits;
use crate::output::Outputs;

/// Puts a level together from the pieces of a kit, doorway to doorway, without a bake.
///
/// LEVEL.toml names the kit's folder and lists places, each a piece at a position or with one of its attachments onto that of an
/// earlier one. What does not fit or is in the way is refused, with the place and by how much; nothing is written then.
#[derive(clap::Args)]
pub(crate) struct Assemble {
    /// Level: `kit = "DIR"` and a list of places.
    #[arg(value_name = "LEVEL.toml")]
    level: PathBuf,
    /// World to write, one GLB; `-` for standard output.
    #[arg(short, long, value_name = "OUT.glb")]
    output: PathBuf,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

pub(crate) fn run(args: &Assemble) -> anyhow::Result<()> {
    args.limits.begin()?;
    let mut outputs = Outputs::reading([&args.level])?;
    outputs.write("-o", Format::World, &args.output)?;
    let file = read_level(&args.level)?;
    let near = args.level.parent().unwrap_or(Path::new(""));
    let folder = read_kit(&near.join(&file.kit))?;
    outputs.read(&folder.files)?;
    let mut level = Assembly::new(folder.kit);
    level.set_tolerance(folder.tolerance);
    build_level(&file, &mut level).with_context(|| args.level.display().to_string())?;
    write_level(&level, &args.output, &outputs, args.json)
}
