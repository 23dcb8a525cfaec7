//! The changes of a space, for those who keep something derived from it: things, lamps.
//!
//! Changes are numbered. A reader keeps the number up to which it is current, and reads the later ones at its next query, so
//! nobody needs to be told. The last ones are kept, as many as there are parts and some; a reader that is further behind starts
//! anew. O(1) for a change.

use std::collections::VecDeque;

use enfilade_cpg::PortalId;

use super::id::PartId;

/// Changes kept besides one per part: more than doors move in a frame.
const MARGIN: usize = 4_096;

/// Something that has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// A part was added or moved, with everything that stands in it.
    Part(PartId),
    /// A portal was opened, closed or narrowed, or its leaves moved.
    Door(PartId, PortalId),
}

/// The last changes of a space.
#[derive(Clone, Debug, Default)]
pub(super) struct Changes {
    last: VecDeque<Change>,
    /// Number of all so far.
    n: u64,
}

impl Changes {
    pub(super) fn add(&mut self, change: Change, n_parts: usize) {
        let most = n_parts + MARGIN;
        while self.last.len() >= most {
            self.last.pop_front();
        }
        // At once, so that later changes allocate nothing.
        self.last.reserve(most - self.last.len());
        self.last.push_back(change);
        self.n += 1;
    }

    /// Returns the number of all so far.
    pub(super) fn number(&self) -> u64 {
        self.n
    }

    /// Records a change of everything.
    pub(super) fn reset(&mut self) {
        self.last.clear();
        self.n += 1;
    }

    /// Returns the changes after number `known`, oldest first, or `None` if some are no longer kept; sets `known` to the number
    /// of all so far.
    pub(super) fn since(&self, known: &mut u64) -> Option<impl Iterator<Item = Change> + use<'_>> {
        let n_new = self.n.checked_sub(*known);
        *known = self.n;
        let n_new = n_new.filter(|n| *n <= self.last.len() as u64)?;
        Some(self.last.range(self.last.len() - n_new as usize..).copied())
    }
}
