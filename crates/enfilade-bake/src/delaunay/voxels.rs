//! Cells in voxels: there, all builders find corridors, matter, candidates and votes, by one rule each.

use std::collections::BTreeMap;

use enfilade_geom::{Allowance, Bvh, DVec3};

use super::cells::{Cells, OUTDOOR_CELL};
use super::labels::{BranchMouth, Branches};
use super::space::Space;
use crate::MergeSettings;
use crate::rooms::{Basins, Regions, THICKER, VoxelAir, VoxelRooms};
use crate::structure::OUTDOORS;
use crate::tubes::Walls;

/// Cost of a look-up, in units of [`Allowance`].
const WORK: u64 = 10;

/// The voxels of cells.
pub(super) struct CellVoxels {
    /// A region for each connected set of the voxels of a cell.
    rooms: VoxelRooms,
    cell_of_basin: Vec<u32>,
}

impl CellVoxels {
    /// Finds the cell of each voxel. `walls` are those that cut the tetrahedra.
    pub(super) fn of(
        space: &Space,
        cells: &Cells,
        walls: &Bvh,
        air: VoxelAir,
        allowance: &Allowance,
    ) -> Self {
        let locator = || {
            // The search for a voxel begins where it ended for the one before.
            let mut hint = 0;
            move |p: DVec3| {
                let part = allowance.spend(WORK).then(|| space.part_at(p, hint, walls));
                part.flatten().map(|part| {
                    hint = part;
                    cells.cell_of_part[part as usize]
                })
            }
        };
        let (mut basins, cell_of_basin) = Basins::of_parts(&air, locator, allowance);
        basins.refill(&air.solid.occupied);
        let regions = Regions::of_basins(&basins.labels, basins.peaks.len());
        let mut rooms = VoxelRooms::of(air, basins, regions);
        rooms.are_final = true;
        Self {
            rooms,
            cell_of_basin,
        }
    }

    /// Returns the voxels of rooms, given the room of each cell.
    pub(super) fn of_rooms(&self, room_of_cell: &[u32]) -> VoxelRooms {
        let mut region_of_room = BTreeMap::from([(OUTDOOR_CELL, OUTDOORS)]);
        let region_of_basin: Vec<u32> = (0..)
            .zip(&self.cell_of_basin)
            .map(|(basin, &cell)| match basin {
                0 | OUTDOORS => basin,
                _ => *region_of_room
                    .entry(room_of_cell[cell as usize])
                    .or_insert(basin),
            })
            .collect();
        let mut rooms = self.rooms.clone();
        rooms
            .regions
            .rename(|basin| region_of_basin[basin as usize]);
        rooms
    }
}

/// Cells on the axis of a corridor have balls larger than this share of its largest.
const ON_AXIS: f64 = 0.9;

impl Branches {
    /// Adds the corridors of rooms, where there are no branches yet. Round tubes are for `branches`.
    pub(super) fn with_limbs(
        mut self,
        space: &Space,
        mut rooms: VoxelRooms,
        walls: &Walls<'_>,
        settings: &MergeSettings,
        allowance: &Allowance,
    ) -> Self {
        rooms.split_limbs(settings, allowance);
        let regions = &rooms.regions;
        let region_of = |basin: &u32| regions.region_of_basin[*basin as usize];
        let mut parts_of_limb: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for limb in regions.limbs.keys() {
            parts_of_limb.insert(region_of(limb), Vec::new());
        }
        for (t, middle) in space.middles.iter().enumerate() {
            let is_free = self.label_of_part[t] == 0;
            if let Some(parts) = parts_of_limb.get_mut(&rooms.region_at(*middle))
                && is_free
            {
                parts.push(t as u32);
            }
        }
        for parts in parts_of_limb.into_values() {
            let ball = |t: &u32| Some(space.radii[*t as usize]).filter(|r| r.is_finite());
            let radius = parts.iter().filter_map(ball).fold(0.0, f64::max);
            let on_axis = |t: &&u32| space.radii[**t as usize] >= ON_AXIS * radius;
            let middles = parts
                .iter()
                .filter(on_axis)
                .map(|&t| space.middles[t as usize]);
            let middles: Vec<DVec3> = middles.collect();
            let mean = middles.iter().sum::<DVec3>() / middles.len().max(1) as f64;
            let off = |p: &DVec3| p.distance_squared(mean);
            let middle = middles.iter().min_by(|p, q| off(p).total_cmp(&off(q)));
            if !middle.is_some_and(|&p| walls.are_of_corridor(p, radius)) {
                continue;
            }
            self.mouths.push(BranchMouth {
                weight: THICKER,
                radius,
                is_limb: true,
            });
            let label = self.mouths.len() as u32;
            for t in parts {
                self.label_of_part[t as usize] = label;
            }
        }
        self
    }
}
