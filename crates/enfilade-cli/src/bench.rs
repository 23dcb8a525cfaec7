//! `enfilade bench`: the experiments behind `docs/benchmarks/sight.md`, printed as Markdown tables.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use enfilade::cpg::{Cell, CellId, CellPortalGraph, Portal, PortalId, PortalKind, World};
use enfilade::geom::{DVec3, Winding};
use enfilade::import::read_prt;
use enfilade::runtime::{
    Narrowing, SeeOptions, Sight, SightOptions, SightState, Sightlines, View, Viewer,
};
use enfilade_testkit::{GridParams, Rng, courtyard, room_grid};
use enfilade_verify::{ViewOptions, ViewReport, verify_views};

use crate::bench_bsp::{bench_bsp, bench_simplify};
use crate::bench_builders::bench_builders;
use crate::bench_facade::bench_facade;
use crate::cameras::walk;
use crate::see::Answers;
use crate::walkthrough::{self, Walkthrough};
use crate::world::read_world;

/// Measures what can be seen and prints the tables of the documentation.
#[derive(clap::Args)]
pub(crate) struct Bench {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand)]
enum What {
    /// Binary space partition: tree, portals, separators, cells.
    Bsp {
        /// Scenes: Quake maps and any others.
        scenes: Vec<PathBuf>,
        /// All heuristics, not only the default.
        #[arg(long)]
        heuristics: bool,
        /// Bake to the end, cells merged up to the threshold.
        #[arg(long)]
        bake: bool,
        /// Merging threshold in polygons of the tree, as in the paper; objects do not count.
        #[arg(long, default_value_t = 50.0)]
        min_polygons: f64,
        /// Polygons of generated clinics, e.g. 11600,50000,200000; prints the growth between them.
        #[arg(long, value_delimiter = ',')]
        clinic: Vec<usize>,
    },
    /// The same scenes through each builder: cells, portals, how far they agree, promises.
    Builders {
        /// Scene files, or folders with `scene.glb` and perhaps `detail.glb`.
        #[arg(required = true)]
        scenes: Vec<PathBuf>,
        /// Rays that try the promises of each world.
        #[arg(long, default_value_t = 100_000)]
        rays: u64,
    },
    /// Simplifier: expected triangles by either metric at the same number of portals.
    Simplify {
        /// Worlds.
        worlds: Vec<PathBuf>,
    },
    /// Time of a view: in worlds, in portal files, in offices of so many rooms, in a courtyard.
    See {
        /// Worlds (`.glb`) and Quake portal files (`.prt`).
        scenes: Vec<PathBuf>,
        /// Rooms of generated offices, e.g. 100,1000,10000.
        #[arg(long, value_delimiter = ',')]
        rooms: Vec<usize>,
        /// Views of each.
        #[arg(long, default_value_t = 2000)]
        views: usize,
    },
    /// Time of a view of towers with so many windows, portals in groups and one by one.
    Facade {
        /// Windows of each tower.
        #[arg(long, value_delimiter = ',', default_values_t = [64, 1024, 10_000])]
        windows: Vec<usize>,
        /// Views from each place.
        #[arg(long, default_value_t = 500)]
        views: usize,
    },
    /// How much is answered beyond what rays hit, from ordinary eyes indoors.
    Tight {
        /// Worlds.
        scenes: Vec<PathBuf>,
        /// Views of each.
        #[arg(long, default_value_t = 300)]
        views: u64,
        /// Rays in each view.
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
        /// Height of the view, in degrees; it is 4:3.
        #[arg(long, default_value_t = 60.0)]
        fov: f32,
        /// Triangles culled together.
        #[arg(long, default_value_t = SightOptions::default().chunk_triangles)]
        chunk: usize,
    },
    /// A walk through rooms, drawn whole, with frustum culling and by portals.
    Walkthrough(Walkthrough),
    /// Lines of sight by cells against the tree of the whole world.
    Los {
        /// Worlds.
        scenes: Vec<PathBuf>,
        /// Rooms of generated offices.
        #[arg(long, value_delimiter = ',')]
        rooms: Vec<usize>,
        /// Pairs of points in each.
        #[arg(long, default_value_t = 1_000_000)]
        pairs: usize,
    },
}

pub(crate) fn run(args: &Bench) -> anyhow::Result<()> {
    let mut table = Table::default();
    match &args.what {
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
    }
    table.finish()
}

/// Lines that are printed as they come: a row may take minutes.
#[derive(Default)]
pub(crate) struct Table {
    /// What went wrong first.
    problem: Option<io::Error>,
}

impl Table {
    pub(crate) fn push(&mut self, mut line: String) {
        if self.problem.is_none() {
            line.push('\n');
            let mut out = io::stdout().lock();
            let printed = out.write_all(line.as_bytes()).and_then(|()| out.flush());
            self.problem = printed.err();
        }
    }

    fn finish(self) -> anyhow::Result<()> {
        self.problem.map_or(Ok(()), |problem| Err(problem.into()))
    }
}

fn name(path: &Path) -> String {
    path.file_stem()
        .map_or_else(String::new, |s| s.to_string_lossy().into_owned())
}

/// A scene, and cells to start from where it has no locator.
struct Subject {
    name: String,
    world: World,
    eyes: Eyes,
}

enum Eyes {
    /// Anywhere in the boxes of cells that are not outdoors.
    Located,
    /// One point in each cell.
    Known(Vec<[f32; 3]>),
}

/// Meters in a Quake unit, nearly.
const QUAKE_UNIT: f64 = 1.0 / 32.0;

/// The leaves of a Quake portal file as a world without triangles.
fn read_portal_file(path: &Path) -> anyhow::Result<Subject> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let file = read_prt(&text).with_context(|| path.display().to_string())?;
    let mut cells = vec![Cell::default(); file.n_clusters as usize];
    let mut sums = vec![(DVec3::ZERO, 0.0); cells.len()];
    let mut portals = Vec::new();
    for p in &file.portals {
        let points: Vec<DVec3> = p
            .points
            .iter()
            // +Z is up in Quake.
            .map(|&[x, y, z]| DVec3::new(x, z, -y) * QUAKE_UNIT)
            .collect();
        let winding = Winding::new(points);
        let Some(normal) = winding.area_normal().try_normalize() else {
            continue;
        };
        for c in p.clusters {
            let sum = &mut sums[c as usize];
            *sum = (sum.0 + winding.centroid(), sum.1 + 1.0);
            cells[c as usize]
                .portals
                .push(PortalId(portals.len() as u32));
        }
        let outline: Vec<[f32; 3]> = winding
            .points
            .iter()
            .map(|p| p.as_vec3().to_array())
            .collect();
        portals.push(Portal {
            cells: p.clusters.map(CellId),
            kind: PortalKind::Open,
            normal: normal.as_vec3().to_array(),
            pieces: vec![outline.clone()],
            outline,
            area: winding.area() as f32,
        });
    }
    for (i, cell) in cells.iter_mut().enumerate() {
        cell.name = format!("cell-{i}");
    }
    // A leaf is convex: the mean of points on its portals lies in it.
    let eyes = sums
        .iter()
        .map(|(sum, n)| (*sum / f64::max(*n, 1.0)).as_vec3().to_array())
        .collect();
    Ok(Subject {
        name: name(path),
        world: World {
            graph: CellPortalGraph {
                cells,
                portals,
                ..CellPortalGraph::default()
            },
            ..World::default()
        },
        eyes: Eyes::Known(eyes),
    })
}

fn subjects(scenes: &[PathBuf], rooms: &[usize]) -> anyhow::Result<Vec<Subject>> {
    let mut out = Vec::new();
    for path in scenes {
        if path.extension().is_some_and(|e| e == "prt") {
            out.push(read_portal_file(path)?);
        } else {
            out.push(Subject {
                name: name(path),
                world: read_world(path)?,
                eyes: Eyes::Located,
            });
        }
    }
    for &n in rooms {
        out.push(Subject {
            name: format!("offices of {n} rooms"),
            world: room_grid(&GridParams::offices(n, 1)),
            eyes: Eyes::Located,
        });
    }
    Ok(out)
}

/// A view with the cell of its eye, upright, 60 degrees high, 16:9.
fn draw_view(
    rng: &mut Rng,
    subject: &Subject,
    sight: &Sight,
) -> anyhow::Result<Option<(View, CellId)>> {
    let cells = &subject.world.graph.cells;
    for _ in 0..10_000 {
        let c = rng.below(cells.len().max(1));
        let (eye, cell) = match &subject.eyes {
            Eyes::Known(eyes) => (eyes[c], Some(CellId(c as u32))),
            Eyes::Located => {
                if cells.get(c).is_none_or(|c| c.outdoor) {
                    continue;
                }
                let [low, high] = cells[c].aabb;
                let eye = [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * rng.unit() as f32);
                (eye, sight.locate(eye).filter(|f| f.0 == c as u32))
            }
        };
        if let Some(cell) = cell {
            let angle = rng.range(0.0, std::f64::consts::TAU);
            let level = rng.range(-0.2, 0.2) as f32;
            let toward = [angle.cos() as f32, level, angle.sin() as f32];
            let view = View::perspective(eye, toward, [0.0, 1.0, 0.0], 1.047, 16.0 / 9.0)?;
            return Ok(Some((view, cell)));
        }
    }
    Ok(None)
}

pub(crate) fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values
        .get((last as f64 * share) as usize)
        .copied()
        .unwrap_or(f64::NAN)
}

const MODES: [(&str, Narrowing); 3] = [
    ("rectangle", Narrowing::Rectangle),
    ("polygon", Narrowing::Polygon),
    ("8 edges", Narrowing::PolygonOf(8)),
];

fn bench_see(
    table: &mut Table,
    scenes: &[PathBuf],
    rooms: &[usize],
    views: usize,
) -> anyhow::Result<()> {
    let mut all = subjects(scenes, rooms)?;
    if scenes.is_empty() {
        for (label, one_room) in [("64 rooms", false), ("a ring", true)] {
            all.push(Subject {
                name: format!("courtyard, 64 windows of {label}"),
                world: courtyard(16, one_room),
                eyes: Eyes::Located,
            });
        }
    }
    table.push("| scene | cells | portals | narrowed by | warm µs | cold µs | p99 µs | worst µs | visits | cells seen | clips | most clips | triangles |".into());
    table.push(
        "| --- | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
            .into(),
    );
    for subject in &all {
        let sight = Sight::build(&subject.world).with_context(|| subject.name.clone())?;
        let state = SightState::new(&sight);
        let mut rng = Rng::new(1);
        let mut drawn = Vec::new();
        for _ in 0..views {
            drawn.extend(draw_view(&mut rng, subject, &sight)?);
        }
        for (mode, narrowing) in MODES {
            let options = SeeOptions {
                narrowing,
                ..SeeOptions::default()
            };
            let mut viewer = Viewer::with_options(&sight, options);
            let mut ask = |view: &View, cell: CellId| {
                let start = Instant::now();
                let seen = match subject.eyes {
                    Eyes::Located => viewer.see(&sight, &state, view),
                    Eyes::Known(_) => viewer.see_from(&sight, &state, view, cell),
                };
                let seconds = start.elapsed().as_secs_f64() * 1e6;
                let counts = seen.counts();
                let n = [
                    seen.visits().len() as f64,
                    seen.cells().len() as f64,
                    f64::from(counts.clips),
                    seen.n_triangles() as f64,
                ];
                (seconds, n)
            };
            // Once for the buffers to grow.
            for (view, cell) in &drawn {
                ask(view, *cell);
            }
            let (mut cold, mut warm, mut sums, mut most) = (Vec::new(), Vec::new(), [0.0; 4], 0.0);
            for (view, cell) in &drawn {
                let (first, n) = ask(view, *cell);
                cold.push(first);
                // As when the same place is looked at frame after frame.
                let least = (0..5).fold(f64::INFINITY, |t, _| t.min(ask(view, *cell).0));
                warm.push(least);
                for k in 0..4 {
                    sums[k] += n[k] / drawn.len() as f64;
                }
                most = f64::max(most, n[2]);
            }
            table.push(format!(
                "| {} | {} | {} | {mode} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {most} | {:.0} |",
                subject.name,
                sight.n_cells(),
                sight.n_portals(),
                quantile(&mut warm, 0.5),
                quantile(&mut cold, 0.5),
                quantile(&mut warm, 0.99),
                quantile(&mut warm, 1.0),
                sums[0],
                sums[1],
                sums[2],
                sums[3],
            ));
        }
    }
    Ok(())
}

fn bench_tight(table: &mut Table, scenes: &[PathBuf], views: u64, rays: u64) -> anyhow::Result<()> {
    table.push(
        "| scene | narrowed by | triangles ÷ hit | details ÷ hit | cells ÷ reached | missed |"
            .into(),
    );
    table.push("| --- | --- | ---: | ---: | ---: | ---: |".into());
    for subject in subjects(scenes, &[])? {
        let sight = Sight::build(&subject.world).with_context(|| subject.name.clone())?;
        let answers = Answers::new(&subject.world, &sight);
        let modes = MODES
            .iter()
            .map(|&(mode, narrowing)| {
                let options = SeeOptions {
                    narrowing,
                    ..SeeOptions::default()
                };
                (mode, Some(options))
            })
            .chain([("view frustum alone", None)]);
        for (mode, options) in modes {
            let asked = ViewOptions {
                views,
                rays_per_view: rays,
                ordinary: true,
                ..ViewOptions::default()
            };
            let report: ViewReport = verify_views(
                &subject.world,
                &asked,
                &|| answers.seer(options),
                &|_, _| (),
            );
            let ratio = |k: usize| match report.hit[k] {
                0 => "-".to_owned(),
                hit => format!("{:.2}", report.answered[k] as f64 / hit as f64),
            };
            table.push(format!(
                "| {} | {mode} | {} | {} | {} | {} |",
                subject.name,
                ratio(0),
                ratio(1),
                ratio(2),
                report.missed
            ));
        }
    }
    Ok(())
}

fn bench_maze(
    table: &mut Table,
    path: &Path,
    views: usize,
    fov: f32,
    chunk: usize,
) -> anyhow::Result<()> {
    let world = read_world(path)?;
    let options = SightOptions {
        chunk_triangles: chunk,
        ..SightOptions::default()
    };
    let sight = Sight::build_with(&world, &options)?;
    let state = SightState::new(&sight);
    let steps = walk(&world, &sight, views);
    let all = sight.n_triangles() as f64;
    table.push(format!(
        "{} views of {fov} degrees on a path, chunks of {chunk}; {} cells, {} portals, {} triangles.",
        steps.len(),
        sight.n_cells(),
        sight.n_portals(),
        all
    ));
    table.push(String::new());
    table.push("| processed | least | mean | most |".into());
    table.push("| --- | ---: | ---: | ---: |".into());
    let modes = [("view frustum alone", None)]
        .into_iter()
        .chain(MODES.map(|(mode, narrowing)| (mode, Some(narrowing))));
    for (mode, narrowing) in modes {
        let mut viewer = Viewer::new(&sight);
        if let Some(narrowing) = narrowing {
            viewer.options_mut().narrowing = narrowing;
        }
        let mut shares = Vec::new();
        for &(eye, toward) in &steps {
            let view =
                View::perspective(eye, toward, [0.0, 1.0, 0.0], fov.to_radians(), 4.0 / 3.0)?;
            let seen = match narrowing {
                None => viewer.see_through_walls(&sight, &view),
                Some(_) => viewer.see(&sight, &state, &view),
            };
            shares.push(seen.n_triangles() as f64 / all * 100.0);
        }
        let mean = shares.iter().sum::<f64>() / shares.len().max(1) as f64;
        let label = narrowing.map_or(mode.to_owned(), |_| format!("portals, by {mode}"));
        table.push(format!(
            "| {label} | {:.2} % | {mean:.2} % | {:.2} % |",
            quantile(&mut shares, 0.0),
            quantile(&mut shares, 1.0)
        ));
    }
    Ok(())
}

fn bench_los(
    table: &mut Table,
    scenes: &[PathBuf],
    rooms: &[usize],
    pairs: usize,
) -> anyhow::Result<()> {
    table.push("| scene | triangles | pairs | hit | differ | by cells | ns by cells | ns by one tree | ratio |".into());
    table.push("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |".into());
    for subject in subjects(scenes, rooms)? {
        let world = &subject.world;
        let lines = Sightlines::build(world);
        let mut rng = Rng::new(3);
        let cells: Vec<&Cell> = world.graph.cells.iter().filter(|c| !c.outdoor).collect();
        let mut point = || {
            let b = cells[rng.below(cells.len())].aabb;
            [0, 1, 2].map(|k| b[0][k] + (b[1][k] - b[0][k]) * rng.unit() as f32)
        };
        let segments: Vec<_> = (0..pairs).map(|_| (point(), point())).collect();
        let start = Instant::now();
        let by_cells: Vec<_> = segments
            .iter()
            .map(|(a, b)| lines.first_hit_by_cells(*a, *b))
            .collect();
        let cells_ns = start.elapsed().as_secs_f64() * 1e9 / pairs.max(1) as f64;
        let start = Instant::now();
        let whole: Vec<_> = segments
            .iter()
            .map(|(a, b)| lines.first_hit(*a, *b))
            .collect();
        let whole_ns = start.elapsed().as_secs_f64() * 1e9 / pairs.max(1) as f64;
        let same = |a: &Option<enfilade::runtime::SightHit>,
                    b: &Option<enfilade::runtime::SightHit>| match (a, b) {
            (Some(a), Some(b)) => {
                (a.t, a.batch, a.triangle, a.front) == (b.t, b.batch, b.triangle, b.front)
            }
            (a, b) => a.is_none() && b.is_none(),
        };
        let differ = by_cells
            .iter()
            .zip(&whole)
            .filter(|(a, b)| !same(a, b))
            .count();
        let hit = whole.iter().flatten().count();
        let walked = by_cells
            .iter()
            .flatten()
            .filter(|h| h.cell.is_some())
            .count();
        let n_triangles: usize = world
            .batches
            .iter()
            .map(|b| b.primitive.indices.len() / 3)
            .sum();
        table.push(format!(
            "| {} | {n_triangles} | {pairs} | {hit} | {differ} | {:.1} % | {cells_ns:.0} | {whole_ns:.0} | {:.2} |",
            subject.name,
            walked as f64 / hit.max(1) as f64 * 100.0,
            whole_ns / cells_ns
        ));
    }
    Ok(())
}
