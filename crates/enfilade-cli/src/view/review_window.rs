//! Options of `enfilade decimate --window`, and the begin of its window.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::bail;
use enfilade::world::Space;
use enfilade_render::AdapterChoice;
use winit::event_loop::EventLoop;

use super::app::App;
use super::args::View;
use super::events::{open_events, run_app};
use super::reviewing::{Reviewer, scene_world};
use crate::formats::Format;
use crate::living::{Lived, LivingFile};
use crate::output::{Outputs, refuse_stream};
use crate::reviewed::Reviewed;
use enfilade_cli::values::{point, size};

const WINDOW: &str = "Window";

#[derive(clap::Args)]
pub(crate) struct ReviewOptions {
    /// Open a window on the scene: the portals left at each step are shown in place and colored by weight, and keys go
    /// through the steps, keep and join portals, undo and redo, save, and bake; F1 in the window lists them.
    #[arg(long, conflicts_with_all = ["steps", "json"], help_heading = WINDOW)]
    pub(crate) window: bool,
    /// File that F2 writes the decisions to [default: that of --choices, or choices.toml].
    #[arg(long, value_name = "TOML", requires = "window", help_heading = WINDOW)]
    save: Option<PathBuf>,
    /// Start, in meters; before the portal of the next step if not given.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true, requires = "window", help_heading = WINDOW)]
    eye: Option<[f32; 3]>,
    /// File that F12 writes pictures to; `shot.png` becomes `shot-1.png` and so on.
    #[arg(long, value_name = "PNG", default_value = "shot.png", requires = "window", help_heading = WINDOW)]
    screenshot: PathBuf,
    /// Size of the window.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x720", requires = "window", help_heading = WINDOW)]
    size: [u32; 2],
    /// Leave the mouse free at first: drag to look around; Tab captures it.
    #[arg(long, requires = "window", help_heading = WINDOW)]
    free_mouse: bool,
    /// Adapter to draw with: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME", requires = "window", help_heading = WINDOW)]
    adapter: AdapterChoice,
}

/// A window to come, and its files.
pub(crate) struct ReviewWindow {
    events: EventLoop<()>,
    save: PathBuf,
    output: Option<PathBuf>,
    name: PathBuf,
}

impl ReviewOptions {
    /// Checks the files, and that a window can be opened: before the scene is read. `known` is the file of decisions
    /// that is read.
    ///
    /// # Errors
    ///
    /// If a file cannot be written, or the system opens no windows.
    pub(crate) fn begin(
        &self,
        input: &Path,
        output: Option<&Path>,
        known: Option<&Path>,
        choices: &mut Outputs,
    ) -> anyhow::Result<Option<ReviewWindow>> {
        if !self.window {
            return Ok(None);
        }
        if let Some(path) = output {
            refuse_stream("-o", path, "a file that F3 writes")?;
        }
        let save = self.save.as_deref().or(known);
        let save = save.unwrap_or(Path::new("choices.toml")).to_owned();
        refuse_stream("--save", &save, "a file that F2 writes")?;
        if self.save.is_some() {
            choices.write("--save", Format::Choices, &save)?;
        }
        refuse_stream("--screenshot", &self.screenshot, "files of a walk")?;
        Format::Picture.check("--screenshot", &self.screenshot)?;
        let Ok(events) = open_events() else {
            bail!("no window can be opened here; `enfilade decimate --steps` reviews without one");
        };
        Ok(Some(ReviewWindow {
            events,
            save,
            output: output.map(Path::to_owned),
            name: input.to_owned(),
        }))
    }

    /// The options of a window of `view`.
    fn view(&self, name: PathBuf) -> View {
        View {
            world: Some(name),
            living: None,
            eye: self.eye,
            path: None,
            record: "path.txt".into(),
            screenshot: self.screenshot.clone(),
            size: self.size,
            free_mouse: self.free_mouse,
            stop: 0.0,
            objects: 0.0,
            lod: 0.0,
            portal_textures: false,
            textures: None,
            max_triangles: None,
            adapter: self.adapter.clone(),
            memory: 1024,
            save: None,
            kit: None,
            limits: crate::limits::Limits::default(),
        }
    }
}

/// Opens the window of a review, until it is closed.
///
/// # Errors
///
/// If the window fails.
pub(crate) fn open_review(
    options: &ReviewOptions,
    window: ReviewWindow,
    reviewed: Reviewed<'_>,
) -> anyhow::Result<()> {
    let args = options.view(window.name);
    let world = Arc::new(scene_world(reviewed.scene()));
    let space = Space::new(Arc::clone(&world))?;
    let outputs = reviewed.outputs.clone();
    let (save, output) = (window.save, window.output);
    let app = App {
        args: &args,
        world: Arc::clone(&world),
        packed: None,
        path: None,
        lived: Some(Lived::in_space(
            space,
            LivingFile::default(),
            Vec::new(),
            None,
        )?),
        outputs,
        editor: None,
        reviewer: Some(Reviewer::new(reviewed, save, output, world)),
        baking: None,
        open: None,
        failed: None,
    };
    run_app(window.events, app)
}
