//! World files by path.

use std::path::{Path, PathBuf};
use std::{fs, io};

use enfilade_cpg::World;
use enfilade_cpg::wire::{WireError, decode_glb, encode_glb};
use enfilade_geom::shown;

use crate::whole;

/// The reason why a world could not be read or written. Messages name the file and say what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", shown(path.display()))]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The file cannot be written.
    #[error("cannot write {}: {source}", shown(path.display()))]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The file is not a world, or the world breaks an invariant.
    #[error("{}: {source}", shown(path.display()))]
    World {
        /// The file.
        path: PathBuf,
        /// The fault.
        source: WireError,
    },
}

/// Reads a world written by `enfilade bake` or [`save`]. Linear in the size of the file, which is held in memory
/// while it is decoded.
///
/// A returned world satisfies every invariant ([`World::validate`]), so that later queries cannot fail.
///
/// # Errors
///
/// If the file cannot be read, is not a world, or is damaged.
pub fn open(path: impl AsRef<Path>) -> Result<World, FileError> {
    let path = path.as_ref();
    let bytes = fs::read(path).map_err(|source| FileError::Read {
        path: path.into(),
        source,
    })?;
    decode_glb(&bytes).map_err(|source| FileError::World {
        path: path.into(),
        source,
    })
}

/// Writes a world as one GLB, [whole or not at all](crate::whole), and removes files that killed runs left beside it.
/// Linear in the size of the world.
///
/// # Errors
///
/// If the file cannot be written, or the world breaks an invariant. An earlier file of that name then stays as it
/// was.
pub fn save(path: impl AsRef<Path>, world: &World) -> Result<(), FileError> {
    let path = path.as_ref();
    let bytes = encode_glb(world).map_err(|source| FileError::World {
        path: path.into(),
        source,
    })?;
    whole::remove_left(&[path]);
    whole::write(path, &bytes).map_err(|source| FileError::Write {
        path: path.into(),
        source,
    })
}
