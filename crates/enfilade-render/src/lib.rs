//! Draws worlds of cells and portals with wgpu: to files without a display, or to a window's texture.
//!
//! Load a world once ([`Studio`]). Each frame, a [`Lister`] turns the run-time's answer into a short list of draws,
//! which the studio draws. Any adapter that wgpu supports works, software included.
//!
//! # Worlds in worlds
//!
//! A lift in a tower, a person, and a lamp in the lift:
//!
//! ```no_run
//! use std::sync::Arc;
//!
//! use enfilade_cpg::World;
//! use enfilade_geom::DVec3;
//! use enfilade_render::{
//!     AdapterChoice, Camera, Gpu, LampLight, Picture, Prop, PropMesh, SpaceShot, Studio, Style,
//! };
//! use enfilade_world::{PartId, Pose, Space, SpaceViewer};
//!
//! fn ride(tower: Arc<World>, cabin: Arc<World>, camera: Camera) -> Result<Picture, Box<dyn std::error::Error>> {
//!     let mut space = Space::new(tower.clone())?;
//!     let lift = space.add_part(cabin.clone(), PartId::ROOT, Pose::IDENTITY)?;
//!     let mut viewer = SpaceViewer::new(&space);
//!     let mut studio = Studio::new(Gpu::open(&AdapterChoice::Best)?, &tower)?;
//!     studio.add_light(&tower)?;
//!     studio.follow_parts(&space)?;
//!     studio.add_part_light(lift, &cabin, space.sight(lift))?;
//!     studio.set_lamps(vec![LampLight {
//!         part: lift,
//!         at: [0.0, 2.2, 0.0],
//!         color: [2.0, 1.8, 1.5],
//!         range: 8.0,
//!         cone: None,
//!     }])?;
//!
//!     // Each frame:
//!     space.set_pose(lift, Pose::from_translation(DVec3::Y * 3.0))?;
//!     let size = [1280, 720];
//!     let view = camera.view(size[0] as f32 / size[1] as f32)?;
//!     let person = Prop {
//!         mesh: PropMesh::PERSON,
//!         part: lift,
//!         color: [0.2, 0.3, 0.7],
//!         ..Prop::default()
//!     };
//!     let shot = SpaceShot {
//!         space: &space,
//!         frame: PartId::ROOT,
//!         camera,
//!         seen: Some(viewer.see(&space, PartId::ROOT, &view)),
//!         style: Style::default(),
//!         marks: &[],
//!         props: &[person],
//!         lamps: None,
//!     };
//!     // Or `draw_space`, to a window.
//!     let (picture, _) = studio.space_picture(&shot, size)?;
//!     Ok(picture)
//! }
//! ```
//!
//! # Limits
//!
//! Shading aims to be clear, not physical: base color, emission, alpha, one sun with shadows, daylight through portals
//! ([`Studio::add_light`]), lamps with shadows ([`Studio::set_lamps`]), ambient occlusion, and glass. Lamps light
//! surfaces directly only, and props cast no shadows. Metalness, roughness and normal maps are ignored.

mod camera;
mod compare;
mod context_targets;
mod contexts;
mod copies;
mod explain;
mod formats;
mod frame;
mod gpu;
mod ids;
mod lamps;
mod levels;
mod light;
mod list;
mod lit;
mod marks;
mod materials;
mod oracle;
mod panes;
mod picture;
mod piece_of;
mod pipelines;
mod portal_texture_file;
mod portal_texture_options;
mod portal_textures;
mod prop;
mod props;
mod queries;
mod renderer;
mod replaced;
mod resources;
mod scale;
mod scene;
mod shadings;
mod shown;
mod space;
mod stage;
mod studio;
mod targets;
mod textured;
mod viewpoints;

pub use camera::{Camera, Projection};
pub use frame::{Frame, Paint, Style};
pub use gpu::{AdapterChoice, Gpu, RenderError};
pub use ids::{Difference, IdPicture, LostPixel, PixelContent};
pub use lamps::{LampCone, LampLight, LampOptions, lamp_lights};
pub use list::{DrawReason, Lister, RenderList, Shot, Sparing};
pub use marks::{MarkShape, PictureMark};
pub use oracle::Oracle;
pub use picture::Picture;
pub use piece_of::PieceOf;
pub use portal_texture_file::PortalTextureFileError;
pub use portal_texture_options::{
    PortalTextureCounts, PortalTextureError, PortalTextureOptions, PortalTexturePaint, Viewpoints,
};
pub use prop::{Prop, PropMesh};
pub use queries::QueryCounts;
pub use scene::{GpuPiece, GpuWorld, PieceMaker, Put, StreamLimits};
pub use space::{SpaceCounts, SpaceShot};
pub use studio::{Culling, Studio, StudioTarget};
pub use textured::{MadePortalTextures, PortalTextureMaking, PortalTextureProgress};
pub use viewpoints::{
    EYE_HEIGHT, FOV, PHOTO_FOV, good_camera, portal_looked_at, walk, walk_cameras,
};
