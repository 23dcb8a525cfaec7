//! What changes while a program runs: portals open, close and narrow; cells are locked.

use enfilade_cpg::{CellId, PortalId};

use enfilade_geom::DVec3;

use crate::point::point;
use crate::sight::Sight;

/// Half-spaces that narrow one portal, at most.
const MAX_CUTS: usize = 4;

/// Which portals are open, how far, and which cells may be entered; by default all, fully.
///
/// Shared by all viewers of a world. Setting costs nanoseconds and takes effect with the next
/// question. What is asked for of a portal or cell that does not exist is ignored.
#[derive(Clone, Debug)]
pub struct SightState {
    /// A byte a portal, apart from the planes, so that a view of a large world touches few cache lines: how many
    /// planes narrow it, or [`CLOSED`] more.
    portals: Vec<u8>,
    /// Open where `n · p + d >= 0`.
    cuts: Vec<[[f32; 4]; MAX_CUTS]>,
    is_locked: Vec<bool>,
}

/// Marks a portal that lets nothing through.
const CLOSED: u8 = 0x80;

impl SightState {
    /// Everything open.
    #[must_use]
    pub fn new(sight: &Sight) -> Self {
        Self {
            portals: vec![0; sight.n_portals()],
            cuts: vec![[[0.0; 4]; MAX_CUTS]; sight.n_portals()],
            is_locked: vec![false; sight.n_cells()],
        }
    }

    /// Of no world: everything open.
    pub(crate) fn new_empty() -> Self {
        Self {
            portals: Vec::new(),
            cuts: Vec::new(),
            is_locked: Vec::new(),
        }
    }

    /// Opens a portal fully.
    pub fn open(&mut self, portal: PortalId) {
        if let Some(p) = self.portals.get_mut(portal.0 as usize) {
            *p = 0;
        }
    }

    /// Closes a portal: nothing is seen through it.
    pub fn close(&mut self, portal: PortalId) {
        if let Some(p) = self.portals.get_mut(portal.0 as usize) {
            *p |= CLOSED;
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
        let n_cuts = usize::from(*p & !CLOSED);
        if !d.is_finite() || n.length_squared() < 0.5 || n_cuts == MAX_CUTS {
            return;
        }
        self.cuts[portal.0 as usize][n_cuts] = n.extend(d).as_vec4().to_array();
        *p += 1;
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
            .is_none_or(|p| p & CLOSED == 0)
    }

    /// Whether a cell is locked.
    #[must_use]
    pub fn is_locked(&self, cell: CellId) -> bool {
        self.is_locked
            .get(cell.0 as usize)
            .copied()
            .unwrap_or_default()
    }

    /// Whether nothing passes a portal at a point of its opening: it is closed, or a plane that narrows it leaves the
    /// point out. O(1). [Units: wu]
    #[must_use]
    pub(crate) fn is_shut_at(&self, portal: PortalId, p: DVec3) -> bool {
        let is_out = |cut: &[f32; 4]| {
            let [x, y, z, d] = cut.map(f64::from);
            DVec3::new(x, y, z).dot(p) + d < 0.0
        };
        !self.is_open(portal) || self.cuts(portal.0).iter().any(is_out)
    }

    #[inline]
    pub(crate) fn lets_through(&self, portal: u32, to: u32) -> bool {
        self.is_open(PortalId(portal)) && !self.is_locked(CellId(to))
    }

    #[inline]
    pub(crate) fn cuts(&self, portal: u32) -> &[[f32; 4]] {
        match self.portals.get(portal as usize).map(|p| p & !CLOSED) {
            None | Some(0) => &[],
            Some(n_cuts) => &self.cuts[portal as usize][..usize::from(n_cuts)],
        }
    }
}
