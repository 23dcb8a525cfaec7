//! The watershed builder: rooms and openings found in a voxel volume.
//!
//! After Haumont, Debeir & Sillion, "Volumetric Cell-and-Portal Generation" (2003), with three
//! departures: distances are exact instead of chamfered, merging cures over-segmentation
//! (`regions`), and the results are not portals but candidates in the real opening, which the cell
//! complex then realizes exactly.
//!
//! Read `propose.rs` first: it calls the steps in order.

mod candidates;
mod flooded;
mod fronts;
mod hollow;
mod lids;
mod limbs;
mod low;
mod propose;
mod refill;
mod regions;
mod rims;
mod sections;
mod slabs;
mod voids;
mod votes;

pub(crate) use propose::propose;
