//! Drawings of cells, portals, narrowed views and sounds.

use bevy::color::palettes::css;
use bevy::prelude::*;

use crate::culling::{PortalView, WorldView};
use crate::hearing::{Ears, Emitter, Heard};
use crate::state::{PortalState, Roots};
use crate::world::PortalWorld;

/// Start of the arrows of sounds, in the space of the camera. [Units: wu]
const BEFORE: Vec3 = Vec3::new(0.0, -0.25, -1.0);
/// Length of the arrows of sounds. [Units: wu]
const ARROW: f32 = 0.3;

/// Choice of gizmos. Everything is off at first.
#[derive(Resource, Default, Clone, Copy, Debug)]
pub struct PortalGizmos {
    /// The boxes of the cells, each in a color of its own: those that a camera sees, if one has a `PortalCulling`.
    pub cells: bool,
    /// The outlines of the portals: green where something is seen through them, red if shut, otherwise yellow.
    pub portals: bool,
    /// The rectangles to which views are narrowed at portals.
    pub views: bool,
    /// An arrow before the camera with [`Ears`] for each sound, to where it seems to come from.
    pub sounds: bool,
}

/// Group of these gizmos, to set their line widths and depth.
#[derive(Default, Reflect, GizmoConfigGroup)]
pub struct PortalGizmoGroup;

/// Draws the lines in front of everything: they show what walls hide.
pub(crate) fn bring_to_front(mut store: ResMut<GizmoConfigStore>) {
    store.config_mut::<PortalGizmoGroup>().0.depth_bias = -1.0;
}

pub(crate) fn draw(
    settings: Res<PortalGizmos>,
    roots: Query<Roots>,
    worlds: Res<Assets<PortalWorld>>,
    views: Query<&PortalView>,
    ears: Query<&GlobalTransform, With<Ears>>,
    emitters: Query<&Heard, With<Emitter>>,
    mut gizmos: Gizmos<PortalGizmoGroup>,
) {
    if let Some(ears) = ears.iter().next().filter(|_| settings.sounds) {
        for heard in emitters.iter().filter(|h| h.gain > 0.0) {
            let start = ears.transform_point(BEFORE);
            gizmos.arrow(start, start + heard.direction * ARROW, css::AQUA);
        }
    }
    if !(settings.cells || settings.portals || settings.views) {
        return;
    }
    for (root, own, state, place) in &roots {
        let Some(world) = worlds.get(&own.world) else {
            continue;
        };
        let view = views.iter().find_map(|v| v.world(root));
        if settings.cells {
            draw_cells(world, place, view, &mut gizmos);
        }
        if settings.portals {
            draw_portals(world, state, place, view, &mut gizmos);
        }
        if let Some(view) = view.filter(|_| settings.views) {
            draw_views(view, place, &mut gizmos);
        }
    }
}

/// Returns a color for a number; neighbors differ much.
fn color_of(i: u32) -> Color {
    Color::hsl((i as f32 * 137.508) % 360.0, 0.8, 0.6)
}

fn draw_cells(
    world: &PortalWorld,
    place: &GlobalTransform,
    view: Option<&WorldView>,
    gizmos: &mut Gizmos<PortalGizmoGroup>,
) {
    let graph = &world.world.graph;
    for cell in graph.cell_ids().filter(|c| !graph[*c].outdoor) {
        if view.is_some_and(|v| !v.sees(cell)) {
            continue;
        }
        let [low, high] = graph[cell].aabb.map(Vec3::from);
        // A little smaller, so that the boxes of neighbors are apart.
        let size = (high - low - 0.04).max(Vec3::ZERO);
        let cube = Transform::from_translation(low.midpoint(high)).with_scale(size);
        gizmos.cube(*place * cube, color_of(cell.0));
    }
}

fn draw_portals(
    world: &PortalWorld,
    state: &PortalState,
    place: &GlobalTransform,
    view: Option<&WorldView>,
    gizmos: &mut Gizmos<PortalGizmoGroup>,
) {
    for portal in world.world.graph.portal_ids() {
        let color = if !state.doors.is_open(portal) {
            css::RED
        } else if view.is_some_and(|v| v.portals.contains(&portal)) {
            css::LIME
        } else {
            css::YELLOW
        };
        let outline = &world.world.graph[portal].outline;
        let points = outline.iter().chain(outline.first());
        let points = points.map(|p| place.transform_point(Vec3::from(*p)));
        gizmos.linestrip(points, color);
    }
}

/// Draws the rectangle of each visit where it enters its cell.
fn draw_views(view: &WorldView, place: &GlobalTransform, gizmos: &mut Gizmos<PortalGizmoGroup>) {
    let out = view.clip_from_root.inverse();
    let eye = Vec3::from(view.eye);
    // The direction of view, along which depth is measured.
    let forward = (out.project_point3(Vec3::new(0.0, 0.0, 0.5)) - eye).normalize_or_zero();
    for visit in view.visits.iter().filter(|v| v.via.is_some()) {
        let [left, bottom, right, top] = visit.rectangle;
        let around = [
            [left, bottom],
            [right, bottom],
            [right, top],
            [left, top],
            [left, bottom],
        ];
        let points = around.map(|[x, y]| {
            let ray = (out.project_point3(Vec3::new(x, y, 0.5)) - eye).normalize_or_zero();
            let along = ray.dot(forward).max(1e-3);
            place.transform_point(eye + ray * (visit.depth / along))
        });
        gizmos.linestrip(points, color_of(visit.cell.0));
    }
}
