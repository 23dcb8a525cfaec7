//! What changes while a program runs: portals open, close and narrow, leaves of doors move; cells are locked.

use std::sync::Arc;

use enfilade_cpg::{CellId, PortalId};

use enfilade_geom::{DMat4, DVec3};

use crate::doors::{Doors, Leaf};
use crate::point::point;
use crate::seen::DetailId;
use crate::sight::Sight;

/// Half-spaces that narrow one portal, at most.
const MAX_CUTS: usize = 4;

/// Which portals are open, how far, how the leaves of doors stand, and which cells may be entered; by default all are open,
/// and leaves stand as the model has them.
///
/// A door whose leaves are [shut](SightState::set_leaves) lets no sight through, unless one sees through a leaf. As the
/// model has it, a door lets sight through however its leaves stand: a model's doors are mostly shut, and a game's are not.
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
    doors: Arc<Doors>,
    /// By moving leaf: the share of its way from shut (0) to open (1); `None` as in the model.
    shares: Vec<Option<f32>>,
}

/// Marks a portal that lets nothing through.
const CLOSED: u8 = 0x80;
/// Marks a portal that shut leaves let nothing through.
const SHUT: u8 = 0x40;
const N_CUTS: u8 = !(CLOSED | SHUT);

impl SightState {
    /// Everything open, leaves as the model has them.
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

    /// Of no world: everything open.
    pub(crate) fn new_empty() -> Self {
        Self {
            portals: Vec::new(),
            cuts: Vec::new(),
            is_locked: Vec::new(),
            doors: Arc::default(),
            shares: Vec::new(),
        }
    }

    /// Opens a portal fully; its leaves stand fully open.
    pub fn open(&mut self, portal: PortalId) {
        if let Some(p) = self.portals.get_mut(portal.0 as usize) {
            *p = 0;
        }
        self.set_leaves(portal, 1.0);
    }

    /// Closes a portal, and shuts its leaves: nothing is seen through it, not even through leaves of glass.
    pub fn close(&mut self, portal: PortalId) {
        self.set_leaves(portal, 0.0);
        if let Some(p) = self.portals.get_mut(portal.0 as usize) {
            *p |= CLOSED;
        }
    }

    /// Moves the leaves of a portal to a share of their way from shut (0) to fully open (1), clamped to these. Once all are
    /// shut, nothing is seen through it, unless one sees through a leaf (`World::is_see_through`). A portal without
    /// [leaves](Sight::leaves) stays as it is, and so does one that was [closed](SightState::close), until it is
    /// [opened](SightState::open). Leaves that shut several portals move for all of them.
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
                let own = doors.slots(PortalId(p));
                let is_shut = own.iter().all(|&s| self.shares[s as usize] == Some(0.0));
                let flags = &mut self.portals[p as usize];
                *flags = if is_shut && !doors.is_clear(p) {
                    *flags | SHUT
                } else {
                    *flags & !SHUT
                };
            }
        }
    }

    /// How the leaves of a portal stand, on their way from shut (0) to fully open (1): as [set](SightState::set_leaves), or
    /// as the model has them; the first of several. `None` for a portal without leaves.
    #[must_use]
    pub fn leaves(&self, portal: PortalId) -> Option<f32> {
        let &slot = self.doors.slots(portal).first()?;
        let as_modeled = || self.doors.moving(slot).motion.share_of_model();
        Some(self.shares[slot as usize].unwrap_or_else(as_modeled))
    }

    /// The leaves that were moved, in ascending order, each with the transform that takes it from where the model has it to
    /// where it stands, in world space: to be applied after the object's own transform.
    pub fn moved(&self) -> impl Iterator<Item = (DetailId, DMat4)> {
        let shares = (0..).zip(&self.shares);
        shares.filter_map(|(slot, share)| {
            let Leaf { detail, motion } = self.doors.moving(slot);
            Some((*detail, motion.at((*share)?)))
        })
    }

    /// That transform of one object; `None` for one that was not moved. O(log leaves).
    #[must_use]
    pub fn pose(&self, detail: DetailId) -> Option<DMat4> {
        let slot = self.doors.slot(detail)?;
        let share = (*self.shares.get(slot as usize)?)?;
        Some(self.doors.moving(slot).motion.at(share))
    }

    /// How each leaf stands, in ascending order of objects: what [`SightState::moved`] depends on, to be compared.
    #[must_use]
    pub fn shares(&self) -> &[Option<f32>] {
        &self.shares
    }

    /// Portals that let nothing through, in ascending order.
    pub fn shut_portals(&self) -> impl Iterator<Item = PortalId> {
        let portals = (0..).zip(&self.portals);
        let shut = portals.filter(|(_, flags)| **flags & (CLOSED | SHUT) != 0);
        shut.map(|(p, _)| PortalId(p))
    }

    /// Whether an object is a leaf of a portal.
    pub(crate) fn is_leaf_of(&self, detail: DetailId, portal: PortalId) -> bool {
        let leaves = self.doors.leaves(portal);
        leaves.iter().any(|l| l.detail == detail)
    }

    /// Where in a portal its shut leaves are. [Units: wu]
    pub(crate) fn depth(&self, portal: u32) -> f64 {
        self.doors.depth(PortalId(portal)).into()
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
        let n_cuts = usize::from(*p & N_CUTS);
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
            .is_none_or(|p| p & (CLOSED | SHUT) == 0)
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
        match self.portals.get(portal as usize).map(|p| p & N_CUTS) {
            None | Some(0) => &[],
            Some(n_cuts) => &self.cuts[portal as usize][..usize::from(n_cuts)],
        }
    }
}
