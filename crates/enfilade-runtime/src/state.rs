//! Run-time state: open, closed and narrowed portals, poses of door leaves, locked cells.

use std::sync::Arc;

use enfilade_cpg::{CellId, PortalId};

use enfilade_geom::{DMat4, DVec3};

use crate::doors::{Doors, Leaf};
use crate::point::point;
use crate::seen::DetailId;
use crate::sight::Sight;

/// Maximum number of half-spaces that narrow one portal.
const MAX_CUTS: usize = 4;

/// State of portals, door leaves and cells. By default all portals are open, no cell is locked, and leaves stand as in the
/// model.
///
/// A door whose leaves are [shut](SightState::set_leaves) blocks sight, unless one sees through a leaf. In the model's pose,
/// a door lets sight through however its leaves stand: doors are mostly shut in models, and open in games.
///
/// Shared by all viewers of a world. Setters take nanoseconds and take effect with the next query. They ignore portals and
/// cells that do not exist.
#[derive(Clone, Debug)]
pub struct SightState {
    /// One byte per portal, apart from the planes, so that a view of a large world touches few cache lines: the number of
    /// planes that narrow it, plus the flags [`CLOSED`] and [`SHUT`].
    portals: Vec<u8>,
    /// Open where `n · p + d >= 0`.
    cuts: Vec<[[f32; 4]; MAX_CUTS]>,
    is_locked: Vec<bool>,
    doors: Arc<Doors>,
    /// Per moving leaf: its position from shut (0) to open (1); `None` as in the model.
    shares: Vec<Option<f32>>,
}

/// State of the doors of a world as plain values, to be saved with any format of `serde`.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SavedDoors {
    /// Position of each leaf that moves, as [`SightState::shares`].
    pub shares: Vec<Option<f32>>,
    /// Closed portals, ascending.
    pub closed: Vec<u32>,
    /// Narrowed portals, ascending, each with its planes: open where `n · p + d >= 0`.
    pub narrowed: Vec<(u32, Vec<[f32; 4]>)>,
    /// Locked cells, ascending.
    pub locked: Vec<u32>,
}

/// Reason why saved doors do not fit a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "these are the doors of another world: {saved} moving leaves, where this one has {own}, or portals or cells that it has not"
)]
#[non_exhaustive]
pub struct SavedDoorsError {
    /// Leaves in the saved state.
    pub saved: usize,
    /// Leaves of the world.
    pub own: usize,
}

/// Flag of a closed portal.
const CLOSED: u8 = 0x80;
/// Flag of a portal blocked by its shut leaves.
const SHUT: u8 = 0x40;
const N_CUTS: u8 = !(CLOSED | SHUT);

impl SightState {
    /// Makes a state with everything open and leaves as in the model.
    #[must_use]
    pub fn new(sight: &Sight) -> Self {
        Self {
            portals: vec![0; sight.n_portals()],
            cuts: vec![[[0.0; 4]; MAX_CUTS]; sight.n_portals()],
            is_locked: vec![false; sight.n_cells()],
            doors: Arc::clone(&sight.doors),
            shares: vec![None; sight.doors.n_moving()],
        }
    }

    /// Makes a state in which doors hide what is behind them if they are shut in the model.
    #[must_use]
    pub fn as_modeled(sight: &Sight) -> Self {
        let mut state = Self::new(sight);
        for portal in (0..sight.n_portals() as u32).map(PortalId) {
            if let Some(share) = state.leaves(portal) {
                state.set_leaves(portal, share);
            }
        }
        state
    }

    /// Makes a state of an empty world.
    pub(crate) fn new_empty() -> Self {
        Self {
            portals: Vec::new(),
            cuts: Vec::new(),
            is_locked: Vec::new(),
            doors: Arc::default(),
            shares: Vec::new(),
        }
    }

    /// Returns the state as plain values. O(portals).
    #[must_use]
    pub fn saved(&self) -> SavedDoors {
        let portals = || (0..).zip(&self.portals);
        let locked = (0..).zip(&self.is_locked).filter(|(_, is)| **is);
        SavedDoors {
            shares: self.shares.clone(),
            closed: (portals().filter(|(_, f)| **f & CLOSED != 0).map(|(p, _)| p)).collect(),
            narrowed: (portals().filter(|(_, f)| **f & N_CUTS != 0))
                .map(|(p, _)| (p, self.cuts(p).to_vec()))
                .collect(),
            locked: locked.map(|(c, _)| c).collect(),
        }
    }

    /// Restores a saved state. O(portals).
    ///
    /// # Errors
    ///
    /// If it is of another world; nothing changes then.
    pub fn restore(&mut self, saved: &SavedDoors) -> Result<(), SavedDoorsError> {
        let portals = saved
            .closed
            .iter()
            .chain(saved.narrowed.iter().map(|n| &n.0));
        let is_own = saved.shares.len() == self.shares.len()
            && portals.copied().all(|p| (p as usize) < self.portals.len())
            && saved.narrowed.iter().all(|n| n.1.len() <= MAX_CUTS)
            && saved
                .locked
                .iter()
                .all(|c| (*c as usize) < self.is_locked.len());
        if !is_own {
            return Err(SavedDoorsError {
                saved: saved.shares.len(),
                own: self.shares.len(),
            });
        }
        self.portals.fill(0);
        self.is_locked.fill(false);
        self.shares.clone_from(&saved.shares);
        for p in 0..self.portals.len() as u32 {
            self.update_shut(p);
        }
        for &p in &saved.closed {
            self.portals[p as usize] |= CLOSED;
        }
        for (p, planes) in &saved.narrowed {
            self.portals[*p as usize] |= planes.len() as u8;
            self.cuts[*p as usize][..planes.len()].copy_from_slice(planes);
        }
        for &c in &saved.locked {
            self.is_locked[c as usize] = true;
        }
        Ok(())
    }

    /// Updates the flag of a portal that its leaves may block.
    fn update_shut(&mut self, portal: u32) {
        let own = self.doors.slots(PortalId(portal));
        let is_shut = !own.is_empty() && own.iter().all(|&s| self.shares[s as usize] == Some(0.0));
        let flags = &mut self.portals[portal as usize];
        *flags = if is_shut && !self.doors.is_clear(portal) {
            *flags | SHUT
        } else {
            *flags & !SHUT
        };
    }

    /// Opens a portal fully, and its leaves.
    pub fn open(&mut self, portal: PortalId) {
        if let Some(p) = self.portals.get_mut(portal.0 as usize) {
            *p = 0;
        }
        self.set_leaves(portal, 1.0);
    }

    /// Closes a portal and shuts its leaves: nothing is seen through it, not even through leaves of glass.
    pub fn close(&mut self, portal: PortalId) {
        self.set_leaves(portal, 0.0);
        if let Some(p) = self.portals.get_mut(portal.0 as usize) {
            *p |= CLOSED;
        }
    }

    /// Moves the leaves of a portal to a position between shut (0) and fully open (1), clamped to that range. Once all are
    /// shut, the portal blocks sight, unless one sees through a leaf (`World::is_see_through`). Does not affect a portal
    /// without [leaves](Sight::leaves), or one that was [closed](SightState::close), until it is [opened](SightState::open).
    /// Leaves that shut several portals move for all of them.
    pub fn set_leaves(&mut self, portal: PortalId, share: f32) {
        if share.is_nan() {
            return;
        }
        let doors = Arc::clone(&self.doors);
        for &slot in doors.slots(portal) {
            self.shares[slot as usize] = Some(share.clamp(0.0, 1.0));
        }
        for &slot in doors.slots(portal) {
            for &p in doors.portals(slot) {
                self.update_shut(p);
            }
        }
    }

    /// Returns the position of a portal's leaves, from shut (0) to fully open (1), as [set](SightState::set_leaves) or as in
    /// the model; of the first, if there are several. `None` for a portal without leaves.
    #[must_use]
    pub fn leaves(&self, portal: PortalId) -> Option<f32> {
        let &slot = self.doors.slots(portal).first()?;
        let as_modeled = || self.doors.moving(slot).motion.share_of_model();
        Some(self.shares[slot as usize].unwrap_or_else(as_modeled))
    }

    /// Returns the moved leaves in ascending order, each with the transform from its pose in the model to its current pose, in
    /// world space: apply it after the object's own transform.
    pub fn moved(&self) -> impl Iterator<Item = (DetailId, DMat4)> {
        let shares = (0..).zip(&self.shares);
        shares.filter_map(|(slot, share)| {
            let Leaf { detail, motion } = self.doors.moving(slot);
            Some((*detail, motion.at((*share)?)))
        })
    }

    /// Returns the transform of one object, as in [`SightState::moved`]; `None` if it was not moved. O(log leaves).
    #[must_use]
    pub fn pose(&self, detail: DetailId) -> Option<DMat4> {
        let slot = self.doors.slot(detail)?;
        let share = (*self.shares.get(slot as usize)?)?;
        Some(self.doors.moving(slot).motion.at(share))
    }

    /// Returns the position of each leaf, in ascending order of objects. If equal, [`SightState::moved`] is equal.
    #[must_use]
    #[doc(hidden)]
    pub fn shares(&self) -> &[Option<f32>] {
        &self.shares
    }

    /// Returns the portals that let nothing through, in ascending order.
    #[doc(hidden)]
    pub fn shut_portals(&self) -> impl Iterator<Item = PortalId> {
        let portals = (0..).zip(&self.portals);
        let shut = portals.filter(|(_, flags)| **flags & (CLOSED | SHUT) != 0);
        shut.map(|(p, _)| PortalId(p))
    }

    /// Returns `true` if an object is a leaf of a portal.
    pub(crate) fn is_leaf_of(&self, detail: DetailId, portal: PortalId) -> bool {
        let leaves = self.doors.leaves(portal);
        leaves.iter().any(|l| l.detail == detail)
    }

    /// Returns the offset of a portal's shut leaves from its plane. [Units: wu]
    pub(crate) fn depth(&self, portal: u32) -> f64 {
        self.doors.depth(PortalId(portal)).into()
    }

    /// Narrows a portal to one side of a plane, `normal · p >= normal · through`, as a sliding door or a rising
    /// shutter does. At most four planes add up; further ones, and planes with a zero normal, have no effect.
    /// [`SightState::open`] removes them.
    pub fn narrow(&mut self, portal: PortalId, normal: [f32; 3], through: [f32; 3]) {
        let Some(p) = self.portals.get_mut(portal.0 as usize) else {
            return;
        };
        let n = point(normal).normalize_or_zero();
        let d = -n.dot(point(through));
        let n_cuts = usize::from(*p & N_CUTS);
        if !d.is_finite() || n.length_squared() < 0.5 || n_cuts == MAX_CUTS {
            return;
        }
        self.cuts[portal.0 as usize][n_cuts] = n.extend(d).as_vec4().to_array();
        *p += 1;
    }

    /// Locks or unlocks a cell. A locked cell is never entered, though an eye may be in it. For cells that are not
    /// loaded, or not to be seen by this viewer.
    pub fn lock(&mut self, cell: CellId, locked: bool) {
        if let Some(c) = self.is_locked.get_mut(cell.0 as usize) {
            *c = locked;
        }
    }

    /// Returns `true` if a portal lets anything through.
    #[must_use]
    pub fn is_open(&self, portal: PortalId) -> bool {
        self.portals
            .get(portal.0 as usize)
            .is_none_or(|p| p & (CLOSED | SHUT) == 0)
    }

    /// Returns `true` if a cell is locked.
    #[must_use]
    pub fn is_locked(&self, cell: CellId) -> bool {
        self.is_locked
            .get(cell.0 as usize)
            .copied()
            .unwrap_or_default()
    }

    /// Returns `true` if nothing passes a portal at the point `p` of its opening: it is closed, or a plane that narrows it
    /// excludes the point. O(1). [Units: wu]
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
        match self.portals.get(portal as usize).map(|p| p & N_CUTS) {
            None | Some(0) => &[],
            Some(n_cuts) => &self.cuts[portal as usize][..usize::from(n_cuts)],
        }
    }
}
