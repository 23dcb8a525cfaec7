//! `bench portal-textures`: doorways drawn as pictures of the rooms behind, against portal culling and frustum culling.
//!
//! After Aliaga & Lastra, "Architectural Walkthroughs Using Portal Textures" (IEEE Visualization 1997), §5. To add a way to
//! draw, add a variant to [`DrawMode`] and name it in `FIGURES` in `figures.rs`; to add a row, a line in [`PARTS`].

mod bad;
mod ends;
mod errors;
mod figures;
mod models;
mod plot;
mod rows;
mod series;
mod stroll;
mod textured;

use std::collections::BTreeMap;

use enfilade_cli::values::{bytes, size};
use enfilade_render::{AdapterChoice, Studio};

use crate::rows::{Chosen, RowPrinter};
use models::WalkedModel;
use series::{DrawMode, Series, measure};
use stroll::middle;

/// The options of the bench.
#[derive(clap::Args)]
pub(crate) struct PortalTextures {
    #[command(flatten)]
    chosen: Chosen,
    /// Successive frames of each walk, 60 a second, around the middle of the whole walk.
    #[arg(long, default_value_t = 1000)]
    frames: usize,
    /// Pairs of frames of which pictures are compared.
    #[arg(long, default_value_t = 20)]
    pictures: usize,
    /// Size of the frames.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "640x480")]
    size: [u32; 2],
    /// Largest file of textures made ahead: a number and K, M, G or T.
    #[arg(long, value_name = "BYTES", default_value = "64M", value_parser = bytes)]
    ahead: u64,
    /// Adapter: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME")]
    adapter: AdapterChoice,
    /// Write the plots to docs/images.
    #[arg(long)]
    write: bool,
}

type TexturesPart = fn(&mut Measurements<'_>, &str) -> anyhow::Result<()>;

/// The rows: a function, its first word, its scenes.
const PARTS: &[(&str, &[&str], TexturesPart)] = &[
    ("model", &["brooks", "haunted"], rows::model),
    (
        "portal culling",
        &["brooks", "haunted", "institute", "tower"],
        rows::portal_culling,
    ),
    ("truth", &["brooks", "haunted"], rows::truth),
    ("fewer triangles", &["brooks", "haunted"], textured::gains),
    (
        "quality",
        &[
            "brooks",
            "haunted",
            "institute",
            "duplex",
            "aws-small-house",
        ],
        textured::quality,
    ),
    ("ends", &["institute", "duplex", "fzk-haus"], ends::ends),
    (
        "bad input",
        &["institute", "duplex", "fzk-haus"],
        bad::bad_input,
    ),
    ("bound", &["institute", "tower"], textured::bound),
    ("figures", &["brooks", "haunted"], figures::draw),
];

/// Scenes in the order of their rows.
const SCENES: [&str; 7] = [
    "brooks",
    "haunted",
    "institute",
    "duplex",
    "aws-small-house",
    "fzk-haus",
    "tower",
];

/// Measures and prints; fails if a bar is missed.
pub(crate) fn bench_portal_textures(options: &PortalTextures, is_json: bool) -> anyhow::Result<()> {
    let mut all = Measurements {
        printer: RowPrinter::new(is_json),
        options,
        model: None,
        series: BTreeMap::new(),
    };
    // Scene by scene, for each is made once and some are large.
    for scene in SCENES {
        for (name, scenes, part) in PARTS.iter().copied() {
            let is_asked = options.chosen.has_row(name) && options.chosen.has_scene(scene);
            if is_asked && scenes.contains(&scene) {
                part(&mut all, scene)?;
            }
        }
    }
    all.printer.finish()
}

/// The rows printed so far, and what later ones share.
struct Measurements<'a> {
    printer: RowPrinter,
    options: &'a PortalTextures,
    /// The last model, with its studio.
    model: Option<(WalkedModel, Studio)>,
    series: BTreeMap<(String, DrawMode), Series>,
}

impl Measurements<'_> {
    /// Returns a model on the adapter; `None`, told as a row, if its scene is missing.
    fn studio(
        &mut self,
        row: &str,
        scene: &str,
    ) -> anyhow::Result<Option<(&WalkedModel, &mut Studio)>> {
        if self.model.as_ref().is_none_or(|(m, _)| m.name != scene) {
            self.model = None;
            let Some(model) = WalkedModel::of(scene)? else {
                (self.printer).print(row, scene, None, "", None, "the scene is missing");
                return Ok(None);
            };
            let gpu = enfilade_cli::adapter::open(&self.options.adapter)?;
            let studio = Studio::new(gpu, &model.world)?;
            self.model = Some((model, studio));
        }
        Ok((self.model.as_mut()).map(|(model, studio)| (&*model, studio)))
    }

    /// Returns the walk of a scene drawn one way, measured once; `None`, told as a row, if its scene is missing.
    fn series(
        &mut self,
        row: &str,
        scene: &str,
        mode: DrawMode,
    ) -> anyhow::Result<Option<&Series>> {
        let key = (scene.to_owned(), mode);
        if !self.series.contains_key(&key) {
            let (n, size) = (self.options.frames, self.options.size);
            let frames = (size, self.options.ahead);
            let Some((model, studio)) = self.studio(row, scene)? else {
                return Ok(None);
            };
            let cameras = middle(&model.cameras(&studio.sight), n);
            let series = measure(studio, (&model.world, &cameras), mode, frames)?;
            self.series.insert(key.clone(), series);
        }
        Ok(self.series.get(&key))
    }

    fn at_least(&mut self, row: &str, scene: &str, value: f64, least: Option<f64>, note: &str) {
        let bar = least.map_or_else(String::new, |least| format!(">= {least}"));
        let ok = least.map(|least| value >= least);
        self.printer.print(row, scene, Some(value), &bar, ok, note);
    }

    fn at_most(&mut self, row: &str, scene: &str, value: f64, most: f64, note: &str) {
        let bar = format!("<= {most}");
        let ok = Some(value <= most);
        self.printer.print(row, scene, Some(value), &bar, ok, note);
    }
}
