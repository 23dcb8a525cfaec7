//! `bench rooms`: rooms, doors and openings as architects mean them, clean and spoilt, on buildings and levels; each figure with its
//! bar. `bench levels`: those of levels of games alone.

mod advice;
mod bars;
mod hole;
mod levels;
mod marked;
mod openings;
mod sets;
mod spoilt;
mod verified;
mod worlds;

use crate::rows::{Chosen, RowPrinter};
use worlds::Worlds;

/// Segments and rays of `verify`.
const RAYS: u64 = 1_000_000;

/// The options of the bench.
#[derive(clap::Args)]
pub(crate) struct Rooms {
    #[command(flatten)]
    chosen: Chosen,
    /// Segments that `verify` tries, and as many rays; a hundredth as many views.
    #[arg(long, default_value_t = RAYS)]
    rays: u64,
    /// Do not bake again what an earlier run of the same build has baked.
    #[arg(long)]
    keep: bool,
}

/// Measures the rows of levels alone, each baked anew; an error if a bar is missed.
pub(crate) fn bench_levels(chosen: &Chosen, is_json: bool) -> anyhow::Result<()> {
    let mut out = RowPrinter::new(is_json);
    let mut worlds = Worlds::new(chosen, false)?;
    levels::run(&mut worlds, &mut out)?;
    verified::run_levels(&mut worlds, RAYS, &mut out)?;
    marked::run(chosen, &mut out)?;
    advice::run(chosen, &mut out)?;
    out.finish()
}

/// Measures the rows; an error if a bar is missed.
pub(crate) fn bench_rooms(options: &Rooms, is_json: bool) -> anyhow::Result<()> {
    let mut out = RowPrinter::new(is_json);
    let mut worlds = Worlds::new(&options.chosen, options.keep)?;
    sets::run(&mut worlds, &mut out);
    openings::run(&mut worlds, &mut out)?;
    levels::run(&mut worlds, &mut out)?;
    spoilt::run(&mut worlds, &mut out);
    verified::run(&mut worlds, options.rays, &mut out)?;
    out.finish()
}
