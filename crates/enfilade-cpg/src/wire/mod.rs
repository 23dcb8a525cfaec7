//! The world file: graph and geometry ⇄ bytes.
//!
//! A world is one GLB that every glTF viewer opens. Our data is in the root extension [`EXTENSION`], which is in
//! `extensionsUsed` and never in `extensionsRequired`; its bulk data (portal vertices, locator) is in buffer views.
//! `docs/format.md` describes every field.
//!
//! ```text
//! world ─┬─ cell-0, cell-1, …   one node per cell: triangles that only this cell sees
//!        ├─ shared ── shared-0, …   one node per set of cells: triangles that several see
//!        ├─ unseen                  triangles that no cell sees, such as the inside of walls
//!        ├─ details ── …            placed detail objects; instances share their mesh
//!        ├─ fixtures ── …           the input's lights, cameras and marked places
//!        └─ enfilade leak path      a polyline for people, only if requested
//! ```
//!
//! Every triangle is drawn exactly once. Equal worlds give equal bytes, and
//! `encode(decode(bytes)) == bytes` for bytes that [`encode_glb`] made.
//!
//! # Changed on writing
//!
//! glTF's rules are stricter than inputs. Values that break them are changed visibly, and counted in the statistics
//! where the picture changes:
//! - normals of a primitive, if any is not of unit length (and its tangents with them): dropped, counted as
//!   `dropped_normals`; tangents alone likewise, `dropped_tangents`. Viewers then shade flat. Normals are not
//!   renormalized, because a zero normal has no direction to restore.
//! - texture coordinates that are not finite become 0; vertex colors are clamped to 0 … 1.
//! - texture coordinate sets that a material reads and a primitive lacks are written as zeros.
//! - primitives without triangles are left out.
//! - a detail object whose transform shears or flattens, which glTF nodes cannot express, gets a transformed copy of
//!   its mesh, counted as `flattened_details`.
//! - an image without bytes (its file was missing) becomes one white pixel.

mod arrays;
mod boxes;
mod buffer;
mod decode;
mod encode;
mod fitting;
mod json;
mod origin;
mod pieces;
mod rows;
mod special;
mod transform;
mod visible;

pub use decode::{decode_glb, is_world};
pub use encode::encode_glb;
pub use pieces::{PieceContent, SplitFile, join_file, read_piece, split_file};

use crate::GraphError;
use enfilade_geom::shown;

/// Name of the glTF extension.
pub const EXTENSION: &str = "ENFILADE_cell_portal_graph";

/// Name of the node that draws [`World::leak_path`](crate::World::leak_path).
pub const LEAK_PATH: &str = "enfilade leak path";

/// Name of the glTF extension for lights.
const LIGHTS: &str = "KHR_lights_punctual";

/// Newest version of the extension that this program writes; it reads all from 1 on.
///
/// A world is written in the lowest version that can hold it, so that older programs read what they understand: special portals
/// need version 2.
pub const VERSION: u64 = 2;

const GLB_MAGIC: [u8; 4] = *b"glTF";
const GLB_VERSION: u32 = 2;
const CHUNK_JSON: [u8; 4] = *b"JSON";
const CHUNK_BIN: [u8; 4] = *b"BIN\0";

/// The reasons why bytes are not a world, or a world cannot become bytes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WireError {
    /// The bytes are not a GLB.
    #[error("this is not a GLB file ({0}); make a world with `enfilade bake IN -o OUT.glb`")]
    NotGlb(&'static str),
    /// The bytes end early or too late, or chunks do not fit together.
    #[error("the file is cut off or damaged: {problem} (byte {at})")]
    Damaged {
        /// Offset in the file.
        at: usize,
        /// The problem.
        problem: &'static str,
    },
    /// The JSON chunk cannot be parsed, or one of our fields is missing or has the wrong type.
    #[error("the file's JSON is damaged: {}", shown(.0))]
    Json(String),
    /// A GLB without our extension.
    #[error(
        "this GLB holds a scene but no rooms and doorways ({EXTENSION} is missing); \
         run `enfilade bake IN.glb -o OUT.glb` first and use OUT.glb"
    )]
    NotAWorld,
    /// A world of another version.
    #[error(
        "this world has version {found}, but this program reads versions 1 to {VERSION}; \
         bake the scene again, or use the program that wrote it"
    )]
    Version {
        /// Version of the file.
        found: u64,
    },
    /// A reference or a size in the file is wrong.
    #[error("the file is damaged: {}: {}", shown(at), shown(problem))]
    Structure {
        /// The place, e.g. `accessor 12` or `portal 3`.
        at: String,
        /// The problem.
        problem: String,
    },
    /// The world breaks invariants.
    #[error("the world is broken: {}", list(.0))]
    Invalid(Vec<GraphError>),
    /// More than the 4 GiB that a GLB can hold.
    #[error(
        "the world needs {bytes} bytes, but a GLB holds at most 4 GiB; bake it in parts or with smaller images"
    )]
    TooLarge {
        /// Size of the file. [Units: bytes]
        bytes: u64,
    },
}

fn list(errors: &[GraphError]) -> String {
    let shown: Vec<String> = errors.iter().take(3).map(ToString::to_string).collect();
    let more = errors.len().saturating_sub(shown.len());
    let tail = if more > 0 {
        format!("; and {more} more")
    } else {
        String::new()
    };
    shown.join("; ") + &tail
}

fn broken(at: impl Into<String>, problem: impl Into<String>) -> WireError {
    WireError::Structure {
        at: at.into(),
        problem: problem.into(),
    }
}
