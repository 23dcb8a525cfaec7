//! A builder's proposal: rooms and possible portals. [`realize`](crate::realize) makes it exact.

use std::collections::{BTreeMap, BTreeSet};

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
    /// Regions that nobody walks into: one space wherever they open to each other.
    pub(crate) low: BTreeSet<u32>,
    /// How votes become cells.
    pub(crate) label: LabelSettings,
    /// Joins regions that no plane separates: see [`crate::join::join_unparted`].
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
            low: BTreeSet::new(),
            label: LabelSettings::default(),
            joins_unparted: true,
            counts: Vec::new(),
            notes: Vec::new(),
            settings: BTreeMap::new(),
            resolution: Resolution::Planes,
        }
    }
}
