//! Tests of the crate, in one program: each file alone would be linked with all of it.

mod doors;
mod hollow;
mod lamps;
mod opengl;
mod pictures;
mod places;
mod portal_textures;
mod portal_textures_ahead;
mod portal_textures_lamps;
mod spaces;
mod specials;
mod two_places;
