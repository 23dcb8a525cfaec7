//! The experiments behind `docs/benchmarks/`: run by `cargo xtask bench NAME`, printed as Markdown tables or as lines
//! of JSON.

// A program that prints tables, which the workspace's lints forbid.
#![allow(clippy::print_stdout)]

mod input;
mod kept;
mod measure;
mod paths;
mod process;
mod render;
mod rooms;
mod rows;
mod sight;
mod size;
mod sound;
mod stream;
mod table;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use enfilade::runtime::SightOptions;

use input::Trust;
use input::tampered::bench_tampered;
use process::scenes_in;
use render::textures::{PortalTextures, bench_portal_textures};
use rooms::bsp::{bench_bsp, bench_simplify};
use rooms::builders::bench_builders;
use rooms::facts::bench_facts;
use rooms::score::bench_score;
use rooms::{Messy, Worlds};
use rows::{Chosen, Row, RowPrinter, bench_rows};
use sight::facade::bench_facade;
use sight::see::{bench_los, bench_maze, bench_see, bench_tight};
use sight::walkthrough::{self, Walkthrough};
use size::growth::bench_growth;
use table::Table;

/// Segments and rays of `verify`.
const RAYS: u64 = 1_000_000;

/// Measure, and print the tables of the documentation.
#[derive(Parser)]
#[command(name = "cargo xtask bench", version)]
struct Cli {
    #[command(subcommand)]
    what: What,
    /// Print a line of JSON for each row.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(clap::Subcommand)]
enum What {
    /// Inputs of any size: a row per figure, with the value that it must reach.
    AnySize(Chosen),
    /// A measurement of `any-size`, in a process of its own.
    #[command(hide = true)]
    SizeStep {
        step: size::SizeStep,
        /// The generated scene, such as `town-1000`.
        scene: String,
    },
    /// Levels put together from pieces: a row per figure, with the value that it must reach. Rows: stitched, speed, memory, city,
    /// local rebuild, undo, bad input.
    Constructive(Chosen),
    /// A measurement of `constructive`, in a process of its own.
    #[command(hide = true)]
    LevelStep {
        step: size::levels::LevelStep,
        /// The generated level, such as `dungeon-380`.
        scene: String,
    },
    /// Rooms of sources that are not triangles: a row per figure, with the value that it must reach.
    AnySource(Chosen),
    /// Value of worlds to programs and modelers: a row per figure, with the value that it must reach.
    Bring(Chosen),
    /// Rooms and doors as architects mean them: a row per figure, with the value that it must reach.
    /// Rows: first, more, scenes3 (each with rooms, doors, windows, extra, spare, cells, cracks), openings, levels, spoilt, verify.
    Rooms {
        #[command(flatten)]
        chosen: Chosen,
        /// Segments that `verify` tries, and as many rays; a hundredth as many views.
        #[arg(long, default_value_t = RAYS)]
        rays: u64,
        /// Do not bake again what an earlier run of the same build has baked.
        #[arg(long)]
        keep: bool,
    },
    /// Levels of games and small cases with known answers: a row per figure, with the value that it must reach.
    Levels(Chosen),
    /// Decisions of a bake: numbers, code, answers to why, and how well the verdict knows which worlds are wrong. Rows: one labelling,
    /// numbers, code, why, verdict.
    Judge(Chosen),
    /// Facts of all decisions of all buildings with truth, by rule; with `--csv` each of them, labelled right or wrong.
    Facts {
        #[command(flatten)]
        chosen: Chosen,
        /// Print each decision with its facts as CSV.
        #[arg(long)]
        csv: bool,
    },
    /// Rooms for other trades: a row per figure, with the value that it must reach. Rows: open rooms, neighbors, spaces, map labels.
    Exports(Chosen),
    /// Things, paths, sound, contacts and moving rooms: a row per figure, with the value that it must reach.
    Living(Chosen),
    /// Special portals, such as mirrors: a row per figure, with the value that it must reach.
    Portals(Chosen),
    /// Doorways drawn as pictures: a row per figure, with the value that it must reach. Rows: model, portal culling, error,
    /// pops, figures.
    PortalTextures {
        #[command(flatten)]
        chosen: Chosen,
        #[command(flatten)]
        options: PortalTextures,
    },
    /// Worlds in pieces over a simulated link: a row per figure, with the value that it must reach.
    Stream(Chosen),
    /// A step of the row `size` of `stream`, in a process of its own.
    #[command(hide = true)]
    Town {
        step: stream::TownStep,
        /// The generated town, such as `offices-10000`.
        scene: String,
        /// Folder of the packed town.
        dir: PathBuf,
    },
    /// Rooms, doors and windows found, compared with those that architects modeled; fails below the floors.
    Score {
        /// Folders with `scene.glb` and `truth.json`; all real scenes if there are none.
        dirs: Vec<PathBuf>,
        /// All scenes in this folder.
        #[arg(long = "scenes", value_name = "DIR")]
        folders: Vec<PathBuf>,
        /// Worlds baked before, each named as its scene.
        #[arg(long, value_name = "DIR")]
        baked: Option<PathBuf>,
        /// Write the table to docs/benchmarks/rooms.md.
        #[arg(long)]
        write: bool,
    },
    /// Growth of time and memory of a bake with the size of an office tower.
    Growth {
        /// The voxel kernels beside other implementations too, with inputs from these scripts
        /// (scripts/bench_kernels.py).
        #[arg(long, value_name = "DIR")]
        peers: Option<PathBuf>,
        /// Write the table to docs/benchmarks/growth.md.
        #[arg(long)]
        write: bool,
    },
    /// Scenes of strangers: a row per figure, with the value that it must reach. Rows:
    /// axes, kinds, merged, verdict.
    Stranger(Chosen),
    /// Robustness of rooms and doors against disturbed models: a row per figure, with the value that it must reach.
    /// Rows: moved, missing, quantized, unnamed, exact, undisturbed, fault, foreign.
    Messy {
        #[command(flatten)]
        chosen: Chosen,
        /// Segments that `verify` tries, and as many rays.
        #[arg(long, default_value_t = RAYS)]
        rays: u64,
    },
    /// Hostile and huge input: a row per figure, with the value that it must reach. Rows: bound, case, commands,
    /// estimate, gate, habits, large, mutated, nasty, order, tampered, tight.
    Trust {
        #[command(flatten)]
        chosen: Chosen,
        #[command(flatten)]
        options: Trust,
    },
    /// Tampered worlds, those of a generated house included: at how many of three places the defaults find each kind.
    /// Prints lines of JSON, the input of `bench trust`.
    Tampered {
        /// Folders with `scene.glb` and optionally `detail.glb`
        scenes: Vec<PathBuf>,
        /// Only kinds whose names begin with one of these.
        #[arg(long, value_delimiter = ',', value_name = "KIND,...")]
        kinds: Vec<String>,
    },
    /// Binary space partition: tree, portals, separators, cells.
    Bsp {
        /// Scenes: Quake maps and any others.
        scenes: Vec<PathBuf>,
        /// All heuristics, not only the default.
        #[arg(long)]
        heuristics: bool,
        /// Bake to the end, with cells merged up to the threshold.
        #[arg(long)]
        bake: bool,
        /// Merging threshold in polygons of the tree, as in the paper; objects do not count.
        #[arg(long, default_value_t = 50.0)]
        min_polygons: f64,
        /// Polygons of generated clinics, e.g. 11600,50000,200000; prints the growth between them.
        #[arg(long, value_delimiter = ',')]
        clinic: Vec<usize>,
    },
    /// All builders on the same scenes: cells, portals, agreement, promises.
    Builders {
        /// Scene files, or folders with `scene.glb` and optionally `detail.glb`
        #[arg(required = true)]
        scenes: Vec<PathBuf>,
        /// Rays that test the promises of each world.
        #[arg(long, default_value_t = 100_000)]
        rays: u64,
    },
    /// Simplifier: expected triangles by either metric at the same number of portals.
    Simplify {
        /// Worlds.
        worlds: Vec<PathBuf>,
    },
    /// Time of a view: in worlds, in portal files, in generated offices, in a courtyard.
    See {
        /// Worlds (`.glb`) and Quake portal files (`.prt`).
        scenes: Vec<PathBuf>,
        /// Numbers of rooms of generated offices, e.g. 100,1000,10000.
        #[arg(long, value_delimiter = ',')]
        rooms: Vec<usize>,
        /// Views per scene.
        #[arg(long, default_value_t = 2000)]
        views: usize,
    },
    /// Time of a view of towers with many windows, with portals in groups and one by one.
    Facade {
        /// Numbers of windows of the towers.
        #[arg(long, value_delimiter = ',', default_values_t = [64, 1024, 10_000])]
        windows: Vec<usize>,
        /// Views per place.
        #[arg(long, default_value_t = 500)]
        views: usize,
    },
    /// Tightness: size of the answer relative to the objects that rays hit, from ordinary eyes indoors.
    Tight {
        /// Worlds.
        scenes: Vec<PathBuf>,
        /// Views per world.
        #[arg(long, default_value_t = 300)]
        views: u64,
        /// Rays per view.
        #[arg(long, default_value_t = 20_000)]
        rays: u64,
    },
    /// Dirkse's maze: share of the triangles processed on a path of 290 views.
    Maze {
        /// The maze, baked.
        world: PathBuf,
        /// Views on the path.
        #[arg(long, default_value_t = 290)]
        views: usize,
        /// Vertical angle of view, in degrees; the picture is 4:3.
        #[arg(long, default_value_t = 60.0)]
        fov: f32,
        /// Triangles per chunk.
        #[arg(long, default_value_t = SightOptions::default().chunk_triangles)]
        chunk: usize,
    },
    /// A walk through rooms: drawn whole, with frustum culling, and by portals.
    Walkthrough(Walkthrough),
    /// Lines of sight by cells, compared with one tree of the whole world.
    Los {
        /// Worlds.
        scenes: Vec<PathBuf>,
        /// Numbers of rooms of generated offices.
        #[arg(long, value_delimiter = ',')]
        rooms: Vec<usize>,
        /// Pairs of points per scene.
        #[arg(long, default_value_t = 1_000_000)]
        pairs: usize,
    },
}

/// Returns the rows that a name stands for, if they share nothing.
fn rows_of(what: &What) -> Option<(&Chosen, &'static [&'static [Row]])> {
    Some(match what {
        What::AnySize(chosen) => (chosen, &[size::ROWS]),
        What::AnySource(chosen) => (chosen, &[input::sources::ROWS]),
        What::Constructive(chosen) => (chosen, &[size::levels::ROWS]),
        What::Bring(chosen) => (chosen, &[sight::VALUE]),
        What::Judge(chosen) => (chosen, &[rooms::DECISIONS]),
        What::Exports(chosen) => (chosen, &[rooms::EXPORTS]),
        What::Living(chosen) => (
            chosen,
            &[paths::MOVING, render::LAMPS, paths::WALKING, sound::ROWS],
        ),
        What::Portals(chosen) => (chosen, &[render::SPECIALS, sight::SPECIALS]),
        What::Stranger(chosen) => (chosen, &[rooms::FOREIGN]),
        What::Stream(chosen) => (chosen, &[stream::ROWS]),
        _ => return None,
    })
}

fn run(args: &Cli) -> anyhow::Result<()> {
    let json = args.json;
    if let Some((chosen, lists)) = rows_of(&args.what) {
        return bench_rows(lists, json, chosen, ());
    }
    match &args.what {
        What::Levels(chosen) => {
            bench_rows(&[rooms::LEVELS], json, chosen, Worlds::new(RAYS, false)?)
        }
        What::Rooms { chosen, rays, keep } => {
            let worlds = Worlds::new(*rays, *keep)?;
            bench_rows(&[rooms::BUILDINGS], json, chosen, worlds)
        }
        What::Messy { chosen, rays } => {
            let mut out = RowPrinter::new(json, chosen, Messy::new(*rays));
            out.run(rooms::DISTURBED)?;
            out.report();
            Ok(())
        }
        What::Trust { chosen, options } => {
            bench_rows(&[input::HOSTILE], json, chosen, options.begin()?)
        }
        What::PortalTextures { chosen, options } => bench_portal_textures(options, chosen, json),
        What::SizeStep { step, scene } => size::run_step(*step, scene),
        What::LevelStep { step, scene } => size::levels::run_step(*step, scene),
        What::Town { step, scene, dir } => stream::run_step(*step, scene, dir),
        What::Facts { chosen, csv } => bench_facts(chosen, *csv),
        What::Tampered { scenes, kinds } => bench_tampered(scenes, kinds),
        _ => print_table(args),
    }
}

/// Prints a table of the documentation.
fn print_table(args: &Cli) -> anyhow::Result<()> {
    let mut table = Table::new(args.json);
    match &args.what {
        What::Score {
            dirs,
            folders,
            baked,
            write,
        } => {
            let found = folders.iter().flat_map(|folder| scenes_in(folder));
            let dirs: Vec<PathBuf> = dirs.iter().cloned().chain(found).collect();
            bench_score(&mut table, &dirs, baked.as_deref(), *write)?;
        }
        What::Growth { peers, write } => bench_growth(&mut table, peers.as_deref(), *write)?,
        What::Bsp {
            scenes,
            heuristics,
            bake,
            min_polygons,
            clinic,
        } => bench_bsp(
            &mut table,
            scenes,
            clinic,
            *heuristics,
            bake.then_some(*min_polygons),
        )?,
        What::Builders { scenes, rays } => bench_builders(&mut table, scenes, *rays)?,
        What::Simplify { worlds } => bench_simplify(&mut table, worlds)?,
        What::See {
            scenes,
            rooms,
            views,
        } => bench_see(&mut table, scenes, rooms, *views)?,
        What::Tight {
            scenes,
            views,
            rays,
        } => bench_tight(&mut table, scenes, *views, *rays)?,
        What::Facade { windows, views } => bench_facade(&mut table, windows, *views)?,
        What::Maze {
            world,
            views,
            fov,
            chunk,
        } => bench_maze(&mut table, world, *views, *fov, *chunk)?,
        What::Walkthrough(args) => walkthrough::bench(&mut table, args)?,
        What::Los {
            scenes,
            rooms,
            pairs,
        } => bench_los(&mut table, scenes, rooms, *pairs)?,
        _ => {}
    }
    table.finish()
}

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("bench: {error:#}");
            ExitCode::FAILURE
        }
    }
}
