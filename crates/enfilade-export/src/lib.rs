//! Rooms of enfilade worlds for other trades: the facts of their surfaces, and the files that programs for energy, robots and
//! acoustics take.
//!
//! ```
//! use enfilade_cpg::World;
//! use enfilade_export::{SurfaceOptions, room_surfaces};
//!
//! assert!(room_surfaces(&World::default(), &SurfaceOptions::default()).is_empty());
//! ```
//!
//! All functions take a valid world (`World::validate`) and return the same bytes every time. Lengths are meters, +Y is up.

mod coarse;
mod floor_map;
mod gbxml;
mod hbjson;
mod ifc;
mod indoor_gml;
mod names;
mod room_solid;
mod surfaces;
mod triangles;

pub use floor_map::{FloorMap, FloorMapError, FloorMapOptions};
pub use gbxml::gbxml;
pub use hbjson::{HbjsonModel, hbjson};
pub use ifc::{IfcError, IfcOptions, IfcSpaces, ifc_with_spaces};
pub use indoor_gml::indoor_gml;
pub use room_solid::{RoomSolid, room_solids};
pub use surfaces::{
    Behind, BoundarySurface, RoomSurfaces, SurfaceCover, SurfaceLevel, SurfaceOptions,
    room_surfaces,
};
