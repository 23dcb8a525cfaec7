//! Worlds in pieces, fetched as they come into view and kept within a budget.
//!
//! A [`PackedWorld`] is a head and pieces; unpacked, it has the bytes of before:
//!
//! ```
//! use enfilade::cpg::wire::encode_glb;
//! use enfilade::stream::{PackedHead, PackedWorld};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! let bytes = encode_glb(&world)?;
//! let packed = PackedWorld::pack(&bytes)?;
//! assert_eq!(packed.unpack()?, bytes);
//! let [(_, head), _] = packed.files()?;
//! let head = PackedHead::decode(&head)?;
//! assert_eq!(head.sight()?.n_cells(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A [`Streamer`] decides what a [`Source`] fetches for a [`StreamFrame`], and tells the [`Changes`]:
//!
//! ```
//! use std::time::Duration;
//!
//! use enfilade::stream::{
//!     Changes, Eye, InView, SimulatedLink, SimulatedLinkOptions, StreamFrame, StreamOptions, Streamer, WorldPieces,
//! };
//! use enfilade::CellId;
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! let catalog = WorldPieces::of_world(&world, &|_| Vec::new()).catalog;
//! let mut source = SimulatedLink::new(&catalog, SimulatedLinkOptions::default());
//! let mut streamer = Streamer::new(catalog, &world.graph, None, StreamOptions::default());
//! let mut changes = Changes::default();
//! let in_view = [InView { cell: CellId(0), share: 1.0 }];
//! for second in 0..60 {
//!     let now = Duration::from_secs(second);
//!     source.advance(now);
//!     let eye = Eye { cell: Some(CellId(0)), ..Eye::default() };
//!     streamer.update(&mut source, &StreamFrame { now, eye, in_view: &in_view }, &mut changes);
//! }
//! assert!(streamer.is_complete(CellId(0)) && streamer.view_settled());
//! assert!(streamer.counts().n_loaded > 0);
//! ```
//!
//! A [`Catalog`] of your own pieces:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::stream::{Catalog, PieceId, PieceSizes};
//!
//! let piece = |n_bytes| PieceSizes { n_resident: n_bytes, n_packed: n_bytes / 2 };
//! let rows = [vec![PieceId(0)], vec![PieceId(0), PieceId(1)]]; // the pieces that each cell needs
//! let catalog = Catalog::new(vec![piece(1000), piece(50)], &rows);
//! assert_eq!(catalog.pieces_of(CellId(1)), [PieceId(0), PieceId(1)]);
//! ```
//!
//! [`PackedPlace`] opens packed worlds from folders, single files and servers:
//!
//! ```
//! use std::sync::Arc;
//!
//! use enfilade::cpg::wire::encode_glb;
//! use enfilade::stream::{PackedPlace, PackedWorld, Source};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! let path = std::env::temp_dir().join(format!("enfilade-packed-{}.enf", std::process::id()));
//! enfilade::whole::write(&path, &PackedWorld::pack(&encode_glb(&world)?)?.one_file()?)?;
//! let (head, place) = PackedPlace::open(&path)?;
//! let mut source = place.source(&Arc::new(head)); // threads that read
//! source.request(enfilade::stream::PieceId(0));
//! let mut replies = Vec::new();
//! while replies.is_empty() {
//!     source.poll(&mut replies);
//! }
//! assert!(replies[0].bytes.is_ok());
//! # std::fs::remove_file(&path)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use enfilade_stream::{
    Catalog, Changes, Eye, Failed, Fetch, FetchError, FileFetch, HEAD, InView, Loaded, PackError,
    PackedFiles, PackedHead, PackedPlace, PackedWorld, PieceAt, PieceId, PieceSizes, PinError,
    Policy, Reply, SimulatedLink, SimulatedLinkOptions, Source, StandIn, StandInCause,
    StreamCounts, StreamFrame, StreamOptions, Streamer, ThreadSource, WorldPieces,
};
#[cfg(feature = "http")]
pub use enfilade_stream::{HttpFetch, PackedHttp};
