//! Scenes for enfilade's tests and benchmarks, beside those of `enfilade-demo`, each with the truth about itself, and slow
//! plain oracles to check kernels against.
//!
//! Every generator gives a [`Generated`]: a [`Scene`](enfilade_geom::scene::Scene) and its
//! [`Truth`], the rooms and openings that it was built from. The same arguments give the same
//! scene, to the bit, on every machine.
//!
//! ```
//! use enfilade_testkit::{TowerParams, office_tower, rotated};
//!
//! let tower = office_tower(&TowerParams::with_rooms(16, 1));
//! assert_eq!(tower.truth.rooms.len(), 16);
//! let turned = rotated(tower, 17.0); // kernels must not care
//! assert!(turned.truth_json().contains("\"door\""));
//! ```

mod assembled;
mod cave;
mod clinic;
mod disturb;
mod edits;
mod faults;
mod gjorup;
mod glb;
mod graphs;
mod land;
pub mod mixed;
mod open_land;
pub mod oracle;
mod same_graph;
mod shuffle;
mod solids;
mod surface_net;
pub mod tamper;
mod tower;
mod town;
mod traced;
mod transform;
mod tubes;

pub use enfilade_demo::*;

pub use assembled::{Assembled, Beyond, Standing, assembled, chamber};
pub use cave::cave;
pub use clinic::clinic;
pub use disturb::{Disturbance, disturb, disturbed};
pub use edits::{Edit, edited, with_cupboards};
pub use faults::Fault;
pub use gjorup::{Variant, gjorup_cavern, gjorup_rooms};
pub use glb::glb;
pub use graphs::{
    Dwelling, DwellingParams, GridParams, cabin, courtyard, dwelling, endless_room, linked_copies,
    room_grid, scaled_world, traced_step, window_tower, with_doors, with_specials,
};
pub use land::hills;
pub use open_land::{OpenLand, city, hamlets, valleys};
pub use same_graph::differences;
pub use shuffle::{shuffled_glb, shuffled_map, shuffled_obj};
pub use solids::Solids;
pub use tower::{TowerParams, office_tower};
pub use town::{Town, town, village};
pub use traced::{Chain, Traced, TracedCamera, chains_of, painted};
pub use transform::{reordered, rotated, scaled, shuffled, transformed};
pub use tubes::{Tube, surface_of, tubes};
