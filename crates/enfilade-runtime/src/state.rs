//! What changes while a program runs: portals open, close and narrow; cells are locked.

use enfilade_cpg::{CellId, PortalId};

use crate::sight::{Sight, point};

/// Half-spaces that narrow one portal, at most.
const MAX_CUTS: usize = 4;

/// Which portals are open, how far, and which cells may be entered; by default all, fully.
///
/// Shared by all viewers of a world. Setting costs nanoseconds and takes effect with the next
/// question. What is asked for of a portal or cell that does not exist is ignored.
#[derive(Clone, Debug)]
pub struct SightState {
    portals: Vec<Opening>,
    is_locked: Vec<bool>,
}

#[derive(Clone, Copy, Debug)]
struct Opening {
    is_closed: bool,
    n_cuts: u8,
    /// Open where `n · p + d >= 0`.
    cuts: [[f32; 4]; MAX_CUTS],
}

const OPEN: Opening = Opening {
    is_closed: false,
    n_cuts: 0,
    cuts: [[0.0; 4]; MAX_CUTS],
};

impl SightState {
    /// Everything open.
    #[must_use]
    pub fn new(sight: &Sight) -> Self {
        Self {
            portals: vec![OPEN; sight.n_portals()],
            is_locked: vec![false; sight.n_cells()],
        }
    }

    /// Of no world: everything open.
    pub(crate) fn new_empty() -> Self {
        Self {
            portals: Vec::new(),
            is_locked: Vec::new(),
        }
    }

    /// Opens a portal fully.
    pub fn open(&mut self, portal: PortalId) {
        if let Some(p) = self.portals.get_mut(portal.0 as usize) {
            *p = OPEN;
        }
    }

    /// Closes a portal: nothing is seen through it.
    pub fn close(&mut self, portal: PortalId) {
        if let Some(p) = self.portals.get_mut(portal.0 as usize) {
            p.is_closed = true;
        }
    }

    /// Opens a portal on one side of a plane only, as a sliding door or a rising shutter does:
    /// where `normal · p >= normal · through`. Several planes add up, at most four; further ones, and
    /// planes without a direction, narrow nothing. [`SightState::open`] starts anew.
    pub fn narrow(&mut self, portal: PortalId, normal: [f32; 3], through: [f32; 3]) {
        let Some(p) = self.portals.get_mut(portal.0 as usize) else {
            return;
        };
        let n = point(normal).normalize_or_zero();
        let d = -n.dot(point(through));
        if !d.is_finite() || n.length_squared() < 0.5 || usize::from(p.n_cuts) == MAX_CUTS {
            return;
        }
        p.cuts[usize::from(p.n_cuts)] = n.extend(d).as_vec4().to_array();
        p.n_cuts += 1;
    }

    /// Locks a cell: it is never entered, though an eye may be in it. For what is not loaded, or not
    /// to be seen by this one.
    pub fn lock(&mut self, cell: CellId, locked: bool) {
        if let Some(c) = self.is_locked.get_mut(cell.0 as usize) {
            *c = locked;
        }
    }

    /// Whether a portal lets anything through.
    #[must_use]
    pub fn is_open(&self, portal: PortalId) -> bool {
        self.portals
            .get(portal.0 as usize)
            .is_none_or(|p| !p.is_closed)
    }

    /// Whether a cell is locked.
    #[must_use]
    pub fn is_locked(&self, cell: CellId) -> bool {
        self.is_locked
            .get(cell.0 as usize)
            .copied()
            .unwrap_or_default()
    }

    #[inline]
    pub(crate) fn lets_through(&self, portal: u32, to: u32) -> bool {
        self.is_open(PortalId(portal)) && !self.is_locked(CellId(to))
    }

    #[inline]
    pub(crate) fn cuts(&self, portal: u32) -> &[[f32; 4]] {
        self.portals
            .get(portal as usize)
            .map_or(&[], |p| &p.cuts[..usize::from(p.n_cuts)])
    }
}
