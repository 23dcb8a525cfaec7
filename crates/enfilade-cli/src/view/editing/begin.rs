//! The begin of an editing session: its kit, its world, and the journal beside the world that is saved.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, bail};
use enfilade::edit::{EditGround, EditSession};
use enfilade::geom::shown;
use enfilade::kit::{Choice, DEFAULT_TOLERANCE, Kit, Piece};
use enfilade::world::Space;

use super::editor::Editor;
use crate::formats::Format;
use crate::kit::read_kit;
use crate::output::{Outputs, refuse_stream};
use enfilade_cli::world::read_world_hashed;

/// Opens the session of a world that is to be saved at `save`: over `world`, if there is one, with the pieces of `kit`.
///
/// `before_journal` is called before a journal is made; if it fails, none is.
///
/// # Errors
///
/// If the world, the kit or the journal cannot be used, or if the file to save is not one that was edited here.
pub(crate) fn begin(
    world: Option<&Path>,
    kit: Option<&Path>,
    save: &Path,
    outputs: &mut Outputs,
    before_journal: impl FnOnce() -> anyhow::Result<()>,
) -> anyhow::Result<(Editor, Space)> {
    refuse_stream("--save", save, "a world with its journal")?;
    let journal = save.with_extension("journal");
    if save.exists() && !journal.exists() {
        bail!(
            "{} was not edited here: there is no {}; give it as the world to edit, and another name with --save",
            save.display(),
            journal.display()
        );
    }
    outputs.write("--save", Format::World, save)?;
    let read = world.map(|path| Ok::<_, anyhow::Error>((path, read_world_hashed(path)?)));
    let read = read.transpose()?;
    let folder = kit.map(read_kit).transpose()?;
    let tolerance = folder.as_ref().map_or(DEFAULT_TOLERANCE, |f| f.tolerance);
    if let Some(folder) = &folder {
        outputs.read(&folder.files)?;
    }
    let (kit, ground, mark) = match (folder, read) {
        (Some(folder), None) => (folder.kit, EditGround::Open, "-".to_owned()),
        (None, None) => bail!("a world or a kit is needed to edit"),
        (None, Some((_, (world, hash)))) => {
            let ground = EditGround::World(Arc::new(world));
            (Kit::default(), ground, format!("world-{hash:016x}"))
        }
        (Some(folder), Some((path, (world, hash)))) => {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            let piece = Piece::new(&*name, world, &Choice::Doorways);
            let piece = piece.with_context(|| {
                format!(
                    "pieces cannot be attached to {}",
                    shown(&path.to_string_lossy())
                )
            })?;
            let mut pieces = folder.kit.pieces().to_vec();
            let number = pieces.len();
            pieces.push(piece);
            let ground = EditGround::Piece(number);
            (Kit::new(pieces)?, ground, format!("piece-{hash:016x}"))
        }
    };
    before_journal()?;
    let opened = EditSession::open(&journal, Arc::new(kit), ground, &mark, tolerance);
    let (session, resumed) = opened.with_context(|| journal.display().to_string())?;
    let mut editor = Editor::new(session, save.to_owned(), journal);
    editor.resumed(&resumed);
    let space = if editor.has_parts() {
        editor.new_space()?
    } else {
        Space::new(editor.world()?.world.clone())?
    };
    Ok((editor, space))
}
