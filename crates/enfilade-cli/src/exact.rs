//! `verify --views`: pictures with and without culling, compared pixel by pixel.

use std::fmt;
use std::path::PathBuf;

use enfilade::cpg::{CellId, World};
use enfilade::geom::shown;
use enfilade_demo::Rng;
use enfilade_render::{
    AdapterChoice, Camera, Culling, LostPixel, MarkShape, Oracle, Picture, PictureMark,
    PixelContent, Studio, Style,
};
use serde::Serialize;

use crate::formats::Format;
use crate::output::{Outputs, make_folder, write_whole};
use crate::progress::StageBar;
use crate::render::tell_of_pictures;
use enfilade_cli::cameras::random_camera;
use enfilade_cli::doors::random_doors;
use enfilade_cli::values::size;

/// Most eyes drawn for one view, if they lie on surfaces.
const MAX_DRAWS: usize = 100;

/// Options of the comparison.
#[derive(clap::Args)]
pub(crate) struct ViewComparison {
    /// Views to draw with and without culling by portals, and to compare pixel by pixel.
    #[arg(long, default_value_t = 0, value_name = "N")]
    views: u64,
    /// Open and shut doors at random, again for each of these views.
    #[arg(long, requires = "views")]
    doors: bool,
    /// Size of the compared pictures.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "320x240")]
    view_size: [u32; 2],
    /// Draw the views that differ, with and without culling, to PNG files in this folder.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Adapter to draw the views with: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME")]
    adapter: AdapterChoice,
}

/// Results of the comparison.
#[derive(Default, Serialize)]
pub(crate) struct Exactness {
    views: u64,
    pixels: u64,
    /// Pixels that differ.
    differing: u64,
    /// Views with such pixels.
    differing_views: u64,
    /// Pixels whose center lies on an edge, within a 64th of a pixel: both pictures are right.
    edges: u64,
    /// Pixels where the picture without culling shows something through a crack alone that is at most as wide as the
    /// adapter's rounding, or as the world's tolerance.
    cracks: u64,
    /// Views skipped because the eye was on a surface.
    on_surface: u64,
    /// Triangles drawn, and triangles drawn without culling.
    triangles: [u64; 2],
    adapter: String,
    lost: Vec<Lost>,
}

/// An object or triangle missing from the culled picture.
#[derive(Serialize)]
struct Lost {
    view: u64,
    eye: [f32; 3],
    look: [f32; 3],
    fov_degrees: f32,
    cell: Option<u32>,
    #[serde(skip)]
    cell_name: Option<String>,
    at: [u32; 2],
    pixels: usize,
    expected: String,
    /// Cells that see it.
    cells: Vec<u32>,
    #[serde(skip)]
    cell_names: Vec<String>,
    found: String,
    /// Distances of the missing and of the shown surface along the view direction. [Units: wu]
    depths: [f32; 2],
}

impl Exactness {
    /// Pixels that differ.
    pub(crate) fn differing(&self) -> u64 {
        self.differing
    }
}

impl fmt::Display for Exactness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = 100.0 * self.triangles[0] as f64 / self.triangles[1].max(1) as f64;
        writeln!(
            f,
            "exact      {} views, {} pixels: {} lost in {} views; {} are on an edge, {} look through cracks no wider \
             than rounding and tolerance\n                 {} views passed over at a surface; {share:.2} % of the triangles drawn; {}",
            self.views,
            self.pixels,
            self.differing,
            self.differing_views,
            self.edges,
            self.cracks,
            self.on_surface,
            self.adapter
        )?;
        for l in &self.lost {
            let p = |p: [f32; 3]| format!("{},{},{}", p[0], p[1], p[2]);
            writeln!(
                f,
                "  view {}: {} pixels, at {},{} {} of {} at {:.4} m is not drawn, {} at {:.4} m is; \
                 --eye {} --look {} --fov {}, in {}",
                l.view,
                l.pixels,
                l.at[0],
                l.at[1],
                shown(&l.expected),
                shown(l.cell_names.join(" ")),
                l.depths[0],
                shown(&l.found),
                l.depths[1],
                p(l.eye),
                p(l.look),
                l.fov_degrees,
                shown(l.cell_name.as_deref().unwrap_or("no cell"))
            )?;
        }
        Ok(())
    }
}

/// The content of a pixel in words, and the cells that see it.
fn named(studio: &Studio, world: &World, shown: PixelContent) -> (String, Vec<CellId>) {
    match shown {
        PixelContent::Sky => ("the sky".into(), Vec::new()),
        PixelContent::Structure { triangle } => {
            let chunk = studio.world.chunk_of_triangle(triangle);
            let batch = chunk.and_then(|c| studio.world.batch_of_chunk(c));
            let cells = batch.map_or(Vec::new(), |b| world.batches[b as usize].cells.clone());
            let batch = batch.map_or("?".to_owned(), |b| b.to_string());
            (format!("triangle {triangle} of batch {batch}"), cells)
        }
        PixelContent::Plug { portal } => (
            format!("what fills {portal}"),
            world.graph[portal].cells.to_vec(),
        ),
        PixelContent::Detail { detail, .. } => {
            let d = &world.details[detail as usize];
            (format!("detail {detail} ({})", d.name), d.cells.clone())
        }
    }
}

impl ViewComparison {
    /// Makes the folder of pictures.
    pub(crate) fn make_folder(&self) -> anyhow::Result<()> {
        match &self.pictures {
            Some(folder) if self.views > 0 => make_folder("--pictures", folder),
            _ => Ok(()),
        }
    }

    /// Compares views, if asked to; lists as many losses as `max_listed`.
    pub(crate) fn compare(
        &self,
        world: &World,
        seed: u64,
        max_listed: usize,
        outputs: &mut Outputs,
    ) -> anyhow::Result<Option<Exactness>> {
        if self.views == 0 {
            return Ok(None);
        }
        let mut studio = Studio::new(enfilade_cli::adapter::open(&self.adapter)?, world)?;
        tell_of_pictures(&studio)?;
        let bounds = studio.world.bounds();
        let margin = 0.05;
        let bounds = [bounds[0].map(|x| x - margin), bounds[1].map(|x| x + margin)];
        let mut rng = Rng::new(seed);
        let mut out = Exactness {
            views: self.views,
            adapter: studio.gpu.name(),
            ..Exactness::default()
        };
        let mut oracle = Oracle::new(world, &studio.sight);
        let bar = StageBar::new();
        bar.start("comparing pictures", self.views);
        let aspect = self.view_size[0] as f32 / self.view_size[1] as f32;
        for view in 0..self.views {
            // No renderer draws what the near plane cuts off, so draw another eye.
            if self.doors {
                studio.state = random_doors(&mut rng, &studio.sight);
                oracle.follow(&studio.sight, &studio.state);
            }
            let mut camera = random_camera(&mut rng, world, &studio.sight, bounds);
            for _ in 0..MAX_DRAWS {
                if !oracle.is_at_surface(camera.eye) {
                    break;
                }
                camera = random_camera(&mut rng, world, &studio.sight, bounds);
            }
            if oracle.is_at_surface(camera.eye) {
                out.on_surface += 1;
                continue;
            }
            let [whole, culled] = studio.ids_compared(&camera, self.view_size)?;
            out.triangles[1] += studio.world.n_triangles();
            let seen = camera.view(aspect)?;
            out.triangles[0] += studio
                .list(&seen, camera.eye, Culling::Portals, self.view_size)
                .n_triangles();
            let mut lost: Vec<LostPixel> = Vec::new();
            for (layer, (a, b)) in whole.iter().zip(&culled).enumerate() {
                let mut difference = a.difference(b);
                // Each pixel once, although it has two layers.
                out.pixels += if layer == 0 { difference.n_pixels } else { 0 };
                // If another opaque triangle is shown, and rightly, it hides other things as well.
                let is_hidden_by_that = |l: &LostPixel| {
                    let [before, now] = [&whole[0], &culled[0]].map(|p| p.at(l.at));
                    layer == 1
                        && before.0 != now.0
                        && Camera::distance_of(before.1) <= Camera::distance_of(l.found.1)
                        && !lost.iter().any(|o| o.at == l.at)
                };
                difference.lost.retain(|l| {
                    if is_hidden_by_that(l) {
                        out.edges += 1;
                        return false;
                    }
                    let drawn = f64::from(Camera::distance_of(l.found.1));
                    let on_edge = oracle.is_right(&camera, l.at, self.view_size, drawn, layer == 1);
                    let in_crack =
                        !oracle.is_met(&camera, l.at, self.view_size, l.expected.0, layer == 1);
                    out.edges += u64::from(on_edge);
                    out.cracks += u64::from(in_crack && !on_edge);
                    !on_edge && !in_crack
                });
                lost.extend(difference.lost);
            }
            if !lost.is_empty() {
                out.differing += lost.len() as u64;
                out.differing_views += 1;
                if out.lost.len() < max_listed {
                    out.lost
                        .push(describe(&studio, world, &camera, view, &lost));
                    if let Some(dir) = &self.pictures {
                        let picture = picture_of_loss(&mut studio, &camera, &lost, self.view_size)?;
                        let to = dir.join(format!("view-{view}.png"));
                        outputs.write("--pictures", Format::Picture, &to)?;
                        write_whole(&to, &picture.to_png()?)?;
                    }
                }
            }
            bar.set(view + 1);
        }
        bar.finish();
        Ok(Some(out))
    }
}

fn describe(
    studio: &Studio,
    world: &World,
    camera: &Camera,
    view: u64,
    lost: &[LostPixel],
) -> Lost {
    let first = lost[0];
    let (expected, cells) = named(studio, world, first.expected.0);
    let (found, _) = named(studio, world, first.found.0);
    let cell = studio.sight.locate(camera.eye);
    let name = |c: &CellId| world.graph[*c].name.clone();
    Lost {
        view,
        eye: camera.eye,
        look: [0, 1, 2].map(|k| camera.eye[k] + camera.toward[k]),
        fov_degrees: camera.fov_y.to_degrees(),
        cell: cell.map(|c| c.0),
        cell_name: cell.as_ref().map(name),
        at: first.at,
        pixels: lost.len(),
        expected,
        cell_names: cells.iter().map(name).collect(),
        cells: cells.iter().map(|c| c.0).collect(),
        found,
        depths: [first.expected.1, first.found.1].map(Camera::distance_of),
    }
}

/// Everything, the culled picture, and both from outside: side by side, with frames around the missing parts.
fn picture_of_loss(
    studio: &mut Studio,
    camera: &Camera,
    lost: &[LostPixel],
    size: [u32; 2],
) -> anyhow::Result<Picture> {
    let style = Style {
        shadows: false,
        dark_corners: false,
        ..Style::default()
    };
    let marks: Vec<PictureMark> = lost
        .iter()
        .take(200)
        .map(|l| {
            let at = |i: usize, d: f32| (l.at[i] as f32 + 0.5 + d) / size[i] as f32 * 2.0 - 1.0;
            PictureMark {
                shape: MarkShape::Rectangle([at(0, -4.0), -at(1, 4.0), at(0, 4.0), -at(1, -4.0)]),
                color: [1.0, 0.0, 0.2, 1.0],
                width: 1.5,
                on_top: true,
            }
        })
        .collect();
    let whole = studio.picture(camera, Culling::Everything, style, &marks, size)?;
    let culled = studio.picture(camera, Culling::Portals, style, &marks, size)?;
    let mut out = Picture {
        width: size[0] * 2,
        height: size[1],
        rgba: vec![255; (size[0] * size[1] * 8) as usize],
    };
    out.put(&whole, 0, 0);
    out.put(&culled, size[0], 0);
    Ok(out)
}
