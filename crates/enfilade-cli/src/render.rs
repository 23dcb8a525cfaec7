//! `enfilade render`: draws pictures, without a display.

use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::ValueEnum;
use enfilade::cpg::{PortalId, World};
use enfilade::world::PartId;
use enfilade_render::{
    AdapterChoice, Camera, Culling, FOV, Mark, MarkShape, Paint, Picture, Sparing, Studio, Style,
    good_camera, lamp_lights, walk_cameras,
};
use serde_json::json;

mod above;
mod special;

use crate::formats::Format;
use crate::limits::Limits;
use crate::living::{Lived, Player, STEP};
use crate::output::{Outputs, refuse_stream, write_whole};
use crate::screen::{Warned, print_json};
use crate::walk::WorldFile;
use enfilade_cli::cameras::{path_text, read_path};
use enfilade_cli::input::name_of;
use enfilade_cli::values::{door, point, size};
use enfilade_cli::world::read_world;

pub(crate) use above::above;
use special::Mirrored;

/// Draws a picture of a world, or one for each camera of a path, to PNG files; does not need a display.
#[derive(clap::Args)]
pub(crate) struct Render {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// File for the picture, `-` for standard output; for a path, `walk.png` becomes `walk-0001.png` and so on.
    #[arg(short, long, value_name = "PNG")]
    output: PathBuf,
    /// Position of the eye, in meters; a place with much to see if not given.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true, requires = "look")]
    eye: Option<[f32; 3]>,
    /// The point looked at, in meters; not a direction.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true, requires = "eye")]
    look: Option<[f32; 3]>,
    /// Draw a picture for each line of this file: eye and point looked at, `x y z x y z`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["eye", "walk"])]
    path: Option<PathBuf>,
    /// Draw this many pictures on a walk through the doorways, 10,000 at most.
    #[arg(long, value_name = "N", conflicts_with = "eye", value_parser = clap::value_parser!(u32).range(0..=10_000))]
    walk: Option<u32>,
    /// Write the cameras of the pictures to this file, for use with --path.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Angle from the lower to the upper edge of the picture, in degrees.
    #[arg(long, value_name = "DEG", default_value_t = FOV.to_degrees(), value_parser = angle)]
    fov: f32,
    /// Width and height of the picture.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x720")]
    size: [u32; 2],
    /// Set of things to draw: everything, all in the view, or all visible through portals.
    #[arg(long, value_enum, default_value_t = RenderMode::Portals)]
    mode: RenderMode,
    /// Colors of surfaces: lit materials, one color per cell, or how often pixels are drawn.
    #[arg(long, value_enum, default_value_t = Colors::Lit)]
    paint: Colors,
    /// Outline the portals in view, and the view as each one narrows it.
    #[arg(long)]
    portals: bool,
    /// Show the world from above, with the view and what is culled: dark is out of view, red behind
    /// walls, orange hidden by a large polygon.
    #[arg(long)]
    above: bool,
    /// Remove everything higher than this, in meters, and light the rest evenly; with --above, 0.5 above the eye by
    /// default.
    #[arg(long, value_name = "METERS", allow_hyphen_values = true)]
    cut: Option<f32>,
    /// Portals to close, by number: their leaves are shut, and a panel fills those without leaves.
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    close: Vec<u32>,
    /// Lifts, people, lamps and sounds in the world, as `demo --living` writes them; pictures of a path are a 30th of a
    /// second apart.
    #[arg(long, value_name = "JSON", conflicts_with_all = ["above", "portals", "close", "door", "stop", "objects", "lod", "mode"])]
    living: Option<PathBuf>,
    /// Time of the first picture of --living, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, requires = "living", value_parser = time)]
    time: f64,
    /// How far the leaves of a portal are open, from shut (0) to open (1); as in the model if not given.
    #[arg(long, value_name = "ID=SHARE", value_delimiter = ',', value_parser = door)]
    door: Vec<(u32, f32)>,
    /// Do not look through portals that cover fewer pixels: the mean color of the cell behind replaces the view.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    stop: f32,
    /// Leave the portals of --stop empty.
    #[arg(long, requires = "stop")]
    stop_at_nothing: bool,
    /// Do not draw objects in cells that are seen through fewer pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    objects: f32,
    /// Draw objects with fewer triangles if that moves their surface by at most this many pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    lod: f32,
    /// No shadows, no ambient occlusion, no lamps, the same daylight everywhere: faster.
    #[arg(long)]
    plain: bool,
    /// Leave the lamps of the world dark: its point and spot lights.
    #[arg(long)]
    no_lamps: bool,
    /// Share of the daylight that is left, from night (0) to day (1).
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = share)]
    daylight: f32,
    /// Adapter to draw with: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME")]
    adapter: AdapterChoice,
    /// Print a report on the pictures as JSON for machines; for a path, as a list.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// The set of things to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RenderMode {
    Everything,
    Frustum,
    Portals,
}

impl RenderMode {
    pub(crate) fn culling(self) -> Culling {
        match self {
            Self::Everything => Culling::Everything,
            Self::Frustum => Culling::Frustum,
            Self::Portals => Culling::Portals,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Colors {
    Lit,
    Cells,
    Overdraw,
}

fn time(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..=3600.0).contains(&x) => Ok(x),
        _ => Err("a time between 0 and 3600 seconds is needed".into()),
    }
}

fn angle(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if (1.0..=165.0).contains(&x) => Ok(x),
        _ => Err("an angle between 1 and 165 degrees is needed".into()),
    }
}

fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("a number from 0 to 1 is needed".into()),
    }
}

/// Reads a world and loads it on an adapter.
pub(crate) fn open(path: &Path, adapter: &AdapterChoice) -> anyhow::Result<(World, Studio)> {
    let world = read_world(path)?;
    let studio = Studio::new(enfilade_cli::adapter::open(adapter)?, &world)
        .with_context(|| name_of(path))?;
    tell_of_pictures(&studio)?;
    Ok((world, studio))
}

/// Warns about texture pictures that are not drawn.
pub(crate) fn tell_of_pictures(studio: &Studio) -> anyhow::Result<()> {
    for (n, why) in [
        (studio.world.n_missing_pictures(), "missing or damaged"),
        (
            studio.world.n_large_pictures(),
            "larger than 8192x8192, or in total than 512 MiB and 128 times their files",
        ),
    ] {
        if n > 0 {
            writeln!(
                Warned,
                "enfilade: {n} texture pictures are {why}; drawn without them"
            )?;
        }
    }
    Ok(())
}

/// Computes the light of each place; if the adapter cannot hold it, warns, and all places are lit alike.
pub(crate) fn light(studio: &mut Studio, world: &World) -> anyhow::Result<()> {
    if let Err(error) = studio.add_light(world) {
        writeln!(Warned, "enfilade: all rooms are lit alike: {error}")?;
    }
    Ok(())
}

/// Lights the lamps of a world; if the adapter cannot hold their maps, warns, and they stay dark.
pub(crate) fn light_lamps(studio: &mut Studio, world: &World) -> anyhow::Result<()> {
    let lamps = lamp_lights(world, PartId::ROOT);
    if let Err(error) = studio.set_lamps(lamps) {
        writeln!(Warned, "enfilade: the lamps stay dark: {error}")?;
    }
    Ok(())
}

/// Draws a picture at twice the size and halves it: smooth edges.
pub(crate) fn smooth(
    size: [u32; 2],
    draw: impl FnOnce([u32; 2]) -> anyhow::Result<Picture>,
) -> anyhow::Result<Picture> {
    // Beyond 4096 the adapter's limit is near, and edges are fine as they are.
    if size[0].max(size[1]) > 4096 {
        return draw(size);
    }
    Ok(draw(size.map(|n| n * 2))?.halved())
}

pub(crate) fn run(args: &Render) -> anyhow::Result<()> {
    args.limits.begin()?;
    let fov = args.fov.to_radians();
    let is_path = args.path.is_some() || args.walk.is_some();
    let inputs = [&args.world].into_iter().chain(&args.path);
    let mut outputs = Outputs::reading(inputs.chain(&args.living))?;
    if let Some(record) = &args.record {
        outputs.write("--record", Format::Cameras, record)?;
    }
    if is_path {
        // The names of the pictures follow when their number is known.
        refuse_stream("-o", &args.output, "several pictures")?;
        Format::Picture.check("-o", &args.output)?;
    } else {
        outputs.write("-o", Format::Picture, &args.output)?;
    }
    let given = args
        .path
        .as_deref()
        .map(|p| read_path(p, fov))
        .transpose()?;
    let (world, mut studio) = open(&args.world, &args.adapter)?;
    set_doors(args, &mut studio)?;
    let cameras = match given {
        Some(path) => path,
        None => cameras(args, &mut studio, &world)?,
    };
    if cameras.is_empty() {
        bail!("{}: no room to walk in", name_of(&args.world));
    }
    if is_path {
        let pictures: Vec<_> = (1..=cameras.len())
            .map(|n| numbered(&args.output, n))
            .collect();
        outputs.write_all("-o", Format::Picture, &pictures)?;
    }
    if args.lod > 0.0 {
        studio.add_levels(&world)?;
    }
    if !args.plain || args.above || args.paint == Colors::Cells {
        light(&mut studio, &world)?;
    }
    if !args.plain && !args.no_lamps {
        light_lamps(&mut studio, &world)?;
    }
    studio.day = args.daylight;
    let mut lived = match &args.living {
        Some(path) => {
            let lived = Lived::read(path, &world, WorldFile::of(&args.world))?;
            lived.furnish(&mut studio)?;
            Some(lived)
        }
        None => None,
    };
    let mut mirrored = Mirrored::new(&world, &args.door, &args.close)?;
    let mut out = outputs.printed();
    let mut all = Vec::new();
    for (i, camera) in cameras.iter().enumerate() {
        let mut drawn_size = args.size;
        if let Some(lived) = &mut lived {
            let seconds = if i == 0 { args.time } else { STEP };
            lived.play(&Player::at(camera.eye), seconds);
        }
        let mut picture = smooth(args.size, |size| {
            drawn_size = size;
            let live = (lived.as_mut(), mirrored.as_mut());
            draw(args, (&world, &mut studio), live, camera, size)
        })?;
        let to = if is_path {
            numbered(&args.output, i + 1)
        } else {
            args.output.clone()
        };
        if args.paint == Colors::Overdraw && !args.above {
            picture.add_overdraw_scale();
        }
        write_whole(&to, &picture.to_png()?)?;
        let drawn = Drawn::new(args, &mut studio, &world, camera, (to, drawn_size))?;
        if args.json {
            all.push(drawn);
        } else {
            writeln!(out, "{drawn}")?;
        }
    }
    if let Some(record) = &args.record {
        write_whole(record, path_text(&cameras).as_bytes())?;
    }
    match &all[..] {
        _ if !args.json => Ok(()),
        [one] if !is_path => print_json(out, one),
        all => print_json(out, &json!({ "pictures": all })),
    }
}

/// Draws a picture of a size, which may be a multiple of the requested one.
fn draw(
    args: &Render,
    (world, studio): (&World, &mut Studio),
    (lived, mirrored): (Option<&mut Lived>, Option<&mut Mirrored>),
    camera: &Camera,
    size: [u32; 2],
) -> anyhow::Result<Picture> {
    let scale = (size[0] as f32 / args.size[0] as f32).powi(2);
    studio.sparing = Sparing {
        stop_below: args.stop * scale,
        stop_at_nothing: args.stop_at_nothing,
        objects_below: args.objects * scale,
        // A length, so it scales with the picture's edge.
        lod: args.lod * scale.sqrt(),
    };
    let style = style_of(args);
    if let Some(lived) = lived {
        return lived.picture(studio, PartId::ROOT, camera, style, size);
    }
    if args.above {
        return above(studio, world, camera, args.cut, size);
    }
    let marks = if args.portals {
        portal_marks(studio, world, camera, size)?
    } else {
        Vec::new()
    };
    let culling = args.mode.culling();
    if let Some(mirrored) = mirrored {
        return mirrored.picture(studio, (camera, culling), style, &marks, size);
    }
    Ok(studio.picture(camera, culling, style, &marks, size)?)
}

/// Closes portals and moves leaves.
fn set_doors(args: &Render, studio: &mut Studio) -> anyhow::Result<()> {
    let n = studio.sight.n_portals();
    let asked = args.door.iter().map(|(p, _)| p).chain(&args.close);
    if let Some(p) = asked.into_iter().find(|p| **p as usize >= n) {
        bail!("there is no portal {p}; `enfilade inspect` lists them");
    }
    for &(p, share) in &args.door {
        if studio.sight.leaves(PortalId(p)).is_empty() {
            bail!(
                "--door: portal {p} has no leaf that moves; `enfilade inspect` lists those with leaves; --close fills any"
            );
        }
        studio.state.set_leaves(PortalId(p), share);
    }
    for &p in &args.close {
        studio.state.close(PortalId(p));
    }
    Ok(())
}

/// The look of pictures.
fn style_of(args: &Render) -> Style {
    Style {
        paint: match args.paint {
            Colors::Lit => Paint::Lit,
            Colors::Cells => Paint::Cells,
            Colors::Overdraw => Paint::Overdraw,
        },
        dark_corners: !args.plain,
        // The shadow of a removed ceiling would stay.
        shadows: !args.plain && args.cut.is_none(),
        daylight: !args.plain && args.cut.is_none(),
        cut_above: args.cut.unwrap_or(f32::INFINITY),
    }
}

/// The cameras to draw from, if no path gives them.
fn cameras(args: &Render, studio: &mut Studio, world: &World) -> anyhow::Result<Vec<Camera>> {
    let fov_y = args.fov.to_radians();
    if let Some(n) = args.walk {
        return Ok(walk_cameras(world, &studio.sight, n as usize, fov_y));
    }
    let camera = match args.eye.zip(args.look) {
        Some((eye, look)) => Camera::looking_at(eye, look),
        None => good_camera(studio, world)?,
    };
    Ok(vec![Camera { fov_y, ..camera }])
}

fn numbered(path: &Path, n: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-{n:04}.png"))
}

/// The report on a picture.
#[derive(serde::Serialize)]
struct Drawn {
    /// As text: JSON cannot hold other names.
    file: String,
    eye: [f32; 3],
    look: [f32; 3],
    cell: Option<u32>,
    #[serde(skip)]
    cell_name: Option<String>,
    triangles: u64,
    of_triangles: u64,
    draws: usize,
    adapter: String,
}

impl Drawn {
    fn new(
        args: &Render,
        studio: &mut Studio,
        world: &World,
        camera: &Camera,
        // The size before halving: sparing depends on its pixels.
        (file, size): (PathBuf, [u32; 2]),
    ) -> anyhow::Result<Self> {
        let view = camera.view(size[0] as f32 / size[1] as f32)?;
        let list = studio.list(&view, camera.eye, args.mode.culling(), size);
        let (triangles, draws) = (list.n_triangles(), list.n_draws());
        let cell = studio.sight.locate(camera.eye);
        Ok(Self {
            file: file.display().to_string(),
            eye: camera.eye,
            look: [0, 1, 2].map(|k| camera.eye[k] + camera.toward[k]),
            cell: cell.map(|c| c.0),
            cell_name: cell.map(|c| world.graph[c].name.clone()),
            triangles,
            of_triangles: studio.world.n_triangles(),
            draws,
            adapter: studio.gpu.name(),
        })
    }
}

impl fmt::Display for Drawn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = |p: [f32; 3]| p.map(|x| format!("{x:.2}")).join(",");
        write!(
            f,
            "{}: --eye {} --look {}, in {}, {} of {} triangles in {} draws, {}",
            self.file,
            text(self.eye),
            text(self.look),
            self.cell_name.as_deref().unwrap_or("no cell"),
            self.triangles,
            self.of_triangles,
            self.draws,
            self.adapter
        )
    }
}

/// Outlines of the portals in view, and the rectangles that they narrow the view to.
pub(crate) fn portal_marks(
    studio: &mut Studio,
    world: &World,
    camera: &Camera,
    size: [u32; 2],
) -> anyhow::Result<Vec<Mark>> {
    let view = camera.view(size[0] as f32 / size[1] as f32)?;
    let seen = studio.viewer.see(&studio.sight, &studio.state, &view);
    let mut marks = Vec::new();
    for p in seen.portals() {
        let outline = &world.graph[*p].outline;
        // As wide as a frame of 20 mm, so that far ones are thin; at least a pixel of the finished picture.
        let focal = size[1] as f32 * 0.5 / (camera.fov_y * 0.5).tan();
        let nearest = (outline.iter())
            .map(|c| {
                (0..3)
                    .map(|k| (c[k] - camera.eye[k]).powi(2))
                    .sum::<f32>()
                    .sqrt()
            })
            .fold(f32::INFINITY, f32::min);
        let (least, most) = (size[1] as f32 / 540.0, size[1] as f32 / 110.0);
        let width = (0.02 * focal / nearest.max(0.1)).clamp(least, most);
        let mark = |shape, color, width, on_top| Mark {
            shape,
            color,
            width,
            on_top,
        };
        let area = MarkShape::Area(outline.clone());
        marks.push(mark(area, [1.0, 0.62, 0.05, 0.10], 0.0, false));
        let line = MarkShape::Outline(outline.clone());
        marks.push(mark(line.clone(), [1.0, 0.45, 0.02, 0.22], width, true));
        marks.push(mark(line, [1.0, 0.45, 0.02, 1.0], width, false));
    }
    for v in seen
        .visits()
        .iter()
        .filter(|v| v.via.is_some() && v.face == 0)
    {
        marks.push(Mark {
            shape: MarkShape::Rectangle(v.rectangle),
            color: [0.05, 0.55, 0.9, 0.8],
            width: size[1] as f32 / 480.0,
            on_top: true,
        });
    }
    Ok(marks)
}
