//! Textures that were made ahead, compressed in host memory.

use std::collections::BTreeMap;

use enfilade_cpg::CellId;

use super::conditions::TextureConditions;
use super::file::PtxEntry;
use super::viewpoints::{DoorwayId, TextureKey};
use crate::lamps::LampLight;
use crate::scene::GpuWorld;

/// Greatest difference of an eye's height from that of textures made ahead at which they are used as if it were there: walkers
/// differ in size, and floors are uneven. [Units: mm]
pub(crate) const ANCHOR_REACH: i32 = 100;

/// Returns a length in millimeters. [Units: mm]
pub(crate) fn millimeters(length: f64) -> i32 {
    (length * 1e3).round() as i32
}

/// Textures made ahead, and which of them are true in the frame.
pub(crate) struct AheadTextures {
    /// Conditions at the making.
    conditions: TextureConditions,
    /// Lamps at the making.
    pub(crate) lamps: Vec<LampLight>,
    /// Cells lit by lamps that differ from those; `None` if all may look different.
    pub(crate) relit: Option<Vec<CellId>>,
    entries: BTreeMap<TextureKey, PtxEntry>,
    /// Heights of the viewpoints of each doorway. [Units: mm]
    anchors: BTreeMap<DoorwayId, Vec<i32>>,
    /// Conditions of the last frame.
    followed: Option<TextureConditions>,
    /// Cells at doors that differ from those at the making; `None` if everything looks different.
    changed: Option<Vec<CellId>>,
}

impl AheadTextures {
    pub(crate) fn new(
        conditions: TextureConditions,
        lamps: Vec<LampLight>,
        entries: Vec<PtxEntry>,
    ) -> Self {
        let mut anchors: BTreeMap<DoorwayId, Vec<i32>> = BTreeMap::new();
        for entry in &entries {
            let of = anchors.entry(entry.id).or_default();
            if !of.contains(&entry.index[4]) {
                of.push(entry.index[4]);
            }
        }
        let keyed = entries.into_iter().map(|e| ((e.id, Some(e.index)), e));
        Self {
            conditions,
            lamps,
            relit: Some(Vec::new()),
            entries: keyed.collect(),
            anchors,
            followed: None,
            changed: None,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Finds out which textures are true in a frame.
    pub(crate) fn follow(&mut self, world: &GpuWorld, now: &TextureConditions) {
        if self.followed.as_ref() != Some(now) {
            self.changed = self.conditions.changed_cells(world, now);
            self.followed = Some(now.clone());
        }
    }

    /// Returns a texture if there is one that is true.
    pub(crate) fn find(&self, key: TextureKey) -> Option<&PtxEntry> {
        let (changed, relit) = (self.changed.as_ref()?, self.relit.as_ref()?);
        let entry = self.entries.get(&key)?;
        let mut all = changed.iter().chain(relit);
        let is_true = !all.any(|c| entry.cells.binary_search(c).is_ok());
        is_true.then_some(entry)
    }

    /// Forgets a texture that turned out to be damaged.
    pub(crate) fn forget(&mut self, key: TextureKey) {
        self.entries.remove(&key);
    }

    /// Returns the height of a doorway's textures that is nearest to an eye's, if it is near. [Units: mm]
    pub(crate) fn anchor(&self, id: DoorwayId, height: i32) -> Option<i32> {
        self.changed.as_ref().and(self.relit.as_ref())?;
        let off = |anchor: &i32| anchor.abs_diff(height);
        let all = self.anchors.get(&id)?.iter().copied();
        let nearest = all.min_by_key(|a| off(a))?;
        (off(&nearest) <= ANCHOR_REACH.unsigned_abs()).then_some(nearest)
    }
}
