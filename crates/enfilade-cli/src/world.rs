//! Reads world files.

use std::path::Path;

use anyhow::Context;
use enfilade::cpg::World;
use enfilade::cpg::wire::{WireError, decode_glb, encode_glb};
use enfilade::world::WalkMapKey;

use enfilade_report::measured_room_facts;

use crate::input::{name_of, read_glb, read_packed};

/// Reads a world written by `bake` from `path`, or from standard input if that is `-`.
///
/// # Errors
///
/// If the file cannot be read or is not a valid world; the error names it.
pub fn read_world(path: &Path) -> anyhow::Result<World> {
    decode_glb(&read_glb(path)?).with_context(|| name_of(path))
}

/// As [`read_world`]; also checks that the head of a packed world is that of its pieces, and returns the file.
///
/// # Errors
///
/// As [`read_world`]; a head that was forged, or written wrongly.
pub fn read_world_checked(path: &Path) -> anyhow::Result<(World, Vec<u8>)> {
    let file = match read_packed(path, true).with_context(|| name_of(path))? {
        Some(file) => file,
        None => read_glb(path)?,
    };
    Ok((decode_glb(&file).with_context(|| name_of(path))?, file))
}

/// As [`read_world`]; also returns the hash of the file, for what is kept beside it.
///
/// # Errors
///
/// As [`read_world`].
pub fn read_world_hashed(path: &Path) -> anyhow::Result<(World, u64)> {
    let bytes = read_glb(path)?;
    let world = decode_glb(&bytes).with_context(|| name_of(path))?;
    Ok((world, WalkMapKey::hash(&bytes)))
}

/// Returns the file of a valid world, which it completes: facts of rooms are measured if it has none.
///
/// # Errors
///
/// Those of [`encode_glb`].
pub fn encode_whole(world: &mut World) -> Result<Vec<u8>, WireError> {
    if world.room_facts.is_none() {
        world.room_facts = Some(measured_room_facts(world));
    }
    encode_glb(world)
}
