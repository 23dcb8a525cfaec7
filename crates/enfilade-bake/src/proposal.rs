//! A builder's proposal: rooms and possible portals. [`realize`](crate::realize) makes it exact.

use std::collections::BTreeMap;
use std::ops::Range;

use enfilade_cpg::Why;
use enfilade_geom::{Aabb, DVec3};

use crate::Resolution;
use crate::complex::{Label, LabelSettings, Vote};
use crate::structure::{Candidate, OUTDOORS};

/// A decision about a place that is not a cell, in scene coordinates.
#[derive(Clone, Debug)]
pub(crate) struct FoundPlace {
    /// [Units: wu]
    pub(crate) at: DVec3,
    pub(crate) why: Why,
}

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
    /// Close decisions about places that are not cells.
    pub(crate) places: Vec<FoundPlace>,
    /// Decisions about regions, ascending by region.
    pub(crate) whys: Vec<(u32, Why)>,
    /// Regions that are open land: parts of the outdoors.
    pub(crate) land: Range<u32>,
    /// How votes become cells.
    pub(crate) label: LabelSettings,
    /// Joins regions that no plane separates, and voids that open to each other: see [`crate::join`].
    pub(crate) joins_unparted: bool,
    /// Volume of the regions in which tubes meet, and of all. [Units: wu³]
    pub(crate) tubes: [f64; 2],
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
            places: Vec::new(),
            whys: Vec::new(),
            land: 0..0,
            label: LabelSettings::default(),
            joins_unparted: true,
            tubes: [0.0; 2],
            counts: Vec::new(),
            notes: Vec::new(),
            settings: BTreeMap::new(),
            resolution: Resolution::Planes,
        }
    }

    /// Returns the greatest region with a vote or a void, at least the outdoors.
    pub(crate) fn n_regions(&self) -> u32 {
        let region = |label: &Label| label.region().unwrap_or(OUTDOORS);
        let votes = self.votes.iter().map(|v| region(&v.label));
        let last = votes.chain(self.voids.iter().map(|v| v.1)).max();
        last.unwrap_or(OUTDOORS)
    }

    /// Returns `true` if most of the air is in tubes that meet: of an airway, a vessel or a burrow. There, a low place is a
    /// branch like another.
    pub(crate) fn is_tree(&self) -> bool {
        2.0 * self.tubes[0] > self.tubes[1]
    }

    /// Adds the proposal for another part of the scene that nothing but the outdoors connects with this one.
    pub(crate) fn beside(mut self, mut other: Self) -> Self {
        let after = self.n_regions();
        let moved = |region: u32| match region {
            0 | OUTDOORS => region,
            _ => after + region - OUTDOORS,
        };
        for vote in &mut other.votes {
            vote.label = match vote.label {
                Label::Region(region) => Label::Region(moved(region)),
                Label::Void(region) => Label::Void(moved(region)),
                label @ (Label::Beyond | Label::Solid) => label,
            };
        }
        other.voids.iter_mut().for_each(|v| v.1 = moved(v.1));
        other.whys.iter_mut().for_each(|w| w.0 = moved(w.0));
        self.whys.append(&mut other.whys);
        self.places.append(&mut other.places);
        self.bounds = self.bounds.union(other.bounds);
        self.candidates.append(&mut other.candidates);
        self.votes.append(&mut other.votes);
        self.voids.append(&mut other.voids);
        self.tubes = [0, 1].map(|i| self.tubes[i] + other.tubes[i]);
        for ((name, count), (_, more)) in self.counts.iter_mut().zip(other.counts) {
            match *name {
                "grid_turn_degrees" => {}
                "voxel_size" => *count = count.max(more),
                _ => *count += more,
            }
        }
        other.notes.retain(|note| !self.notes.contains(note));
        self.notes.append(&mut other.notes);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proposal(regions: &[u32]) -> Proposal {
        let vote = |&region: &u32| Vote {
            point: DVec3::splat(f64::from(region)),
            label: Label::Region(region),
            weight: 1.0,
        };
        let voids = vec![(DVec3::ZERO, *regions.last().unwrap())];
        let counts = vec![("voxels", 10.0), ("voxel_size", 0.1)];
        Proposal {
            voids,
            counts,
            notes: vec!["one".to_owned()],
            ..Proposal::new(Aabb::EMPTY, regions.iter().map(vote).collect())
        }
    }

    #[test]
    fn regions_of_two_parts_keep_apart_and_both_have_the_same_outdoors() {
        let both = proposal(&[1, 2, 5]).beside(proposal(&[1, 3, 2]));
        let regions: Vec<_> = both.votes.iter().filter_map(|v| v.label.region()).collect();
        assert_eq!(regions, [1, 2, 5, 1, 7, 6]);
        assert_eq!([both.voids[0].1, both.voids[1].1], [5, 6]);
        assert_eq!(both.counts, [("voxels", 20.0), ("voxel_size", 0.1)]);
        assert_eq!(both.notes.len(), 1);
    }
}
