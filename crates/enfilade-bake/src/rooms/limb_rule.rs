//! The rule for limbs: corridors of buildings, and streets of land.

use crate::MergeSettings;

/// A limb opens to areas at least this many times as thick: its section is at most half of theirs.
pub(crate) const THICKER: f64 = 2.0;

/// Rule for limbs, and the settings of merging.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LimbSettings<'a> {
    pub(crate) merge: &'a MergeSettings,
    pub(crate) rule: LimbRule,
}

/// Rule for limbs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LimbRule {
    /// A limb opens to areas at least this many times as thick.
    pub(crate) thicker: f64,
    /// Limbs form a net: they may begin and end in the same area, and for wider ones the mouths of narrower ones are walls.
    pub(crate) is_net: bool,
}

impl LimbRule {
    /// The rule for buildings.
    pub(crate) const ROOMS: Self = Self {
        thicker: THICKER,
        is_net: false,
    };
}

/// Returns the depth to which a disc, so many times as thick as a limb, reaches into it. [Units: vx]
pub(super) fn sagitta(thicker: f64, half_width: f64) -> f64 {
    (thicker - (thicker * thicker - 1.0).sqrt()) * half_width
}
