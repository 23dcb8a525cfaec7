//! `enfilade plan`: a floor plan per storey.

#[cfg_attr(not(feature = "print"), path = "plan/form_left_out.rs")]
mod form;

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::bail;
use enfilade::cpg::World;
use enfilade_report::{PlanOptions, Plans, Storey};

use crate::formats::Format;
use crate::limits::Limits;
use crate::output::{Outputs, Written, write_whole};
use crate::screen::{Warned, print_json};
use enfilade_cli::input::name_of;
use enfilade_cli::world::read_world;
use enfilade_report::{is_empty, why_empty};

/// Placeholder for a storey's name in the name of an output.
const PLACE: &str = "{}";

/// Draws floor plans: rooms colored and named, doorways at their width.
///
/// A storey consists of connected floors, none above another. Spaces without a floor to stand on have their own
/// plans, named 2a, 2b, …, if the plan of the storey below has no room for them. One sheet shows all plans; a PDF has
/// a page for each.
#[derive(clap::Args)]
pub(crate) struct Plan {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// File to write: a .svg or a .png with all plans on one sheet, or a .pdf with a page for each. With `{}` in the
    /// name, as in `plan-{}.svg`, one file for each storey, by its name. `-` is SVG to standard output.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Draw only this storey, given by its name, `1` or `2a`, or by the name of a room on it. May be repeated.
    #[arg(long, value_name = "N|ROOM")]
    storey: Vec<String>,
    /// Height of the cut above each floor, in meters.
    #[arg(long, default_value_t = 1.2, value_name = "METERS", value_parser = height)]
    height: f64,
    /// Draw a numbered ring where the bake decided, and list the reasons: the closest decisions first, then spaces as large as a room that
    /// are none, and openings that parted none; 40 at most.
    #[arg(long)]
    why: bool,
    #[cfg(feature = "print")]
    #[command(flatten)]
    print: form::PrintOptions,
    /// Print a report on the files as JSON for machines; nothing is printed otherwise.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// The output of `--json`.
#[derive(serde::Serialize)]
#[serde(untagged)]
enum PlanReport<'a> {
    One {
        #[serde(flatten)]
        written: Written,
        storeys: Vec<StoreyReport<'a>>,
    },
    Several {
        plans: Vec<PlanReport<'a>>,
    },
}

#[derive(serde::Serialize)]
struct StoreyReport<'a> {
    name: &'a str,
    floor: f64,
    /// Ids.
    cells: Vec<u32>,
}

pub(crate) fn run(args: &Plan) -> anyhow::Result<()> {
    args.limits.begin()?;
    let form = args.form()?;
    let name = args.output.file_name().unwrap_or_default();
    let is_several = name.to_string_lossy().contains(PLACE);
    let mut outputs = Outputs::reading([&args.world])?;
    if !is_several {
        outputs.write("-o", Format::Plan, &args.output)?;
    }
    let world = read(args)?;
    if is_empty(&world) {
        writeln!(
            Warned,
            "{} has no room, so that the plan shows the ground outdoors at most: {}",
            name_of(&args.world),
            why_empty(&world)
        )?;
    }
    let options = PlanOptions {
        cut_height: args.height,
        has_reasons: args.why,
    };
    let plans = Plans::new(&world, &options);
    let which = chosen(args, &plans)?;
    let jobs: Vec<(PathBuf, Vec<usize>)> = if is_several {
        let storeys: Vec<&Storey> = plans.storeys().collect();
        let path = |k: usize| named(&args.output, &storeys[k].name);
        which.iter().map(|&k| (path(k), vec![k])).collect()
    } else {
        vec![(args.output.clone(), which)]
    };
    if is_several {
        let paths: Vec<PathBuf> = jobs.iter().map(|j| j.0.clone()).collect();
        outputs.write_all("-o", Format::Plan, &paths)?;
    }
    let mut reports = Vec::new();
    for (path, which) in &jobs {
        let bytes = form.drawn(&plans, which)?;
        write_whole(path, &bytes)?;
        reports.push(PlanReport::One {
            written: Written::new(path, &bytes),
            storeys: plans
                .storeys()
                .enumerate()
                .filter(|(k, _)| which.contains(k))
                .map(|(_, storey)| StoreyReport::new(storey))
                .collect(),
        });
    }
    if !args.json {
        return Ok(());
    }
    let report = if is_several {
        PlanReport::Several { plans: reports }
    } else {
        reports.remove(0)
    };
    print_json(outputs.printed(), &report)
}

impl<'a> StoreyReport<'a> {
    fn new(storey: &'a Storey) -> Self {
        Self {
            name: &storey.name,
            floor: storey.floor,
            cells: storey.cells.iter().map(|c| c.0).collect(),
        }
    }
}

fn read(args: &Plan) -> anyhow::Result<World> {
    let world = read_world(&args.world)?;
    if let Err(errors) = world.validate() {
        let first = errors.first().map(ToString::to_string).unwrap_or_default();
        bail!(
            "{}: the world is broken, so no plan is drawn: {first}",
            name_of(&args.world)
        );
    }
    Ok(world)
}

/// The plans to draw, by index.
fn chosen(args: &Plan, plans: &Plans) -> anyhow::Result<Vec<usize>> {
    let mut out: Vec<usize> = Vec::new();
    for name in &args.storey {
        let found = plans.find(name);
        if found.is_empty() {
            let names: Vec<&str> = plans.storeys().map(|s| s.name.as_str()).collect();
            bail!(
                "{} has no storey {name}, and no room of that name; its storeys are {}",
                name_of(&args.world),
                if names.is_empty() {
                    "none".into()
                } else {
                    names.join(", ")
                }
            );
        }
        out.extend(found);
    }
    if args.storey.is_empty() {
        out.extend(0..plans.storeys().len());
    }
    out.sort_unstable();
    out.dedup();
    Ok(out)
}

/// The output's name for one storey.
fn named(path: &Path, storey: &str) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(name.replace(PLACE, storey))
}

fn height(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x < 100.0 => Ok(x),
        _ => Err("a height in meters between 0 and 100 is needed, e.g. 1.2".into()),
    }
}
