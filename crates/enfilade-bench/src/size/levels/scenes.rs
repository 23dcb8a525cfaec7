//! The levels: generated, and as one merged mesh.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Context, bail};
use enfilade::geom::scene::Scene;
use enfilade::kit::{Assembly, Choice, Kit, Piece, generate};
use enfilade_testkit::{PieceScene, dungeon_kit, maze_kit, office_kit};

use crate::rows::baked;

/// A level and the models of its pieces.
pub(super) struct Level {
    pub(super) level: Assembly,
    models: Vec<PieceScene>,
}

pub(super) fn kit_of(models: &[PieceScene]) -> anyhow::Result<Kit> {
    let piece = |model: &PieceScene| -> anyhow::Result<Piece> {
        Ok(Piece::new(
            model.name,
            baked(&model.scene)?,
            &Choice::Doorways,
        )?)
    };
    Ok(Kit::new(
        models.iter().map(piece).collect::<Result<_, _>>()?,
    )?)
}

/// Generates the level of a name: a kind and a number of rooms.
pub(super) fn level(name: &str) -> anyhow::Result<Level> {
    let (kind, n) = name.rsplit_once('-').context("a kind and a number")?;
    let n: usize = n.parse()?;
    let models = match kind {
        "dungeon" => dungeon_kit(),
        "office" => office_kit(),
        "maze" => maze_kit(),
        _ => bail!("there are dungeons, offices and mazes"),
    };
    let mut level = Assembly::new(Arc::new(kit_of(&models)?));
    match kind {
        "dungeon" => generate::dungeon(&mut level, n, 1)?,
        "office" => generate::office(&mut level, n, 1)?,
        _ => generate::maze(&mut level, n.isqrt() + usize::from(n.isqrt().pow(2) < n), 1)?,
    };
    Ok(Level { level, models })
}

impl Level {
    /// Returns the models of all instances as one scene.
    pub(super) fn merged(&self) -> Scene {
        let mut scene = Scene::default();
        let mut firsts: BTreeMap<usize, u32> = BTreeMap::new();
        for (_, instance) in self.level.instances() {
            let name = self.level.kit().pieces()[instance.piece].name();
            let Some(model) = self.models.iter().find(|m| m.name == name) else {
                continue;
            };
            let first = *firsts.entry(instance.piece).or_insert_with(|| {
                let first_material = scene.materials.len() as u32;
                scene.materials.extend_from_slice(&model.scene.materials);
                let first = scene.meshes.len() as u32;
                scene
                    .meshes
                    .extend(model.scene.meshes.iter().cloned().map(|mut mesh| {
                        for primitive in &mut mesh.primitives {
                            primitive.material = primitive.material.map(|m| m + first_material);
                        }
                        mesh
                    }));
                first
            });
            for object in &model.scene.objects {
                let mut object = object.clone();
                object.mesh += first;
                object.transform = instance.pose.matrix() * object.transform;
                scene.objects.push(object);
            }
        }
        scene
    }
}
