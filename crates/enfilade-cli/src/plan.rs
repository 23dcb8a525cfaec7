//! `enfilade plan`: a floor plan per storey.

use std::path::PathBuf;

use anyhow::bail;
use enfilade_report::{PlanOptions, plan_svg};

use crate::formats::Format;
use crate::output::{Outputs, Written, print_json, write_whole};
use enfilade_cli::input::name_of;
use enfilade_cli::world::read_world;

/// Draws the floor plan of every storey as one SVG: rooms colored, doorways at their width.
#[derive(clap::Args)]
pub(crate) struct Plan {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// Where to write the drawing; `-` for standard output.
    #[arg(short, long, value_name = "SVG")]
    output: PathBuf,
    /// Height of the cut above each storey's floor, in meters.
    #[arg(long, default_value_t = 1.2, value_name = "METERS", value_parser = height)]
    height: f64,
    /// Print what was written as JSON for machines; nothing is printed otherwise.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Plan) -> anyhow::Result<()> {
    let mut outputs = Outputs::reading([&args.world])?;
    outputs.write("-o", Format::Plan, &args.output)?;
    let world = read_world(&args.world)?;
    if let Err(errors) = world.validate() {
        let first = errors.first().map(ToString::to_string).unwrap_or_default();
        bail!(
            "{}: the world is broken, so no plan is drawn: {first}",
            name_of(&args.world)
        );
    }
    let svg = plan_svg(
        &world,
        &PlanOptions {
            cut_height: args.height,
        },
    );
    write_whole(&args.output, svg.as_bytes())?;
    if args.json {
        print_json(
            outputs.printed(),
            &Written::new(&args.output, svg.as_bytes()),
        )?;
    }
    Ok(())
}

fn height(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x < 100.0 => Ok(x),
        _ => Err("a height in meters between 0 and 100 is needed, e.g. 1.2".into()),
    }
}
