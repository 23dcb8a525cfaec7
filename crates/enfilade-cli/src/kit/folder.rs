//! Kits on disk: a folder of worlds and scenes, and a file that chooses their attachments.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::bake::{BakeConfig, BakeContext, bake};
use enfilade::cpg::wire::{WireError, decode_glb};
use enfilade::geom::DVec3;
use enfilade::geom::scene::Scene;
use enfilade::import::ImportOptions;
use enfilade::kit::{Choice, Chosen, DEFAULT_TOLERANCE, Kit, Piece, Spot};
use enfilade::{PortalId, World};
use enfilade_settings::parse_toml;
use serde::Deserialize;

use enfilade_cli::input::{import_scene, read_glb, read_text};
use enfilade_cli::memory::held_memory;

/// Name of the file that chooses attachments.
const SETTINGS: &str = "kit.toml";
/// Extensions of pieces.
const PIECES: [&str; 6] = ["glb", "gltf", "obj", "ply", "stl", "map"];

/// A kit that was read.
pub(crate) struct KitFolder {
    /// Name of the folder.
    pub(crate) name: String,
    pub(crate) kit: Kit,
    pub(crate) tolerance: f64,
    /// The files that were read.
    pub(crate) files: Vec<PathBuf>,
}

/// `kit.toml`.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct KitSettings {
    tolerance: Option<f64>,
    pieces: BTreeMap<String, PieceSettings>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct PieceSettings {
    /// The attachments by name; all doorways to the outdoors if absent.
    attach: Option<BTreeMap<String, SpotEntry>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SpotEntry {
    portal: Option<u32>,
    near: Option<[f64; 3]>,
}

/// Reads a kit; bakes the scenes in it.
///
/// # Errors
///
/// If the folder or a file in it cannot be read, two pieces share a name, or a piece cannot be one; the error names the file.
pub(crate) fn read_kit(folder: &Path) -> anyhow::Result<KitFolder> {
    let cannot = || format!("cannot read the kit {}", folder.display());
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(cannot)? {
        let path = entry.with_context(cannot)?.path();
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        if PIECES.contains(&&*extension.to_lowercase()) && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    if files.is_empty() {
        bail!(
            "{} has no pieces: put worlds (.glb, made by `enfilade bake`) or scenes there",
            folder.display()
        );
    }
    let path = folder.join(SETTINGS);
    let mut settings = KitSettings::default();
    if path.exists() {
        let text = read_text("the kit's settings", &path)?;
        settings = parse_toml(&text).with_context(|| path.display().to_string())?;
    }
    let tolerance = settings.tolerance.unwrap_or(DEFAULT_TOLERANCE);
    if !(tolerance > 0.0 && tolerance <= 0.1) {
        bail!(
            "{}: tolerance {tolerance}: above 0 and at most 0.1 m is needed",
            path.display()
        );
    }
    let mut pieces: BTreeMap<String, (PathBuf, Piece)> = BTreeMap::new();
    for file in &files {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        if let Some((other, _)) = pieces.get(&*name) {
            bail!(
                "two pieces are named {name:?}: {} and {}; rename one of them",
                other.display(),
                file.display()
            );
        }
        let choice = settings.pieces.remove(&*name).unwrap_or_default();
        let piece = choice
            .choice()
            .and_then(|choice| Ok(Piece::new(&*name, world_of(file)?, &choice)?))
            .with_context(|| file.display().to_string())?;
        pieces.insert(name.into_owned(), (file.clone(), piece));
    }
    if let Some(name) = settings.pieces.keys().next() {
        bail!(
            "{}: the kit has no piece {name:?}; remove the entry, or add a file of this name",
            path.display()
        );
    }
    let kit = Kit::new(pieces.into_values().map(|p| p.1).collect())?;
    let name = std::fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    let name = name.file_name().unwrap_or_default().to_string_lossy();
    files.extend(path.exists().then_some(path));
    Ok(KitFolder {
        name: name.into_owned(),
        kit,
        tolerance,
        files,
    })
}

/// Reads a world, or bakes a scene.
fn world_of(file: &Path) -> anyhow::Result<World> {
    if file
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("glb"))
    {
        match decode_glb(&read_glb(file)?) {
            Err(WireError::NotAWorld) => {}
            read => return Ok(read?),
        }
    }
    let imported = import_scene(&[file.to_owned()], &[], &ImportOptions::default())?;
    bake_piece(&imported.scene)
}

/// Bakes a piece with default settings, and without words: it takes a moment.
pub(crate) fn bake_piece(scene: &Scene) -> anyhow::Result<World> {
    let context = BakeContext::default().measured_by(held_memory);
    Ok(bake(scene, &BakeConfig::default(), &context)?.world)
}

impl PieceSettings {
    fn choice(self) -> anyhow::Result<Choice> {
        let Some(attach) = self.attach else {
            return Ok(Choice::Doorways);
        };
        let chosen = attach.into_iter().map(|(name, entry)| {
            let spot = match (entry.portal, entry.near) {
                (Some(portal), None) => Spot::Portal(PortalId(portal)),
                (None, Some(p)) if p.iter().all(|x| x.is_finite()) => {
                    Spot::Near(DVec3::from_array(p))
                }
                _ => bail!("attach.{name}: give either portal = NUMBER or near = [x, y, z]"),
            };
            Ok(Chosen { name, spot })
        });
        Ok(Choice::Only(chosen.collect::<anyhow::Result<_>>()?))
    }
}
