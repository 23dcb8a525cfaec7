//! Portals that a view does not pass, because something stands in for what lies behind them.

use enfilade_cpg::{CellId, PortalId};

use crate::exits::Exit;

/// Portals at which [`Viewer::see`](crate::Viewer::see) stops: far ones, but for some, and chosen ones. They are listed in
/// [`Seen::stopped`](crate::Seen::stopped), for the caller to draw a picture of what lies behind (Aliaga & Lastra 1997,
/// section 4). With stops, answers are not supersets.
///
/// Each is a portal with the cell behind it; the other direction is another.
#[derive(Debug, PartialEq)]
pub struct Stops {
    /// Portals whose bounding sphere is farther from the eye; infinite for none. [Units: wu]
    pub beyond: f32,
    /// Far portals that are passed all the same.
    passed: Vec<(PortalId, CellId)>,
    /// Stops at any distance.
    chosen: Vec<(PortalId, CellId)>,
}

impl Default for Stops {
    /// No stops.
    fn default() -> Self {
        Self {
            beyond: f32::INFINITY,
            passed: Vec::new(),
            chosen: Vec::new(),
        }
    }
}

impl Clone for Stops {
    fn clone(&self) -> Self {
        let mut own = Self::default();
        own.clone_from(self);
        own
    }

    /// Allocates only while buffers grow.
    fn clone_from(&mut self, source: &Self) {
        self.beyond = source.beyond;
        self.passed.clone_from(&source.passed);
        self.chosen.clone_from(&source.chosen);
    }
}

fn put(list: &mut Vec<(PortalId, CellId)>, portal: PortalId, into: CellId) {
    if let Err(at) = list.binary_search(&(portal, into)) {
        list.insert(at, (portal, into));
    }
}

fn take(list: &mut Vec<(PortalId, CellId)>, portal: PortalId, into: CellId) {
    if let Ok(at) = list.binary_search(&(portal, into)) {
        list.remove(at);
    }
}

impl Stops {
    /// Removes all stops.
    pub fn clear(&mut self) {
        self.beyond = f32::INFINITY;
        self.passed.clear();
        self.chosen.clear();
    }

    /// Passes a portal into a cell, however far it is.
    pub fn pass(&mut self, portal: PortalId, into: CellId) {
        take(&mut self.chosen, portal, into);
        put(&mut self.passed, portal, into);
    }

    /// Stops at a portal into a cell, however near it is.
    pub fn stop(&mut self, portal: PortalId, into: CellId) {
        take(&mut self.passed, portal, into);
        put(&mut self.chosen, portal, into);
    }

    /// Returns `true` if there are none.
    #[must_use]
    #[doc(hidden)]
    pub fn is_empty(&self) -> bool {
        self.beyond == f32::INFINITY && self.chosen.is_empty()
    }

    /// Returns `true` at a stop. `distance` is that of the exit's center.
    #[inline]
    pub(super) fn has(&self, exit: &Exit, distance: f64) -> bool {
        if self.is_empty() {
            return false;
        }
        let own = (PortalId(exit.portal), CellId(exit.to));
        let is_far = distance - f64::from(exit.radius) > f64::from(self.beyond);
        (is_far && self.passed.binary_search(&own).is_err())
            || self.chosen.binary_search(&own).is_ok()
    }
}
