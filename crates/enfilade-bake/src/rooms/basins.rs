//! Basins: the parts into which a builder divides the air, before they are merged into rooms.

use std::collections::BTreeMap;
use std::ops::Range;

use enfilade_geom::{Allowance, DVec3};

use super::air::VoxelAir;
use super::flooded::Flooded;
use super::refill::flood_closures;
use super::regions::{Regions, merge_basins};
use super::slabs::cut_at_slabs;
use crate::BakeConfig;
use crate::structure::OUTDOORS;
use crate::voxel::{BitVolume, DistanceField, Grid, Labels, SparseVolume, connected_labels};

/// Label of part 0, before parts have basins.
const AFTER: u32 = OUTDOORS + 1;
/// Edges of the blocks whose part is looked up at once, the second as thick as a layer of labels. [Units: vx]
const BLOCKS: [usize; 2] = [16, 4];

/// A place in a division of space: a part, or several.
pub(crate) type Place = i32;
/// All of space.
pub(crate) const ROOT: Place = i32::MAX;

/// A division of space into parts, in the axes of the grid.
pub(crate) trait Parts: Sync {
    /// Returns the smallest known place within `place` that holds a ball.
    fn around(&self, place: Place, center: DVec3, radius: f64) -> Place;
    /// Returns `true` if a place is one part.
    fn is_part(&self, place: Place) -> bool;
    /// Returns the part of a point in a place, below 2³⁰, or `None` for matter.
    fn part_at(&self, place: Place, p: DVec3) -> Option<u32>;
}

/// Parts of the air. The outdoors is the basin [`OUTDOORS`](crate::structure::OUTDOORS).
pub(crate) struct Basins {
    /// Basin of each voxel; 0 where it is solid or shut.
    pub(crate) labels: Labels,
    /// Largest distance in each basin, by label. [Units: vx]
    pub(crate) peaks: Vec<f32>,
    /// Greatest distance at which two basins touch, lower label first. [Units: vx]
    pub(crate) saddles: BTreeMap<(u32, u32), f32>,
    pub(crate) n_basins: usize,
}

impl Basins {
    /// Makes a basin of each connected set of air voxels in one part. Everything that connects to the border is outdoors.
    ///
    /// Blocks of voxels are looked up before their voxels, so that the time is linear in voxels, and logarithmic in parts near
    /// borders of parts alone. About 2 bytes a voxel.
    pub(crate) fn of_parts(air: &VoxelAir, parts: &impl Parts, allowance: &Allowance) -> Self {
        let grid = &air.grid;
        let field = air.solid.field(allowance);
        let outer = parts.part_at(ROOT, grid.center(0, 0, 0)).unwrap_or(0);
        let is_outer = |label: u32| label == OUTDOORS || label == AFTER + outer;
        let mut n = OUTDOORS + 1;
        let name = |least: u32| match least {
            OUTDOORS => OUTDOORS,
            _ => {
                n += 1;
                n - 1
            }
        };
        let labels = part_labels(air, parts, allowance);
        let alike = |a: u32, b: u32| a == b || is_outer(a) && is_outer(b);
        let labels = connected_labels(&labels, alike, name);
        let mut basins = Self {
            labels,
            peaks: vec![0.0; n as usize],
            saddles: BTreeMap::new(),
            n_basins: n as usize - 1,
        };
        basins.measure(&field, |_| true, allowance);
        basins.cut(grid, &air.slabs, &field, allowance);
        basins
    }

    /// Takes the basins of a flood of the air, and cuts them where a slab ends a storey.
    pub(crate) fn flooded(
        air: &VoxelAir,
        field: &DistanceField,
        config: &BakeConfig,
        allowance: &Allowance,
    ) -> Self {
        let flood = field.watershed(config.noise / air.grid.voxel, allowance);
        let peaks = flood.basins.iter().map(|b| b.peak as f32);
        let saddles = flood.saddles.iter();
        let mut basins = Self {
            peaks: std::iter::once(0.0).chain(peaks).collect(),
            saddles: saddles.map(|s| ((s.a, s.b), s.distance as f32)).collect(),
            n_basins: flood.basins.len(),
            labels: flood.labels,
        };
        basins.cut(&air.grid, &air.slabs, field, allowance);
        basins
    }

    /// Cuts basins where a slab ends a storey. What the flood knew of them holds for no part of them, so it is measured.
    fn cut(&mut self, grid: &Grid, slabs: &[f64], field: &DistanceField, allowance: &Allowance) {
        let n = self.peaks.len();
        let parents = cut_at_slabs(grid, &mut self.labels, n, slabs);
        if parents.is_empty() {
            return;
        }
        self.peaks.resize(n + parents.len(), 0.0);
        let mut is_cut = vec![false; n];
        for &parent in &parents {
            is_cut[parent as usize] = true;
        }
        let is_part = |label: u32| is_cut.get(label as usize).is_none_or(|&is| is);
        self.saddles.retain(|&(a, b), _| !is_part(a) && !is_part(b));
        self.measure(field, is_part, allowance);
        // The cut itself is where a slab is, not where the air is narrow.
        let whole = |label: u32| {
            *parents
                .get((label as usize).wrapping_sub(n))
                .unwrap_or(&label)
        };
        self.saddles.retain(|&(a, b), _| whole(a) != whole(b));
    }

    /// Measures the peaks of `wanted` basins, and their saddles with any.
    fn measure(
        &mut self,
        field: &DistanceField,
        wanted: impl Fn(u32) -> bool + Sync,
        allowance: &Allowance,
    ) {
        let found = field.touching(&self.labels, wanted, allowance);
        for (label, peak) in found.peaks {
            self.peaks[label as usize] = peak as f32;
        }
        self.peaks[OUTDOORS as usize] = f32::INFINITY;
        let saddles = found.saddles.into_iter();
        self.saddles
            .extend(saddles.map(|(pair, d)| (pair, d as f32)));
    }

    /// Gives the air inside closures to the basins beside it.
    pub(super) fn refill(&mut self, occupied: &BitVolume) {
        flood_closures(&mut self.labels, occupied);
    }

    pub(super) fn merge(
        &self,
        grid: &Grid,
        shut: &SparseVolume,
        slabs: &[f64],
        config: &BakeConfig,
        allowance: &Allowance,
    ) -> Regions {
        let flooded = Flooded {
            grid,
            labels: &self.labels,
            peaks: &self.peaks,
            closures: Some(shut),
            slabs,
            allowance,
        };
        merge_basins(flooded, &self.saddles, &config.merge)
    }
}

/// Labels voxels by parts: 0 is matter, the border and what is far from everything is [`OUTDOORS`], and the rest follow.
fn part_labels(air: &VoxelAir, parts: &impl Parts, allowance: &Allowance) -> Labels {
    let grid = &air.grid;
    let [nx, ny, nz] = grid.dims;
    let (blocked, far) = air.solid.blocked(allowance);
    let label_of = |part: Option<u32>| part.map_or(0, |part| AFTER + part);
    // The place that holds all voxels from the first to before the last.
    let within = |place: Place, first: [usize; 3], last: [usize; 3]| {
        let [low, high] = [first, last].map(|at| grid.to_world(DVec3::from(at.map(|n| n as f64))));
        parts.around(place, (low + high) / 2.0, low.distance(high) / 2.0)
    };
    Labels::filled(grid.dims, |z, labels| {
        let end = nz.min(z + BLOCKS[1]);
        for wide in blocks([0, 0], [nx, ny], BLOCKS[0]) {
            let place = within(
                ROOT,
                [wide[0].start, wide[1].start, z],
                [wide[0].end, wide[1].end, end],
            );
            let [first, last] = [wide.clone().map(|r| r.start), wide.map(|r| r.end)];
            for narrow in blocks(first, last, BLOCKS[1]) {
                let [xs, ys] = narrow;
                if !allowance.spend((xs.len() * ys.len() * (end - z)) as u64) {
                    return;
                }
                let place = within(place, [xs.start, ys.start, z], [xs.end, ys.end, end]);
                let whole = parts
                    .is_part(place)
                    .then(|| label_of(parts.part_at(place, DVec3::ZERO)));
                for k in z..end {
                    for y in ys.clone() {
                        for x in xs.clone() {
                            let is_border = [(x, nx), (y, ny), (k, nz)]
                                .iter()
                                .any(|&(at, n)| at == 0 || at + 1 == n);
                            labels[x + nx * (y + ny * (k - z))] = if blocked.get(x, y, k) {
                                0
                            } else if is_border || far.get(x, y, k) {
                                OUTDOORS
                            } else {
                                whole.unwrap_or_else(|| {
                                    label_of(parts.part_at(place, grid.center(x, y, k)))
                                })
                            };
                        }
                    }
                }
            }
        }
    })
}

/// Returns the blocks of a rectangle, of at most so many steps each way.
fn blocks(
    first: [usize; 2],
    last: [usize; 2],
    edge: usize,
) -> impl Iterator<Item = [Range<usize>; 2]> {
    let along = move |k: usize| {
        let starts = (first[k]..last[k]).step_by(edge);
        starts.map(move |at| at..last[k].min(at + edge))
    };
    along(1).flat_map(move |ys| along(0).map(move |xs| [xs, ys.clone()]))
}
