//! Pieces of a bake that are kept, so that a bake that was ended goes on from them, and several machines share its work.
//!
//! A scene falls into *sites*, buildings apart from each other, and each is worked on by itself. For each there are two pieces:
//! the basins of its air, and the rooms and openings found among them. The exact cells of all sites are made from the latter at the
//! end, all at once.
//!
//! **Keys** are hashes of everything that a piece depends on: the scene, the settings that change a result, the version, the kind
//! of piece and the site. So pieces of other bakes never match, and two processes that make the same piece write the same bytes.
//! Each piece begins with a hash of its key and its contents: one that is damaged or cut off, or lies under the key of another,
//! counts as missing.

use std::fmt::{self, Write as _};

use enfilade_geom::scene::{Mesh, Scene};
use serde::Serialize;
use serde::de::DeserializeOwned;
use twox_hash::XxHash3_128;

use crate::{BakeConfig, BakeError, Budget};

/// A place for pieces: a folder, a bucket, memory.
pub trait Pieces: Sync {
    /// Returns the piece with this key, if it is there.
    fn get(&self, key: &str) -> Option<Vec<u8>>;

    /// Keeps a piece. If it is there already, its bytes are the same.
    fn put(&self, key: &str, bytes: &[u8]);
}

/// The pieces of one bake, if it keeps any.
#[derive(Clone, Copy)]
pub(crate) struct Kept<'a> {
    pieces: Option<&'a dyn Pieces>,
    scene: u128,
}

/// A kind of piece.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PieceKind {
    Basins,
    Rooms,
}

impl<'a> Kept<'a> {
    /// Takes the pieces of a bake of a scene.
    pub(crate) fn of(scene: &Scene, config: &BakeConfig, pieces: Option<&'a dyn Pieces>) -> Self {
        Self {
            pieces,
            scene: pieces.map_or(0, |_| fingerprint(scene, config)),
        }
    }

    /// Returns the key of a piece, 32 hexadecimal digits, given the place and the voxels of its site.
    pub(crate) fn key(&self, kind: PieceKind, plot: &impl fmt::Debug) -> String {
        let mut hasher = XxHash3_128::new();
        hasher.write(&self.scene.to_le_bytes());
        // With the voxels, which depend on the memory.
        hasher.write(format!("{kind:?} {plot:?}").as_bytes());
        format!("{:032x}", hasher.finish_128())
    }

    /// Returns a piece that is there and whole, or else makes and keeps it.
    ///
    /// # Errors
    /// Those of `make`.
    pub(crate) fn or_make<T: KeptPiece>(
        &self,
        kind: PieceKind,
        plot: &impl fmt::Debug,
        make: impl FnOnce() -> Result<T, BakeError>,
    ) -> Result<T, BakeError> {
        let Some(pieces) = self.pieces else {
            return make();
        };
        let key = self.key(kind, plot);
        if let Some(found) = pieces.get(&key).and_then(|bytes| unsealed(&key, &bytes)) {
            return Ok(found);
        }
        let made = make()?;
        pieces.put(&key, &sealed(&key, &made));
        Ok(made)
    }
}

/// Hashes everything that rooms depend on: the scene and the settings, without the limits on resources.
fn fingerprint(scene: &Scene, config: &BakeConfig) -> u128 {
    let mut hashed = Hashed(XxHash3_128::new());
    let config = BakeConfig {
        budget: Budget::default(),
        ..config.clone()
    };
    let Scene {
        meshes,
        objects,
        materials,
        textures,
        images,
        solids,
        is_open_world,
        rooms,
        marks,
        // Carried through, and of no influence on rooms.
        sky: _,
        given_portals: _,
        entities: _,
        nodes: _,
        fixtures: _,
        about: _,
    } = scene;
    let version = env!("CARGO_PKG_VERSION");
    // Numbers are written so that different ones differ.
    let written = write!(
        hashed,
        "{version} {config:?} {objects:?} {materials:?} {textures:?} {solids:?} {is_open_world} {rooms:?} {marks:?}"
    );
    debug_assert!(written.is_ok(), "hashing does not fail");
    for image in images {
        hashed.add(&image.bytes);
    }
    for Mesh { name, primitives } in meshes {
        hashed.add(name.as_bytes());
        for part in primitives {
            hashed.add(format!("{:?}", part.material).as_bytes());
            hashed.add(bytemuck::cast_slice(&part.positions));
            hashed.add(bytemuck::cast_slice(&part.normals));
            hashed.add(bytemuck::cast_slice(&part.colors));
            hashed.add(bytemuck::cast_slice(&part.indices));
            for uvs in &part.uvs {
                hashed.add(bytemuck::cast_slice(uvs));
            }
        }
    }
    hashed.0.finish_128()
}

/// A hash of text and bytes.
struct Hashed(XxHash3_128);

impl Hashed {
    /// Adds bytes after their number, so that two lists are not taken for one.
    fn add(&mut self, bytes: &[u8]) {
        self.0.write(&(bytes.len() as u64).to_le_bytes());
        self.0.write(bytes);
    }
}

impl fmt::Write for Hashed {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}

/// A piece that can be written and read again.
pub(crate) trait KeptPiece: Sized {
    /// Its form in a file.
    type Written: Serialize + DeserializeOwned;

    fn written(&self) -> Self::Written;

    /// Returns `None` if the form contradicts itself.
    fn read(written: Self::Written) -> Option<Self>;
}

/// Returns the hash of a piece's key and contents.
fn seal(key: &str, body: &[u8]) -> [u8; 16] {
    let mut hashed = Hashed(XxHash3_128::new());
    hashed.add(key.as_bytes());
    hashed.add(body);
    hashed.0.finish_128().to_le_bytes()
}

/// Returns the bytes of a piece, after a hash of its key and them.
fn sealed<T: KeptPiece>(key: &str, piece: &T) -> Vec<u8> {
    let body = bitcode::serialize(&piece.written()).expect("numbers, text and lists");
    [&seal(key, &body)[..], &body].concat()
}

/// Returns the piece of these bytes, unless they were changed or have another key.
pub(crate) fn unsealed<T: KeptPiece>(key: &str, bytes: &[u8]) -> Option<T> {
    let (hash, body) = bytes.split_first_chunk::<16>()?;
    if *hash != seal(key, body) {
        return None;
    }
    T::read(bitcode::deserialize(body).ok()?)
}
