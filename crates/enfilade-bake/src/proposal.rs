//! What a builder proposes: where rooms are and where portals may be. [`realize`](crate::realize) makes it exact.

use std::collections::BTreeMap;

use enfilade_geom::{Aabb, DVec3};

use crate::Resolution;
use crate::complex::{LabelSettings, Vote};
use crate::structure::Candidate;

/// Rooms and openings as a builder found them, where the scene has them.
pub(crate) struct Proposal {
    /// What is to be parted into cells.
    pub(crate) bounds: Aabb,
    /// Candidate portals.
    pub(crate) candidates: Vec<Candidate>,
    /// Points that are known to be in a region.
    pub(crate) votes: Vec<Vote>,
    /// Points in shallow voids, each with the region that it belongs to though no opening joins them.
    pub(crate) voids: Vec<(DVec3, u32)>,
    /// How votes become cells.
    pub(crate) label: LabelSettings,
    /// Whether regions that no plane parts are joined: see [`crate::join::join_unparted`].
    pub(crate) joins_unparted: bool,
    /// Numbers for the statistics of the file.
    pub(crate) counts: Vec<(&'static str, f64)>,
    /// What was assumed or decided in doubt, one sentence each.
    pub(crate) notes: Vec<String>,
    /// The settings that it went by, for the provenance of the file.
    pub(crate) settings: BTreeMap<String, String>,
    pub(crate) resolution: Resolution,
}

impl Proposal {
    /// One without candidates.
    pub(crate) fn new(bounds: Aabb, votes: Vec<Vote>) -> Self {
        Self {
            bounds,
            candidates: Vec::new(),
            votes,
            voids: Vec::new(),
            label: LabelSettings::default(),
            joins_unparted: true,
            counts: Vec::new(),
            notes: Vec::new(),
            settings: BTreeMap::new(),
            resolution: Resolution::Planes,
        }
    }
}
