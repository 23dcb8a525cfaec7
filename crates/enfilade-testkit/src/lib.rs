//! Scenes for enfilade's tests, benchmarks and demo, each with the truth about itself, and slow
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
pub mod furniture;
mod gjorup;
mod graphs;
mod house;
mod impossible;
mod interior;
mod kits;
mod land;
mod lift_tower;
mod maze;
pub mod mixed;
mod open_land;
pub mod oracle;
mod picture;
mod rng;
mod roof;
mod same_graph;
mod shuffle;
mod site;
pub mod solid;
mod surface_net;
pub mod tamper;
mod tower;
mod town;
mod traced;
mod transform;
mod truth;
mod truth_json;
mod tubes;

pub use assembled::{Assembled, Beyond, Standing, assembled, chamber};
pub use cave::cave;
pub use clinic::clinic;
pub use disturb::{Disturbance, disturb, disturbed};
pub use edits::{Edit, edited, with_cupboards};
pub use faults::Fault;
pub use gjorup::{Variant, gjorup_cavern, gjorup_rooms};
pub use graphs::{
    Dwelling, DwellingParams, GridParams, cabin, courtyard, dwelling, endless_room, linked_copies,
    room_grid, scaled_world, traced_step, window_tower, with_doors, with_specials,
};
pub use house::furnished_house;
pub use impossible::{ImpossibleHouse, impossible_house};
pub use kits::{PieceScene, dungeon_kit, maze_kit, office_kit};
pub use land::hills;
pub use lift_tower::{LiftTower, lift_tower};
pub use maze::dirkse_maze;
pub use open_land::{OpenLand, city, hamlets, valleys};
pub use rng::Rng;
pub use same_graph::differences;
pub use shuffle::{shuffled_glb, shuffled_map, shuffled_obj};
pub use site::{Generated, Site};
pub use tower::{TowerParams, office_tower};
pub use town::{Town, town, village};
pub use traced::{Chain, Traced, TracedCamera, painted};
pub use transform::{reordered, rotated, scaled, shuffled, transformed};
pub use truth::{Convex, Opening, OpeningKind, Room, Side, Truth};
pub use tubes::{Tube, surface_of, tubes};
