//! Scenes made by code, for the demos of the command and for tests.
//!
//! Every generator gives a [`Generated`]: a [`Scene`](enfilade_geom::scene::Scene) and its [`Truth`], the rooms and openings
//! that it was built from. The same arguments give the same scene, to the bit, on every machine.
//!
//! ```
//! let house = enfilade_demo::furnished_house();
//! assert!(house.truth_json().contains("\"door\""));
//! ```

pub mod furniture;
mod house;
mod impossible;
pub mod interior;
mod kits;
mod lift_tower;
mod maze;
mod picture;
mod rng;
pub mod roof;
mod site;
pub mod solid;
mod truth;
mod truth_json;

pub use house::furnished_house;
pub use impossible::{ImpossibleHouse, impossible_house};
pub use kits::{PieceScene, dungeon_kit, maze_kit, office_kit};
pub use lift_tower::{LiftTower, lift_tower};
pub use maze::dirkse_maze;
pub use picture::oak_planks;
pub use rng::Rng;
pub use site::{Generated, Site};
pub use truth::{Convex, Opening, OpeningKind, Room, Side, Truth};
