//! The Delaunay builder: tetrahedra between the surfaces, merged into rooms.
//!
//! Gjørup, "Portal techniques for large interactive worlds" (1999), chapter 4. As with the watershed, the results are
//! candidate portals and votes, and the cell complex makes them exact.
//!
//! | stage | file | source |
//! | --- | --- | --- |
//! | tetrahedra of points | `insert`, `tetrahedra`, `order`, `predicate` | Bowyer 1981, Watson 1981 |
//! | points where surfaces need them | `refine`, `balls` | Chew 1993; Boissonnat & Oudot 2005 |
//! | tetrahedra cut by polygons, and openings between them | `cut`, `openings` | §4.2.1, §4.2.2 |
//! | air, and ways through it | `space` | §4.2.2; Dey, Giesen & Goswami 2003 |
//! | merging of parts of the air between which nothing narrows | `cells` | ours |
//! | tubes that leave a room without a pinch | `branches`; `labels`: the result | ours, after Matheron 1975 |
//! | corridors that leave a room without a pinch | `limbs`, by the rule of `rooms` | ours |
//! | portals removed one by one | `decimate`; `decimate/remaining`: those left after a step | §4.1.4, §4.2.3, §4.3 |
//! | overruling by a person | `review` | §4.2.3 |
//! | remaining rooms, and matter | `standing` | ours |
//! | candidates and votes | `rooms` | ours |
//!
//! `session` runs the stages up to decimation, `propose` the rest.

mod balls;
mod branches;
mod cells;
mod cut;
mod decimate;
mod insert;
mod labels;
mod limbs;
mod limits;
mod openings;
mod order;
mod predicate;
mod propose;
mod refine;
mod review;
mod rooms;
mod session;
mod space;
mod standing;
mod tetrahedra;

#[cfg(test)]
mod space_tests;
#[cfg(test)]
mod tests;

pub use crate::config::{Choices, DelaunayConfig, Weight};
pub use crate::error::DelaunayError;
pub use cells::{CellPortal, Cells, OUTDOOR_CELL, flow_together};
pub use decimate::{Choice, Decimation, JOINED, RemainingPortal, Step, decimate, default_stop};
pub use insert::tetrahedralize;
pub(crate) use propose::{propose, propose_of};
pub use review::{Decision, Review};
pub use session::Session;
pub use space::{LEAST_BALL, Link, Space, divide};
pub use tetrahedra::{Delaunay, INFINITE, Tetrahedron};
