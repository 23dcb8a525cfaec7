//! The structure of a scene, as all builders see it before any of them searches for rooms.
//!
//! | question | file |
//! | --- | --- |
//! | which triangles bound rooms, which are stairs, along which axes | `of`, `stairs`, `frame` |
//! | surfaces that close openings: door leaves and panes | `blockers` |
//! | where storeys end | `slabs` |
//! | which parts of a site are built up, and what is open land | `site` |
//! | how badly triangles fit together, and how to make them fit | `misfit`, `settle`, `weld`, `sheets` |
//! | where surfaces end, which triangles are missing | `rims` |
//! | which side of a surface is matter | `backs` |
//! | where cells are one room | `pinch`, `lattice` |
//! | which plane an opening lies in, and an outline that covers it | `candidate`, `picture`, `outline` |

mod backs;
mod blockers;
mod candidate;
mod frame;
mod lattice;
mod misfit;
mod of;
mod outline;
mod picture;
mod pinch;
mod rims;
mod settle;
mod sheets;
mod site;
mod slabs;
mod stairs;
mod weld;

pub(crate) use backs::{POINTS, count_backs, is_inside, rays_from};
pub(crate) use blockers::{Plate, plates};
pub(crate) use candidate::{Candidate, Opening, fit_candidate};
pub(crate) use frame::Frame;
pub(crate) use lattice::{Jambs, connected_count, rim_share};
pub(crate) use of::{
    OUTDOORS, SceneStructure, Structure, bounds_of, in_own_order, slabs_of, structural_triangles,
};
pub(crate) use outline::grown;
pub(crate) use pinch::{Mergeable, Pair, join_rooms};
pub(crate) use rims::{RimVertex, Rims};
pub(crate) use site::{Site, sites};
pub(crate) use slabs::lies_in_slab;
