//! Basins: the parts into which a builder divides the air, before they are merged into rooms.

use std::collections::BTreeMap;

use enfilade_geom::{Allowance, DVec3};

use rayon::prelude::*;

use super::air::VoxelAir;
use super::flooded::Flooded;
use super::refill::flood_closures;
use super::regions::{Regions, merge_basins};
use super::slabs::cut_at_slabs;
use crate::BakeConfig;
use crate::structure::OUTDOORS;
use crate::voxel::{BitVolume, DistanceField, Grid, Labels, SparseVolume, border};

/// Marks a voxel that has a part, but no basin yet; the other bits are the part.
const WAITING: u32 = 1 << 31;

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
    /// Makes a basin of each connected set of air voxels in one part. `part_at` returns the part of a point, below 2³¹, or
    /// `None` for matter. Everything that connects to the border is outdoors.
    ///
    /// Linear in voxels, besides the calls of `part_at` for those that are not far from everything; 6 bytes a voxel.
    pub(crate) fn of_parts(
        air: &VoxelAir,
        part_at: impl Fn(DVec3) -> Option<u32> + Sync,
        allowance: &Allowance,
    ) -> Self {
        let dims = air.grid.dims;
        let (distances, far) = air.solid.distances(allowance);
        let mut outdoors = border(dims);
        outdoors.union_with(&far);
        let part_of = |i: usize| {
            if distances[i] == 0 || !allowance.spend(1) {
                return 0;
            }
            if outdoors.get_index(i) {
                return OUTDOORS;
            }
            let [x, y, z] = air.grid.coords(i);
            part_at(air.grid.center(x, y, z)).map_or(0, |part| WAITING | part)
        };
        let mut labels: Vec<u32> = (0..distances.len()).into_par_iter().map(part_of).collect();
        let outer = part_at(air.grid.center(0, 0, 0)).unwrap_or(0);
        let n = number_parts(dims, &mut labels, outer);
        let field = DistanceField::of_squared(dims, distances, &outdoors);
        let mut basins = Self {
            labels: Labels::of(dims, &labels),
            peaks: vec![0.0; n],
            saddles: BTreeMap::new(),
            n_basins: n - 1,
        };
        basins.measure(&field, |_| true, allowance);
        basins.cut(&air.grid, &air.slabs, &field, allowance);
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

/// Replaces the parts of voxels by basins, numbered in order of their first voxels; returns the number of labels. Waiting
/// voxels of part `outer` that connect to those that are outdoors are, too.
fn number_parts([nx, ny, nz]: [usize; 3], labels: &mut [u32], outer: u32) -> usize {
    let mut stack: Vec<usize> = (0..labels.len())
        .filter(|&i| labels[i] == OUTDOORS)
        .collect();
    let flood = |labels: &mut [u32], stack: &mut Vec<usize>, from: u32, to: u32| {
        while let Some(i) = stack.pop() {
            let [x, y, z] = [i % nx, i / nx % ny, i / (nx * ny)];
            for (at, n, step) in [(x, nx, 1), (y, ny, nx), (z, nz, nx * ny)] {
                let next = [(at > 0, i.wrapping_sub(step)), (at + 1 < n, i + step)];
                for (_, j) in next.into_iter().filter(|n| n.0) {
                    if labels[j] == from {
                        labels[j] = to;
                        stack.push(j);
                    }
                }
            }
        }
    };
    flood(labels, &mut stack, WAITING | outer, OUTDOORS);
    let mut n = OUTDOORS + 1;
    for i in 0..labels.len() {
        let part = labels[i];
        if part & WAITING != 0 {
            labels[i] = n;
            stack.push(i);
            flood(labels, &mut stack, part, n);
            n += 1;
        }
    }
    n as usize
}
