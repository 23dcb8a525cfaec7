//! The watershed builder: rooms and openings found in a voxel volume.
//!
//! Haumont, Debeir & Sillion, "Volumetric Cell-and-Portal Generation" (2003), with three
//! departures: distances are exact instead of chamfered, over-segmentation is cured by merging
//! (`regions`), and what comes out are not portals but *screens* (`fit`): candidates in the real
//! opening, which the cell complex then realizes exactly.

mod closures;
mod fit;
mod frame;
mod fronts;
mod hollow;
mod lids;
mod limbs;
mod regions;
mod rims;
mod sections;
mod slabs;
mod stairs;
mod voids;

pub use closures::{bounds_of, closure_triangles, flood_closures, plates, without_open_leaves};
pub use fit::{Screen, fit_screen, fit_screen_at};
pub use frame::Frame;
pub use fronts::{
    Opening, connected_patches, face_center, group_faces, is_in, opening_of, without_corners,
};
pub use hollow::{Matter, find_matter};
pub use lids::{Lids, find_lids};
pub use limbs::split_limbs;
pub use regions::{Flooded, MergeSettings, OUTDOORS, Regions, merge_basins};
pub use rims::rim_caps;
pub(crate) use sections::{connected_count, rim_share};
pub use slabs::{cut_at_slabs, slab_heights};
pub use stairs::find_stairs;
pub use voids::shallow_voids;
