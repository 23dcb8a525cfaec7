//! A world on the adapter: vertices, indices, materials, textures, placed objects.
//!
//! One buffer holds all triangles: first those of the chunks of [`Sight`], in the same order, then those of
//! detail meshes, each mesh once. Draws are ranges of it, so that adjacent chunks join to one draw whatever their
//! room. In a hollow world the same buffer has room for some of them (`hollow.rs`).

mod buffers;
mod color;
mod filling;
mod gpu_world;
mod hollow;
mod pieces;
mod placed;
mod plug;
mod room;
mod streamed;
mod textures;

pub(crate) use color::{OUTDOORS, packed_cell_color};
pub(crate) use filling::{CORNER_LAYOUT, Corner, Finish, Span};
pub use gpu_world::GpuWorld;
pub use hollow::{Put, StreamLimits};
pub use pieces::{GpuPiece, PieceMaker};
pub(crate) use placed::{INSTANCE_LAYOUT, Instance};
pub(crate) use plug::plug;
pub(crate) use textures::texture_layout;
