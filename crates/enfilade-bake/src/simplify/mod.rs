//! Makes any cell-and-portal graph simpler: merges cells until their costs are within bounds.
//!
//! After Lefebvre & Hornus 2003, §3: the cheapest cell first, the worst of its portals removed; the
//! lower bound is sought, the upper one guaranteed. Where only a number of cells or portals is asked for,
//! the merge that adds least to what sampled views draw is next, wherever it is (`views.rs`). Works on
//! any [`World`](enfilade_cpg::World), whatever built it, since a merge needs nothing but the world: the two cells become one,
//! the portals between them go, what either saw the new one sees.
//!
//! **Every promise is kept:** a portal is left out only where both its sides are the same cell.

mod apply;
mod cost;
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
