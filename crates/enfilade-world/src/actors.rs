//! Those who go about their errands, far from any eye: where each is follows from its plan and the time, and costs nothing until
//! somebody asks.
//!
//! After Gjørup 1999, section 3.3.4: a car that enters a segment gets an entry, an exit and a time, is looked at again only when
//! that time is over, and its place between them is computed only where it is seen; sounds and effects of cells that have
//! not been seen for a while sleep. Beyond him, a plan reaches over many cells, so that the cells on it need not be asked; and plans change
//! only by events that have a time, with chance drawn from actor and event alone. So who is where at a time does not depend on who
//! looked, how often, or in which steps time went by.
//!
//! | file | holds |
//! | --- | --- |
//! | `chance.rs` | chance that two numbers decide |
//! | `plan.rs` | places and times, straight lines between them |
//! | `wheel.rs` | who is due when |
//! | `crowd.rs` | all actors: events, cells, places |
//! | `errand.rs` | plans of those who go somewhere, stay, and go on |
//! | `awake.rs` | which cells are seen or heard, or were a short while ago |

mod awake;
mod chance;
mod crowd;
mod errand;
mod plan;
#[cfg(test)]
mod tests;
mod wheel;

pub use awake::AwakeCells;
pub use chance::Chance;
pub use crowd::{ActorEvent, ActorId, ActorPlace, Actors, Cause};
pub use errand::Errands;
pub use plan::{PlanDraft, WayPoint};
