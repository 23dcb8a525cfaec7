//! From basins to rooms: merging across openings that are not a pinch cures over-segmentation.
//!
//! The flood (Haumont et al. 2003, §4.2) cuts a scene into far more basins than it has rooms (§6).
//! Two basins belong to one room if the opening between them is hardly narrower than the space on
//! either side of it. The measure is the smaller of two ratios, both scale-free:
//!
//! * *section ratio*: area of the opening ÷ the smaller of the two cells' largest cross-sections
//!   parallel to it, measured close to the opening (a room that is large elsewhere must neither turn
//!   its own alcove into another room, nor swallow its neighbors one by one);
//! * *radius ratio*: saddle radius ÷ the smaller of the two peak radii.
//!
//! Pairs are merged least pinched first, and weighed again as cells grow. No merge crosses an opening
//! that a door leaf or a pane fills, whatever its shape: this separates a closet as deep as its door is
//! wide from an alcove.
//!
//! The opening's area is the length of the *vector area* of the faces between the two cells. It
//! depends on the rim alone, not on bulges of the flood's front or on the building's rotation
//! in the grid.
//!
//! Cost: one evaluation visits a few tens of thousands of lattice points around an opening; the number of evaluations
//! grows with the basins, and so with the building. Errs towards too many cells.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{Fact, Why};
use enfilade_geom::DVec3;
use rayon::prelude::*;

use super::flooded::{Flooded, contact_faces};
use super::fronts::{Faces, Front, group_faces, is_in};
use super::sections::section_of;
use super::slabs::{LAYERS, sum};
use crate::MergeSettings;
use crate::budget::WORK_A_LOOK;
use crate::judge::{OpeningFacts, OpeningVerdict, judge};
use crate::structure::{Mergeable, OUTDOORS, Opening, Pair, join_rooms, lies_in_slab};
use crate::voxel::Labels;

/// Rooms as unions of basins.
#[derive(Clone, Debug)]
pub(crate) struct Regions {
    /// Room label of each basin label (index 0: solid). [`OUTDOORS`] stays itself.
    pub(crate) region_of_basin: Vec<u32>,
    /// Faces between each pair of regions (lower label first).
    pub(crate) contacts: BTreeMap<(u32, u32), Faces>,
    /// Greatest distance at which two regions touch, where the flood knows it. [Units: vx]
    pub(crate) saddles: BTreeMap<(u32, u32), f32>,
    /// Joins that were close, in order.
    pub(crate) joins: Vec<CloseJoin>,
    /// Corridors and arms of forks, each by a basin of it, with its length in widths if it is a corridor.
    pub(crate) limbs: BTreeMap<u32, Option<f64>>,
}

/// An opening that nearly parted two cells, each as large as a room.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CloseJoin {
    /// Middle of the opening. [Units: wu]
    pub(crate) at: DVec3,
    pub(crate) verdict: OpeningVerdict,
    /// Volume of the smaller of the two. [Units: wu³]
    pub(crate) volume: f64,
}

impl CloseJoin {
    /// Joins of a greater openness are not close: some way beyond what a model's noise changes.
    const MOST_OPEN: f64 = 1.3;
    /// Smaller cells are not rooms. [Units: wu³]
    pub(super) const LEAST_VOLUME: f64 = 3.0;

    /// Returns why there is one cell.
    pub(super) fn why(&self, settings: &MergeSettings) -> Why {
        let volume = (Fact::Volume, self.volume);
        self.verdict.why(settings, false).with(&[volume])
    }
}

impl Regions {
    /// Gives each region the name that `name` returns; regions of one name are one.
    pub(super) fn rename(&mut self, name: impl Fn(u32) -> u32) {
        for region in &mut self.region_of_basin {
            *region = name(*region);
        }
        for ((a, b), faces) in std::mem::take(&mut self.contacts) {
            let (a, b) = (name(a), name(b));
            if a != b {
                let of = self.contacts.entry((a.min(b), a.max(b))).or_default();
                of.extend(faces);
            }
        }
        self.contacts.values_mut().for_each(|f| f.sort_unstable());
    }
}

/// Merges the basins of `flooded` into rooms. `saddles` holds the saddle distance of each pair of
/// touching basins, lower label first. [Units: vx]
#[must_use]
pub(crate) fn merge_basins(
    flooded: Flooded<'_>,
    saddles: &BTreeMap<(u32, u32), f32>,
    settings: &MergeSettings,
) -> Regions {
    let n = flooded.peaks.len();
    let mut merger = BasinMerger {
        flooded,
        settings,
        cell: (0..n as u32).collect(),
        basins: (0..n as u32).map(|b| vec![b]).collect(),
        peak: flooded.peaks.to_vec(),
        version: vec![0; n],
        neighbors: vec![BTreeSet::new(); n],
        contacts: contact_faces(flooded.labels),
        saddles: saddles.clone(),
        n_voxels: n_voxels_of(flooded.labels, n),
        joins: Vec::new(),
        storeys_apart: true,
    };
    merger.peak[OUTDOORS as usize] = f32::INFINITY;
    for &(a, b) in merger.contacts.keys() {
        merger.neighbors[a as usize].insert(b);
        merger.neighbors[b as usize].insert(a);
    }
    // Space under a wide hole in a slab is a room only together with its surroundings: so each
    // storey is merged first, and only then are openings between storeys weighed.
    for storeys_apart in [true, false] {
        merger.storeys_apart = storeys_apart;
        join_rooms(&mut merger);
    }
    merger.absorb_crevices();
    merger.absorb_bays();
    merger.finish()
}

struct BasinMerger<'a> {
    flooded: Flooded<'a>,
    settings: &'a MergeSettings,
    /// The cell of each basin, named by one of its basins.
    cell: Vec<u32>,
    /// The basins of each cell, at the index of the basin that names it.
    basins: Vec<Vec<u32>>,
    peak: Vec<f32>,
    /// Grows with the cell, so that stale queue entries are recognized by their age.
    version: Vec<u32>,
    neighbors: Vec<BTreeSet<u32>>,
    contacts: BTreeMap<(u32, u32), Faces>,
    saddles: BTreeMap<(u32, u32), f32>,
    /// Voxels of each cell, at the index of the basin that names it.
    n_voxels: Vec<usize>,
    joins: Vec<CloseJoin>,
    /// Treats openings that lie in a slab as shut for now.
    storeys_apart: bool,
}

impl BasinMerger<'_> {
    fn lies_in_slab(&self, opening: &Opening) -> bool {
        lies_in_slab(opening.plane.normal, opening.center.y, self.flooded.slabs)
    }

    /// Joins cells too narrow to be a room to the neighbor with which they share the largest open front.
    fn absorb_crevices(&mut self) {
        // A voxel center next to a wall is already one voxel away from it.
        let limit = self.settings.min_radius / self.flooded.grid.voxel + 0.5;
        let mut narrow: Vec<u32> = (OUTDOORS + 1..self.cell.len() as u32)
            .filter(|&c| self.cell[c as usize] == c && f64::from(self.peak[c as usize]) < limit)
            .collect();
        narrow.sort_by(|&p, &q| {
            self.peak[p as usize]
                .total_cmp(&self.peak[q as usize])
                .then(p.cmp(&q))
        });
        for c in narrow {
            let n_neighbors = self.neighbors[c as usize].len() as u64;
            if self.cell[c as usize] != c || !self.flooded.allowance.spend(1 + n_neighbors) {
                continue;
            }
            // Space that only closures shut off (under a table top) is not a room either.
            let open_faces = |n: u32| {
                let faces = &self.contacts[&(c.min(n), c.max(n))];
                (self.open_faces(faces).count(), faces.len())
            };
            let home = self.neighbors[c as usize]
                .iter()
                .map(|&n| (open_faces(n), Reverse(n)))
                .max();
            if let Some((_, Reverse(n))) = home {
                self.join((c.min(n), c.max(n)));
            }
        }
    }

    /// Joins cells whose sides are hardly walled to the neighbor that they open to most, least walled first: bays
    /// between the columns of a hall.
    ///
    /// One pass over all voxels, and one over all pairs for each cell so joined.
    fn absorb_bays(&mut self) {
        let mut sides = self.side_faces();
        let is_upright = |f: &&u64| **f % 4 != 1;
        let n_open = |merger: &Self, pair: (u32, u32)| {
            let faces = &merger.contacts[&pair];
            merger.open_faces(faces).filter(is_upright).count()
        };
        let mut open: BTreeMap<(u32, u32), usize> = BTreeMap::new();
        for &pair in self.contacts.keys() {
            open.insert(pair, n_open(self, pair));
        }
        // Each round visits all pairs from both sides.
        while self.flooded.allowance.spend(2 * self.contacts.len() as u64) {
            let bays = (OUTDOORS + 1..self.cell.len() as u32).filter_map(|c| {
                let neighbors = self.neighbors[c as usize].iter();
                let open = neighbors.map(|&n| (open[&(c.min(n), c.max(n))], Reverse(n)));
                let (all, most) =
                    open.fold((0, None), |(all, most), o| (all + o.0, most.max(Some(o))));
                let share = all as f64 / f64::from(sides[c as usize].max(1));
                let Reverse(home) = most?.1;
                (share >= self.settings.bay_share).then_some((share, Reverse(c), home))
            });
            let order = |a: &(f64, Reverse<u32>, u32), b: &(f64, Reverse<u32>, u32)| {
                a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
            };
            let Some((_, Reverse(bay), home)) = bays.max_by(order) else {
                break;
            };
            let pair = (bay.min(home), bay.max(home));
            let shared = self.contacts[&pair].iter().filter(is_upright).count();
            // The sides of the outdoors are not counted, and not needed.
            let rest =
                (sides[bay as usize] + sides[home as usize]).saturating_sub(2 * shared as u32);
            self.join(pair);
            let whole = self.cell[bay as usize];
            sides[whole as usize] = rest;
            for &n in &self.neighbors[whole as usize] {
                let pair = (whole.min(n), whole.max(n));
                open.insert(pair, n_open(self, pair));
            }
        }
    }

    /// Returns the faces that no door leaf or pane fills.
    fn open_faces<'a>(&'a self, faces: &'a [u64]) -> impl Iterator<Item = &'a u64> {
        let Flooded {
            grid,
            closures,
            allowance,
            ..
        } = self.flooded;
        allowance.spend(1 + faces.len() as u64 / 16);
        faces
            .iter()
            .filter(move |&&f| !closures.is_some_and(|bits| is_in(grid, bits, f)))
    }

    /// Returns the number of upright faces around each cell but the outdoors, which is all around.
    fn side_faces(&self) -> Vec<u32> {
        let labels = self.flooded.labels;
        let zero = || vec![0_u32; self.cell.len()];
        let count = |mut sides: Vec<u32>, layer: usize| {
            labels.for_faces(layer, |_, axis, pair| {
                let cells = pair.map(|l| self.cell[l as usize]);
                if axis != 1 && cells[0] != cells[1] {
                    cells.iter().for_each(|&c| sides[c as usize] += 1);
                }
            });
            sides
        };
        let layers = (0..labels.n_layers())
            .into_par_iter()
            .with_min_len(LAYERS / 4);
        layers.fold(zero, count).reduce(zero, sum)
    }

    fn finish(self) -> Regions {
        let region_of_basin = self.cell;
        let mut contacts = self.contacts;
        for faces in contacts.values_mut() {
            faces.sort_unstable();
        }
        Regions {
            region_of_basin,
            contacts,
            saddles: self.saddles,
            joins: self.joins,
            limbs: BTreeMap::new(),
        }
    }

    /// Returns the radius of the largest ball that passes between two cells ÷ that of the smaller of the largest in each.
    fn balls(&self, (a, b): Pair) -> f64 {
        let smaller = self.peak[a as usize].min(self.peak[b as usize]);
        balls_of(&self.saddles, (a, b), smaller)
    }

    /// Returns the verdicts on the openings between two cells, each with its middle: on the two largest, since a third is smaller
    /// still.
    fn verdicts(&self, (a, b): Pair, faces: &[u64], balls: f64) -> Vec<(OpeningVerdict, DVec3)> {
        self.flooded.allowance.spend(10 * WORK_A_LOOK);
        let side = |at| self.cell[self.flooded.labels.at(at) as usize] == a;
        let cell_of = |label: u32| self.cell[label as usize];
        let fronts = group_faces(self.flooded, faces, &side);
        let verdict = |front: &Front| {
            let facts = OpeningFacts {
                is_between_storeys: self.storeys_apart && self.lies_in_slab(&front.opening),
                closed: front.opening.closed,
                is_to_outdoors: a == OUTDOORS,
                balls,
            };
            let section = || section_of(self.flooded, self.settings, front, [a, b], &cell_of);
            (judge(self.settings, facts, section), front.opening.center)
        };
        fronts.iter().take(2).map(verdict).collect()
    }

    /// Keeps a join that was close, before it is made.
    fn keep(&mut self, pair: Pair, openness: f64) {
        let n_voxels = [pair.0, pair.1].map(|c| match c {
            OUTDOORS => usize::MAX,
            c => self.n_voxels[c as usize],
        });
        let volume = n_voxels[0].min(n_voxels[1]) as f64 * self.flooded.grid.voxel.powi(3);
        if openness >= CloseJoin::MOST_OPEN || volume < CloseJoin::LEAST_VOLUME {
            return;
        }
        let Some(faces) = self.contacts.get(&pair) else {
            return;
        };
        let verdicts = self.verdicts(pair, faces, self.balls(pair)).into_iter();
        let most = verdicts.max_by(|p, q| p.0.openness.total_cmp(&q.0.openness));
        self.joins.extend(most.map(|(verdict, at)| CloseJoin {
            at,
            verdict,
            volume,
        }));
    }
}

/// Returns the radius of the largest ball that passes between two cells ÷ the `smaller` of the largest in each. Pairs made by a cut
/// have no saddle: the ratio is unknown, so the sections decide.
pub(super) fn balls_of(saddles: &BTreeMap<Pair, f32>, pair: Pair, smaller: f32) -> f64 {
    let saddle = saddles.get(&pair).copied().unwrap_or(f32::INFINITY);
    f64::from(saddle / smaller.max(1e-6))
}

/// Returns the number of voxels of each basin but the outdoors.
fn n_voxels_of(labels: &Labels, n_basins: usize) -> Vec<usize> {
    let mut n = vec![0; n_basins];
    labels.for_runs(0..labels.len(), |run, label| n[label as usize] += run.len());
    n
}

impl Mergeable for BasinMerger<'_> {
    fn may_go_on(&self) -> bool {
        self.flooded.allowance.spend(1)
    }

    fn pairs(&self) -> Vec<Pair> {
        self.contacts.keys().copied().collect()
    }

    fn is_pair(&self, pair: Pair) -> bool {
        self.contacts.contains_key(&pair)
    }

    fn ages(&self, (a, b): Pair) -> [u32; 2] {
        [a, b].map(|c| self.version[c as usize])
    }

    fn openness(&self, (a, b): Pair) -> f64 {
        let Some(faces) = self.contacts.get(&(a, b)) else {
            return 0.0;
        };
        let balls = self.balls((a, b));
        // A neck parts them, whatever its shape.
        let by_balls = self.settings.by_balls(balls, a == OUTDOORS);
        if by_balls < 1.0 {
            return by_balls;
        }
        let verdicts = self.verdicts((a, b), faces, balls).into_iter();
        verdicts.map(|(v, _)| v.openness).fold(0.0, f64::max)
    }

    fn keep_close(&mut self, pair: Pair, openness: f64) {
        self.keep(pair, openness);
    }

    /// The cell with more neighbors survives, except that outdoors always does.
    fn join(&mut self, (a, b): Pair) -> Vec<Pair> {
        let pair = (a.min(b), a.max(b));
        let n = |c: u32| self.neighbors[c as usize].len();
        let (a, b) = if a != OUTDOORS && (b == OUTDOORS || n(b) > n(a)) {
            (b, a)
        } else {
            (a, b)
        };
        let n_pairs = self.neighbors[b as usize].len();
        self.flooded.allowance.spend(5 + 5 * n_pairs as u64);
        let joined = std::mem::take(&mut self.basins[b as usize]);
        for &basin in &joined {
            self.cell[basin as usize] = a;
        }
        self.basins[a as usize].extend(joined);
        self.peak[a as usize] = self.peak[a as usize].max(self.peak[b as usize]);
        self.n_voxels[a as usize] += self.n_voxels[b as usize];
        self.version[a as usize] += 1;
        self.contacts.remove(&pair);
        self.saddles.remove(&pair);
        self.neighbors[a as usize].remove(&b);
        let mut changed = Vec::new();
        for c in std::mem::take(&mut self.neighbors[b as usize]) {
            if c == a {
                continue;
            }
            let (old, new) = ((b.min(c), b.max(c)), (a.min(c), a.max(c)));
            let faces = self.contacts.remove(&old).unwrap_or_default();
            let saddle = self.saddles.remove(&old).unwrap_or(f32::INFINITY);
            let entry = self.contacts.entry(new).or_default();
            if entry.len() < faces.len() {
                let small = std::mem::replace(entry, faces);
                entry.extend(small);
            } else {
                entry.extend(faces);
            }
            let s = self.saddles.entry(new).or_insert(0.0);
            *s = s.max(saddle);
            self.neighbors[c as usize].remove(&b);
            self.neighbors[c as usize].insert(a);
            self.neighbors[a as usize].insert(c);
            changed.push(new);
        }
        changed
    }
}
