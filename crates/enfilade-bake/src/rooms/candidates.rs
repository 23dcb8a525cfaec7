//! Fits a candidate portal to each opening between two regions.

use std::collections::BTreeMap;

use enfilade_cpg::{Fact, Reason, Why};
use enfilade_geom::{Allowance, Bvh, DVec3, Triangle};
use rayon::prelude::*;

use super::flooded::Flooded;
use super::fronts::{
    Faces, Front, WORK_A_FACE as PATCH_WORK_A_FACE, connected_patches, face_center, front_of,
    is_in, without_corners,
};
use super::lids::Lids;
use super::limbs::LONG;
use super::regions::{Regions, balls_of};
use super::sections::whole_section_of;
use crate::MergeSettings;
use crate::budget::WORK_A_LOOK;
use crate::judge::{OpeningFacts, why_parted, why_unjoined};
use crate::structure::{Candidate, OUTDOORS, fit_candidate};
use crate::voxel::{Grid, Labels, SparseVolume};

/// Smaller openings, in voxel faces, are left to the complex, which finds them as cracks.
const MIN_FACES: usize = 4;

/// Cost of each face of an opening to which a candidate is fitted, in units of [`Allowance`].
const WORK_A_FACE: u64 = 5;

/// The regions of a flooded volume and what stands between them.
pub(super) struct Openings<'a> {
    pub(super) grid: &'a Grid,
    pub(super) labels: &'a Labels,
    /// Radius of the largest ball in each basin. [Units: vx]
    pub(super) peaks: &'a [f32],
    /// Voxels that stop a flood besides those of surfaces.
    pub(super) shut: &'a SparseVolume,
    pub(super) allowance: &'a Allowance,
    pub(super) regions: &'a Regions,
    /// Voxels that door leaves and panes fill.
    pub(super) closures: &'a SparseVolume,
    pub(super) lids: &'a Lids,
    pub(super) walls: &'a [Triangle],
    /// Slits narrower than this count as closed. [Units: wu]
    pub(super) hole: f64,
    pub(super) settings: &'a MergeSettings,
}

impl Openings<'_> {
    /// Fits a candidate to each opening, and judges it. A front with at least the share `closed_share` of leaves and panes is a pane, and
    /// is split where it bends.
    pub(super) fn candidates(&self) -> Vec<Candidate> {
        let bvh = Bvh::build(self.walls);
        let facts = RegionFacts::of(self);
        let contacts = self.regions.contacts.iter();
        let openings: Vec<([u32; 2], Faces)> = contacts
            .flat_map(|(&(a, b), faces)| {
                let patches = self.patches(faces).into_iter();
                patches.map(move |patch| ([a, b], patch))
            })
            .collect();
        let openings = openings.into_par_iter();
        openings
            .filter_map(|(pair, faces)| self.candidate(pair, faces, &bvh, &facts))
            .collect()
    }

    fn flooded(&self) -> Flooded<'_> {
        Flooded {
            grid: self.grid,
            labels: self.labels,
            peaks: self.peaks,
            closures: Some(self.shut),
            slabs: &[],
            allowance: self.allowance,
        }
    }

    fn patches(&self, faces: &[u64]) -> Vec<Faces> {
        let Self {
            grid, allowance, ..
        } = *self;
        if !allowance.spend(PATCH_WORK_A_FACE * faces.len() as u64) {
            return Vec::new();
        }
        let is_shut = |faces: &[u64]| {
            let is_closed = |f: &&u64| is_in(grid, self.closures, **f);
            let n = faces.iter().filter(is_closed).count();
            n as f64 >= self.settings.closed_share * faces.len() as f64
        };
        let whole = connected_patches(grid, faces).into_iter();
        let parts = whole.flat_map(|patch| {
            if is_shut(&patch) {
                without_corners(grid, patch)
            } else {
                vec![patch]
            }
        });
        parts.filter(|patch| patch.len() >= MIN_FACES).collect()
    }

    fn candidate(
        &self,
        pair: [u32; 2],
        faces: Faces,
        bvh: &Bvh,
        facts: &RegionFacts,
    ) -> Option<Candidate> {
        let Self {
            grid,
            labels,
            allowance,
            ..
        } = *self;
        // Measured: a picture of the opening, many times finer than its faces.
        if !allowance.spend(10 * WORK_A_LOOK + WORK_A_FACE * faces.len() as u64) {
            return None;
        }
        if let Some(lid) = self.lids.candidate_of(grid, &faces) {
            return Some(lid);
        }
        let region_of = |label: u32| self.regions.region_of_basin[label as usize];
        let is_lesser = |at| region_of(labels.at(at)) == pair[0];
        let front = front_of(grid, faces, &is_lesser, Some(self.closures));
        let centers: Vec<DVec3> = front.faces.iter().map(|&f| face_center(grid, f)).collect();
        let opening = &front.opening;
        let winding = fit_candidate(
            &centers, grid.voxel, opening, self.walls, bvh, self.hole, allowance,
        );
        Some(Candidate {
            winding,
            closed: opening.closed,
            why: self.why(pair, &front, facts),
        })
    }

    /// Returns why two regions are apart at an opening.
    fn why(&self, pair: [u32; 2], front: &Front, facts: &RegionFacts) -> Why {
        let region_of = |label: u32| self.regions.region_of_basin[label as usize];
        let of_opening = OpeningFacts {
            is_between_storeys: false,
            closed: front.opening.closed,
            is_to_outdoors: pair[0] == OUTDOORS,
            balls: facts.balls(pair),
        };
        let section = whole_section_of(self.flooded(), self.settings, front, pair, &region_of);
        let area = (Fact::Area, front.opening.area);
        if let Some(why) = why_parted(self.settings, of_opening, section) {
            return why.with(&[area]);
        }
        // A rule of another kind parts them.
        let limb = pair.into_iter().find_map(|region| facts.limbs.get(&region));
        match limb {
            Some(Some(length)) => {
                Why::compared(Reason::Mouth, LONG, &[(Fact::Length, *length), area])
            }
            Some(None) => Why::given(Reason::Mouth).with(&[area]),
            None => why_unjoined(self.settings, of_opening, section).with(&[area]),
        }
    }
}

/// Facts of regions, as they are in the end.
struct RegionFacts {
    /// Radius of the largest ball in each region. [Units: vx]
    peaks: BTreeMap<u32, f32>,
    saddles: BTreeMap<(u32, u32), f32>,
    limbs: BTreeMap<u32, Option<f64>>,
}

impl RegionFacts {
    fn of(openings: &Openings<'_>) -> Self {
        let Regions {
            region_of_basin,
            saddles,
            limbs,
            ..
        } = openings.regions;
        let region = |basin: u32| region_of_basin[basin as usize];
        let mut facts = Self {
            peaks: BTreeMap::new(),
            saddles: BTreeMap::new(),
            limbs: limbs
                .iter()
                .map(|(&basin, &l)| (region(basin), l))
                .collect(),
        };
        for (&r, &peak) in region_of_basin.iter().zip(openings.peaks) {
            let of = facts.peaks.entry(r).or_insert(0.0);
            *of = of.max(peak);
        }
        for (&(a, b), &saddle) in saddles {
            let (a, b) = (region(a), region(b));
            let of = facts.saddles.entry((a.min(b), a.max(b))).or_insert(0.0);
            *of = of.max(saddle);
        }
        facts
    }

    fn balls(&self, [a, b]: [u32; 2]) -> f64 {
        let peak = |r: u32| self.peaks.get(&r).copied().unwrap_or(f32::INFINITY);
        let of_a = if a == OUTDOORS {
            f32::INFINITY
        } else {
            peak(a)
        };
        balls_of(&self.saddles, (a, b), of_a.min(peak(b)))
    }
}
