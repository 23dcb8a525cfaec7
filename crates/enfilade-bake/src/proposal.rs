//! A builder's proposal: rooms and possible portals. [`realize`](crate::realize) makes it exact.

use std::collections::BTreeMap;

use enfilade_geom::{Aabb, DVec3};

use crate::Resolution;
use crate::complex::{LabelSettings, Vote};
use crate::structure::Candidate;

/// Rooms and openings that a builder found, in scene coordinates.
pub(crate) struct Proposal {
    /// The box to divide into cells.
    pub(crate) bounds: Aabb,
    /// Candidate portals.
    pub(crate) candidates: Vec<Candidate>,
    /// Points known to lie in a region.
    pub(crate) votes: Vec<Vote>,
    /// Points in shallow voids, each with its region, although no opening connects the two.
    pub(crate) voids: Vec<(DVec3, u32)>,
    /// How votes become cells.
    pub(crate) label: LabelSettings,
    /// Joins regions that no plane separates, and voids that open to each other: see [`crate::join`].
    pub(crate) joins_unparted: bool,
    /// Numbers for the statistics of the file.
    pub(crate) counts: Vec<(&'static str, f64)>,
    /// Assumptions and doubtful decisions, one sentence each.
    pub(crate) notes: Vec<String>,
    /// The settings used, for the provenance of the file.
    pub(crate) settings: BTreeMap<String, String>,
    pub(crate) resolution: Resolution,
}

impl Proposal {
    /// Makes a proposal without candidates.
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
