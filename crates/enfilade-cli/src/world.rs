//! Reads world files.

use std::path::Path;

use anyhow::Context;
use enfilade::cpg::World;
use enfilade::cpg::wire::decode_glb;

use crate::input::{name_of, read_glb};

/// Reads the world that `bake` wrote to `path`, or that comes from standard input where that is `-`.
///
/// # Errors
///
/// A file that cannot be read, or is no valid world; the error names it.
pub fn read_world(path: &Path) -> anyhow::Result<World> {
    decode_glb(&read_glb(path)?).with_context(|| name_of(path))
}
