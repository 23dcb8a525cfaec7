//! Pictures of a report, and its walk, which is measured in views of a camera.

use std::io::Write;

use anyhow::bail;
use enfilade::cpg::World;
use enfilade::runtime::{Sight, SightState, Viewer};
use enfilade_render::{
    AdapterChoice, Culling, FOV, Gpu, RenderError, Studio, Style, good_camera, walk_cameras,
};
use enfilade_report::{Figure, ReportParts, Table};

use super::row;
use crate::render::{above, light, portal_marks, smooth, tell_of_pictures};
use crate::screen::Warned;

/// Options of all that needs a camera.
#[derive(clap::Args)]
pub(super) struct PictureOptions {
    /// Number of views on the measured walk, 100,000 at most.
    #[arg(long, default_value_t = 200, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=100_000))]
    views: u32,
    /// Adapter to draw pictures with: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME")]
    adapter: AdapterChoice,
    /// Leave out pictures: no adapter is needed.
    #[arg(long)]
    no_pictures: bool,
}

/// Adds a table of the walk, and pictures if there is an adapter.
pub(super) fn add(
    parts: &mut ReportParts,
    options: &PictureOptions,
    world: &World,
    sight: &Sight,
) -> anyhow::Result<()> {
    let steps = measured(world, sight, options.views as usize);
    if !steps.is_empty() {
        parts.tables.push(on_a_walk(sight, &steps));
    }
    if options.no_pictures {
        return Ok(());
    }
    match enfilade_cli::adapter::open(&options.adapter) {
        Ok(gpu) => parts.figures = pictures(gpu, world)?,
        Err(why @ RenderError::NoAdapter) => {
            let _ = writeln!(Warned, "enfilade: the report has no pictures: {why}");
            parts.notes.push(format!("No pictures: {why}."));
        }
        Err(why) => bail!(why),
    }
    Ok(())
}

const SIZE: [u32; 2] = [960, 540];

/// One view of the walk.
struct Step {
    frustum: u64,
    portals: u64,
    cells: usize,
    clips: u64,
}

fn measured(world: &World, sight: &Sight, views: usize) -> Vec<Step> {
    let state = SightState::new(sight);
    let mut viewer = Viewer::new(sight);
    let mut steps = Vec::new();
    for camera in walk_cameras(world, sight, views, FOV) {
        let Ok(view) = camera.view(16.0 / 9.0) else {
            continue;
        };
        let frustum = viewer.see_through_walls(sight, &view).n_triangles();
        let seen = viewer.see(sight, &state, &view);
        steps.push(Step {
            frustum,
            portals: seen.n_triangles(),
            cells: seen.cells().len(),
            clips: u64::from(seen.counts().clips),
        });
    }
    steps
}

fn on_a_walk(sight: &Sight, steps: &[Step]) -> Table {
    let all = sight.n_triangles().max(1) as f64;
    let line = |name: &str, digits: usize, value: &dyn Fn(&Step) -> f64| {
        let values = || steps.iter().map(value);
        let mean = values().sum::<f64>() / steps.len() as f64;
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(0.0, f64::max);
        let mut cells = vec![name.to_owned()];
        cells.extend([low, mean, high].map(|x| format!("{x:.digits$}")));
        cells
    };
    Table {
        title: "On a walk".into(),
        note: format!(
            "{} views at eye height, a meter apart, through the doorways.",
            steps.len()
        ),
        rows: vec![
            row(&["", "least", "mean", "most"]),
            line("triangles in the view frustum, %", 2, &|s| {
                s.frustum as f64 / all * 100.0
            }),
            line("triangles seen through doorways, %", 2, &|s| {
                s.portals as f64 / all * 100.0
            }),
            line("rooms seen", 1, &|s| s.cells as f64),
            line("doorways clipped to find out", 1, &|s| s.clips as f64),
        ],
    }
}

fn pictures(gpu: Gpu, world: &World) -> anyhow::Result<Vec<Figure>> {
    let mut studio = Studio::new(gpu, world)?;
    tell_of_pictures(&studio)?;
    light(&mut studio, world)?;
    let mut out = Vec::new();
    let style = Style::default();
    let camera = good_camera(&mut studio, world)?;
    let picture = smooth(SIZE, |size| {
        Ok(studio.picture(&camera, Culling::Portals, style, &[], size)?)
    })?;
    out.push(Figure {
        caption: "A view inside.".into(),
        png: picture.to_png()?,
    });
    let picture = smooth(SIZE, |size| {
        let marks = portal_marks(&mut studio, world, &camera, size)?;
        Ok(studio.picture(&camera, Culling::Portals, style, &marks, size)?)
    })?;
    out.push(Figure {
        caption: "The same view: doorways in orange, the narrowed views in blue.".into(),
        png: picture.to_png()?,
    });
    let picture = smooth(SIZE, |size| above(&mut studio, world, &camera, None, size))?;
    out.push(Figure {
        caption: "The same view from above: what is visible keeps its color; behind walls reddish, out of view gray, the portals looked through orange.".into(),
        png: picture.to_png()?,
    });
    Ok(out)
}
