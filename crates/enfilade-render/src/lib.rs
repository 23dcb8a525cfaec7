//! Draws worlds of cells and portals with wgpu: to files without a display, or to a window's texture.
//!
//! Load a world once ([`Studio`]). Each frame, a [`Lister`] turns the run-time's answer into a short list of draws,
//! which the studio draws. Any adapter that wgpu supports works, software included.
//!
//! # Limits
//!
//! Shading aims to be clear, not physical: base color, emission, alpha, one sun with shadows, daylight through portals
//! ([`Studio::add_light`]), ambient occlusion, and glass. Metalness, roughness and normal maps are ignored.

mod camera;
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
mod picture;
mod pipelines;
mod props;
mod queries;
mod renderer;
mod resources;
mod scale;
mod scene;
mod shadings;
mod space;
mod stage;
mod studio;
mod viewpoints;

pub use camera::{Camera, Projection};
pub use frame::{Frame, Paint, Style};
pub use gpu::{AdapterChoice, Gpu, RenderError};
pub use ids::{Difference, IdPicture, LostPixel, PixelContent};
pub use lamps::{LampCone, LampLight, LampOptions, lamp_lights};
pub use list::{DrawReason, Lister, RenderList, Shot, Sparing};
pub use marks::{Mark, MarkShape};
pub use oracle::Oracle;
pub use picture::Picture;
pub use props::{Prop, PropMesh};
pub use queries::QueryCounts;
pub use scene::{GpuWorld, cell_color};
pub use space::{SpaceCounts, SpaceShot};
pub use studio::{Culling, Studio, StudioTarget};
pub use viewpoints::{EYE_HEIGHT, FOV, good_camera, portal_looked_at, walk, walk_cameras};
