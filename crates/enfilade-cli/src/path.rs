//! `enfilade path`: finds the walk from one point to another.

pub(crate) mod refusal;

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, bail};
use enfilade::geom::DVec3;
use enfilade::world::{Agent, PartId, Path, Space};

use self::refusal::{MovedEnd, Wanted};
use crate::formats::Format;
use crate::limits::Limits;
use crate::output::Outputs;
use crate::screen::{Warned, print_json, printed_at_once};
use crate::walk::{self, Walks, WorldFile};
use enfilade_cli::input::{is_address, is_stream};
use enfilade_cli::values::point;
use enfilade_cli::world::read_world_hashed;

/// Prints the walk from one point to another: its length, the portals it passes, and the points where it bends.
///
/// Leads over floors, stairs and ramps, around walls and furniture; through doors, which the walker opens except for
/// `--closed`, not through windows.
#[derive(clap::Args)]
pub(crate) struct WalkedPath {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// Start, in meters: at the feet, or at any height up to the head.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    from: [f32; 3],
    /// End, in meters.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    to: [f32; 3],
    /// Distance that the walker keeps from walls and furniture, in meters.
    #[arg(long, value_name = "METERS", default_value_t = 0.25)]
    radius: f64,
    /// The walker's height, in meters.
    #[arg(long, value_name = "METERS", default_value_t = 1.8)]
    height: f64,
    /// The highest step, up or down, in meters.
    #[arg(long, value_name = "METERS", default_value_t = 0.3)]
    step: f64,
    /// Closed portals, by number.
    #[arg(long, value_name = "PORTAL,…", value_delimiter = ',')]
    closed: Vec<u32>,
    /// Walk through objects, such as furniture.
    #[arg(long)]
    no_objects: bool,
    /// Keep the map of floors beside the world, as `world.walk`: later runs for the same walker start at once, and `view` for
    /// the usual one.
    #[arg(long)]
    keep: bool,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// The output of `--json`.
#[derive(serde::Serialize)]
struct PathReport {
    length: f64,
    length_in_plan: f64,
    cells: Vec<u32>,
    portals: Vec<u32>,
    points: Vec<[f64; 3]>,
    /// Ends that are elsewhere than they were asked for.
    moved: Vec<MovedEnd>,
}

pub(crate) fn run(args: &WalkedPath) -> anyhow::Result<()> {
    args.limits.begin()?;
    for (name, value) in [("radius", args.radius), ("height", args.height)] {
        if !(value > 0.0 && value < 100.0) {
            bail!("--{name} {value}: a length above 0 and below 100 is needed");
        }
    }
    if !(0.0..100.0).contains(&args.step) {
        bail!("--step {}: a length of at least 0 is needed", args.step);
    }
    if args.keep {
        if is_stream(&args.world) || is_address(&args.world) {
            bail!("--keep writes a file beside the world; give it a file, not '-' or an address");
        }
        let mut outputs = Outputs::reading([&args.world])?;
        outputs.write("--keep", Format::Walk, &walk::beside(&args.world))?;
    }
    let (world, hash) = read_world_hashed(&args.world)?;
    let n_portals = world.graph.portals.len();
    if let Some(p) = args.closed.iter().find(|p| **p as usize >= n_portals) {
        bail!("--closed {p}: the world has {n_portals} portals, counted from 0");
    }
    let names: Vec<String> = world.graph.cells.iter().map(|c| c.name.clone()).collect();
    let space = Space::new(world)?;
    let walker = Agent {
        radius: args.radius,
        height: args.height,
        step: args.step,
        ..Agent::default()
    };
    let walks = Walks {
        agent: walker,
        objects: !args.no_objects,
    };
    let file = WorldFile {
        path: &args.world,
        hash,
    };
    let map = walk::kept_or_made(Some(file), &space, &walks);
    if args.keep {
        walk::keep(file, &space, &walks, &map)?;
    }
    let exact = |p: [f32; 3]| DVec3::from_array(p.map(f64::from));
    let wanted = Wanted {
        space: &space,
        map: &map,
        walks,
        ends: [exact(args.from), exact(args.to)],
        options: ["--from", "--to"],
        closed: &args.closed,
    };
    let mut path = Path::default();
    wanted.find(&mut path)?;
    let moved = wanted.moved(&path);
    for end in &moved {
        writeln!(Warned, "{}", wanted.told(end))?;
    }
    let layout = space.layout(PartId::ROOT);
    let start = layout.locate(path.points[0].at + DVec3::Y * 0.5 * args.height);
    let cells = path.portals.iter().map(|p| p.exit.to);
    let report = PathReport {
        length: path.length,
        length_in_plan: path.length_in_plan,
        cells: start.into_iter().chain(cells).map(|c| c.0).collect(),
        portals: path.portals.iter().map(|p| p.exit.portal.0).collect(),
        points: path.points.iter().map(|p| p.at.to_array()).collect(),
        moved,
    };
    let mut out = printed_at_once();
    if args.json {
        return print_json(out, &report);
    }
    let many = |n: usize, thing: &str| format!("{n} {thing}{}", if n == 1 { "" } else { "s" });
    writeln!(
        out,
        "{:.2} m ({:.2} m in plan), {}, {}",
        report.length,
        report.length_in_plan,
        many(report.portals.len(), "portal"),
        many(report.points.len(), "point")
    )?;
    let name = |c: u32| names[c as usize].as_str();
    if let Some(&first) = report.cells.first() {
        writeln!(out, "from {}", name(first))?;
    }
    for exit in path.portals.iter().map(|p| p.exit) {
        writeln!(
            out,
            "{:>12}  into {}",
            exit.portal.to_string(),
            name(exit.to.0)
        )?;
    }
    for [x, y, z] in &report.points {
        writeln!(out, "{x:>10.3} {y:>10.3} {z:>10.3}")?;
    }
    out.flush().context("cannot write to standard output")
}
