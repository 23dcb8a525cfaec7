//! Corridors: limbs of rooms in plan, found by the same rule as in voxels ([`Plan`]).
//!
//! A corridor that is nearly as wide as the rooms beside it are high passes their balls, and one of two mouths of any
//! corridor flows into a room. In plan, limbs are narrower than their rooms whatever the height. A round tube does not count: see `branches`.

use std::cell::Cell;
use std::collections::BTreeMap;

use enfilade_geom::{Aabb, Allowance, DVec3};
use rayon::prelude::*;

use super::cells::OUTDOOR_CELL;
use super::labels::{BranchMouth, Branches};
use super::space::Space;
use crate::rooms::{Limb, LimbRule, Plan, THICKER};
use crate::tubes::Walls;

/// Cells of a plan across the narrowest opening.
const ACROSS: f64 = 6.0;
/// Most cells of a plan, about: 1,000 m² in decimeters. Larger rooms have larger cells.
const MAX_CELLS: f64 = 1e5;
/// Levels at which a room is measured to find its largest, which is its plan.
const LEVELS: usize = 8;
/// Edge of the cells in which levels are compared. [Units: cells of the plan]
const COARSE: usize = 4;
/// Cost of a look-up, in units of [`Allowance`].
const WORK: u64 = 10;

/// The space of rooms before limbs leave them.
pub(super) struct RoomSpace<'a> {
    pub(super) space: &'a Space,
    pub(super) walls: &'a Walls<'a>,
    pub(super) room_of_part: &'a [u32],
    pub(super) allowance: &'a Allowance,
}

/// The plan of a room, as the cells at one height.
struct RoomLevel {
    /// Least vertex of the plan, at its height. [Units: wu]
    origin: DVec3,
    /// Edge of a cell. [Units: wu]
    step: f64,
    plan: Plan,
}

impl Branches {
    /// Adds the limbs of rooms in plan, where there are no branches yet. Half-widths count from `min_radius` on.
    ///
    /// A look-up for each cell of each room's plan, besides the distance transforms of [`Plan::limbs`].
    pub(super) fn with_limbs(
        mut self,
        of: &RoomSpace<'_>,
        narrowest: f64,
        min_radius: f64,
    ) -> Self {
        let mut parts: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (t, &room) in of.room_of_part.iter().enumerate() {
            if room != OUTDOOR_CELL {
                parts.entry(room).or_default().push(t as u32);
            }
        }
        let limbs_of = |(&room, parts): (&u32, &Vec<u32>)| {
            let level = of.largest_level(room, parts, narrowest / ACROSS)?;
            let (_, mut limbs) =
                level
                    .plan
                    .limbs(min_radius / level.step, LimbRule::ROOMS, of.allowance);
            limbs.retain(|limb| level.is_corridor(limb, of.walls));
            Some((room, level, limbs))
        };
        let found: Vec<(u32, RoomLevel, Vec<Limb>)> =
            parts.par_iter().filter_map(limbs_of).collect();
        for (room, level, limbs) in found {
            let mut label_of_cell = BTreeMap::new();
            for limb in &limbs {
                self.mouths.push(BranchMouth {
                    weight: THICKER,
                    radius: limb.half_width * level.step,
                    is_limb: true,
                });
                let label = self.mouths.len() as u32;
                let cells = level.plan.up_to_mouths(limb);
                let cells = cells.into_iter().map(|c| level.plan.column(c));
                label_of_cell.extend(cells.map(|cell| (cell, label)));
            }
            for &t in &parts[&room] {
                let at = ((of.space.middles[t as usize] - level.origin) / level.step).floor();
                let of_part = &mut self.label_of_part[t as usize];
                if *of_part == 0
                    && let Some(&label) = label_of_cell.get(&[at.x as usize, at.z as usize])
                {
                    *of_part = label;
                }
            }
        }
        self
    }
}

impl RoomLevel {
    /// Returns `true` if the walls beside the middle cell of a limb stand at right angles: round tubes are for `branches`.
    fn is_corridor(&self, limb: &Limb, walls: &Walls<'_>) -> bool {
        let [x, z] = self
            .plan
            .column(self.plan.middle(limb))
            .map(|c| c as f64 + 0.5);
        let middle = self.origin + DVec3::new(x, 0.0, z) * self.step;
        walls.are_of_corridor(middle, limb.half_width * self.step)
    }
}

impl RoomSpace<'_> {
    /// Returns the plan of a room at the height at which it is largest; `None` if it is too small for cells.
    fn largest_level(&self, room: u32, parts: &[u32], least: f64) -> Option<RoomLevel> {
        // The tetrahedron of a spike may reach far beyond a wall.
        let bounds = parts.iter().fold(Aabb::EMPTY, |b, &t| {
            let is_whole = self.space.radii[t as usize] > 0.0;
            let vertices = self.space.corners(t).into_iter().filter(|_| is_whole);
            vertices.fold(b.including(self.space.middles[t as usize]), Aabb::including)
        });
        let size = bounds.size();
        let step = least.max((size.x * size.z / MAX_CELLS).sqrt());
        let [nx, nz] = [size.x, size.z].map(|s| (s / step).ceil() as usize);
        if nx == 0 || nz == 0 {
            return None;
        }
        let hint = Cell::new(parts[0]);
        let is_in = |origin: DVec3, x: usize, z: usize| {
            let p = origin + DVec3::new(x as f64 + 0.5, 0.0, z as f64 + 0.5) * step;
            let part = self
                .allowance
                .spend(WORK)
                .then(|| self.space.part_at(p, hint.get(), self.walls.bvh));
            part.flatten().is_some_and(|t| {
                hint.set(t);
                self.room_of_part[t as usize] == room
            })
        };
        let at = |level: usize| {
            let up = size.y * (level as f64 + 0.5) / LEVELS as f64;
            bounds.min + DVec3::Y * up
        };
        let n_in = |&level: &usize| {
            let rows = (COARSE / 2..nz).step_by(COARSE);
            let cells = rows.flat_map(|z| (COARSE / 2..nx).step_by(COARSE).map(move |x| (x, z)));
            cells.filter(|&(x, z)| is_in(at(level), x, z)).count()
        };
        // The lowest of equals.
        let level = (0..LEVELS).rev().max_by_key(n_in)?;
        let origin = at(level);
        let plan = Plan::of(0, [[0, 0], [nx - 1, nz - 1]], &|x, z| is_in(origin, x, z));
        Some(RoomLevel { origin, step, plan })
    }
}
