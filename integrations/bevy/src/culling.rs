//! The entities that a camera draws: those that the engine found visible, less those that walls hide.

use std::any::TypeId;

use bevy::camera::visibility::{CubemapVisibleEntities, VisibleEntities, VisibleMeshEntities};
use bevy::ecs::entity::EntityHashSet;
use bevy::light::cluster::ClusterVisibilityClass;
use bevy::math::Affine3A;
use bevy::prelude::*;
use enfilade::cpg::CellSet;
use enfilade::runtime::Visit;
use enfilade::{CellId, PortalId, View, Viewer};

use crate::labels::{PartKind, WorldPart};
use crate::reach::{Mover, Reach};
use crate::space::into_root;
use crate::state::{PortalState, Roots};
use crate::world::PortalWorld;

/// Culls what a camera draws by the cells and portals of the worlds around it. Put it on a `Camera3d`.
///
/// Entities that no world knows stay visible. Lights stay if their range reaches a visible cell; the shadow cascades of suns are
/// left alone. In a wall, and with an orthographic projection, everything in the frustum is drawn.
#[derive(Component, Reflect, Clone, Debug)]
#[reflect(Component, Default)]
#[require(PortalView)]
pub struct PortalCulling {
    /// False to draw as the engine does; [`PortalView`] is still kept up to date.
    pub is_enabled: bool,
}

impl Default for PortalCulling {
    fn default() -> Self {
        Self { is_enabled: true }
    }
}

/// The parts of each world that a camera with [`PortalCulling`] sees, as of the last frame.
#[derive(Component, Default)]
pub struct PortalView {
    worlds: Vec<WorldView>,
    /// Entities in the engine's lists, before culling.
    pub n_before: usize,
    /// Entities left in them.
    pub n_after: usize,
    /// Lights among those before.
    pub n_lights_before: usize,
    /// Lights among those left.
    pub n_lights_after: usize,
}

/// The parts of one world that a camera sees.
pub struct WorldView {
    /// The entity with the [`PortalRoot`](crate::PortalRoot).
    pub root: Entity,
    /// The cell of the eye; `None` in solid matter.
    pub cell: Option<CellId>,
    /// Visible cells, near to far.
    pub cells: Vec<CellId>,
    /// Portals through which something is seen.
    pub portals: Vec<PortalId>,
    /// Views of cells, each narrowed by the portals before it.
    pub visits: Vec<Visit>,
    /// The eye in the world's space.
    pub eye: [f32; 3],
    /// The camera's map from the world's space to the screen.
    pub clip_from_root: Mat4,
    /// True if everything in the frustum counts as visible: the eye is in solid matter, or the projection is not a perspective.
    pub is_lost: bool,
    viewer: Viewer,
    seen_cells: CellSet,
    /// Per batch.
    batches: Vec<bool>,
    /// Per detail object.
    details: Vec<bool>,
    /// Movers in view.
    movers: EntityHashSet,
    revision: u32,
    is_current: bool,
}

impl PortalView {
    /// Returns the views of all worlds.
    #[must_use]
    pub fn worlds(&self) -> &[WorldView] {
        &self.worlds
    }

    /// Returns the view of one world.
    #[must_use]
    pub fn world(&self, root: Entity) -> Option<&WorldView> {
        self.worlds.iter().find(|w| w.root == root)
    }
}

impl WorldView {
    fn new(root: Entity, revision: u32, world: &PortalWorld) -> Self {
        Self {
            root,
            revision,
            cell: None,
            cells: Vec::new(),
            portals: Vec::new(),
            visits: Vec::new(),
            eye: [0.0; 3],
            clip_from_root: Mat4::IDENTITY,
            is_lost: true,
            viewer: Viewer::new(&world.sight),
            seen_cells: CellSet::new(world.world.graph.cells.len()),
            batches: vec![false; world.world.batches.len()],
            details: vec![false; world.world.details.len()],
            movers: EntityHashSet::default(),
            is_current: true,
        }
    }

    /// Returns `true` if a cell is visible.
    #[must_use]
    pub fn sees(&self, cell: CellId) -> bool {
        self.is_lost || self.seen_cells.contains(cell)
    }

    /// Looks again, at the world and the movers in it.
    fn look_at_all(
        &mut self,
        world: &PortalWorld,
        state: &PortalState,
        into: &Affine3A,
        eye: Vec3,
        clip_from_world: Mat4,
        movers: &Query<(Entity, &Reach), With<Mover>>,
    ) {
        self.eye = into.transform_point3(eye).to_array();
        self.clip_from_root = clip_from_world * Mat4::from(into.inverse());
        self.cell = world.sight.locate(self.eye);
        self.clear();
        let matrix = self.clip_from_root.to_cols_array_2d();
        let Ok(view) = View::from_view_projection(self.eye, matrix) else {
            return;
        };
        let seen = self.viewer.see(&world.sight, &state.doors, &view);
        self.is_lost = seen.counts().is_eye_lost;
        self.cells.extend_from_slice(seen.cells());
        self.portals.extend_from_slice(seen.portals());
        self.visits.extend_from_slice(seen.visits());
        for &cell in seen.cells() {
            self.seen_cells.insert(cell);
        }
        for &chunk in seen.chunks() {
            self.batches[world.sight[chunk].batch as usize] = true;
        }
        for &detail in seen.details() {
            self.details[detail.0 as usize] = true;
        }
        for (mover, reach) in movers {
            let extent = reach.worlds.iter().find(|(root, _)| *root == self.root);
            if extent.is_some_and(|(_, e)| seen.sees_box(&e.cells, e.bounds)) {
                self.movers.insert(mover);
            }
        }
    }

    fn clear(&mut self) {
        self.is_lost = true;
        self.seen_cells.clear();
        self.batches.fill(false);
        self.details.fill(false);
        self.movers.clear();
        self.cells.clear();
        self.portals.clear();
        self.visits.clear();
    }

    /// Returns `true` if a part of the world is visible. Parts of an older version of the file are.
    fn sees_part(&self, kind: PartKind) -> bool {
        let seen = match kind {
            PartKind::Batch(i) => self.batches.get(i as usize),
            PartKind::Detail(i) => self.details.get(i as usize),
        };
        self.is_lost || seen.copied().unwrap_or(true)
    }
}

type Cameras<'a> = (
    &'a Camera,
    &'a GlobalTransform,
    &'a PortalCulling,
    &'a mut PortalView,
    &'a mut VisibleEntities,
);
type Known<'w, 's> = Query<
    'w,
    's,
    (
        Option<&'static WorldPart>,
        Option<&'static Reach>,
        Has<Mover>,
    ),
    Or<(With<WorldPart>, With<Reach>)>,
>;

/// Retains what each camera sees in the lists that the engine made for it.
pub(crate) fn cull(
    mut cameras: Query<Cameras>,
    roots: Query<Roots>,
    worlds: Res<Assets<PortalWorld>>,
    movers: Query<(Entity, &Reach), With<Mover>>,
    known: Known,
    mut dropped: ResMut<DroppedLights>,
) {
    dropped.0.clear();
    for (camera, place, culling, mut view, mut visible) in &mut cameras {
        if !camera.is_active {
            continue;
        }
        let clip_from_world = camera.clip_from_view() * place.to_matrix().inverse();
        let eye = place.translation();
        view.worlds.iter_mut().for_each(|w| w.is_current = false);
        for (root, own, state, root_place) in &roots {
            let (Some(world), Some(into)) = (worlds.get(&own.world), into_root(root_place)) else {
                continue;
            };
            let own = view.world_of(root, state.revision, world);
            own.look_at_all(world, state, &into, eye, clip_from_world, &movers);
        }
        view.worlds.retain(|w| w.is_current);
        view.retain(&mut visible, culling.is_enabled, &known, &mut dropped.0);
    }
}

impl PortalView {
    /// Returns the view of a world, a new one if it was loaded anew.
    fn world_of(&mut self, root: Entity, revision: u32, world: &PortalWorld) -> &mut WorldView {
        let at = self.worlds.iter().position(|w| w.root == root);
        let at = at.unwrap_or_else(|| {
            self.worlds.push(WorldView::new(root, revision, world));
            self.worlds.len() - 1
        });
        let own = &mut self.worlds[at];
        if own.revision != revision {
            *own = WorldView::new(root, revision, world);
        }
        own.is_current = true;
        own
    }

    /// Retains what is visible in the engine's lists, and counts.
    fn retain(
        &mut self,
        visible: &mut VisibleEntities,
        is_enabled: bool,
        known: &Known,
        dropped: &mut EntityHashSet,
    ) {
        let lights = TypeId::of::<ClusterVisibilityClass>();
        let sum = |v: &VisibleEntities| v.entities.values().map(Vec::len).sum();
        self.n_before = sum(visible);
        self.n_lights_before = visible.get(lights).len();
        if is_enabled {
            for (class, entities) in &mut visible.entities {
                entities.retain(|&entity| {
                    let is_hidden = self.hides(entity, known);
                    if is_hidden && *class == lights {
                        dropped.insert(entity);
                    }
                    !is_hidden
                });
            }
        }
        self.n_after = sum(visible);
        self.n_lights_after = visible.get(lights).len();
    }

    /// Returns `true` if one of the worlds shows that an entity adds nothing to the picture.
    fn hides(&self, entity: Entity, known: &Known) -> bool {
        let Ok((part, reach, is_mover)) = known.get(entity) else {
            return false;
        };
        match (part, reach) {
            (_, Some(reach)) if is_mover => reach.worlds.iter().any(|(root, extent)| {
                let world = self.world(*root).filter(|w| !w.is_lost);
                world
                    .is_some_and(|w| extent.is_apart_from(|_| false) && !w.movers.contains(&entity))
            }),
            (Some(part), _) => self
                .world(part.root)
                .is_some_and(|w| !w.sees_part(part.kind)),
            (None, Some(reach)) => reach.worlds.iter().any(|(root, extent)| {
                let world = self.world(*root);
                world.is_some_and(|w| extent.is_apart_from(|cell| w.sees(cell)))
            }),
            (None, None) => false,
        }
    }
}

/// Lights that a camera dropped in this frame.
#[derive(Resource, Default)]
pub(crate) struct DroppedLights(EntityHashSet);

/// Empties the shadow lists of lights that no camera keeps: the engine fills those of the others only, and lists of an earlier
/// frame would be drawn again.
pub(crate) fn empty_shadows(
    dropped: Res<DroppedLights>,
    cameras: Query<&VisibleEntities>,
    mut points: Query<&mut CubemapVisibleEntities>,
    mut spots: Query<&mut VisibleMeshEntities>,
) {
    let lights = TypeId::of::<ClusterVisibilityClass>();
    let is_kept = |light: &Entity| {
        let mut lists = cameras.iter().map(|c| c.get(lights));
        lists.any(|list| list.binary_search(light).is_ok())
    };
    for &light in dropped.0.iter().filter(|l| !is_kept(l)) {
        // Writing marks a list as changed, which costs an extraction.
        if let Ok(mut faces) = points.get_mut(light)
            && faces.iter().any(|f| !f.entities.is_empty())
        {
            faces.iter_mut().for_each(|f| f.entities.clear());
        }
        if let Ok(mut list) = spots.get_mut(light)
            && !list.entities.is_empty()
        {
            list.entities.clear();
        }
    }
}
