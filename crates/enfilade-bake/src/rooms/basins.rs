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
use crate::voxel::{DistanceField, Grid, Labels, SparseVolume, connected_labels};

/// Label of part 0, before parts have basins.
const AFTER: u32 = OUTDOORS + 1;
/// Edges of the blocks whose part is looked up at once, the second as thick as a layer of labels. [Units: vx]
const BLOCKS: [usize; 2] = [16, 4];

/// A node of a division of space: a part, or several.
pub(crate) type DivisionNode = i32;
/// All of space.
pub(crate) const ROOT: DivisionNode = i32::MAX;

/// A division of space into parts, in the axes of the grid.
pub(crate) trait Division: Sync {
    /// Returns the smallest known node within `node` that holds a ball.
    fn around(&self, node: DivisionNode, center: DVec3, radius: f64) -> DivisionNode;
    /// Returns `true` if a node is one part.
    fn is_part(&self, node: DivisionNode) -> bool;
    /// Returns the part of a point in a node, below 2³⁰, or `None` for matter.
    fn part_at(&self, node: DivisionNode, p: DVec3) -> Option<u32>;
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
    pub(crate) fn of_parts(
        air: &VoxelAir,
        division: &impl Division,
        allowance: &Allowance,
    ) -> Self {
        let grid = &air.grid;
        let field = air.solid.field(allowance);
        let outer = division.part_at(ROOT, grid.center(0, 0, 0)).unwrap_or(0);
        let is_outer = |label: u32| label == OUTDOORS || label == AFTER + outer;
        let mut n = OUTDOORS + 1;
        let name = |least: u32| match least {
            OUTDOORS => OUTDOORS,
            _ => {
                n += 1;
                n - 1
            }
        };
        let (blocked, far) = air.solid.blocked(allowance);
        let labelling = Labelling {
            grid,
            blocked: &blocked,
            far: &far,
            division,
        };
        let labels = labelling.labels(allowance);
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
    pub(super) fn refill(&mut self, occupied: &SparseVolume) {
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

/// The division of a grid, and the voxels whose label is known without it.
struct Labelling<'a, D> {
    grid: &'a Grid,
    blocked: &'a SparseVolume,
    far: &'a SparseVolume,
    division: &'a D,
}

impl<D: Division> Labelling<'_, D> {
    /// Labels voxels by parts: 0 is matter, the border and what is far from everything is [`OUTDOORS`], and the rest follow.
    fn labels(&self, allowance: &Allowance) -> Labels {
        let [nx, ny, nz] = self.grid.dims;
        Labels::filled(self.grid.dims, |z, labels| {
            let zs = z..nz.min(z + BLOCKS[1]);
            for [xs, ys] in blocks([0..nx, 0..ny], BLOCKS[0]) {
                let node = self.around(ROOT, [&xs, &ys, &zs]);
                for [xs, ys] in blocks([xs, ys], BLOCKS[1]) {
                    if !allowance.spend((xs.len() * ys.len() * zs.len()) as u64) {
                        return;
                    }
                    self.fill(node, [xs, ys, zs.clone()], labels);
                }
            }
        })
    }

    /// Returns the smallest node within one that holds a block.
    fn around(&self, node: DivisionNode, block: [&Range<usize>; 3]) -> DivisionNode {
        let corner = |at: [usize; 3]| self.grid.to_world(DVec3::from(at.map(|n| n as f64)));
        let (low, high) = (corner(block.map(|r| r.start)), corner(block.map(|r| r.end)));
        let radius = low.distance(high) / 2.0;
        self.division.around(node, (low + high) / 2.0, radius)
    }

    /// Labels a block within a node, in layers that begin with it.
    fn fill(&self, node: DivisionNode, [xs, ys, zs]: [Range<usize>; 3], layers: &mut [u32]) {
        let [nx, ny, nz] = self.grid.dims;
        let is_end = |at: usize, n: usize| at == 0 || at + 1 == n;
        let node = self.around(node, [&xs, &ys, &zs]);
        let part_at = |p: DVec3| {
            self.division
                .part_at(node, p)
                .map_or(0, |part| AFTER + part)
        };
        let whole = self.division.is_part(node).then(|| part_at(DVec3::ZERO));
        for (y, z) in zs.clone().flat_map(|z| ys.clone().map(move |y| (y, z))) {
            let row = &mut layers[nx * (y + ny * (z - zs.start))..][..nx];
            let is_border = is_end(y, ny) || is_end(z, nz);
            for x in xs.clone() {
                row[x] = if self.blocked.get(x, y, z) {
                    0
                } else if is_border || is_end(x, nx) || self.far.get(x, y, z) {
                    OUTDOORS
                } else {
                    whole.unwrap_or_else(|| part_at(self.grid.center(x, y, z)))
                };
            }
        }
    }
}

/// Returns the blocks of a rectangle, of at most so many steps each way.
fn blocks([xs, ys]: [Range<usize>; 2], edge: usize) -> impl Iterator<Item = [Range<usize>; 2]> {
    let cut = move |r: Range<usize>| {
        r.clone()
            .step_by(edge)
            .map(move |at| at..r.end.min(at + edge))
    };
    cut(ys).flat_map(move |ys| cut(xs.clone()).map(move |xs| [xs, ys.clone()]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel::BitVolume;
    use enfilade_geom::Plane;
    use proptest::prelude::*;

    /// A tree of planes, each node with one for both of its children; the parts below are 0 to 7, and every third is matter.
    struct Planes([Plane; 7]);

    impl Planes {
        /// Returns the node below `node` in front of its plane or behind it; nodes from 7 on are parts.
        fn below(node: i32, is_front: bool) -> i32 {
            2 * node + 1 + i32::from(is_front)
        }

        fn descend(&self, node: i32, step: impl Fn(&Plane) -> Option<bool>) -> i32 {
            let mut node = if node == ROOT { 0 } else { node };
            while let Some(is_front) = self.0.get(node as usize).and_then(&step) {
                node = Self::below(node, is_front);
            }
            node
        }
    }

    impl Division for Planes {
        fn around(&self, node: DivisionNode, center: DVec3, radius: f64) -> DivisionNode {
            self.descend(node, |plane| {
                let height = plane.signed_distance(center);
                (height.abs() > radius).then_some(height > 0.0)
            })
        }

        fn is_part(&self, node: DivisionNode) -> bool {
            node != ROOT && node >= 7
        }

        fn part_at(&self, node: DivisionNode, p: DVec3) -> Option<u32> {
            let part = self.descend(node, |plane| Some(plane.signed_distance(p) > 0.0)) - 7;
            (part % 3 != 0).then_some(part as u32)
        }
    }

    fn plane() -> impl Strategy<Value = Plane> {
        let normal = prop::array::uniform3(-1.0..1.0f64).prop_map(DVec3::from_array);
        let normal = normal.prop_filter_map("direction", DVec3::try_normalize);
        (prop::array::uniform3(0.0..12.0f64), normal)
            .prop_map(|(p, normal)| Plane::through(DVec3::from_array(p), normal))
    }

    proptest! {
        #[test]
        fn blocks_have_the_labels_of_their_voxels(
            dims in [3_usize..40, 3_usize..24, 3_usize..11],
            planes in prop::array::uniform7(plane()),
            seed in any::<u64>(),
        ) {
            let grid = Grid { origin: DVec3::new(-1.0, 0.5, 2.0), voxel: 0.5, dims };
            let is_of = |i: usize, salt: u64| {
                (i as u64 ^ seed ^ salt).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 60 == 0
            };
            let [mut blocked, mut far] = [BitVolume::new(dims), BitVolume::new(dims)];
            let [nx, ny, nz] = dims;
            let voxels = || (0..nx * ny * nz).map(|i| [i % nx, i / nx % ny, i / (nx * ny)]);
            for (i, [x, y, z]) in voxels().enumerate() {
                blocked.set(x, y, z, is_of(i, 1));
                far.set(x, y, z, is_of(i, 2));
            }
            let [blocked, far] = [blocked, far].map(|v| SparseVolume::of(&v));
            let division = Planes(planes);
            let labelling = Labelling { grid: &grid, blocked: &blocked, far: &far, division: &division };
            let labels = labelling.labels(&Allowance::default());
            for [x, y, z] in voxels() {
                let is_border = [x, y, z].iter().zip(dims).any(|(&at, n)| at == 0 || at + 1 == n);
                let expected = if blocked.get(x, y, z) {
                    0
                } else if is_border || far.get(x, y, z) {
                    OUTDOORS
                } else {
                    let part = division.part_at(ROOT, grid.center(x, y, z));
                    part.map_or(0, |part| AFTER + part)
                };
                prop_assert_eq!(labels.at([x, y, z]), expected, "{:?}", [x, y, z]);
            }
        }
    }
}
