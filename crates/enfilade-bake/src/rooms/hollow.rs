//! Separates rooms from matter: the insides of walls and of closed solids.
//!
//! The hollow between the two faces of a wall is as empty as a room, and so is the inside of a block,
//! a column or a piece of furniture. Two properties identify matter: nothing can get in, and the
//! surfaces around it face away. Regions connected with the outdoors through openings are always air.
//!
//! The facing of surfaces is sampled along rays, as for a winding number (Jacobson, Kavan &
//! Sorkine-Hornung, "Robust Inside-Outside Segmentation using Generalized Winding Numbers", 2013), but
//! one ray at a time: a ray from matter leaves one solid more than it enters, wherever solids overlap
//! or stand on a sheet of land. A ray from a room never does, because it enters a wall first. A
//! sum over the whole sphere would be a meaningless fraction in a scene with open sheets.
//!
//! Not every model allows this test. The known air (regions open to the outdoors, or else the
//! outdoors) decides. If it sees fronts, surfaces are trusted; if it sees backs, they are turned; if it sees some of
//! each, only connections count: a closed-off region is matter if a single sheet separates it from its
//! surroundings, and a room if walls do, or if fronts face it from all sides (as in a vessel or a level modelled from
//! inside), or if it lies between other spaces ([`super::beside`]). Air that opens outdoors is matter only where it is
//! the inside of a piece of wall without an end.
//!
//! A scene that consists only of such a shell is a building, not a boulder: kept, with a note.
//!
//! Cost: 14 rays from up to 32 points of each region, each through everything that it hits.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use enfilade_cpg::{Fact, Reason, Why};
use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Sets};
use rayon::prelude::*;

use crate::budget::WORK_A_LOOK;
use crate::voxel::{Grid, Labels};

use super::beside::{Beside, Known, SheetTree, beside, between};
use super::regions::{CloseJoin, Regions};
use super::slabs::LAYERS;
use crate::judge::{EnclosedFacts, Facing, NARROW, is_hollow_piece, why_open};
use crate::proposal::FoundPlace;
use crate::structure::{OUTDOORS, POINTS, rays_from};

/// Two surfaces nearer than this are the two faces of a wall. [Units: wu]
const WALL: f64 = 0.5;
/// … and nearer than this are one duplicated sheet. [Units: wu]
const TWICE: f64 = 0.01;
/// Surfaces nearer than this along a ray are at the same place, up to rounding. [Units: wu]
const SAME: f64 = 1e-5;
/// If shells bound this share of all structure, the scene consists of them.
const ALL_THERE_IS: f64 = 0.9;

/// The regions that are not rooms.
#[derive(Clone, Debug, Default)]
pub(crate) struct Matter {
    /// Regions, ascending: solid matter, and closed-off spaces in which no ball of the least radius
    /// fits (bays between rafters, gaps in the construction). Parts of the latter that leak into a room
    /// still become part of that room: the cell complex sees to it.
    pub(crate) regions: Vec<u32>,
    /// Doubtful decisions, one sentence each.
    pub(crate) notes: Vec<String>,
    /// Why closed regions are rooms, ascending by region.
    pub(crate) whys: Vec<(u32, Why)>,
    /// Spaces as large as a room that are not rooms, in the axes of the grid.
    pub(crate) spaces: Vec<FoundPlace>,
    /// Surfaces show their fronts to air and their backs to matter.
    pub(crate) fronts_face_air: bool,
}

/// Returns `true` if a person fits in a space, given the radius of its largest ball and its volume.
fn is_room_sized(radius: f64, volume: f64) -> bool {
    radius >= NARROW && volume >= CloseJoin::LEAST_VOLUME
}

/// Regions connected by openings, none to the outdoors.
struct Closed {
    /// Ascending.
    regions: Vec<u32>,
    facts: EnclosedFacts,
    n_voxels: usize,
}

/// Returns the mean share of backs that regions of these sizes see: a hundred hollow pieces of wall are less air than three
/// halls. `None` if they see nothing.
fn mean_backs<'s>(regions: impl Iterator<Item = (&'s Seen, usize)>) -> Option<f64> {
    let seen = regions.filter(|r| r.0.all > 0.0);
    let (backs, all) = seen.fold((0.0, 0.0), |(backs, all), (seen, size)| {
        (backs + size as f64 * seen.backs(), all + size as f64)
    });
    (all > 0.0).then(|| backs / all)
}

/// Returns `true` if a scene in which nothing is open makes more sense with its surfaces turned: its rooms are larger then, and
/// more of them open to each other, as rooms do and solids do not.
fn are_inside_out(closed: &[Closed], min_radius: f64) -> bool {
    let rooms = |facing| {
        let is_room = |c: &&Closed| c.facts.why(facing, min_radius).reason == Reason::Enclosed;
        let rooms = closed.iter().filter(is_room);
        rooms.fold((0, 0), |(n_joined, n_voxels), c| {
            (n_joined + c.regions.len() - 1, n_voxels + c.n_voxels)
        })
    };
    let (own, turned) = (rooms(Facing::Outward), rooms(Facing::Inward));
    turned.0 > own.0 && turned.1 > own.1
}

/// Finds the regions that are not rooms; the largest ball in a room has at least the radius `min_radius`.
#[must_use]
pub(crate) fn find_matter(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    peaks: &[f32],
    bvh: &Bvh,
    min_radius: f64,
    allowance: &Allowance,
) -> Matter {
    let radius = radii(regions, peaks);
    let (open, enclosed): (Vec<_>, Vec<_>) =
        groups(regions).into_iter().partition(|g| g[0] == OUTDOORS);
    let mut open: Vec<u32> = open.into_iter().flatten().collect();
    open.sort_unstable();
    let wanted: Vec<u32> = enclosed.iter().flatten().chain(&open).copied().collect();
    let RegionSamples { points, n_voxels } = sample_points(grid, labels, regions, &wanted);
    let size = |region: &u32| n_voxels.get(region).copied().unwrap_or(0);
    let n_voxels = |of: &[u32]| of.iter().map(size).sum::<usize>();
    let seen = seen_from(&points, &open, bvh, allowance);
    let view = |group: &[u32]| {
        let of = group.iter().filter_map(|r| seen.get(r));
        of.fold(Seen::default(), Seen::and)
    };
    // A voxel center next to a wall is at least half a voxel away from it.
    let widest_of = |r: &u32| (f64::from(radius[r]) - 0.5).max(0.0) * grid.voxel;
    let closed_of = |mut regions: Vec<u32>| {
        regions.sort_unstable();
        let widest = regions.iter().map(widest_of).fold(0.0, f64::max);
        Closed {
            facts: view(&regions).facts(widest),
            n_voxels: n_voxels(&regions),
            regions,
        }
    };
    let mut closed: Vec<Closed> = enclosed.into_iter().map(closed_of).collect();
    let indoors: Vec<u32> = open.iter().copied().filter(|&r| r != OUTDOORS).collect();
    let seen_indoors = indoors.iter().filter_map(|r| Some((seen.get(r)?, size(r))));
    let mut facing = Facing::of(mean_backs(seen_indoors), view(&[OUTDOORS]).backs());
    if indoors.is_empty() && facing == Facing::Outward && are_inside_out(&closed, min_radius) {
        facing = Facing::Inward;
    }
    let is_hollow = |r: &u32| {
        let seen = seen.get(r);
        seen.is_some_and(|s| is_hollow_piece(facing, widest_of(r), s.backs()))
    };
    let (mut narrow, indoors): (Vec<u32>, Vec<u32>) = indoors.into_iter().partition(is_hollow);
    let n_pieces = narrow.len();
    if facing == Facing::Anyhow {
        let sheets = SheetTree::of(bvh);
        let walks = |group: &[u32]| {
            let points = group.iter().filter_map(|r| points.get(r)).flatten();
            beside(grid, labels, &sheets, regions, group, points, allowance)
        };
        weigh_between(&mut closed, walks, &open, min_radius);
    }

    let (mut doubtful, mut whys, mut spaces) = (Vec::new(), Vec::new(), Vec::new());
    let mut any_room = !indoors.is_empty();
    for c in closed {
        let why = c.facts.why(facing, min_radius);
        let volume = c.n_voxels as f64 * grid.voxel.powi(3);
        if why.reason != Reason::Enclosed && is_room_sized(c.facts.radius, volume) {
            let inside = points.get(&c.regions[0]).and_then(|of| of.first());
            spaces.extend(inside.map(|&at| FoundPlace {
                at,
                why: why.clone().with(&[(Fact::Volume, volume)]),
            }));
        }
        match why.reason {
            Reason::Crevice => narrow.extend(c.regions),
            Reason::Solid => doubtful.push(c.regions),
            _ => {
                any_room = true;
                whys.extend(c.regions.into_iter().map(|region| (region, why.clone())));
            }
        }
    }
    if facing == Facing::Outward {
        let why = |r: &u32| Some((*r, why_open(seen.get(r)?.backs())));
        whys.extend(indoors.iter().filter_map(why));
    }
    let mut matter = Matter {
        regions: narrow,
        notes: Vec::new(),
        whys,
        spaces,
        fronts_face_air: facing == Facing::Outward,
    };
    if n_pieces > 0 {
        matter.notes.push(note_on_pieces(n_pieces));
    }
    // The evidence that surfaces face inward must hold more voxels than would be lost by it: beside a cave it may be a
    // crevice of the outside.
    let lost: usize = doubtful.iter().map(|group| n_voxels(group)).sum();
    let is_known = facing == Facing::Inward && !indoors.is_empty();
    let are_shells = is_known && lost > n_voxels(&indoors)
        || !any_room && are_all_there_is(grid, labels, regions, &doubtful, facing, allowance);
    matter.add_solids(doubtful, are_shells, facing);
    matter
}

impl Matter {
    /// Adds closed groups that look like the insides of solids, or `are_shells`, which are rooms.
    fn add_solids(&mut self, solids: Vec<Vec<u32>>, are_shells: bool, facing: Facing) {
        let n = solids.len();
        let regions = solids.into_iter().flatten();
        if n == 0 {
        } else if are_shells {
            self.notes.push(note_on_shells(n));
            self.spaces.retain(|s| s.why.reason != Reason::Solid);
            let shell = |region| (region, Why::given(Reason::Shell));
            self.whys.extend(regions.map(shell));
        } else {
            self.notes.push(note_on_solids(n, facing));
            self.regions.extend(regions);
        }
        self.whys.sort_unstable_by_key(|w| w.0);
        self.regions.sort_unstable();
    }
}

/// Looks around from points of regions, of which some are `open` to the outdoors.
fn seen_from(
    points: &BTreeMap<u32, Vec<DVec3>>,
    open: &[u32],
    bvh: &Bvh,
    allowance: &Allowance,
) -> BTreeMap<u32, Seen> {
    // First hits are enough of air that is open to the outdoors.
    let rays = |region: u32| match open.binary_search(&region) {
        Ok(_) => Rays::First,
        Err(_) => Rays::All,
    };
    let look =
        |(&region, at): (&u32, &Vec<DVec3>)| (region, Seen::from(bvh, at, rays(region), allowance));
    let seen: Vec<(u32, Seen)> = points.par_iter().map(look).collect();
    seen.into_iter().collect()
}

/// Weighs which of the closed groups lie between spaces, given the regions beside each, and the regions that are open.
fn weigh_between(
    closed: &mut [Closed],
    beside: impl Fn(&[u32]) -> Beside + Sync,
    open: &[u32],
    min_radius: f64,
) {
    let beside: Vec<Beside> = closed.par_iter().map(|c| beside(&c.regions)).collect();
    let is_room = |c: &&Closed| c.facts.why(Facing::Anyhow, min_radius).reason == Reason::Enclosed;
    let rooms = closed.iter().filter(is_room).flat_map(|c| &c.regions);
    let sized = closed.iter().filter(|c| c.facts.radius >= NARROW);
    let known = Known {
        air: open.iter().chain(rooms).copied().collect(),
        sized: sized.flat_map(|c| &c.regions).copied().collect(),
    };
    let groups = closed.iter().map(|c| &c.regions[..]).zip(&beside);
    let between = between(&groups.collect::<Vec<_>>(), known);
    for (c, between) in closed.iter_mut().zip(between) {
        c.facts.between = between;
    }
}

/// Returns the radius of the largest ball in each region. [Units: vx]
fn radii(regions: &Regions, peaks: &[f32]) -> BTreeMap<u32, f32> {
    let mut radius: BTreeMap<u32, f32> = BTreeMap::new();
    for (&region, &peak) in regions.region_of_basin.iter().zip(peaks) {
        let r = radius.entry(region).or_insert(0.0);
        *r = r.max(peak);
    }
    radius
}

fn note_on_shells(n: usize) -> String {
    let (s, are) = if n == 1 { ("", "is") } else { ("s", "are") };
    format!(
        "{n} closed shell{s} without openings {are} the whole scene: treated as rooms, not as solids"
    )
}

fn note_on_pieces(n: usize) -> String {
    match n {
        1 => "the inside of a hollow piece of wall, open at an end, is not a room".to_owned(),
        _ => format!("the insides of {n} hollow pieces of wall, open at an end, are not rooms"),
    }
}

fn note_on_solids(n: usize, facing: Facing) -> String {
    let (s, are) = match n {
        1 => ("", "is not a room"),
        _ => ("s", "are not rooms"),
    };
    format!(
        "the inside{s} of {n} closed solid{s} {are}{}",
        by_facing(facing)
    )
}

/// Returns the reason for which solids are told, where surfaces do not face outward.
fn by_facing(facing: Facing) -> &'static str {
    match facing {
        Facing::Outward => "",
        Facing::Inward => " (the surfaces of this model face into solid matter)",
        Facing::Anyhow => {
            " (the surfaces of this model face either way; these have no openings, and only a single sheet bounds them)"
        }
    }
}

/// Hits of a ray that are looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rays {
    /// All that it passes, as if surfaces were glass.
    All,
    /// Those at the first place where it hits anything: much cheaper in a large building.
    First,
}

/// The hits of rays from inside a region.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// Rays that hit anything.
    all: f64,
    /// … a back first.
    back: f64,
    /// … and a second surface right behind the first.
    walled: f64,
    /// Rays that hit anything and do not go down: an object that stands on a sheet of land, or is sunk into
    /// it, has a floor like a room's.
    aside: f64,
    /// … a back first.
    back_aside: f64,
    /// … and leave one solid more than they enter, if surfaces face outward, and if inward.
    leaving: [f64; 2],
}

impl Seen {
    fn from(bvh: &Bvh, points: &[DVec3], rays: Rays, allowance: &Allowance) -> Self {
        let mut seen = Self::default();
        let mut hits: Vec<(f64, bool)> = Vec::new();
        for mut ray in rays_from(points) {
            hits.clear();
            if rays == Rays::First {
                let Some(hit) = bvh.closest_hit(&ray, |_| false) else {
                    continue;
                };
                ray.t_max = hit.t;
            }
            bvh.for_each_hit(&ray, |hit| hits.push((hit.t, hit.front)));
            if !allowance.spend(WORK_A_LOOK + hits.len() as u64) {
                break;
            }
            // At one place a back counts as first: where two solids touch, the ray leaves one before it
            // enters the other.
            hits.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            seen.add(&hits, ray.direction.y > -0.5);
        }
        seen
    }

    /// Adds a ray. One unit of its parameter is about 1 wu along one axis or along all, so the parameter
    /// is the distance across walls along the grid.
    fn add(&mut self, hits: &[(f64, bool)], goes_aside: bool) {
        let Some(&(at, is_front)) = hits.first() else {
            return;
        };
        let one = |is: bool| f64::from(u8::from(is));
        self.all += 1.0;
        self.back += one(!is_front);
        let next = hits.iter().map(|h| h.0 - at).find(|&d| d > TWICE);
        self.walled += one(next.is_some_and(|d| d < WALL));
        if !goes_aside {
            return;
        }
        self.aside += 1.0;
        self.back_aside += one(!is_front);
        let (mut left, mut least, mut most) = (0, 0, 0);
        for sheet in hits.chunk_by(|a, b| b.0 - a.0 < SAME) {
            left += sheet.iter().map(|h| if h.1 { -1 } else { 1 }).sum::<i32>();
            (least, most) = (least.min(left), most.max(left));
        }
        self.leaving[0] += one(most > 0);
        self.leaving[1] += one(least < 0);
    }

    fn and(mut self, other: &Self) -> Self {
        self.all += other.all;
        self.back += other.back;
        self.walled += other.walled;
        self.aside += other.aside;
        self.back_aside += other.back_aside;
        self.leaving[0] += other.leaving[0];
        self.leaving[1] += other.leaving[1];
        self
    }

    /// Returns the share of backs among the hits.
    fn backs(&self) -> f64 {
        self.back / self.all.max(1.0)
    }

    /// Returns the facts of a closed space in which the largest ball has this radius. [Units: wu]
    fn facts(&self, radius: f64) -> EnclosedFacts {
        let of_aside = |n: f64| n / self.aside.max(1.0);
        EnclosedFacts {
            radius,
            backs: self.backs(),
            walled: self.walled / self.all.max(1.0),
            backs_aside: of_aside(self.back_aside),
            leaving: self.leaving.map(of_aside),
            between: 0.0,
        }
    }
}

/// Returns `true` if closed shells are the whole scene: they bound nearly all structure, and if surfaces
/// face outward, the shells are connected (a group of blocks is not a building).
fn are_all_there_is(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    shells: &[Vec<u32>],
    facing: Facing,
    allowance: &Allowance,
) -> bool {
    let members: BTreeSet<u32> = shells.iter().flatten().copied().collect();
    let region_of = |label: u32| regions.region_of_basin[label as usize];
    let is_inside = |at: [usize; 3]| members.contains(&region_of(labels.at(at)));
    // Surfaces are at most three voxels thick.
    const REACH: usize = 3;
    let near = |at: [usize; 3]| {
        (0..3).any(|k| {
            let from = at[k].saturating_sub(REACH);
            let to = grid.dims[k].min(at[k] + REACH + 1);
            (from..to).any(|c| is_inside(std::array::from_fn(|a| if a == k { c } else { at[a] })))
        })
    };
    let mut bounds: BTreeMap<u32, Aabb> = BTreeMap::new();
    let (mut n_solid, mut n_bounding) = (0_usize, 0_usize);
    labels.for_runs(0..labels.len(), |run, label| {
        let [x, y, z] = grid.coords(run.start);
        let along = x..x + run.len();
        if label == 0 {
            n_solid += run.len();
            let solid = along.filter(allowance.each(1));
            n_bounding += solid.filter(|&x| near([x, y, z])).count();
        } else if members.contains(&region_of(label)) {
            let b = bounds.entry(region_of(label)).or_insert(Aabb::EMPTY);
            for x in [along.start, along.end - 1] {
                *b = b.including(grid.center(x, y, z));
            }
        }
    });
    if (n_bounding as f64) < ALL_THERE_IS * n_solid as f64 {
        return false;
    }
    if facing != Facing::Outward {
        return true;
    }
    let boxes: Vec<Aabb> = bounds.into_values().collect();
    let mut sets = Sets::new(boxes.len());
    for i in 0..boxes.len() {
        if !allowance.spend(1 + i as u64 / 32) {
            return false;
        }
        for j in 0..i {
            if boxes[i].expanded(WALL).overlaps(&boxes[j]) {
                sets.join(i as u32, j as u32);
            }
        }
    }
    (1..boxes.len() as u32).all(|i| sets.find(i) == sets.find(0))
}

/// Returns groups of regions connected by openings, over any number of openings; the group of the outdoors
/// begins with it.
fn groups(regions: &Regions) -> Vec<Vec<u32>> {
    let n = regions.region_of_basin.len();
    let mut sets = Sets::new(n);
    for &(a, b) in regions.contacts.keys() {
        sets.join(a, b);
    }
    let mut groups: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut seen = vec![false; n];
    for &region in &regions.region_of_basin {
        if region != 0 && !std::mem::replace(&mut seen[region as usize], true) {
            groups.entry(sets.find(region)).or_default().push(region);
        }
    }
    groups.into_values().collect()
}

/// Points of regions, and their sizes.
struct RegionSamples {
    points: BTreeMap<u32, Vec<DVec3>>,
    n_voxels: BTreeMap<u32, usize>,
}

/// Returns up to [`POINTS`] voxel centers of each wanted region, evenly picked in scan order.
fn sample_points(grid: &Grid, labels: &Labels, regions: &Regions, wanted: &[u32]) -> RegionSamples {
    let mut is_wanted = vec![false; regions.region_of_basin.len()];
    for &r in wanted {
        is_wanted[r as usize] = true;
    }
    let region_of = |label: u32| regions.region_of_basin[label as usize];
    let layer = grid.dims[0] * grid.dims[1];
    let slabs: Vec<Range<usize>> = (0..grid.dims[2])
        .step_by(LAYERS)
        .map(|z| z * layer..(z + LAYERS).min(grid.dims[2]) * layer)
        .collect();
    let count = |slab: &Range<usize>| {
        let mut count: BTreeMap<u32, usize> = BTreeMap::new();
        labels.for_runs(slab.clone(), |voxels, label| {
            if is_wanted[region_of(label) as usize] {
                *count.entry(region_of(label)).or_default() += voxels.len();
            }
        });
        count
    };
    let counts: Vec<BTreeMap<u32, usize>> = slabs.par_iter().map(count).collect();
    let mut total: BTreeMap<u32, usize> = BTreeMap::new();
    // Numbers of voxels in the slabs before.
    let before = |count: BTreeMap<u32, usize>| {
        let mut add = |(region, n): (u32, usize)| {
            let sum = total.entry(region).or_default();
            *sum += n;
            (region, *sum - n)
        };
        count.into_iter().map(&mut add).collect()
    };
    let before: Vec<BTreeMap<u32, usize>> = counts.into_iter().map(before).collect();
    let sample = |(slab, mut seen): (&Range<usize>, BTreeMap<u32, usize>)| {
        let mut points: Vec<(u32, DVec3)> = Vec::new();
        labels.for_runs(slab.clone(), |voxels, label| {
            let region = region_of(label);
            let Some(k) = seen.get_mut(&region) else {
                return;
            };
            // Every `step`-th of the region's voxels, from the middle of the first `step`.
            let step = total[&region].div_ceil(POINTS);
            let first = (step / 2 + step - *k % step) % step;
            for i in voxels.clone().skip(first).step_by(step) {
                let [x, y, z] = grid.coords(i);
                points.push((region, grid.center(x, y, z)));
            }
            *k += voxels.len();
        });
        points
    };
    let sampled: Vec<Vec<(u32, DVec3)>> = slabs.par_iter().zip(before).map(sample).collect();
    let mut points: BTreeMap<u32, Vec<DVec3>> = BTreeMap::new();
    for (region, point) in sampled.into_iter().flatten() {
        points.entry(region).or_default().push(point);
    }
    RegionSamples {
        points,
        n_voxels: total,
    }
}
