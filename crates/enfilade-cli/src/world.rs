//! Reads world files.

use std::path::Path;

use anyhow::Context;
use enfilade::cpg::World;
use enfilade::cpg::wire::decode_glb;

use crate::input::{name_of, read_glb};

/// Reads a world written by `bake` from `path`, or from standard input if that is `-`.
///
/// # Errors
///
/// If the file cannot be read or is not a valid world; the error names it.
pub fn read_world(path: &Path) -> anyhow::Result<World> {
    decode_glb(&read_glb(path)?).with_context(|| name_of(path))
}
