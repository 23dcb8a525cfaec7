//! Figures of the culling on the screen, switched by a key.

use bevy::color::palettes::css;
use bevy::prelude::*;

use crate::culling::PortalView;
use crate::gizmos::PortalGizmos;
use crate::hearing::{Emitter, Heard};
use crate::queries::PortalWorlds;
use crate::stream::PortalStream;

/// Adds an overlay of the current cell, the visible cells, the entities drawn, the pieces of packed worlds, and what is heard, and
/// switches it by a key. With it, the gizmos of cells, portals, views and sounds come and go. Needs Bevy's feature `bevy_gizmos_render`, and no text or user interface.
pub struct PortalOverlayPlugin {
    /// The key.
    pub key: KeyCode,
}

impl Default for PortalOverlayPlugin {
    fn default() -> Self {
        Self { key: KeyCode::F3 }
    }
}

/// State of the overlay.
#[derive(Resource, Clone, Copy, Debug)]
pub struct PortalOverlay {
    /// True if it is shown.
    pub is_shown: bool,
    key: KeyCode,
}

/// Group of the overlay's letters.
#[derive(Default, Reflect, GizmoConfigGroup)]
struct Letters;

impl Plugin for PortalOverlayPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(PortalOverlay {
            is_shown: false,
            key: self.key,
        })
        .init_gizmo_group::<Letters>()
        .add_systems(Startup, |mut store: ResMut<GizmoConfigStore>| {
            store.config_mut::<Letters>().0.depth_bias = -1.0;
        })
        .add_systems(Update, (switch, write).chain());
    }
}

fn switch(
    keys: Option<Res<ButtonInput<KeyCode>>>,
    mut overlay: ResMut<PortalOverlay>,
    mut gizmos: ResMut<PortalGizmos>,
) {
    if keys.is_some_and(|k| k.just_pressed(overlay.key)) {
        overlay.is_shown = !overlay.is_shown;
        let is_shown = overlay.is_shown;
        *gizmos = PortalGizmos {
            cells: is_shown,
            portals: is_shown,
            views: is_shown,
            sounds: is_shown,
        };
    }
}

/// Writes in front of each camera, a bit beyond its near plane.
fn write(
    overlay: Res<PortalOverlay>,
    views: Query<(&PortalView, &Camera, &GlobalTransform)>,
    worlds: PortalWorlds,
    streams: Query<&PortalStream>,
    emitters: Query<(Option<&Name>, &Heard), With<Emitter>>,
    mut gizmos: Gizmos<Letters>,
) {
    const DEPTH: f32 = 1.0;
    for (view, camera, place) in views.iter().filter(|_| overlay.is_shown) {
        let out = camera.clip_from_view().inverse();
        let edge = out.project_point3(Vec3::new(-1.0, 1.0, 0.5));
        let top_left = edge * (DEPTH / -edge.z);
        let size = 0.045 * top_left.y;
        let streams = streams.iter().map(stream_line);
        let sounds = emitters.iter().map(|(name, heard)| sound_line(name, heard));
        let lines = lines(view, &worlds)
            .into_iter()
            .chain(streams)
            .chain(sounds);
        for (i, line) in (0..).zip(lines) {
            let at = top_left + Vec3::new(0.6 * size, -(i as f32 + 0.6) * 1.6 * size, 0.0);
            let at = place.to_isometry() * Isometry3d::from_translation(at);
            gizmos.text(at, &line, size, Vec2::new(-0.5, 0.5), css::WHITE);
        }
    }
}

/// Returns the lines of the overlay.
fn lines(view: &PortalView, worlds: &PortalWorlds) -> Vec<String> {
    let mut lines: Vec<String> = view
        .worlds()
        .iter()
        .map(|own| {
            let name = own.cell.and_then(|c| worlds.name(own.root, c));
            let n_all = worlds
                .world(own.root)
                .map_or(0, |w| w.world.graph.cells.len());
            let name = name.unwrap_or("in a wall");
            format!("{name}: {} of {n_all} cells", own.cells.len())
        })
        .collect();
    lines.push(format!("{} of {} entities", view.n_after, view.n_before));
    lines.push(format!(
        "{} of {} lights",
        view.n_lights_after, view.n_lights_before
    ));
    lines
}

fn stream_line(stream: &PortalStream) -> String {
    let mib = |n: u64| n as f64 / f64::from(1 << 20);
    let ([n_there, n_all], counts) = (stream.n_pieces(), stream.counts());
    let (kept, most) = (mib(counts.n_kept), mib(counts.max_kept));
    let n_late = counts.n_late;
    format!("{n_there} of {n_all} pieces, {kept:.1} of {most:.0} MiB, {n_late} late")
}

fn sound_line(name: Option<&Name>, heard: &Heard) -> String {
    let name = name.map_or("sound", Name::as_str);
    match heard.gain > 0.0 {
        true => format!("{name}: {:.0} dB, {:.1} m", heard.level(), heard.length),
        false => format!("{name}: silent"),
    }
}
