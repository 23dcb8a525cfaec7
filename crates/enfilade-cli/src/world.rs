//! Reads world files.

use std::fs;
use std::path::Path;

use anyhow::Context;
use enfilade::cpg::World;
use enfilade::cpg::wire::decode_glb;

/// Reads the world that `bake` wrote to `path`.
///
/// # Errors
///
/// A file that cannot be read, or is no valid world; the error names it.
pub fn read_world(path: &Path) -> anyhow::Result<World> {
    let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    decode_glb(&bytes).with_context(|| path.display().to_string())
}
