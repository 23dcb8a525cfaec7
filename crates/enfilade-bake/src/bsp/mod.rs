//! Binary space partition: convex leaves and the portals between them, separators, cells.
//!
//! After Lefebvre & Hornus 2003, *Automatic Cell-and-portal Decomposition*, §2.1 and the notes after
//! §3.0.2. Surfaces share one list of planes by id; the tree cuts space by them until no leaf contains
//! any; the part of a plane between two empty leaves is a portal. Portals of one plane that together
//! close a path, with their whole rim on solid surfaces, are a *separator* ([`separator`](self)), and
//! separators divide the leaves into cells.
//!
//! | step of the paper | file |
//! | --- | --- |
//! | 1: the tree, its heuristics, guided beginnings | `build`, `tree`, `guide`, `surfaces` |
//! | 1: the leaves and the portals between them | `leaves`, `portals` |
//! | 2: separators, valid and invalid | `separator` |
//! | 3: cells, crossing separators | `cells` |
//! | separators that the arrangement would have shown (§3.0.2) | `arrange` |
//! | cells of a guide where there are no walls | `guided` |
//! | separators that may part rooms, in buildings | `lattice`, then `rooms` |
//! | matter, where surfaces are triangles | `inside` |
//! | 4: cells above the bound | [`crate::bound`] |
//! | leaks, as a path | `leak` |
//!
//! Departures from the paper: with brushes, the surface of their union is made first and the parts seen
//! only from the void are dropped, so that no leaf lies in it; and the world is not made from these
//! leaves but from [`crate::complex`], which takes the separators as candidates and the cells as votes, so
//! that a separator spoiled by rounding costs a room but never a promise.

mod arrange;
mod build;
mod cells;
mod grouping;
mod guide;
mod guided;
mod input;
mod inside;
mod lattice;
mod leak;
mod leaves;
mod portals;
mod propose;
mod separator;
mod shape;
mod surfaces;
mod tolerance;
mod tree;

pub use crate::config::{BspConfig, Guide, Heuristic, Rooms};
pub use grouping::Grouping;
pub use input::BspInput;
pub use leak::find_leak;
pub use leaves::{Bsp, BspCounts, LeakPath};
pub(crate) use propose::propose;

#[cfg(test)]
mod tests;
