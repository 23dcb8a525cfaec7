//! Questions to the worlds of a scene, as a system parameter.

use bevy::ecs::system::SystemParam;
use bevy::math::Affine3A;
use bevy::prelude::*;
use enfilade::{CellId, DetailId, Hit, PortalId, Target};

use crate::space::into_root;
use crate::state::{PortalState, Roots};
use crate::world::PortalWorld;

/// All worlds of the scene, to ask for cells, lines of sight and what a ray hits. Points are in the engine's space.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_enfilade::prelude::*;
/// # #[derive(Component)] struct Guard;
/// # #[derive(Component)] struct Player;
/// fn notice(worlds: PortalWorlds, guard: Single<&Transform, With<Guard>>, player: Single<&Transform, With<Player>>) {
///     if worlds.is_clear(guard.translation, player.translation) {
///         println!("seen, in {:?}", worlds.locate(player.translation));
///     }
/// }
/// # bevy::ecs::system::assert_is_system(notice);
/// ```
#[derive(SystemParam)]
pub struct PortalWorlds<'w, 's> {
    roots: Query<'w, 's, Roots<'static>>,
    worlds: Res<'w, Assets<PortalWorld>>,
}

/// A place in a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InCell {
    /// The entity with the [`PortalRoot`](crate::PortalRoot).
    pub root: Entity,
    /// The cell.
    pub cell: CellId,
}

/// The first thing that a ray hits.
#[derive(Clone, Copy, Debug)]
pub struct Picked {
    /// The entity with the [`PortalRoot`](crate::PortalRoot).
    pub root: Entity,
    /// Position, in the engine's space.
    pub position: Vec3,
    /// Unit normal, towards the start of the ray.
    pub normal: Vec3,
    /// Distance from the start. [Units: wu]
    pub distance: f32,
    /// A triangle of a wall or of a detail object, or a closed portal.
    pub target: Target,
    /// The cell from which the ray hit; `None` in solid matter.
    pub cell: Option<CellId>,
    /// The node of the detail object that was hit, with its `WorldDetail`.
    pub entity: Option<Entity>,
    /// The portal that was hit, or that the leaf that was hit shuts.
    pub door: Option<PortalId>,
}

struct PlacedWorld<'a> {
    root: Entity,
    world: &'a PortalWorld,
    state: &'a PortalState,
    into: Affine3A,
}

impl PlacedWorld<'_> {
    fn local(&self, p: Vec3) -> [f32; 3] {
        self.into.transform_point3(p).to_array()
    }

    fn picked(&self, from: Vec3, hit: &Hit) -> Picked {
        let out = self.into.inverse();
        let position = out.transform_point3(Vec3::from(hit.position));
        // Normals map by the inverse transpose.
        let normal = self.into.matrix3.transpose() * Vec3::from(hit.normal);
        let detail = match hit.target {
            Target::Detail { detail, .. } => Some(detail),
            Target::Wall { .. } | Target::Portal(_) => None,
        };
        let leaf_of = |detail: DetailId| self.world.sight.portals_of(detail).next();
        let door = match hit.target {
            Target::Portal(portal) => Some(portal),
            Target::Wall { .. } | Target::Detail { .. } => detail.and_then(leaf_of),
        };
        Picked {
            root: self.root,
            position,
            normal: normal.normalize_or_zero(),
            distance: position.distance(from),
            target: hit.target,
            cell: hit.cell,
            entity: detail.and_then(|d| self.state.detail(d.0)),
            door,
        }
    }
}

impl PortalWorlds<'_, '_> {
    fn placed(&self) -> impl Iterator<Item = PlacedWorld<'_>> {
        self.roots.iter().filter_map(|(root, own, state, place)| {
            Some(PlacedWorld {
                root,
                world: self.worlds.get(&own.world)?,
                state,
                into: into_root(place)?,
            })
        })
    }

    /// Returns the world of a root.
    #[must_use]
    pub fn world(&self, root: Entity) -> Option<&PortalWorld> {
        self.worlds.get(&self.roots.get(root).ok()?.1.world)
    }

    /// Returns the name of a cell.
    #[must_use]
    pub fn name(&self, root: Entity, cell: CellId) -> Option<&str> {
        let cells = &self.world(root)?.world.graph.cells;
        Some(&cells.get(cell.idx())?.name)
    }

    /// Returns the cell of a point; that of the first world which has one.
    #[must_use]
    pub fn locate(&self, p: Vec3) -> Option<InCell> {
        self.placed().find_map(|w| {
            let cell = w.world.sight.locate(w.local(p))?;
            Some(InCell { root: w.root, cell })
        })
    }

    /// Returns `true` if no wall and no shut door is between two points. Ignores detail objects and everything that is not part
    /// of a world. About a microsecond.
    #[must_use]
    pub fn is_clear(&self, a: Vec3, b: Vec3) -> bool {
        self.placed().all(|w| {
            w.world
                .lines
                .is_clear(&w.state.doors, w.local(a), w.local(b))
        })
    }

    /// Returns the first thing hit between two points: a wall, a detail object, a leaf of a door where it stands now, a closed
    /// portal. `None` also if a point is not finite.
    #[must_use]
    pub fn pick(&self, from: Vec3, to: Vec3) -> Option<Picked> {
        let picks = self.placed().filter_map(|w| {
            let hit = w
                .world
                .lines
                .pick(&w.state.doors, w.local(from), w.local(to));
            Some(w.picked(from, &hit.ok()??))
        });
        picks.min_by(|a, b| a.distance.total_cmp(&b.distance))
    }
}
