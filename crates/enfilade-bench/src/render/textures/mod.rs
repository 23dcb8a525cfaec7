//! `bench portal-textures`: doorways drawn as pictures of the rooms behind, against portal culling and frustum culling.
//!
//! After Aliaga & Lastra, "Architectural Walkthroughs Using Portal Textures" (IEEE Visualization 1997), §5. To add a way to
//! draw, add a variant to [`DrawMode`] and name it in `FIGURES` in `figures.rs`; to add a row, a line in [`ROWS`].

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

use crate::rows::{Chosen, Row, RowPrinter};
use models::WalkedModel;
use series::{DrawMode, Series, measure};
use stroll::middle;

/// The options of the bench.
#[derive(Clone, clap::Args)]
pub(crate) struct PortalTextures {
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

/// The rows.
const ROWS: &[Row<Drawn>] = &[
    Row::scene("model", &["brooks", "haunted"], rows::model),
    Row::scene(
        "portal culling",
        &["brooks", "haunted", "institute", "tower"],
        rows::portal_culling,
    ),
    Row::scene("truth", &["brooks", "haunted"], rows::truth),
    Row::scene("fewer triangles", &["brooks", "haunted"], textured::gains),
    Row::scene(
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
    Row::scene("ends", &["institute", "duplex", "fzk-haus"], ends::ends),
    Row::scene(
        "bad input",
        &["institute", "duplex", "fzk-haus"],
        bad::bad_input,
    ),
    Row::scene("bound", &["institute", "tower"], textured::bound),
    Row::scene("figures", &["brooks", "haunted"], figures::draw),
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
pub(crate) fn bench_portal_textures(
    options: &PortalTextures,
    chosen: &Chosen,
    is_json: bool,
) -> anyhow::Result<()> {
    let drawn = Drawn {
        options: options.clone(),
        model: None,
        series: BTreeMap::new(),
    };
    let mut all = RowPrinter::new(is_json, chosen, drawn);
    // Scene by scene, for each is made once and some are large.
    SCENES
        .iter()
        .try_for_each(|scene| all.run_scene(ROWS, scene))?;
    all.finish()
}

/// Options, and measurements that later rows share.
struct Drawn {
    options: PortalTextures,
    /// The last model, with its studio.
    model: Option<(WalkedModel, Studio)>,
    series: BTreeMap<(String, DrawMode), Series>,
}

/// The rows of this benchmark.
type Measurements<'a> = RowPrinter<'a, Drawn>;

impl Measurements<'_> {
    /// Returns a model on the adapter; `None`, told as a row, if its scene is missing.
    fn studio(
        &mut self,
        row: &str,
        scene: &str,
    ) -> anyhow::Result<Option<(&WalkedModel, &mut Studio)>> {
        if self
            .state
            .model
            .as_ref()
            .is_none_or(|(m, _)| m.name != scene)
        {
            self.state.model = None;
            let Some(model) = WalkedModel::of(scene)? else {
                self.missing(row, scene);
                return Ok(None);
            };
            let gpu = enfilade_cli::adapter::open(&self.state.options.adapter)?;
            let studio = Studio::new(gpu, &model.world)?;
            self.state.model = Some((model, studio));
        }
        Ok((self.state.model.as_mut()).map(|(model, studio)| (&*model, studio)))
    }

    /// Returns the walk of a scene drawn one way, measured once; `None`, told as a row, if its scene is missing.
    fn series(
        &mut self,
        row: &str,
        scene: &str,
        mode: DrawMode,
    ) -> anyhow::Result<Option<&Series>> {
        let key = (scene.to_owned(), mode);
        if !self.state.series.contains_key(&key) {
            let options = &self.state.options;
            let (n, size, ahead) = (options.frames, options.size, options.ahead);
            let Some((model, studio)) = self.studio(row, scene)? else {
                return Ok(None);
            };
            let cameras = middle(&model.cameras(&studio.sight), n);
            let series = measure(studio, &model.world, &cameras, mode, size, ahead)?;
            self.state.series.insert(key.clone(), series);
        }
        Ok(self.state.series.get(&key))
    }
}
