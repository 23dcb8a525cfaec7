//! `enfilade view`: a walk in a window, in which worlds are edited.

mod app;
mod args;
mod bare;
mod doors;
mod editing;
mod edits;
mod events;
mod map;
mod mode;
mod open;
mod panel;
mod pointed;
mod review_window;
mod reviewing;
mod reviews;
mod steering;
mod strider;
mod titles;
mod walker;

use std::io::Write as _;
use std::sync::Arc;

use anyhow::Context;
use enfilade::world::{PartId, Space};
use enfilade_render::FOV;

use self::app::App;
pub(crate) use self::args::View;
use self::editing::begin;
use self::events::{open_events, run_app};
pub(crate) use self::review_window::{ReviewOptions, open_review};
use crate::formats::Format;
use crate::living::{Lived, LivingFile};
use crate::output::{Outputs, refuse_stream};
use crate::screen::Told;
use crate::walk::WorldFile;
use enfilade_cli::cameras::read_path;
use enfilade_cli::streamed::Packed;
use enfilade_cli::world::read_world_hashed;

pub(crate) fn run(args: &View) -> anyhow::Result<()> {
    args.limits.begin()?;
    let inputs = args.world.iter().chain(&args.path);
    let inputs = inputs.chain(&args.textures);
    let mut outputs = Outputs::reading(inputs.chain(&args.living))?;
    // Writability is tested when a key requests a file: most walks write none.
    for (option, format, path) in [
        ("--record", Format::Cameras, &args.record),
        ("--screenshot", Format::Picture, &args.screenshot),
    ] {
        refuse_stream(option, path, "files of a walk")?;
        format.check(option, path)?;
    }
    let path = args
        .path
        .as_deref()
        .map(|p| read_path(p, FOV))
        .transpose()?;
    let mut events = None;
    let begun = match &args.save {
        Some(save) => {
            let (world, kit) = (args.world.as_deref(), args.kit.as_deref());
            let open = || {
                events = Some(open_events()?);
                Ok(())
            };
            Some(begin(world, kit, save, &mut outputs, open)?)
        }
        None => None,
    };
    let (editor, (lived, packed)) = match begun {
        Some((editor, space)) => {
            let lived = Lived::in_space(space, LivingFile::default(), Vec::new(), None)?;
            (Some(editor), (lived, None))
        }
        None => (None, read(args)?),
    };
    let events = events.map_or_else(open_events, Ok)?;
    let app = App {
        args,
        world: Arc::clone(lived.space.world(PartId::ROOT)),
        packed,
        path: path.map(Into::into),
        lived: Some(lived),
        outputs,
        editor,
        reviewer: None,
        baking: None,
        open: None,
        failed: None,
    };
    run_app(events, app)
}

/// Reads the world, and what lives in it; of a packed one only the head, if that is enough.
fn read(args: &View) -> anyhow::Result<(Lived, Option<Packed>)> {
    let path = args.world.as_ref().context("a world is needed")?;
    if Packed::is_at(path) {
        let needs_whole = [
            (args.living.is_some(), "--living"),
            (args.lod > 0.0, "--lod"),
            (args.portal_textures, "--portal-textures"),
            (args.max_triangles.is_some(), "--max-triangles"),
        ];
        let Some((_, option)) = needs_whole.into_iter().find(|n| n.0) else {
            let packed = Packed::open(path)?;
            let world = packed.head.world.clone();
            let space = Space::with_sight(world, packed.head.sight()?);
            let lived = Lived::in_space(space, LivingFile::default(), Vec::new(), None)?;
            let name = path.display();
            let memory = args.memory;
            writeln!(
                Told,
                "enfilade: {name} is streamed into {memory} MiB, without daylight and shadows of the sun"
            )?;
            return Ok((lived, Some(packed)));
        };
        let name = path.display();
        writeln!(
            Told,
            "enfilade: {name} is loaded whole: {option} needs all of it"
        )?;
    }
    let (world, hash) = read_world_hashed(path)?;
    let file = WorldFile { path, hash };
    let lived = match &args.living {
        Some(living) => Lived::read(living, &world, Some(file))?,
        None => Lived::new(world, LivingFile::default(), Vec::new(), None)?,
    };
    Ok((lived, None))
}
