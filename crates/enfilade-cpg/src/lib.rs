//! The cell-and-portal graph: made by every builder of enfilade, and read by every consumer.
//!
//! A [`World`] is a [`CellPortalGraph`] together with the geometry of its cells. This crate holds the types, their
//! invariants ([`CellPortalGraph::validate`]), the [`Locator`] (point to cell) and the file: a GLB with the
//! `ENFILADE_cell_portal_graph` extension ([`wire`]). It does not depend on how a graph was made, does not use the
//! file system and does not start threads.

mod access;
mod cell_set;
mod doubts;
mod facts;
mod fitting;
mod graph;
mod holes;
mod ids;
mod leaf;
mod locator;
mod look;
mod named;
mod palette;
mod parts;
mod pvs;
mod seals;
mod sight_graph;
mod sources;
mod special;
mod special_access;
mod trust;
mod validate;
mod why;
pub mod wire;

pub use access::Exit;
pub use cell_set::CellSet;
pub use doubts::Doubt;
pub use facts::RoomFacts;
pub use fitting::{Fitting, FittingPart, Motion, MotionKind};
pub use graph::{
    Batch, Cell, CellPortalGraph, DetailObject, Portal, PortalKind, Provenance, Statistics, World,
};
pub use holes::{Hole, HoleReason};
pub use ids::{CellId, PortalId};
pub use locator::{Around, Locator, LocatorNode};
pub use look::{shifted_textures, used_textures};
pub use palette::{cell_color, cell_paint};
pub use parts::{PartNumbers, VisibleParts, VisibleVolumes};
pub use pvs::Pvs;
pub use seals::Seals;
pub use sight_graph::{SightGraph, SightGraphError, SightPortal};
pub use sources::SourceRuns;
pub use special::{MonitorCamera, Pass, SpecialId, SpecialPortal, SpecialShape, Way};
pub use trust::{CloseDecision, RoomDoubt};
pub use validate::{GraphError, MAX_REPORTED, SpecialProblem};
pub use why::{DecidedPlace, Fact, Reason, Why};
