//! Simplifies any cell-and-portal graph: merges cells until their costs are within bounds.
//!
//! After Lefebvre & Hornus 2003, §3: the cheapest cell first, the worst of its portals removed; the
//! lower bound is a goal, the upper one guaranteed. If only a number of cells or portals is requested,
//! the next merge is the one that adds least to the cost of sampled views, wherever it is (`views.rs`). Works on
//! any [`World`](enfilade_cpg::World), whichever method built it, since a merge needs nothing else: the two cells
//! become one, the portals between them disappear, and the new cell sees everything that either saw.
//!
//! **Every guarantee holds:** a portal is removed only where both its sides are the same cell.

mod apply;
mod cost;
mod doorways;
mod graph;
mod judge;
mod merge;
mod metric;
mod run;
mod settings;
mod views;

pub(crate) use apply::Batches;
pub use cost::{CostModel, UnknownMaterial, costs};
pub(crate) use cost::{Surface, cost_of_cell, surfaces_of};
pub use graph::{SimplifiedGraph, simplify_graph};
pub use judge::{expected_cost, expected_cost_after, least_expected_cost};
pub use metric::{PortalScore, portal_scores};
pub use run::{Simplified, delete_portal, simplify};
pub use settings::{Metric, SimplifySettings};
