//! The models to walk through: those of the paper by size, and larger ones.

use enfilade::World;
use enfilade::runtime::Sight;
use enfilade_render::{Camera, FOV, walk_cameras};
use enfilade_testkit::{Dwelling, DwellingParams, dwelling};

use super::stroll::stroll;
use crate::rows::baked_scene;
use crate::stream::furnished;

/// Triangles of a furnished building.
const FURNISHED: u64 = 820_000;

/// Length of the walk through a baked building. [Units: wu]
const METERS: usize = 150;

/// A world and a walk.
pub(super) struct WalkedModel {
    pub(super) name: String,
    pub(super) world: World,
    /// Points that the eye passes; none to find a walk.
    route: Vec<[f32; 3]>,
}

/// Sizes of a model in the paper: triangles, cells, portals, and triangles by portal culling as a share of those by frustum
/// culling.
pub(super) struct PaperSizes {
    pub(super) n_triangles: u64,
    pub(super) n_cells: usize,
    pub(super) n_portals: usize,
    pub(super) portals_to_frustum: f64,
}

/// Returns the sizes of a model in the paper, §5.1.
pub(super) fn in_paper(scene: &str) -> Option<PaperSizes> {
    let (n_triangles, n_cells, n_portals, portals_to_frustum) = match scene {
        "brooks" => (528_000, 19, 52, 3.3 / 4.6),
        "haunted" => (214_000, 7, 12, 2.6 / 4.3),
        _ => return None,
    };
    Some(PaperSizes {
        n_triangles,
        n_cells,
        n_portals,
        portals_to_frustum,
    })
}

impl WalkedModel {
    /// Makes a model, or bakes and furnishes it; `None` if its scene is missing.
    pub(super) fn of(scene: &str) -> anyhow::Result<Option<Self>> {
        let params = match scene {
            "brooks" => DwellingParams::brooks(),
            "haunted" => DwellingParams::haunted(),
            "tower" => DwellingParams::tower(),
            _ => {
                let world = baked_scene(scene)?.map(|world| furnished(&world, FURNISHED));
                return Ok(world.transpose()?.map(|world| Self {
                    name: scene.into(),
                    world,
                    route: Vec::new(),
                }));
            }
        };
        let Dwelling { world, route } = dwelling(&params);
        Ok(Some(Self {
            name: scene.into(),
            world,
            route,
        }))
    }

    /// Returns the cameras of the whole walk, 60 a second.
    pub(super) fn cameras(&self, sight: &Sight) -> Vec<Camera> {
        if !self.route.is_empty() {
            return stroll(&self.route);
        }
        let found = walk_cameras(&self.world, sight, METERS, FOV);
        let eyes: Vec<[f32; 3]> = found.iter().map(|camera| camera.eye).collect();
        stroll(&eyes)
    }
}
