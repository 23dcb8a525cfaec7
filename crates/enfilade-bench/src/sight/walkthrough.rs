//! `bench walkthrough`: a walk drawn whole, with frustum culling, and by portals.

use std::collections::VecDeque;
use std::f32::consts::TAU;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, bail};
use enfilade::bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade::cpg::{CellId, DetailObject, World};
use enfilade::geom::DVec3;
use enfilade::geom::scene::{Mesh, Primitive};
use enfilade::runtime::Sight;
use enfilade_cli::values::size;
use enfilade_cli::world::read_world;
use enfilade_render::{
    AdapterChoice, Camera, Culling, FOV, Frame, Paint, Sparing, Studio, Style, walk_cameras,
};
use enfilade_testkit::{TowerParams, clinic, office_tower};

use crate::rows::baked;
use crate::table::Table;

/// Scenes and modes of the walk.
#[derive(clap::Args)]
pub(crate) struct Walkthrough {
    /// Worlds.
    scenes: Vec<PathBuf>,
    /// Rooms of a generated, furnished office tower, baked on the spot.
    #[arg(long, value_name = "ROOMS")]
    tower: Option<usize>,
    /// Approximate polygons of a generated clinic, baked on the spot by its planes.
    #[arg(long, value_name = "POLYGONS")]
    clinic: Option<usize>,
    /// Place equal objects in all rooms, with so many triangles that the world has this total.
    #[arg(long, value_name = "TRIANGLES")]
    total: Option<u64>,
    /// Another world of the same scene, such as one of `bake --method bsp` without simplification: same walk, its
    /// portals. With one world only.
    #[arg(long, value_name = "GLB")]
    also: Option<PathBuf>,
    /// Also by occlusion queries instead of clipping.
    #[arg(long)]
    queries: bool,
    /// Also by portals, without looking through those that cover fewer pixels than this.
    #[arg(long, value_name = "PIXELS")]
    stop: Option<f32>,
    /// Also by frustum culling and by portals, with coarser objects where their surface moves by at most this many
    /// pixels.
    #[arg(long, value_name = "PIXELS")]
    lod: Option<f32>,
    /// Frames of the walk.
    #[arg(long, default_value_t = 200)]
    frames: usize,
    /// Size of the frames.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x720")]
    size: [u32; 2],
    /// With shadows and ambient occlusion.
    #[arg(long)]
    full: bool,
    /// Adapter: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME")]
    adapter: AdapterChoice,
    /// Draw only every Nth frame of *everything*, for slow adapters.
    #[arg(long, default_value_t = 1, value_name = "N")]
    sparse: usize,
}

/// Most frames in flight, as in a program with a window.
const IN_FLIGHT: usize = 2;

pub(crate) fn bench(table: &mut Table, args: &Walkthrough) -> anyhow::Result<()> {
    let mut worlds = Vec::new();
    for path in &args.scenes {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        worlds.push((name.into_owned(), read_world(path)?));
    }
    if let Some(rooms) = args.tower {
        let scene = office_tower(&TowerParams::with_rooms(rooms, 1)).scene;
        worlds.push((format!("office tower of {rooms} rooms"), baked(&scene)?));
    }
    if let Some(polygons) = args.clinic {
        let scene = clinic(polygons, 1);
        let context = BakeContext::new(&Silent, None);
        let baked = bake(&scene, &BakeConfig::of(Method::Bsp), &context)?;
        worlds.push((format!("clinic of {polygons} polygons"), baked.world));
    }
    if worlds.is_empty() {
        bail!("give a world, --tower ROOMS or --clinic POLYGONS");
    }
    table.push("| scene | triangles | drawn | min ms | mean ms | max ms | frames/s to frustum culling | ms of all threads | the same to frustum culling | triangles drawn | draws | ms to hand in |");
    table.push(
        "| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    );
    if args.also.is_some() && worlds.len() != 1 {
        bail!("--also needs exactly one world");
    }
    let mut adapter = String::new();
    for (name, mut world) in worlds {
        let rings = args.total.map(|t| Rings::of(&world, t)).transpose()?;
        if let Some(rings) = &rings {
            rings.place(&mut world);
        }
        let mut studio = Studio::new(enfilade_cli::adapter::open(&args.adapter)?, &world)
            .with_context(|| name.clone())?;
        adapter = studio.gpu.name();
        let cameras = walk_cameras(&world, &studio.sight, args.frames, FOV);
        if cameras.is_empty() {
            bail!("{name}: no room to walk in");
        }
        let mut walks = vec![Mode::Frustum, Mode::Everything, Mode::Portals];
        walks.extend(args.stop.map(Mode::Stopped));
        walks.extend(args.queries.then_some(Mode::Queries));
        let levels = args
            .lod
            .map(|p| [Mode::FrustumLevels(p), Mode::PortalsLevels(p)]);
        walks.extend(levels.into_iter().flatten());
        let mut rows = Rows {
            name: &name,
            frustum: [f64::NAN; 2],
            lines: Vec::new(),
        };
        for mode in walks {
            let step = if mode == Mode::Everything {
                args.sparse.max(1)
            } else {
                1
            };
            let cameras: Vec<Camera> = cameras.iter().copied().step_by(step).collect();
            if matches!(mode, Mode::FrustumLevels(_)) {
                studio.add_levels(&world)?;
            }
            let run = walk(&mut studio, &world, &cameras, mode, args)?;
            rows.add(&mode.label(), &run, studio.world.n_triangles());
        }
        // From the most to the least drawn.
        rows.lines.swap(0, 1);
        if let Some(path) = &args.also {
            let mut other = read_world(path)?;
            if let Some(rings) = &rings {
                rings.place(&mut other);
            }
            let mut studio =
                Studio::new(studio.gpu, &other).with_context(|| path.display().to_string())?;
            let run = walk(&mut studio, &other, &cameras, Mode::Portals, args)?;
            let label = format!(
                "by the {} portals of {}",
                other.graph.portals.len(),
                path.file_stem().unwrap_or_default().to_string_lossy()
            );
            rows.add(&label, &run, studio.world.n_triangles());
        }
        rows.lines.into_iter().for_each(|line| table.push(line));
    }
    table.push(String::new());
    table.push(format!(
        "{}×{}, {} frames a walk, {}.",
        args.size[0], args.size[1], args.frames, adapter
    ));
    Ok(())
}

/// How the walk is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Everything,
    Frustum,
    Portals,
    /// Portals of fewer pixels are not looked through.
    Stopped(f32),
    Queries,
    /// Objects are off by at most this many pixels.
    FrustumLevels(f32),
    PortalsLevels(f32),
}

impl Mode {
    fn label(self) -> String {
        match self {
            Self::Everything => "everything".into(),
            Self::Frustum => "by frustum culling".into(),
            Self::Portals => "by portals".into(),
            Self::Stopped(pixels) => format!("by portals of {pixels} pixels and more"),
            Self::Queries => "by occlusion queries".into(),
            Self::FrustumLevels(p) => format!("by frustum culling, levels of detail to {p} px"),
            Self::PortalsLevels(p) => format!("by portals, levels of detail to {p} px"),
        }
    }
}

/// The lines of one world.
struct Rows<'a> {
    name: &'a str,
    /// Seconds per frame by frustum culling: elapsed, and of all threads.
    frustum: [f64; 2],
    lines: Vec<String>,
}

impl Rows<'_> {
    fn add(&mut self, label: &str, run: &Run, all: u64) {
        if self.frustum[0].is_nan() {
            self.frustum = [run.mean(), run.threads];
        }
        let n = run.seconds.len() as f64;
        let all = all as f64;
        let ms = |x: f64| format!("{:.2}", x * 1e3);
        self.lines.push(format!(
            "| {} | {all} | {label} | {} | {} | {} | {:.2} | {} | {:.2} | {:.2} % | {:.0} | {} |",
            self.name,
            ms(run.seconds.iter().copied().fold(f64::INFINITY, f64::min)),
            ms(run.mean()),
            ms(run.seconds.iter().copied().fold(0.0, f64::max)),
            self.frustum[0] / run.mean(),
            ms(run.threads),
            self.frustum[1] / run.threads,
            run.triangles / n / all * 100.0,
            run.draws / n,
            ms(run.processor / n),
        ));
    }
}

#[derive(Default)]
struct Run {
    seconds: Vec<f64>,
    /// Time of the thread that submits frames.
    processor: f64,
    /// Time of all threads per frame, without other programs.
    threads: f64,
    triangles: f64,
    draws: f64,
}

impl Run {
    fn mean(&self) -> f64 {
        self.seconds.iter().sum::<f64>() / self.seconds.len().max(1) as f64
    }
}

fn walk(
    studio: &mut Studio,
    world: &World,
    cameras: &[Camera],
    mode: Mode,
    args: &Walkthrough,
) -> anyhow::Result<Run> {
    let target = studio.target(args.size)?;
    let culling = match mode {
        Mode::Everything => Culling::Everything,
        Mode::Frustum | Mode::FrustumLevels(_) => Culling::Frustum,
        _ => Culling::Portals,
    };
    studio.sparing = Sparing {
        stop_below: if let Mode::Stopped(pixels) = mode {
            pixels
        } else {
            0.0
        },
        lod: if let Mode::FrustumLevels(pixels) | Mode::PortalsLevels(pixels) = mode {
            pixels
        } else {
            0.0
        },
        ..Sparing::default()
    };
    let aspect = args.size[0] as f32 / args.size[1] as f32;
    let style = Style {
        paint: Paint::Lit,
        dark_corners: args.full,
        shadows: args.full,
        ..Style::default()
    };
    let mut run = Run::default();
    let mut pending = VecDeque::new();
    // Warm-up frames grow buffers and build pipelines.
    let warm = cameras.iter().take(3).map(|c| (c, false));
    let mut last = Instant::now();
    let mut threads = f64::NAN;
    for (camera, counts) in warm.chain(cameras.iter().map(|c| (c, true))) {
        let begin = Instant::now();
        let (view, projection) = (camera.view(aspect)?, camera.projection(aspect)?);
        let list = if mode == Mode::Queries {
            studio.list_by_queries(world, camera, args.size)?.0
        } else {
            studio.take_list(&view, camera.eye, culling, args.size)
        };
        let frame = Frame {
            projection,
            list: &list,
            style,
            marks: &[],
        };
        studio.draw_to(&frame, &target)?;
        let processor = begin.elapsed().as_secs_f64();
        pending.push_back(studio.gpu.mark());
        if !counts {
            studio.gpu.wait()?;
            pending.clear();
            last = Instant::now();
            threads = thread_seconds();
        } else {
            if pending.len() > IN_FLIGHT
                && let Some(mark) = pending.pop_front()
            {
                studio.gpu.wait_for(mark)?;
            }
            let now = Instant::now();
            run.seconds.push((now - last).as_secs_f64());
            last = now;
            run.processor += processor;
            run.triangles += list.n_triangles() as f64;
            run.draws += list.n_draws() as f64;
        }
        studio.give_list(list);
    }
    studio.gpu.wait()?;
    // Work in flight after the last frame belongs to the frames as well.
    if let Some(seconds) = run.seconds.last_mut() {
        *seconds += last.elapsed().as_secs_f64();
    }
    run.threads = (thread_seconds() - threads) / run.seconds.len().max(1) as f64;
    Ok(run)
}

/// Returns the processor time of all threads of this process on Linux; elsewhere not a number. [Units: s]
fn thread_seconds() -> f64 {
    let Ok(text) = std::fs::read_to_string("/proc/self/stat") else {
        return f64::NAN;
    };
    // After the name, which may contain anything: `utime` and `stime`, in hundredths of a second.
    let after = text.rsplit(')').next().unwrap_or_default();
    let mut fields = after.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    match (ticks(), ticks()) {
        (Some(user), Some(system)) => (user + system) / 100.0,
        _ => f64::NAN,
    }
}

/// Equal objects, one per room.
pub(crate) struct Rings {
    places: Vec<[f32; 3]>,
    ring: Primitive,
}

/// Outer radius of a ring. [Units: wu]
const RADIUS: f32 = 0.42;

impl Rings {
    /// Makes as many as rooms have space for, so that the world has about `total` triangles.
    pub(crate) fn of(world: &World, total: u64) -> anyhow::Result<Self> {
        let sight = Sight::build(world)?;
        let mut places = Vec::new();
        for (i, cell) in (0..).zip(&world.graph.cells) {
            let [low, high] = cell.aabb;
            let at = |t: [f32; 3]| [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * t[k]);
            let spots = [
                [0.5, 0.35, 0.5],
                [0.3, 0.35, 0.3],
                [0.7, 0.35, 0.7],
                [0.3, 0.4, 0.7],
            ];
            let spot = spots
                .iter()
                .map(|&t| at(t))
                .find(|&p| sight.locate(p) == Some(CellId(i)));
            if let Some(p) = spot.filter(|_| !cell.outdoor) {
                places.push(p);
            }
        }
        let missing = total.saturating_sub(sight.n_triangles());
        if places.is_empty() || missing == 0 {
            bail!(
                "it already has {} triangles, or no rooms",
                sight.n_triangles()
            );
        }
        let each = missing.div_ceil(places.len() as u64);
        // A ring wound as a tube, of quads 4 by 1.
        let around = ((each as f64 / 8.0).sqrt().ceil() as u32).max(2) * 2;
        let along = u32::try_from(each.div_ceil(u64::from(around) * 2))?.max(3);
        Ok(Self {
            places,
            ring: ring(along, around),
        })
    }

    /// Places them in a world: the one they were made for, or another of the same scene.
    pub(crate) fn place(&self, world: &mut World) {
        let mesh = world.detail_meshes.len() as u32;
        world.detail_meshes.push(Mesh {
            name: "ring".into(),
            primitives: vec![self.ring.clone()],
        });
        let radius = f64::from(RADIUS);
        for p in &self.places {
            let mut cells = Vec::new();
            let center = DVec3::new(p[0].into(), p[1].into(), p[2].into());
            cells.extend(world.graph.locator.locate(center));
            for axis in 0..3 {
                for side in [-radius, radius] {
                    let corners =
                        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[u, v]| {
                            let mut d = [0.0; 3];
                            d[axis] = side;
                            d[(axis + 1) % 3] = u * radius;
                            d[(axis + 2) % 3] = v * radius;
                            center + DVec3::from(d)
                        });
                    world.graph.locator.cells_touching(&corners, &mut cells);
                }
            }
            cells.sort_unstable();
            cells.dedup();
            let mut transform = [0.0; 16];
            for k in 0..3 {
                transform[k * 5] = 1.0;
                transform[12 + k] = p[k];
            }
            transform[15] = 1.0;
            world.details.push(DetailObject {
                name: "ring".into(),
                mesh,
                transform,
                cells,
                source: None,
                part_of: None,
            });
        }
    }
}

/// Returns a ring of 40 cm radius with a wavy surface.
fn ring(along: u32, around: u32) -> Primitive {
    let mut out = Primitive::default();
    for i in 0..along {
        let a = i as f32 / along as f32 * TAU;
        for j in 0..around {
            let b = j as f32 / around as f32 * TAU;
            let r = 0.09 * (1.0 + 0.25 * (a * 12.0 + b * 3.0).sin());
            let (x, y) = (0.28 + r * b.cos(), r * b.sin());
            out.positions.push([x * a.cos(), y, x * a.sin()]);
            out.normals
                .push([b.cos() * a.cos(), b.sin(), b.cos() * a.sin()]);
            let at = |i: u32, j: u32| (i % along) * around + j % around;
            let q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            out.indices.extend([q[0], q[1], q[2], q[0], q[2], q[3]]);
        }
    }
    out
}
