//! Levels on disk: a file of places, one a line, and what became of it.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::geom::{DQuat, DVec3};
use enfilade::kit::{Assembly, End, Link, PlaceError, PlaceOptions};
use enfilade::world::Pose;
use enfilade_settings::parse_toml;
use serde::{Deserialize, Serialize};

use crate::output::{Outputs, Written, write_whole};
use crate::screen::print_json;
use enfilade_cli::input::read_text;
use enfilade_cli::world::encode_whole;

/// A file of a level.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LevelFile {
    /// Folder of the kit, relative to the file.
    pub(crate) kit: PathBuf,
    place: Vec<PlaceEntry>,
    /// Attachments that must be joined.
    #[serde(default)]
    close: Vec<[String; 2]>,
}

/// An instance: at a place, or with one of its attachments onto that of an earlier one.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaceEntry {
    /// `PIECE`, or `PIECE.ATTACHMENT` if placed onto another.
    piece: String,
    /// `INSTANCE.ATTACHMENT`.
    onto: Option<String>,
    name: Option<String>,
    /// Position of the piece's origin. [Units: wu]
    at: Option<[f64; 3]>,
    /// Turn about the vertical, counter-clockwise from above. [Units: degrees]
    turn: Option<f64>,
    /// Turn about the normal of the opening. [Units: degrees]
    spin: Option<f64>,
    #[serde(default)]
    tilt: bool,
}

/// Reads a level's file.
///
/// # Errors
///
/// If it cannot be read or is not such a file; the error names it and the line.
pub(crate) fn read_level(path: &Path) -> anyhow::Result<LevelFile> {
    let text = read_text("the level", path)?;
    parse_toml(&text).with_context(|| path.display().to_string())
}

/// Places everything that a file lists.
///
/// # Errors
///
/// The first place that is refused; the error says which, and why.
pub(crate) fn build_level(file: &LevelFile, level: &mut Assembly) -> anyhow::Result<()> {
    for (i, entry) in file.place.iter().enumerate() {
        let what = || match &entry.onto {
            Some(onto) => format!("place {} ({} onto {onto})", i + 1, entry.piece),
            None => format!("place {} ({})", i + 1, entry.piece),
        };
        entry.place(level).with_context(what)?;
    }
    for (i, ends) in file.close.iter().enumerate() {
        let what = || format!("close {}", i + 1);
        let [a, b] = [0, 1].map(|k| end_named(level, &ends[k]));
        level
            .close(a.with_context(what)?, b.with_context(what)?)
            .with_context(what)?;
    }
    Ok(())
}

/// Returns the attachment of a name `INSTANCE.ATTACHMENT`.
fn end_named(level: &Assembly, name: &str) -> anyhow::Result<End> {
    let Some((instance, attachment)) = name.rsplit_once('.') else {
        bail!("{name:?}: an instance, a dot and an attachment are needed");
    };
    let id = level
        .named(instance)
        .ok_or_else(|| PlaceError::NoInstance(instance.to_owned()))?;
    let attachment = attachment_named(level.piece(id), attachment)?;
    Ok(End {
        instance: id,
        attachment,
    })
}

fn attachment_named(piece: &enfilade::kit::Piece, name: &str) -> Result<usize, PlaceError> {
    piece
        .attachment_named(name)
        .ok_or_else(|| PlaceError::NoAttachment {
            of: piece.name().to_owned(),
            name: name.to_owned(),
            known: piece.attachments().iter().map(|a| a.name.clone()).collect(),
        })
}

impl PlaceEntry {
    fn place(&self, level: &mut Assembly) -> anyhow::Result<()> {
        let options = PlaceOptions {
            name: self.name.clone(),
            spin: self.spin.unwrap_or(0.0).to_radians(),
            tilt: self.tilt,
            overlap: false,
        };
        let numbers = [self.turn.unwrap_or(0.0), options.spin];
        if numbers.iter().any(|x| !x.is_finite()) {
            bail!("angles must be finite");
        }
        let piece = |name: &str| {
            let number = level.kit().named(name);
            number.ok_or_else(|| PlaceError::NoPiece(name.to_owned()))
        };
        let Some(onto) = &self.onto else {
            if self.spin.is_some() {
                bail!("spin turns a piece that is placed onto another; use turn");
            }
            let number = piece(&self.piece)?;
            let pose = Pose {
                turn: DQuat::from_rotation_y(self.turn.unwrap_or(0.0).to_radians()),
                at: DVec3::from_array(self.at.unwrap_or_default()),
            };
            level.put(number, pose, &options)?;
            return Ok(());
        };
        if self.at.is_some() || self.turn.is_some() {
            bail!("at and turn are for pieces that are not placed onto another");
        }
        let Some((name, attachment)) = self.piece.rsplit_once('.') else {
            bail!(
                "which of its attachments? Give piece = \"{}.ATTACHMENT\"",
                self.piece
            );
        };
        let number = piece(name)?;
        let attachment = attachment_named(&level.kit().pieces()[number], attachment)?;
        let onto = end_named(level, onto)?;
        level.place(number, attachment, onto, &options)?;
        Ok(())
    }
}

/// A level that was written. The output of `--json`.
#[derive(Serialize)]
pub(crate) struct LevelSummary {
    #[serde(flatten)]
    written: Written,
    instances: usize,
    rooms: usize,
    portals: usize,
    /// Attachments by what they lead to: pairs of rooms, the outdoors, walls.
    joined: usize,
    open: usize,
    walled_up: usize,
    triangles: usize,
}

/// Writes a level as a world, and reports it.
///
/// # Errors
///
/// If it cannot be written.
pub(crate) fn write_level(
    level: &Assembly,
    path: &Path,
    outputs: &Outputs,
    is_json: bool,
) -> anyhow::Result<()> {
    let mut world = level.flattened()?;
    let bytes = encode_whole(&mut world).context("the level breaks an invariant (a bug)")?;
    write_whole(path, &bytes)?;
    let links = || level.instances().flat_map(|(_, instance)| &instance.links);
    let n = |is: fn(&Link) -> bool| links().filter(|link| is(link)).count();
    let summary = LevelSummary {
        written: Written::new(path, &bytes),
        instances: level.len(),
        rooms: world.graph.rooms().count(),
        portals: world.graph.portals.len(),
        joined: n(|l| matches!(l, Link::Joined(_))) / 2,
        open: n(|l| *l == Link::Open),
        walled_up: n(|l| matches!(l, Link::Blocked(_))),
        triangles: world
            .batches
            .iter()
            .map(|b| b.primitive.indices.len() / 3)
            .sum(),
    };
    let mut out = outputs.printed();
    if is_json {
        return print_json(out, &summary);
    }
    let LevelSummary {
        instances,
        rooms,
        portals,
        joined,
        open,
        walled_up,
        triangles,
        ..
    } = &summary;
    writeln!(
        out,
        "{instances} pieces with {rooms} rooms, {portals} portals, {triangles} triangles of walls"
    )?;
    writeln!(
        out,
        "attachments: {joined} pairs joined, {open} lead outdoors, {walled_up} are in front of walls"
    )?;
    writeln!(out, "{}", summary.written)?;
    Ok(())
}
