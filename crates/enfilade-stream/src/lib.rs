//! Worlds larger than memory: pieces of a world, fetched as they come into view and kept within a budget.
//!
//! A packed world is a small head, always in memory (graph, locator, potentially visible set, boxes, sizes, mean
//! colors), and *pieces*: the triangles of a set of cells, a mesh of objects, a picture. [`Catalog`] lists the pieces and
//! the cells that need them. A [`Source`] fetches pieces from wherever they are; it never blocks. After Dirkse (2002), §4.

mod bound;
mod catalog;
mod deadlines;
mod files;
mod first_picture;
mod head;
#[cfg(feature = "http")]
mod http;
mod link;
mod of_world;
mod pack;
mod place;
mod source;
mod streamer;
mod threads;

pub use bound::{Due, deadlines, due_times, least_bandwidth};
pub use catalog::{Catalog, PieceId, PieceSizes};
pub use files::{FileFetch, HEAD, PackedFiles};
pub use first_picture::first_picture;
pub use head::{PackError, PackedHead, PieceAt};
#[cfg(feature = "http")]
pub use http::{HttpFetch, PackedHttp};
pub use link::{SimulatedLink, SimulatedLinkOptions};
pub use of_world::{WorldPieces, images_of};
pub use pack::PackedWorld;
pub use place::PackedPlace;
pub use source::{FetchError, Reply, Source};
pub use streamer::{
    Changes, Eye, Failed, InView, Loaded, PinError, Policy, StandIn, StandInCause, StreamCounts,
    StreamFrame, StreamOptions, Streamer,
};
pub use threads::{Fetch, ThreadSource};
