//! The world file: graph and geometry ⇄ bytes.
//!
//! A world is one GLB that every glTF viewer opens. What is ours sits in the root extension
//! [`EXTENSION`], which is in `extensionsUsed` and never in `extensionsRequired`; its bulk data
//! (portal corners, locator) sits in buffer views. `docs/format.md` describes every field.
//!
//! ```text
//! world ─┬─ cell-0, cell-1, …   one node a cell: what is seen from that cell only
//!        ├─ shared ── shared-0, …   one node a set of cells: what is seen from several
//!        ├─ unseen                  what no cell sees, such as the inside of walls
//!        ├─ details ── …            placed detail objects; instances share their mesh
//!        ├─ fixtures ── …           the input's lights, cameras and marked places
//!        └─ enfilade leak path      a polyline for people, only where it was asked for
//! ```
//!
//! Every triangle is drawn exactly once. Equal worlds give equal bytes, and
//! `encode(decode(bytes)) == bytes` for bytes that [`encode_glb`] made.
//!
//! # What is not kept
//!
//! glTF's rules are stricter than inputs are. What breaks them is mended in a way that shows, and
//! counted in the statistics where the picture changes:
//! - normals of a primitive where any is not of unit length (and its tangents with them): dropped,
//!   counted as `dropped_normals`; tangents alone likewise, `dropped_tangents`. Viewers then shade
//!   flat. They are not renormalized, because a zero normal has no direction to restore.
//! - texture coordinates that are not finite become 0; vertex colors are clamped to 0 … 1.
//! - texture coordinate sets that a material reads and a primitive lacks are written as zeros.
//! - primitives without triangles are left out.
//! - a detail object whose transform shears or flattens, which glTF nodes cannot express, gets a
//!   transformed copy of its mesh, counted as `flattened_details`.
//! - an image without bytes (its file was missing) becomes one white pixel.

mod boxes;
mod buffer;
mod decode;
mod encode;
mod fitting;
mod json;
mod origin;
mod rows;
mod transform;
mod visible;

pub use decode::decode_glb;
pub use encode::encode_glb;

use crate::GraphError;
use enfilade_geom::shown;

/// Name of the glTF extension.
pub const EXTENSION: &str = "ENFILADE_cell_portal_graph";

/// Name of the node that draws [`World::leak_path`](crate::World::leak_path).
pub const LEAK_PATH: &str = "enfilade leak path";

/// Name of the glTF extension that lights are in.
const LIGHTS: &str = "KHR_lights_punctual";

/// Version of the extension that this program writes and reads.
pub const VERSION: u64 = 1;

const GLB_MAGIC: [u8; 4] = *b"glTF";
const GLB_VERSION: u32 = 2;
const CHUNK_JSON: [u8; 4] = *b"JSON";
const CHUNK_BIN: [u8; 4] = *b"BIN\0";

/// Why bytes are no world, or a world could not become bytes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WireError {
    /// The bytes are no GLB at all.
    #[error("this is no GLB file ({0}); a world is made with `enfilade bake IN -o OUT.glb`")]
    NotGlb(&'static str),
    /// The bytes end early, go on too long, or chunks do not fit into each other.
    #[error("the file is cut off or damaged: {problem} (byte {at})")]
    Damaged {
        /// Offset into the file.
        at: usize,
        /// What does not fit.
        problem: &'static str,
    },
    /// The JSON part cannot be parsed, or a field of ours is missing or of the wrong type.
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
        "this world is of version {found}, this program reads version {VERSION}; \
         bake the scene again, or use the program that wrote it"
    )]
    Version {
        /// Version of the file.
        found: u64,
    },
    /// A reference or a size within the file does not fit.
    #[error("the file is damaged: {}: {}", shown(at), shown(problem))]
    Structure {
        /// Where, e.g. `accessor 12` or `portal 3`.
        at: String,
        /// What is wrong.
        problem: String,
    },
    /// The world breaks invariants.
    #[error("the world is broken: {}", list(.0))]
    Invalid(Vec<GraphError>),
    /// More than the 4 GiB that a GLB can hold.
    #[error(
        "the world takes {bytes} bytes, a GLB holds at most 4 GiB; bake it in parts or with smaller pictures"
    )]
    TooLarge {
        /// What it would take.
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
