#![doc = include_str!("../README.md")]

mod arrivals;
#[cfg(feature = "bake")]
mod bake;
mod cells;
mod culling;
mod doors;
mod gizmos;
mod hearing;
mod labels;
mod loader;
mod overlay;
mod packed;
mod pieces;
mod queries;
mod reach;
mod set_up;
mod site;
mod space;
mod state;
mod stream;
mod world;

use bevy::camera::CameraUpdateSystems;
use bevy::camera::visibility::VisibilitySystems;
use bevy::gltf::extensions::GltfExtensionHandlers;
use bevy::light::SimulationLightSystems;
use bevy::prelude::*;

pub use arrivals::{CellLoaded, CellUnloaded, PieceFailed};
#[cfg(feature = "bake")]
pub use bake::{BakeBackend, BakeDone, BakeFailed, BakeMesh, BakeRole, PortalBake};
pub use cells::{CellEntered, CellLeft, CurrentCell};
pub use culling::{PortalCulling, PortalView, WorldView};
pub use doors::Door;
pub use enfilade;
pub use gizmos::{PortalGizmoGroup, PortalGizmos};
pub use hearing::{Ears, Emitter, Heard};
pub use labels::{PartKind, PortalRoot, WorldCell, WorldDetail, WorldPart};
pub use loader::EXTENSION;
pub use overlay::{PortalOverlay, PortalOverlayPlugin};
pub use packed::{PACKED_LABEL, PackedRoot, PackedWorld};
pub use queries::{InCell, Picked, PortalWorlds};
pub use reach::{Mover, Reach};
pub use state::PortalState;
pub use stream::{PortalStream, StreamSettings};
pub use world::{PortalWorld, WORLD_LABEL};

/// The names that programs use most.
pub mod prelude {
    pub use crate::{
        CellEntered, CellLeft, CellLoaded, CellUnloaded, CurrentCell, Door, Ears, Emitter,
        EnfiladePlugin, Heard, Mover, PieceFailed, PortalCulling, PortalGizmos,
        PortalOverlayPlugin, PortalRoot, PortalState, PortalStream, PortalView, PortalWorld,
        PortalWorlds, StreamSettings,
    };
    pub use enfilade::{CellId, PortalId};
}

/// Steps of each frame in `PostUpdate`, to order own systems by.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EnfiladeSystems {
    /// Worlds that were just spawned are prepared, and doors move. Before transforms are propagated.
    Update,
    /// [`CurrentCell`], [`Reach`] and [`Heard`] are found. After transforms are propagated.
    Track,
    /// The lists of cameras are culled. After the engine's own check, and before it gives lights their shadow casters.
    Cull,
    /// Pieces of packed worlds come and go, by what was just seen. They are drawn from the next frame on.
    Stream,
}

/// Reads the cells and portals of glTF files, and culls by them. Add it after `DefaultPlugins`.
pub struct EnfiladePlugin;

impl Plugin for EnfiladePlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<PortalWorld>()
            .init_asset::<PackedWorld>()
            .init_resource::<packed::Loading>()
            .init_resource::<site::ShownPictures>()
            .preregister_asset_loader::<packed::PackedLoader>(packed::EXTENSIONS)
            .init_resource::<culling::DroppedLights>()
            .register_type::<PortalRoot>()
            .register_type::<WorldPart>()
            .register_type::<WorldDetail>()
            .register_type::<WorldCell>()
            .register_type::<PackedRoot>()
            .register_type::<Emitter>()
            .register_type::<Ears>()
            .register_type::<Heard>()
            .register_type::<Door>()
            .register_type::<Mover>()
            .register_type::<PortalCulling>()
            .register_required_components::<PointLight, Reach>()
            .register_required_components::<SpotLight, Reach>()
            .add_message::<CellEntered>()
            .add_message::<CellLeft>()
            .add_message::<CellLoaded>()
            .add_message::<CellUnloaded>()
            .add_message::<PieceFailed>()
            .add_observer(stream::close_stream);
        let heads = app.world().resource::<packed::Loading>().0.clone();
        let handlers = app
            .world_mut()
            .get_resource_or_init::<GltfExtensionHandlers>();
        let extension = Box::new(loader::PortalExtension::new(&heads));
        handlers.0.write_blocking().push(extension);
        use EnfiladeSystems::{Cull, Stream, Track, Update};
        app.configure_sets(
            PostUpdate,
            (
                Update.before(TransformSystems::Propagate),
                Track
                    .after(TransformSystems::Propagate)
                    .after(VisibilitySystems::CalculateBounds)
                    .before(Cull),
                Cull.after(VisibilitySystems::CheckVisibility)
                    .after(CameraUpdateSystems)
                    .before(SimulationLightSystems::CheckLightVisibility),
                Stream.after(Cull),
            ),
        )
        .add_systems(
            PostUpdate,
            (
                (
                    set_up::set_up_roots,
                    doors::move_doors,
                    reach::pass_on_movers,
                )
                    .chain()
                    .in_set(Update),
                (cells::track_cells, reach::find_reaches, hearing::hear).in_set(Track),
                (culling::cull, culling::empty_shadows).chain().in_set(Cull),
                (stream::open_streams, stream::run_streams)
                    .chain()
                    .in_set(Stream)
                    // Programs without a renderer, such as servers, have no materials.
                    .run_if(resource_exists::<Assets<StandardMaterial>>),
            ),
        );
        #[cfg(feature = "bake")]
        bake::build(app);
        // Programs without a renderer, such as servers, have no gizmos.
        if app.is_plugin_added::<bevy::gizmos::GizmoPlugin>() {
            app.init_resource::<PortalGizmos>()
                .init_gizmo_group::<PortalGizmoGroup>()
                .add_systems(Startup, gizmos::bring_to_front)
                .add_systems(PostUpdate, gizmos::draw.after(Cull));
        }
    }

    fn finish(&self, app: &mut App) {
        // Only now does the program's glTF loader know what the card supports.
        let heads = app.world().resource::<packed::Loading>().0.clone();
        let loader = packed::PackedLoader::new(app, &heads);
        app.register_asset_loader(loader);
    }
}
