//! Actors on errands, simulated lazily: the position of each follows from its plan and the time, and costs nothing until it is
//! queried.
//!
//! After Gjørup 1999, section 3.3.4: a car that enters a segment gets an entry, an exit and a time, is updated again only when
//! that time is over, and its position in between is computed only where it is seen; sounds and effects sleep in cells that have
//! not been seen for a while. Beyond him, a plan spans many cells, so that the cells on it need no updates; and plans change
//! only by events with a time, whose random numbers depend on actor and event alone. So positions do not depend on views,
//! queries, or the steps in which time advances.
//!
//! | file | holds |
//! | --- | --- |
//! | `chance.rs` | random numbers determined by seed, actor and event |
//! | `plan.rs` | points with times, straight lines between them |
//! | `way.rs` | ways along paths, cut at portals |
//! | `wheel.rs` | timing wheel of due actors |
//! | `crowd.rs` | all actors: events, cells, positions |
//! | `errand.rs` | plans that go somewhere, stay, and go on |
//! | `awake.rs` | cells that are seen or heard, or were recently |

mod awake;
mod chance;
mod crowd;
mod errand;
mod plan;
#[cfg(test)]
mod tests;
mod way;
mod wheel;

pub use awake::AwakeCells;
pub use chance::Chance;
pub use crowd::{ActorEvent, ActorId, ActorPlace, Actors, Cause};
pub use errand::Errands;
pub use plan::{PlanDraft, WayPoint};
