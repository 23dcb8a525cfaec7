//! Draws worlds of cells and portals with wgpu: to files without a display, or to a window's texture.
//!
//! A world is loaded once ([`GpuWorld`]); each frame, a [`Lister`] turns what the run-time sees into a
//! short list of draws, and a [`Renderer`] draws it. Any adapter that wgpu supports will do, software
//! included.
//!
//! # What is not promised
//!
//! Looks are meant to be clear, not physical: base color, emission, alpha, one sun with shadows, daylight that comes
//! through portals ([`Studio::add_light`]), dark corners, and glass. Metal, roughness and normal maps are not drawn.

mod camera;
mod explain;
mod formats;
mod frame;
mod gpu;
mod ids;
mod levels;
mod light;
mod list;
mod marks;
mod materials;
mod oracle;
mod picture;
mod pipelines;
mod queries;
mod renderer;
mod resources;
mod scale;
mod scene;
mod shadings;
mod studio;

pub use camera::{Camera, Projection};
pub use frame::{Frame, Paint, Style};
pub use gpu::{AdapterChoice, Gpu, RenderError};
pub use ids::{Difference, IdPicture, LostPixel, Shown};
pub use list::{DrawList, Lister, Reason, Shot, Sparing};
pub use marks::{Mark, Shape};
pub use oracle::Oracle;
pub use picture::Picture;
pub use queries::QueryCounts;
pub use renderer::{Renderer, Stage};
pub use scene::{GpuWorld, cell_color};
pub use studio::{Culling, Studio, Target};
