//! Rooms and openings found in a voxel volume, of whatever parts a builder divides the air into.
//!
//! All builders measure openings here, so that one rule (`judge`) tells a doorway from a mouth, a niche or a beam. They
//! differ in the parts that they begin with: basins of a flood, cells of a tree, bundles of tetrahedra. The results are
//! not portals but candidates in the real opening, which the cell complex then realizes exactly.
//!
//! Read `find.rs` first: it calls the steps in order.

mod air;
mod basins;
mod beside;
mod candidates;
mod find;
mod flooded;
mod fork_pieces;
mod fork_place;
mod forks;
mod fronts;
mod hollow;
mod lids;
mod limb_rule;
mod limbs;
mod low;
mod part;
mod refill;
mod regions;
mod rims;
mod sections;
mod sheltered;
mod slabs;
mod voids;
mod votes;
mod voxel_balls;

pub(crate) use air::{FLOODED, Plot, measure, plots, prepare};
pub(crate) use basins::{Basins, Division, DivisionNode, ROOT};
pub(crate) use find::{COUNTS, propose};
pub(crate) use flooded::Flooded;
pub(crate) use limb_rule::{LimbRule, LimbSettings, THICKER};
pub(crate) use limbs::{Limb, Plan, split_limbs};
pub(crate) use part::{VoxelRange, WholeAir};
pub(crate) use regions::merge_basins;
pub(crate) use voids::inside_stairs;
