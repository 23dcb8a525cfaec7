//! Tests of the crate, in one program: each file alone would be linked with all of it.

mod doors;
mod groups;
mod hollow;
mod hostile;
mod lines;
mod parts;
mod pick;
mod seen;
