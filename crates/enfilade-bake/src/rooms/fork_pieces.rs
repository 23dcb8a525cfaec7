//! The rest of a region without the balls of its forks.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use enfilade_geom::Sets;

use super::fork_place::{ForkPlace, ball};
use super::regions::Regions;
use crate::tubes::Arm;
use crate::voxel::{Grid, Labels};

/// A run of voxels of one row: first voxel, and the end along x.
pub(super) type VoxelRun = ([usize; 3], usize);

/// The rest of a region without the balls of its forks.
pub(super) struct ForkPieces {
    /// Runs, ascending by row, and the first of each row.
    runs: Vec<VoxelRun>,
    first_of_row: Vec<u32>,
    /// Runs that belong together.
    sets: Sets,
    /// Voxels of each ball.
    balls: Vec<Vec<[usize; 3]>>,
    dims: [usize; 3],
}

impl ForkPieces {
    pub(super) fn of(
        grid: &Grid,
        labels: &Labels,
        regions: &Regions,
        region: u32,
        places: &[ForkPlace],
    ) -> Self {
        let [nx, ny, nz] = grid.dims;
        let is_in = |at: [usize; 3]| regions.region_of_basin[labels.at(at) as usize] == region;
        let balls: Vec<_> = places.iter().map(|p| ball(grid, &is_in, p)).collect();
        let mut taken: Vec<[usize; 3]> = balls.iter().flatten().copied().collect();
        let order = |p: &[usize; 3]| [p[2], p[1], p[0]];
        taken.sort_unstable_by_key(order);
        let mut taken = taken.into_iter().peekable();
        let mut runs: Vec<VoxelRun> = Vec::new();
        let mut first_of_row = vec![0];
        for row in 0..ny * nz {
            let (y, z) = (row % ny, row / ny);
            labels.for_runs(row * nx..(row + 1) * nx, |run, label| {
                if regions.region_of_basin[label as usize] != region {
                    return;
                }
                let [mut from, to] = [run.start - row * nx, run.end - row * nx];
                let mut add = |from: usize, to: usize| {
                    if from < to {
                        runs.push(([from, y, z], to));
                    }
                };
                while let Some(at) = taken.next_if(|at| at[1..] == [y, z] && at[0] < to) {
                    add(from, at[0]);
                    from = at[0] + 1;
                }
                add(from, to);
            });
            first_of_row.push(runs.len() as u32);
        }
        let mut pieces = Self {
            sets: Sets::new(runs.len()),
            runs,
            first_of_row,
            balls,
            dims: grid.dims,
        };
        pieces.join_runs();
        pieces
    }

    fn of_row(&self, y: usize, z: usize) -> std::ops::Range<usize> {
        let row = y + self.dims[1] * z;
        self.first_of_row[row] as usize..self.first_of_row[row + 1] as usize
    }

    /// Joins runs that touch.
    fn join_runs(&mut self) {
        for i in 0..self.runs.len() {
            let (at, to) = self.runs[i];
            let before = [
                (at[1] > 0).then(|| self.of_row(at[1] - 1, at[2])),
                (at[2] > 0).then(|| self.of_row(at[1], at[2] - 1)),
            ];
            for row in before.into_iter().flatten() {
                let from = row.start + self.runs[row.clone()].partition_point(|r| r.1 <= at[0]);
                for j in from..row.end {
                    if self.runs[j].0[0] >= to {
                        break;
                    }
                    self.sets.join(i as u32, j as u32);
                }
            }
            // A run of another label may end where this one begins.
            if i > 0 && self.runs[i - 1].1 == at[0] && self.runs[i - 1].0[1..] == at[1..] {
                self.sets.join(i as u32, i as u32 - 1);
            }
        }
    }

    fn run_at(&self, at: [usize; 3]) -> Option<u32> {
        let row = self.of_row(at[1], at[2]);
        let i = row.start + self.runs[row.clone()].partition_point(|r| r.1 <= at[0]);
        (i < row.end && self.runs[i].0[0] <= at[0]).then_some(i as u32)
    }

    /// Returns the number of all voxels, and the arms that are not part of the rest: radius and runs. [Units: wu]
    pub(super) fn rooms(
        mut self,
        grid: &Grid,
        places: &[ForkPlace],
    ) -> (usize, Vec<(f64, Vec<VoxelRun>)>) {
        let n = self.runs.len() as u32;
        let mut arms: Vec<(u32, f64)> = Vec::new();
        let mut stays: Vec<(u32, u32)> = Vec::new();
        for (k, place) in places.iter().enumerate() {
            let ball = self.sets.add();
            let (mut own, mut apart) = (Vec::new(), Vec::new());
            for (i, arm) in place.arms.iter().enumerate() {
                let seed = place.seed(grid, arm, place.removed);
                let Some(run) = seed.and_then(|at| self.run_at(at)) else {
                    continue;
                };
                arms.push((run, arm.radius));
                let is_own = i == 0 || arm.kind != Arm::Tube;
                let of = if is_own { &mut own } else { &mut apart };
                of.push(self.sets.find(run));
            }
            apart.retain(|piece| !own.contains(piece));
            // A piece that touches the ball stays with it, except for the other arms.
            let beside: Vec<u32> = self.balls[k]
                .iter()
                .flat_map(|&at| self.beside(at))
                .collect();
            let is_own = |run: &u32, sets: &mut Sets| !apart.contains(&sets.find(*run));
            let own = beside.into_iter().filter(|run| is_own(run, &mut self.sets));
            stays.extend(own.map(|run| (ball, run)));
        }
        for (ball, run) in stays {
            self.sets.join(ball, run);
        }
        let mut radius_of: BTreeMap<u32, f64> = BTreeMap::new();
        for (run, radius) in arms {
            let of = radius_of.entry(self.sets.find(run)).or_insert(0.0);
            *of = of.max(radius);
        }
        let mut pieces: BTreeMap<u32, (usize, Vec<VoxelRun>)> = BTreeMap::new();
        let mut add = |piece: u32, run: VoxelRun| {
            let of = pieces.entry(piece).or_default();
            of.0 += run.1 - run.0[0];
            of.1.push(run);
        };
        for (i, &run) in (0..n).zip(&self.runs) {
            add(self.sets.find(i), run);
        }
        for (i, ball) in (n..).zip(&self.balls) {
            let piece = self.sets.find(i);
            ball.iter().for_each(|&at| add(piece, (at, at[0] + 1)));
        }
        let n_voxels = pieces.values().map(|of| of.0).sum();
        let largest = pieces
            .iter()
            .max_by_key(|(piece, of)| (of.0, Reverse(**piece)));
        let largest = largest.map(|(&piece, _)| piece);
        pieces.retain(|piece, _| Some(*piece) != largest);
        let room = |(piece, (_, runs))| Some((*radius_of.get(&piece)?, runs));
        (n_voxels, pieces.into_iter().filter_map(room).collect())
    }

    /// Returns the runs that touch a voxel.
    fn beside(&self, at: [usize; 3]) -> impl Iterator<Item = u32> {
        (0..6).filter_map(move |i| {
            let (k, mut to) = (i / 2, at);
            to[k] = if i % 2 == 0 {
                to[k].checked_sub(1)?
            } else {
                to[k] + 1
            };
            (to[k] < self.dims[k]).then(|| self.run_at(to))?
        })
    }
}
