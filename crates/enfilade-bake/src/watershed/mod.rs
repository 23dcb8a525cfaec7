//! The watershed builder: basins of a flood in a voxel volume.
//!
//! After Haumont, Debeir & Sillion, "Volumetric Cell-and-Portal Generation" (2003), with three
//! departures: distances are exact instead of chamfered, merging cures over-segmentation
//! (`rooms`), and the results are not portals but candidates in the real opening, which the cell
//! complex then realizes exactly.

mod propose;

pub(crate) use propose::{propose, propose_site, sites_of};
