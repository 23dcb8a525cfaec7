//! `enfilade render`: draws pictures, without a display.

use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};

use enfilade::cpg::World;
use enfilade::geom::DVec3;
use enfilade::runtime::Seen;
use enfilade::world::{PartId, Pose};
use enfilade_render::{
    Camera, Culling, MarkShape, Paint, Picture, PictureMark, PortalTextureCounts, Sparing, Studio,
    Style,
};
use serde_json::json;

mod above;
mod options;
mod special;
mod streaming;
mod textured;
mod whole;

use crate::formats::Format;
use crate::living::{Lived, Player, STEP};
use crate::output::{Outputs, refuse_stream, write_whole};
use crate::screen::print_json;
use crate::walk::WorldFile;
use enfilade_cli::cameras::{path_text, read_path};

pub(crate) use above::above;
use options::Colors;
pub(crate) use options::Render;
use options::RenderMode;
use special::Mirrored;
use streaming::{Pieces, Setting};
use textured::{add_textures, read_textures, settle};
pub(crate) use whole::{light, light_lamps, open, tell_of_pictures};

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
    let inputs = inputs.chain(&args.textures);
    let mut outputs = Outputs::reading(inputs.chain(&args.living))?;
    let ahead = read_textures(args)?;
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
    let Setting {
        world,
        mut studio,
        cameras,
        mut mirrored,
        mut pieces,
    } = Setting::open(args, given)?;
    if is_path {
        let pictures: Vec<_> = (1..=cameras.len())
            .map(|n| numbered(&args.output, n))
            .collect();
        outputs.write_all("-o", Format::Picture, &pictures)?;
    }
    prepare(args, &world, &mut studio, ahead.as_deref())?;
    let mut lived = match &args.living {
        Some(path) => {
            let lived = Lived::read(path, &world, WorldFile::of(&args.world))?;
            lived.furnish(&mut studio)?;
            Some(lived)
        }
        None => None,
    };
    let mut out = outputs.printed();
    let mut all = Vec::new();
    for (i, camera) in cameras.iter().enumerate() {
        let mut drawn_size = args.size;
        if let Some(lived) = &mut lived {
            let seconds = if i == 0 { args.time } else { STEP };
            lived.play(&Player::at(camera.eye), seconds);
        }
        if let Some(pieces) = &mut pieces {
            pieces.settle(&mut studio, i)?;
        }
        let mut counts = PortalTextureCounts::default();
        let mut picture = smooth(args.size, |size| {
            drawn_size = size;
            let (lived, mirrored) = (lived.as_mut(), mirrored.as_mut());
            let (picture, own) = draw(args, &world, &mut studio, lived, mirrored, camera, size)?;
            counts = own;
            Ok(picture)
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
        let textures = (args.mode == RenderMode::PortalTextures).then_some(counts);
        let culling = culled(args.mode, textures, mirrored.is_some());
        let file = to.display().to_string();
        let mut drawn = Drawn::new(file, &mut studio, &world, drawn_size, camera, culling)?;
        drawn.record(textures);
        drawn.loaded_bytes = pieces.as_ref().map(|p| p.counts().loaded);
        if args.json {
            all.push(drawn);
        } else {
            writeln!(out, "{drawn}")?;
        }
    }
    pieces.as_ref().map_or(Ok(()), Pieces::tell_of_pictures)?;
    if let Some(record) = &args.record {
        write_whole(record, path_text(&cameras).as_bytes())?;
    }
    match &all[..] {
        _ if !args.json => Ok(()),
        [one] if !is_path => print_json(out, one),
        all => print_json(out, &json!({ "pictures": all })),
    }
}

/// Adds what the pictures need: levels of detail, light, lamps, and textures of far portals.
fn prepare(
    args: &Render,
    world: &World,
    studio: &mut Studio,
    ahead: Option<&[u8]>,
) -> anyhow::Result<()> {
    if args.lod > 0.0 {
        studio.add_levels(world)?;
    }
    if !args.plain || args.above || args.paint == Colors::Cells {
        light(studio, world)?;
    }
    if !args.plain && !args.no_lamps {
        light_lamps(studio, world)?;
    }
    studio.day = args.daylight;
    add_textures(args, studio, ahead)
}

/// Draws a picture of a size, which may be a multiple of the requested one. Counts the textures in it.
fn draw(
    args: &Render,
    world: &World,
    studio: &mut Studio,
    lived: Option<&mut Lived>,
    mirrored: Option<&mut Mirrored>,
    camera: &Camera,
    size: [u32; 2],
) -> anyhow::Result<(Picture, PortalTextureCounts)> {
    let none = PortalTextureCounts::default();
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
        return Ok((
            lived.picture(studio, PartId::ROOT, camera, style, size)?,
            none,
        ));
    }
    if args.above {
        return Ok((above(studio, world, camera, args.cut, size)?, none));
    }
    let marks = if args.portals {
        portal_marks(studio, world, camera, size)?
    } else {
        Vec::new()
    };
    let culling = args.mode.culling();
    if let Some(mirrored) = mirrored {
        return mirrored.picture(studio, camera, culling, style, &marks, size);
    }
    let counts = if culling == Culling::PortalTextures {
        settle(studio, |s| Ok(s.plan_portal_textures(camera, style, size)?))?
    } else {
        none
    };
    let picture = studio.picture(camera, culling, style, &marks, size)?;
    Ok((picture, counts))
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
    /// Portals that are textures, and those of one color because of the bound on triangles.
    #[serde(skip_serializing_if = "Option::is_none")]
    textured_portals: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    plain_portals: Option<usize>,
    /// Textures drawn for the picture, and taken from those made ahead.
    #[serde(skip_serializing_if = "Option::is_none")]
    textures_made: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    textures_loaded: Option<usize>,
    /// Size of the pieces loaded so far and of all, as packed; of packed worlds.
    #[serde(skip_serializing_if = "Option::is_none")]
    loaded_bytes: Option<[u64; 2]>,
}

/// Returns how a picture was culled: a mirror in view leaves no portal as a texture.
fn culled(mode: RenderMode, textures: Option<PortalTextureCounts>, is_mirrored: bool) -> Culling {
    match textures {
        Some(none) if is_mirrored && none.n_textured == 0 => Culling::Portals,
        _ => mode.culling(),
    }
}

impl Drawn {
    fn new(
        file: String,
        studio: &mut Studio,
        world: &World,
        // The size before halving: sparing depends on its pixels.
        size: [u32; 2],
        camera: &Camera,
        culling: Culling,
    ) -> anyhow::Result<Self> {
        let view = camera.view(size[0] as f32 / size[1] as f32)?;
        let list = studio.list(&view, camera.eye, culling, size);
        let (triangles, draws) = (list.n_triangles(), list.n_draws());
        let cell = studio.sight.locate(camera.eye);
        Ok(Self {
            file,
            eye: camera.eye,
            look: [0, 1, 2].map(|k| camera.eye[k] + camera.toward[k]),
            cell: cell.map(|c| c.0),
            cell_name: cell.map(|c| world.graph[c].name.clone()),
            triangles,
            of_triangles: studio.world.n_triangles(),
            draws,
            adapter: studio.gpu.name(),
            textured_portals: None,
            plain_portals: None,
            textures_made: None,
            textures_loaded: None,
            loaded_bytes: None,
        })
    }

    fn record(&mut self, textures: Option<PortalTextureCounts>) {
        self.textured_portals = textures.map(|t| t.n_textured);
        self.plain_portals = textures.map(|t| t.n_plain);
        self.textures_made = textures.map(|t| t.n_made);
        self.textures_loaded = textures.map(|t| t.n_loaded);
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
        )?;
        if let (Some(n), Some(plain)) = (self.textured_portals, self.plain_portals) {
            write!(f, ", {n} portals are textures, {plain} of one color")?;
        }
        if let Some([loaded, all]) = self.loaded_bytes {
            let [loaded, all] = [loaded, all].map(|n| n as f64 / 1e6);
            write!(f, ", {loaded:.2} of {all:.2} MB loaded")?;
        }
        Ok(())
    }
}

/// Outlines of the portals in view, and the rectangles that they narrow the view to.
pub(crate) fn portal_marks(
    studio: &mut Studio,
    world: &World,
    camera: &Camera,
    size: [u32; 2],
) -> anyhow::Result<Vec<PictureMark>> {
    let view = camera.view(size[0] as f32 / size[1] as f32)?;
    let seen = studio.viewer.see(&studio.sight, &studio.state, &view);
    let mut marks = Vec::new();
    add_portal_marks(&mut marks, world, &Pose::IDENTITY, &seen, camera, size);
    Ok(marks)
}

/// Adds the marks of a world that stands at a pose in the frame of the camera.
pub(crate) fn add_portal_marks(
    marks: &mut Vec<PictureMark>,
    world: &World,
    pose: &Pose,
    seen: &Seen<'_>,
    camera: &Camera,
    size: [u32; 2],
) {
    let eye = DVec3::from(camera.eye.map(f64::from));
    for p in seen.portals() {
        let outline = world.graph[*p].outline.iter();
        let outline: Vec<DVec3> = outline
            .map(|p| pose.point(DVec3::from(p.map(f64::from))))
            .collect();
        // As wide as a frame of 20 mm, so that far ones are thin; at least a pixel of the finished picture.
        let focal = size[1] as f32 * 0.5 / (camera.fov_y * 0.5).tan();
        let nearest = outline.iter().map(|p| p.distance(eye) as f32);
        let nearest = nearest.fold(f32::INFINITY, f32::min);
        let outline: Vec<[f32; 3]> = outline.iter().map(|p| p.as_vec3().to_array()).collect();
        let (least, most) = (size[1] as f32 / 540.0, size[1] as f32 / 110.0);
        let width = (0.02 * focal / nearest.max(0.1)).clamp(least, most);
        let mark = |shape, color, width, on_top| PictureMark {
            shape,
            color,
            width,
            on_top,
        };
        let area = MarkShape::Area(outline.clone());
        marks.push(mark(area, [1.0, 0.62, 0.05, 0.10], 0.0, false));
        let line = MarkShape::Outline(outline);
        marks.push(mark(line.clone(), [1.0, 0.45, 0.02, 0.22], width, true));
        marks.push(mark(line, [1.0, 0.45, 0.02, 1.0], width, false));
    }
    let visits = seen.visits().iter();
    for v in visits.filter(|v| v.via.is_some() && v.face == 0) {
        marks.push(PictureMark {
            shape: MarkShape::Rectangle(v.rectangle),
            color: [0.05, 0.55, 0.9, 0.8],
            width: size[1] as f32 / 480.0,
            on_top: true,
        });
    }
}
