//! Limbs: corridors that open to rooms without a frame.
//!
//! At the mouth of a corridor as high as the room, nothing is narrower than the corridor itself. So no
//! ratio of an opening to the space beside it shows where the room ends, and the floods meet in the
//! middle of the corridor. The local thickness in plan does show it: a limb is an area that fits no disc of
//! twice its own width, and it is a room if it is at least two and a half of its widths long. An alcove is
//! shorter. A bend or a crossing of corridors of equal width has no space for the larger disc, so
//! corridors that meet are one limb.
//!
//! Floods that meet in the middle of a corridor are joined again. Doors are not: they are
//! narrower than the corridor.
//!
//! A limb that begins and ends in the same room (beside a column, a counter or a free-standing partition)
//! is part of that room.
//!
//! The plan of a region is its largest layer of voxels; a limb includes everything above and below.
//! Cost: a distance transform of the plan for each width tried.

use std::collections::BTreeMap;
use std::ops::Range;

use enfilade_geom::{Allowance, Sets};
use rayon::prelude::*;

use crate::voxel::{BitVolume, Grid, Labels, SparseVolume, distance};

use super::flooded::{Flooded, contact_faces};
use super::fronts::group_faces;
use super::limb_rule::{LimbRule, LimbSettings, THICKER, sagitta};
use super::regions::Regions;
use super::sections::section_of;
use super::slabs::LAYERS;
use crate::MergeSettings;
use crate::structure::OUTDOORS;

/// A limb is at least this many of its widths long, of which up to half a width lies in the room before its mouth.
pub(super) const LONG: f64 = 2.5;
/// Cells on the axis of a limb are farther from its walls than this share of its half-width.
const ON_AXIS: f64 = 0.9;
/// Factor from one width tried to the next.
const STEP: f64 = 1.15;

/// Splits limbs off their rooms, in the labels of a flooded volume. Half-widths count from
/// `min_radius` of the settings on; `shut` are the voxels that door leaves and panes fill.
pub(crate) fn split_limbs(
    grid: &Grid,
    labels: &mut Labels,
    regions: &mut Regions,
    peaks: &mut Vec<f32>,
    shut: &SparseVolume,
    LimbSettings {
        merge: settings,
        rule,
    }: LimbSettings<'_>,
    allowance: &Allowance,
) {
    let least = settings.min_radius / grid.voxel;
    let mut limbs: Vec<(u32, usize, Vec<[usize; 2]>)> = Vec::new();
    // Largest half-width of each region, in plan. [Units: vx]
    let mut thickness: BTreeMap<u32, f64> = BTreeMap::new();
    let n = regions.region_of_basin.len();
    let found: Vec<(u32, Plan, (f64, Vec<Limb>))> = plans(grid, labels, regions)
        .into_par_iter()
        .map(|(region, plan)| {
            let limbs = plan.limbs(least, rule, allowance);
            (region, plan, limbs)
        })
        .collect();
    for (region, plan, (thickest, found)) in found {
        thickness.insert(region, thickest);
        for limb in found {
            let basin = (n + limbs.len()) as u32;
            thickness.insert(basin, limb.half_width);
            regions.limbs.insert(basin, Some(limb.length));
            let columns = limb.cells.iter().map(|&c| plan.column(c)).collect();
            limbs.push((region, plan.row, columns));
            peaks.push((limb.half_width + 0.5) as f32);
        }
    }
    if limbs.is_empty() {
        return;
    }
    for (k, (region, row, columns)) in limbs.into_iter().enumerate() {
        let of = |labels: &Labels, at: [usize; 3]| {
            // Basins from `n` on are limbs that were split off before.
            let basin = labels.at(at) as usize;
            basin < n && regions.region_of_basin[basin] == region
        };
        for [x, z] in columns {
            let at = |y: usize| [x, y, z];
            let down = (0..=row).rev().take_while(|&y| of(labels, at(y))).count();
            let up = (row + 1..grid.dims[1])
                .take_while(|&y| of(labels, at(y)))
                .count();
            for y in row + 1 - down..=row + up {
                labels.set(at(y), (n + k) as u32);
            }
        }
    }
    regions.region_of_basin.extend(n as u32..peaks.len() as u32);
    regions.contacts.clear();
    regions.contacts = contacts_of(regions, contact_faces(labels));
    let flooded = Flooded {
        grid,
        labels,
        peaks,
        closures: Some(shut),
        slabs: &[],
        allowance,
    };
    let first = n as u32;
    join_limbs(flooded, regions, &thickness, first, rule.thicker, settings);
}

pub(super) type Contacts = BTreeMap<(u32, u32), Vec<u64>>;

/// Returns the faces between regions, given those between basins.
pub(super) fn contacts_of(regions: &Regions, by_basin: Contacts) -> Contacts {
    let mut contacts = Contacts::new();
    for ((a, b), mut faces) in by_basin {
        let [a, b] = [a, b].map(|l| regions.region_of_basin[l as usize]);
        if a != b {
            let of = contacts.entry((a.min(b), a.max(b))).or_default();
            of.append(&mut faces);
        }
    }
    contacts.values_mut().for_each(|f| f.sort_unstable());
    contacts
}

/// Joins limbs (from label `first` on) with neighbors that they open to over their whole width and that are not
/// thick enough to be a room beside them: the halves of a corridor in whose middle two floods
/// met, the arms of a crossing.
fn join_limbs(
    flooded: Flooded<'_>,
    regions: &mut Regions,
    thickness: &BTreeMap<u32, f64>,
    first: u32,
    thicker: f64,
    settings: &MergeSettings,
) {
    let region_of = |basin: u32| regions.region_of_basin[basin as usize];
    let mut sets = Sets::new(regions.region_of_basin.len());
    let mut any = false;
    for (&(a, b), faces) in &regions.contacts {
        let (Some(&s), Some(&t)) = (thickness.get(&a), thickness.get(&b)) else {
            continue;
        };
        if b < first || s.max(t) >= thicker * s.min(t) {
            continue;
        }
        let is_lesser = |at| region_of(flooded.labels.at(at)) == a;
        let fronts = group_faces(flooded, faces, &is_lesser);
        let Some(front) = fronts.first() else {
            continue;
        };
        if front.opening.closed < settings.closed_share
            && section_of(flooded, settings, front, [a, b], &region_of).ratio
                >= settings.wall_threshold
        {
            sets.join(a, b);
            any = true;
        }
    }
    if any {
        let least = sets.into_least();
        regions.rename(|region| least[region as usize]);
    }
}

/// The largest layer of a region.
pub(crate) struct Plan {
    row: usize,
    /// Column of the first cell.
    first: [usize; 2],
    /// Number of cells along x and z, with a rim of cells outside the region.
    side: [usize; 2],
    is_free: Vec<bool>,
}

/// A limb of a plan.
pub(crate) struct Limb {
    pub(crate) cells: Vec<usize>,
    /// [Units: vx]
    pub(crate) half_width: f64,
    /// Length in widths.
    pub(crate) length: f64,
}

/// Position of one layer of a region.
#[derive(Clone, Copy)]
struct Layer {
    n_voxels: usize,
    /// Lowest and highest column.
    columns: [[usize; 2]; 2],
}

impl Layer {
    const EMPTY: Self = Self {
        n_voxels: 0,
        columns: [[usize::MAX; 2], [0; 2]],
    };

    /// Includes the voxels `along` x of the row at `z`.
    fn add(&mut self, along: Range<usize>, z: usize) {
        let [least, greatest] = &mut self.columns;
        *least = [least[0].min(along.start), least[1].min(z)];
        *greatest = [greatest[0].max(along.end - 1), greatest[1].max(z)];
        self.n_voxels += along.len();
    }

    fn unite(&mut self, other: &Self) {
        for k in 0..2 {
            let [least, greatest] = &mut self.columns;
            least[k] = least[k].min(other.columns[0][k]);
            greatest[k] = greatest[k].max(other.columns[1][k]);
        }
        self.n_voxels += other.n_voxels;
    }
}

/// Returns the plan of each region except the outdoors.
fn plans(grid: &Grid, labels: &Labels, regions: &Regions) -> Vec<(u32, Plan)> {
    // Layers by row: in a tower, a list of all rows for each room would be the largest thing in memory.
    type Layers = BTreeMap<u32, BTreeMap<usize, Layer>>;
    let [nx, ny, nz] = grid.dims;
    let add = |mut layers: Layers, z: usize| {
        for y in 0..ny {
            let from = grid.index(0, y, z);
            labels.for_runs(from..from + nx, |run, label| {
                let region = regions.region_of_basin[label as usize];
                if region > OUTDOORS {
                    let of = layers.entry(region).or_default();
                    let of = of.entry(y).or_insert(Layer::EMPTY);
                    of.add(run.start - from..run.end - from, z);
                }
            });
        }
        layers
    };
    let unite = |mut all: Layers, part: Layers| {
        for (region, layers) in part {
            let of = all.entry(region).or_default();
            for (y, layer) in &layers {
                of.entry(*y).or_insert(Layer::EMPTY).unite(layer);
            }
        }
        all
    };
    let layers = (0..nz).into_par_iter().with_min_len(LAYERS);
    let layers = layers.fold(Layers::new, add).reduce(Layers::new, unite);
    let region_at = |at| regions.region_of_basin[labels.at(at) as usize];
    layers
        .into_par_iter()
        .filter_map(|(region, of)| {
            // The lowest of several.
            let (row, largest) = of.into_iter().rev().max_by_key(|(_, l)| l.n_voxels)?;
            let is_free = |x: usize, z: usize| region_at([x, row, z]) == region;
            Some((region, Plan::of(row, largest.columns, &is_free)))
        })
        .collect()
}

impl Plan {
    /// Makes the plan of the free columns from the lowest to the highest.
    pub(crate) fn of(
        row: usize,
        [least, greatest]: [[usize; 2]; 2],
        is_free: &dyn Fn(usize, usize) -> bool,
    ) -> Self {
        let side = [0, 1].map(|k| greatest[k] - least[k] + 3);
        let mut plan = Self {
            row,
            first: least,
            side,
            is_free: vec![false; side[0] * side[1]],
        };
        for z in least[1]..=greatest[1] {
            for x in least[0]..=greatest[0] {
                plan.is_free[x - least[0] + 1 + (z - least[1] + 1) * side[0]] = is_free(x, z);
            }
        }
        plan
    }

    /// Returns the column of a cell.
    pub(crate) fn column(&self, cell: usize) -> [usize; 2] {
        let [x, z] = [cell % self.side[0], cell / self.side[0]];
        [x + self.first[0] - 1, z + self.first[1] - 1]
    }

    /// Returns the largest half-width, and the limbs whose half-width is at least `least`, narrow ones first.
    /// [Units: vx]
    pub(crate) fn limbs(
        &self,
        least: f64,
        rule: LimbRule,
        allowance: &Allowance,
    ) -> (f64, Vec<Limb>) {
        let LimbRule { thicker, is_net } = rule;
        let mut to_wall = self.distance_to(|c| !self.is_free[c]);
        // A cell center next to a wall is already half a cell away from it.
        let thickness = |c: usize| f64::from(to_wall[c]) - 0.5;
        let thickest = (0..to_wall.len()).map(thickness).fold(0.0, f64::max);
        // A mouth may be wide enough for a room and what is behind it a crevice.
        let to_room = self.distance_to(|c| thickness(c) >= least);
        let is_crevice = |c: usize| f64::from(to_room[c]) > least + 0.5;
        let mut rest = self.is_free.clone();
        let mut out = Vec::new();
        let mut half_width = least;
        // Each width computes distances and components over all cells.
        let work = 1 + self.is_free.len() as u64;
        while thicker * half_width <= thickest && allowance.spend(work) {
            let reach = thicker * half_width;
            let thickness = |c: usize| f64::from(to_wall[c]) - 0.5;
            let to_core = self.distance_to(|c| thickness(c) >= reach);
            // Rounded outward by half a cell, or a lining of single cells would be left along walls.
            let core =
                |(&to_core, &is_left): (&f32, &bool)| f64::from(to_core) <= reach + 0.5 && is_left;
            let is_core: Vec<bool> = to_core.iter().zip(&rest).map(core).collect();
            let narrow = self.components(|c| rest[c] && !is_core[c]).1;
            // Most widths have nothing narrow but the ends of rooms.
            let core = std::cell::OnceCell::new();
            let core = || &core.get_or_init(|| self.components(|c| is_core[c])).0[..];
            let mut found = Vec::new();
            for cells in narrow {
                let widest = cells.iter().map(|&c| thickness(c)).fold(0.0, f64::max);
                if widest < least || widest > half_width {
                    continue;
                }
                let roomy: Vec<usize> = cells.iter().copied().filter(|&c| !is_crevice(c)).collect();
                let work = self.is_free.len() as u64 / 16 + 5 * cells.len() as u64;
                if !allowance.spend(work) {
                    continue;
                }
                let length = self.length(&roomy, core(), is_net) / (2.0 * widest);
                if length >= LONG {
                    found.push(Limb {
                        cells,
                        half_width: widest,
                        length,
                    });
                }
            }
            for limb in &found {
                limb.cells.iter().for_each(|&c| rest[c] = false);
            }
            if is_net && !found.is_empty() {
                // A disc of the wider part reaches into each mouth.
                let to_limb = self.distance_to(|c| self.is_free[c] && !rest[c]);
                let is_mouth = |c: usize| f64::from(to_limb[c]) <= sagitta(thicker, half_width);
                to_wall = self.distance_to(|c| !rest[c] || is_mouth(c));
            }
            out.append(&mut found);
            half_width *= STEP;
        }
        (thickest, out)
    }

    /// Returns a cell about on the axis of a limb, away from where its list of cells begins.
    pub(crate) fn middle(&self, limb: &Limb) -> usize {
        let to_wall = self.distance_to(|c| !self.is_free[c]);
        let from_half = limb.cells.len() / 2..;
        let rest = limb.cells[from_half].iter().chain(&limb.cells).copied();
        let is_wide = |&c: &usize| f64::from(to_wall[c]) - 0.5 >= ON_AXIS * limb.half_width;
        rest.clone()
            .find(is_wide)
            .or(rest.clone().next())
            .unwrap_or(0)
    }

    /// Returns the cells of a limb, up to the line across each mouth: there a disc of the room reaches into the limb.
    pub(crate) fn up_to_mouths(&self, limb: &Limb) -> Vec<usize> {
        let sagitta = sagitta(THICKER, limb.half_width);
        let mut is_in = vec![false; self.is_free.len()];
        limb.cells.iter().for_each(|&c| is_in[c] = true);
        let to_limb = self.distance_to(|c| is_in[c]);
        let is_near = |&c: &usize| self.is_free[c] && f64::from(to_limb[c]) <= sagitta;
        (0..is_in.len()).filter(is_near).collect()
    }

    /// Returns the length of an area between the thicker parts `core`: from mouth to mouth, or to its end. 0 if
    /// it has no mouth, or more than one to the same part unless it `is_net`.
    fn length(&self, cells: &[usize], core: &[u32], is_net: bool) -> f64 {
        let mut steps: BTreeMap<usize, u32> = cells.iter().map(|&c| (c, u32::MAX)).collect();
        let mut front: Vec<usize> = Vec::new();
        let mut opens_to: Vec<u32> = Vec::new();
        for &c in cells {
            if let Some(part) = self.around(c).map(|d| core[d]).find(|&p| p != 0) {
                steps.insert(c, 0);
                front.push(c);
                opens_to.push(part);
            }
        }
        let mut is_mouth = vec![false; self.is_free.len()];
        front.iter().for_each(|&c| is_mouth[c] = true);
        // Mouths are wider than a step: diagonal and edge neighbors form one mouth.
        let n_mouths = self.count_patches(&front, &is_mouth);
        opens_to.sort_unstable();
        opens_to.dedup();
        if n_mouths == 0 || n_mouths > opens_to.len() && !is_net {
            return 0.0;
        }
        // Alternates steps by edges only and steps with diagonals: exact along the axes, short by a tenth at most
        // elsewhere, and never too long, so that an acute end of a room is never a limb.
        let mut far = 0;
        while !front.is_empty() {
            let mut next = Vec::new();
            for c in front {
                let n = if far % 2 == 0 { 4 } else { 8 };
                for d in self.neighbors(c).into_iter().take(n) {
                    if let Some(s) = steps.get_mut(&d)
                        && *s == u32::MAX
                    {
                        *s = far + 1;
                        next.push(d);
                    }
                }
            }
            far += u32::from(!next.is_empty());
            front = next;
        }
        // Between two mouths the farthest cell is half way.
        f64::from(far + 1) * if n_mouths > 1 { 2.0 } else { 1.0 }
    }

    /// Returns the number of patches of cells, connected by edges or diagonals.
    fn count_patches(&self, cells: &[usize], is_in: &[bool]) -> usize {
        let mut left = is_in.to_vec();
        let mut n = 0;
        for &start in cells {
            if !std::mem::replace(&mut left[start], false) {
                continue;
            }
            n += 1;
            let mut stack = vec![start];
            while let Some(c) = stack.pop() {
                for d in self.neighbors(c) {
                    if std::mem::replace(&mut left[d], false) {
                        stack.push(d);
                    }
                }
            }
        }
        n
    }

    /// Returns the neighbors of a cell that is not on the rim: four by edges, then four diagonal.
    fn neighbors(&self, c: usize) -> [usize; 8] {
        let (up, down) = (c + self.side[0], c - self.side[0]);
        let beside = [c - 1, c + 1, down, up];
        let diagonal = [down - 1, down + 1, up - 1, up + 1];
        let mut out = [0; 8];
        out[..4].copy_from_slice(&beside);
        out[4..].copy_from_slice(&diagonal);
        out
    }

    /// Returns the four neighbors by edges of a cell that is not on the rim.
    fn around(&self, c: usize) -> impl Iterator<Item = usize> + use<> {
        self.neighbors(c).into_iter().take(4)
    }

    /// Returns the components connected by edges: the number of each cell's component from 1 on, and their cells.
    fn components(&self, is_in: impl Fn(usize) -> bool) -> (Vec<u32>, Vec<Vec<usize>>) {
        let mut part = vec![0_u32; self.is_free.len()];
        let mut parts = Vec::new();
        for start in 0..part.len() {
            if part[start] != 0 || !is_in(start) {
                continue;
            }
            let number = parts.len() as u32 + 1;
            part[start] = number;
            let mut cells = vec![start];
            let mut at = 0;
            while at < cells.len() {
                for d in self.around(cells[at]) {
                    if part[d] == 0 && is_in(d) {
                        part[d] = number;
                        cells.push(d);
                    }
                }
                at += 1;
            }
            parts.push(cells);
        }
        (part, parts)
    }

    /// Returns the distance of each cell to the nearest for which `is_there` holds. [Units: vx]
    fn distance_to(&self, is_there: impl Fn(usize) -> bool + Sync) -> Vec<f32> {
        let [nx, nz] = self.side;
        distance(&BitVolume::from_fn([nx, 1, nz], is_there))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a plan of boxes, given as minimum and maximum (exclusive); 10 cells to the meter.
    fn plan(boxes: &[[usize; 4]]) -> Plan {
        let side = [400, 200];
        let mut is_free = vec![false; side[0] * side[1]];
        for &[x0, z0, x1, z1] in boxes {
            for z in z0..z1 {
                is_free[z * side[0] + x0..z * side[0] + x1].fill(true);
            }
        }
        Plan {
            row: 0,
            first: [1, 1],
            side,
            is_free,
        }
    }

    /// Lowest and highest x of each limb.
    fn spans(plan: &Plan) -> Vec<[usize; 2]> {
        let (_, limbs) = plan.limbs(3.0, LimbRule::ROOMS, &Allowance::default());
        let span = |l: &Limb| {
            let x = || l.cells.iter().map(|c| c % plan.side[0]);
            [x().min().unwrap(), x().max().unwrap()]
        };
        limbs.iter().map(span).collect()
    }

    #[test]
    fn a_corridor_between_rooms_is_a_limb_and_an_alcove_is_none() {
        for half in [4, 6, 8] {
            let corridor = [70, 100 - half, 270, 100 + half];
            let rooms = [[10, 70, 70, 130], [270, 70, 330, 130]];
            let found = spans(&plan(&[rooms[0], rooms[1], corridor]));
            assert_eq!(found.len(), 1, "{half}");
            let [lo, hi] = found[0];
            assert!(lo.abs_diff(70) <= 4 && hi.abs_diff(269) <= 4, "{lo} {hi}");
            // Dead ends: three widths long, one, and two.
            let dead = [70, 100 - half, 70 + 6 * half, 100 + half];
            assert_eq!(spans(&plan(&[rooms[0], dead])).len(), 1);
            let alcove = [70, 100 - half, 70 + 2 * half, 100 + half];
            assert!(spans(&plan(&[rooms[0], alcove])).is_empty());
            let arm = [70, 100 - half, 70 + 4 * half, 100 + half];
            assert!(spans(&plan(&[rooms[0], arm])).is_empty(), "{half}");
        }
    }

    #[test]
    fn a_crevice_behind_a_wider_mouth_is_no_limb() {
        // Behind a lining of one cell: a mouth of 5 cells in front of the gap.
        let behind = |gap: usize| {
            let room = [10, 10, 50, 46];
            spans(&plan(&[room, [44, 46, 49, 47], [10, 47, 50, 47 + gap]])).len()
        };
        assert_eq!([4, 7].map(behind), [0, 1]);
    }

    #[test]
    fn corners_of_rooms_are_no_limbs_whatever_their_angle() {
        for slope in [0.3, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0] {
            let mut p = plan(&[]);
            for x in 10..150 {
                let height = (f64::from(x as u32 - 10) * slope) as usize;
                for z in 10..10 + height.min(150) {
                    p.is_free[z * p.side[0] + x] = true;
                }
            }
            assert!(spans(&p).is_empty(), "{slope}: {:?}", spans(&p));
        }
    }

    #[test]
    fn corridors_that_cross_are_one_limb() {
        let found = spans(&plan(&[
            [10, 70, 70, 130],
            [270, 70, 330, 130],
            [70, 92, 270, 108],
            [160, 20, 176, 180],
        ]));
        assert_eq!(found.len(), 1);
    }

    #[test]
    fn what_is_half_as_wide_as_its_room_or_wider_is_none() {
        assert!(spans(&plan(&[[10, 70, 70, 130], [70, 82, 270, 118]])).is_empty());
    }

    #[test]
    fn the_way_around_what_stands_free_is_none() {
        // A room of 12 m by 10 m with a partition 1 m from its wall.
        let mut p = plan(&[[10, 50, 130, 150]]);
        for x in 40..100 {
            for z in 60..62 {
                p.is_free[z * p.side[0] + x] = false;
            }
        }
        assert!(spans(&p).is_empty());
    }
}
