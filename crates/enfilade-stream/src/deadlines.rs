//! Deadlines of cells: the least time until something of a cell may be seen.
//!
//! A cell that may be seen from the eye's cell is due now. Any other is due when the eye can be in a cell from which it may be
//! seen. So the cells within reach are visited in order of the least length of a way to them, and each makes the cells of its
//! potentially visible set due ([`Search`]).
//!
//! **Errs to early.** A way is at least as long as the straight lines from portal to portal, and these at least as long as
//! those between the portals' boxes ([`Ways`]); walls and furniture in between are not known here. Windows are not walked
//! through, unless the eye flies. In a graph without a
//! potentially visible set, everything within reach counts as visible, nearest first.

mod search;
mod ways;

pub(crate) use search::{Planned, Search};
pub(crate) use ways::Ways;
