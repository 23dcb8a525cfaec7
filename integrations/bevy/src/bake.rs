//! Bakes of the program's own entities, while it runs.

use bevy::asset::RenderAssetUsages;
use bevy::ecs::system::SystemId;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, poll_once};
use enfilade::bake::{BakeConfig, BakeContext, bake};
use enfilade::geom::DMat4;
use enfilade::geom::scene::{Mesh as SceneMesh, Object, Primitive, Role, Scene};

use crate::labels::PortalRoot;
use crate::reach::Mover;
use crate::world::PortalWorld;

/// Asks for a bake: put it on an entity, which becomes the root of the world that is found. Insert it again after a change.
///
/// The back end is asked for meshes at once, the bake runs beside the game, and [`BakeDone`] or [`BakeFailed`] is triggered on
/// the entity. Then the entity has a [`PortalRoot`], and each entity of the meshes a [`Mover`], by which it is culled.
#[derive(Component, Clone, Default)]
pub struct PortalBake {
    /// Settings, such as the smallest room.
    pub config: BakeConfig,
}

/// Part of a mesh in bakes. Entities without it are structure.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default)]
pub enum BakeRole {
    /// Bounds rooms: walls, floors, roofs.
    #[default]
    Structure,
    /// Stands in rooms: furniture, door leaves.
    Detail,
    /// Left out.
    Ignored,
}

/// Triangles of an entity, from a back end.
#[derive(Clone, Debug)]
pub struct BakeMesh {
    /// The entity that draws them.
    pub entity: Entity,
    /// A name for reports.
    pub name: String,
    /// Their role in the bake.
    pub role: BakeRole,
    /// Positions in the space of the engine's world. [Units: m]
    pub positions: Vec<Vec3>,
    /// Triangles as triples of positions, counter-clockwise from the front.
    pub indices: Vec<u32>,
}

/// A bake is done; the entity is the root of its world.
#[derive(EntityEvent, Clone, Copy, Debug)]
pub struct BakeDone {
    /// The entity with the [`PortalBake`].
    pub entity: Entity,
}

/// A bake failed; the earlier world, if any, stays.
#[derive(EntityEvent, Clone, Debug)]
pub struct BakeFailed {
    /// The entity with the [`PortalBake`].
    pub entity: Entity,
    /// The reason, for people.
    pub reason: String,
}

/// The system that collects meshes.
#[derive(Resource, Clone, Copy)]
struct Backend(SystemId<(), Vec<BakeMesh>>);

/// Choice of a bake's meshes.
pub trait BakeBackend {
    /// Replaces the back end: a system that returns the meshes to bake, for example those of colliders. The first one takes
    /// all `Mesh3d` that the main world holds.
    fn set_bake_backend<M>(
        &mut self,
        system: impl IntoSystem<(), Vec<BakeMesh>, M> + 'static,
    ) -> &mut Self;
}

impl BakeBackend for App {
    fn set_bake_backend<M>(
        &mut self,
        system: impl IntoSystem<(), Vec<BakeMesh>, M> + 'static,
    ) -> &mut Self {
        let id = self.world_mut().register_system(system);
        self.insert_resource(Backend(id))
    }
}

/// A bake under way.
#[derive(Component)]
pub(crate) struct Baking {
    task: Task<Result<PortalWorld, String>>,
    sources: Vec<Entity>,
}

pub(crate) fn build(app: &mut App) {
    app.register_type::<BakeRole>()
        .set_bake_backend(meshes)
        .add_systems(PreUpdate, (start_bakes, finish_bakes).chain());
}

type DrawnMeshes<'a> = (
    Entity,
    &'a Mesh3d,
    &'a GlobalTransform,
    Option<&'a BakeRole>,
    Option<&'a Name>,
);

/// The first back end: all meshes that the main world holds.
fn meshes(drawn: Query<DrawnMeshes>, assets: Res<Assets<Mesh>>) -> Vec<BakeMesh> {
    let placed = drawn
        .iter()
        .filter_map(|(entity, mesh, place, role, name)| {
            let mesh = assets.get(mesh)?;
            // Meshes that were handed to the renderer alone have no triangles here.
            if !mesh.asset_usage.contains(RenderAssetUsages::MAIN_WORLD) {
                return None;
            }
            let triangles = mesh.triangles().ok()?;
            let positions: Vec<Vec3> = triangles
                .flat_map(|t| t.vertices)
                .map(|p| place.transform_point(p))
                .collect();
            Some(BakeMesh {
                entity,
                name: name.map_or_else(|| entity.to_string(), ToString::to_string),
                role: role.copied().unwrap_or_default(),
                indices: (0..positions.len() as u32).collect(),
                positions,
            })
        });
    placed.collect()
}

fn scene_of(meshes: &[BakeMesh]) -> Scene {
    let mut scene = Scene::default();
    for own in meshes.iter().filter(|m| m.role != BakeRole::Ignored) {
        let is_detail = own.role == BakeRole::Detail;
        scene.objects.push(Object {
            name: own.name.clone(),
            mesh: scene.meshes.len() as u32,
            transform: DMat4::IDENTITY,
            role: if is_detail {
                Role::Detail
            } else {
                Role::Structural
            },
            reason: "as the program has it".to_owned(),
            filling: None,
            node: None,
        });
        scene.meshes.push(SceneMesh {
            name: own.name.clone(),
            primitives: vec![Primitive {
                positions: own.positions.iter().map(Vec3::to_array).collect(),
                indices: own.indices.clone(),
                ..Primitive::default()
            }],
        });
    }
    scene
}

/// Starts the bakes that were asked for; an older one of the same entity ends.
fn start_bakes(
    world: &mut World,
    asked: &mut QueryState<(Entity, &PortalBake), Changed<PortalBake>>,
) {
    let asked: Vec<(Entity, BakeConfig)> = asked
        .iter(world)
        .map(|(entity, bake)| (entity, bake.config.clone()))
        .collect();
    let Some(Backend(backend)) = world.get_resource().copied().filter(|_| !asked.is_empty()) else {
        return;
    };
    let meshes = world.run_system(backend);
    for (entity, config) in asked {
        let meshes = match &meshes {
            Ok(meshes) => meshes,
            Err(error) => {
                let reason = error.to_string();
                world.trigger(BakeFailed { entity, reason });
                continue;
            }
        };
        let baked = meshes.iter().filter(|m| m.role != BakeRole::Ignored);
        let sources = baked.map(|m| m.entity).collect();
        let scene = scene_of(meshes);
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let output = bake(&scene, &config, &BakeContext::default());
            let output = output.map_err(|e| e.to_string())?;
            PortalWorld::new(output.world).map_err(|e| e.to_string())
        });
        world.entity_mut(entity).insert(Baking { task, sources });
    }
}

fn finish_bakes(
    mut commands: Commands,
    mut baking: Query<(Entity, &mut Baking)>,
    mut worlds: ResMut<Assets<PortalWorld>>,
) {
    for (entity, mut own) in &mut baking {
        let Some(result) = block_on(poll_once(&mut own.task)) else {
            continue;
        };
        commands.entity(entity).remove::<Baking>();
        match result {
            Ok(world) => {
                let world = worlds.add(world);
                commands
                    .entity(entity)
                    .insert((PortalRoot { world }, Visibility::default()));
                for &source in &own.sources {
                    commands.entity(source).try_insert(Mover);
                }
                commands.trigger(BakeDone { entity });
            }
            Err(reason) => commands.trigger(BakeFailed { entity, reason }),
        }
    }
}
