//! Branches: tubes that leave a wider place without a pinch.
//!
//! What decimation weighs is a pinch, and a tube that leaves a trunk has none: every ball of the tube
//! passes its mouth. What tells the two apart is that the trunk's balls do not get in. A room's trunk is
//! what a ball [`NARROWS`] times narrower than its largest reaches, a morphological opening; what is left
//! is opened in turn from the largest ball that is left, and so on, which gives limbs from wide to
//! narrow. A limb is a branch if
//!
//! - it has one mouth: what has two is a neck between chambers, or a ring;
//! - no opening leads from it to a room that is wider than its mouth, for the same reason;
//! - its mouth is no longer than wide by much, so that it is no slit under a bed, along a wall or in a corner;
//! - it is [`DEEP`] times as deep as its mouth is wide, so that it is no alcove, nor a taper: balls much narrower than the
//!   mouth do not count;
//! - it narrows [`NARROWS`] times near the mouth, so that it is no tube that tapers.
//!
//! Outdoors is a room, too, and what branches off it is a room: a tube that is open at its ends, a tunnel, a garage, a living
//! room with its terrace door open. There may be several mouths, none a slit, and doors to rooms; depth is what it holds: as much
//! as [`DEEP`] diameters of each mouth.
//!
//! All else is part of what it opens to most. Pockets between rough walls and the balls of a room pass, too; they hold
//! less than a ball, and decimation takes them for the spikes that they are. Where a trunk parts into arms as wide as itself
//! no ball tells them apart; [`forks`] does. Nothing here has a unit.
//!
//! Opening by balls from wide to narrow: Matheron, "Random sets and integral geometry" (1975), on size
//! distributions. The rest is ours. The bounds stand between what was measured: vessels and generated tubes on one
//! side; eaves, niches, beds, window reveals and cave walls of a dozen scenes on the other.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, VecDeque};
use std::f64::consts::PI;

use enfilade_geom::{Aabb, Bvh, DVec3, Triangle};

use super::balls::circumsphere;
use super::decimate::OUTDOOR_CELL;
use super::space::{Space, connected};
use forks::Walls;

mod forks;

/// Largest ball of the trunk near the mouth ÷ largest ball well inside the branch, at least. What narrows this
/// much at a pinch is two rooms.
const NARROWS: f64 = 1.5;
/// Depth of a branch, from its mouth to its far end, ÷ diameter of its mouth, at least. Alcoves are about as deep
/// as wide.
const DEEP: f64 = 2.0;
/// Root of the mean square distance of the mouth's facets from its middle ÷ radius of its ball, at most: a disk has
/// 0.7, a rectangle of 1 : 2 has 1.3, and what runs all around a bed has 2.5 and more.
const SPREAD: f64 = 1.5;
/// The mouth lies where balls of this many times the branch's own no longer pass. Balls of one tube differ by as
/// much, depending on where points are.
const FLARES: f64 = 1.05;

const NONE: u32 = u32::MAX;

/// Which parts lie in branches.
pub(super) struct Branches {
    /// Branch of each part; 0 for none.
    pub(super) label_of_part: Vec<u32>,
    /// Of each branch, from label 1 on.
    mouths: Vec<Found>,
}

/// What is known of a branch.
#[derive(Clone, Copy)]
struct Found {
    /// How many times wider the trunk is.
    weight: f64,
    /// Of the branch's largest ball well inside. [Units: wu]
    radius: f64,
}

impl Branches {
    /// No branch among so many parts.
    pub(super) fn none(n_parts: usize) -> Self {
        Self {
            label_of_part: vec![0; n_parts],
            mouths: Vec::new(),
        }
    }

    /// Moves mouths off cells of [`flow_together`](super::decimate::flow_together) of which they leave less than a ball: what is
    /// left goes with the most of its cell.
    pub(super) fn without_leftovers(mut self, space: &Space, cell_of_part: &[u32]) -> Self {
        let mut pieces: BTreeMap<(u32, u32), (f64, f64)> = BTreeMap::new();
        for (t, (&cell, &label)) in cell_of_part.iter().zip(&self.label_of_part).enumerate() {
            let (volume, radius) = pieces.entry((cell, label)).or_default();
            *volume += space.volumes[t];
            *radius = radius.max(space.radii[t]);
        }
        let mut most: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
        for (&(cell, label), &(volume, _)) in &pieces {
            let of_cell = most.entry(cell).or_insert((volume, label));
            if volume > of_cell.0 {
                *of_cell = (volume, label);
            }
        }
        for (label, cell) in self.label_of_part.iter_mut().zip(cell_of_part) {
            let (volume, radius) = pieces[&(*cell, *label)];
            if volume < 4.0 / 3.0 * PI * radius.powi(3) {
                *label = most[cell].1;
            }
        }
        self
    }

    pub(super) fn is_empty(&self) -> bool {
        self.mouths.is_empty()
    }

    /// What an opening between two parts weighs as a mouth, by their labels: the narrower branch ends there. 0 within
    /// a branch and where there is none.
    pub(super) fn weight(&self, [a, b]: [u32; 2]) -> f64 {
        if a == b {
            return 0.0;
        }
        let found = [a, b].into_iter().filter(|&l| l > 0);
        let found = found.map(|l| self.mouths[l as usize - 1]);
        found
            .min_by(|p, q| p.radius.total_cmp(&q.radius))
            .map_or(0.0, |f| f.weight)
    }
}

/// Finds the branches of rooms, given by the room of each part.
///
/// `O(n log n)` in parts, and what the parts of trunks times their candidates are.
pub(super) fn find_branches(
    space: &Space,
    room_of_part: &[u32],
    walls: &[Triangle],
    bvh: &Bvh,
) -> Branches {
    let mut search = Search::new(space, room_of_part);
    let order = search.by_radius(0..space.radii.len() as u32);
    // The first limb of a room is its trunk.
    let mut rooms = BTreeSet::new();
    let (mut candidates, mut seeds) = (Vec::new(), Vec::new());
    for b in order {
        if search.owner[b as usize] != NONE {
            continue;
        }
        let limb = search.limb(b);
        let is_trunk = rooms.insert(room_of_part[b as usize]);
        if is_trunk || search.is_long(limb) {
            seeds.extend(&search.regions[limb as usize].parts);
        } else {
            search.dissolve(limb);
            continue;
        }
        if !is_trunk {
            candidates.push(limb);
        }
    }
    search.flood(&seeds);
    // Narrow ones first: what is no branch is part of a wider one, which may be.
    for limb in candidates.into_iter().rev() {
        for limb in search.without_flare(limb) {
            match search.judged(limb) {
                Ok(found) => search.regions[limb as usize].branch = Some(found),
                Err(Some(parent)) => search.merge(limb, parent),
                Err(None) => {}
            }
        }
    }
    search.part_forks(&Walls {
        triangles: walls,
        bvh,
    });
    search.finished()
}

/// A connected set of parts.
struct Region {
    parts: Vec<u32>,
    /// Of its largest ball. [Units: wu]
    radius: f64,
    /// Once it is known to be one.
    branch: Option<Found>,
}

/// A way out of a region within its room.
struct Mouth {
    /// The region it leads to.
    parent: u32,
    /// Of the widest ball that passes. [Units: wu]
    radius: f64,
    /// [Units: wu]
    center: DVec3,
    /// Area of its shadow, straight ahead. [Units: wu²]
    area: f64,
    /// Root of the mean square distance of its facets from the middle. [Units: wu]
    spread: f64,
    /// Links of the patch around the widest one.
    links: Vec<u32>,
}

impl Mouth {
    fn is_slit(&self) -> bool {
        self.spread > SPREAD * self.radius
    }

    /// Radius of the disk that goes through: where little of an opening's edge leads elsewhere, that is less than its ball's.
    /// [Units: wu]
    fn disk(&self) -> f64 {
        self.radius.min((self.area / PI).sqrt())
    }

    /// Much narrower than another.
    fn is_chink_beside(&self, other: &Self) -> bool {
        self.disk() * NARROWS < other.radius
    }
}

struct Search<'a> {
    space: &'a Space,
    room_of_part: &'a [u32],
    /// Radius of the largest ball of each room. [Units: wu]
    radius_of_room: BTreeMap<u32, f64>,
    /// Where the links of each part begin in `around`.
    starts: Vec<u32>,
    /// Part and link: the ways from each part to others of its room.
    around: Vec<(u32, u32)>,
    /// Links that leave a room, by part.
    exits: BTreeMap<u32, Vec<u32>>,
    /// Middles of the parts' balls. [Units: wu]
    centers: Vec<DVec3>,
    /// What stands for the radius of balls without an end. [Units: wu]
    most: f64,
    /// Region of each part.
    owner: Vec<u32>,
    regions: Vec<Region>,
}

impl<'a> Search<'a> {
    fn new(space: &'a Space, room_of_part: &'a [u32]) -> Self {
        let n = space.radii.len();
        let mut radius_of_room: BTreeMap<u32, f64> = BTreeMap::new();
        for (t, &room) in room_of_part.iter().enumerate() {
            let r = radius_of_room.entry(room).or_insert(0.0);
            *r = r.max(space.radii[t]);
        }
        let rooms = |parts: [u32; 2]| parts.map(|t| room_of_part[t as usize]);
        let mut starts = vec![0; n + 1];
        let mut exits: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (l, link) in space.links.iter().enumerate() {
            let [a, b] = rooms(link.parts);
            for t in link.parts {
                if a == b {
                    starts[t as usize + 1] += 1;
                } else {
                    exits.entry(t).or_default().push(l as u32);
                }
            }
        }
        for t in 0..n {
            starts[t + 1] += starts[t];
        }
        let mut next = starts.clone();
        let mut around = vec![(0, 0); starts[n] as usize];
        for (l, link) in space.links.iter().enumerate() {
            let [p, q] = rooms(link.parts);
            if p == q {
                let [a, b] = link.parts;
                for (t, other) in [(a, b), (b, a)] {
                    around[next[t as usize] as usize] = (other, l as u32);
                    next[t as usize] += 1;
                }
            }
        }
        let center = |t: u32| {
            let radius = space.radii[t as usize];
            if radius > 0.0 && radius.is_finite() {
                circumsphere(space.corners(t)).0
            } else {
                space.middles[t as usize]
            }
        };
        let bounds = Aabb::of_points(&space.delaunay.vertices);
        Self {
            most: bounds.size().max_element(),
            space,
            room_of_part,
            radius_of_room,
            starts,
            around,
            exits,
            centers: (0..n as u32).map(center).collect(),
            owner: vec![NONE; n],
            regions: Vec::new(),
        }
    }

    fn radius(&self, t: u32) -> f64 {
        self.space.radii[t as usize].min(self.most)
    }

    /// Radius of the ball about the middle of a part: 0 where it has no end, and so no middle. [Units: wu]
    fn ball(&self, t: u32) -> f64 {
        let radius = self.space.radii[t as usize];
        if radius.is_finite() { radius } else { 0.0 }
    }

    fn passes(&self, l: u32) -> f64 {
        self.space.links[l as usize].radius.min(self.most)
    }

    fn is_outdoors(&self, t: u32) -> bool {
        self.room_of_part[t as usize] == OUTDOOR_CELL
    }

    /// Those of some parts whose balls are known well enough to begin a limb, in rooms with place for a branch.
    /// Widest first.
    fn by_radius(&self, parts: impl Iterator<Item = u32>) -> Vec<u32> {
        let finest = self.space.finest;
        let mut order: Vec<u32> = parts
            .filter(|&t| {
                let room = self.room_of_part[t as usize];
                self.radius(t) >= finest && self.radius_of_room[&room] >= finest * NARROWS
            })
            .collect();
        order.sort_unstable_by(|&a, &b| {
            let (p, q) = (self.radius(a), self.radius(b));
            q.total_cmp(&p).then(a.cmp(&b))
        });
        order
    }

    fn ways(&self, t: u32) -> &[(u32, u32)] {
        let [from, to] = [t as usize, t as usize + 1].map(|i| self.starts[i] as usize);
        &self.around[from..to]
    }

    fn give(&mut self, t: u32, region: u32) {
        self.owner[t as usize] = region;
        self.regions[region as usize].parts.push(t);
    }

    /// A new region: what a ball reaches that is [`NARROWS`] times narrower than that of part `b`.
    fn limb(&mut self, b: u32) -> u32 {
        let region = self.regions.len() as u32;
        let radius = self.radius(b);
        self.regions.push(Region {
            parts: Vec::new(),
            radius,
            branch: None,
        });
        self.give(b, region);
        self.reach(region, [(b, b)].into(), radius / NARROWS);
        region
    }

    /// Lets a region reach on into parts without an owner: where balls of radius `least` pass, and where
    /// the region's balls cover the middle of a part. `queue` holds parts, each with the part whose ball covers it.
    fn reach(&mut self, region: u32, mut queue: VecDeque<(u32, u32)>, least: f64) {
        while let Some((t, witness)) = queue.pop_front() {
            for i in self.starts[t as usize]..self.starts[t as usize + 1] {
                let (other, l) = self.around[i as usize];
                if self.owner[other as usize] != NONE {
                    continue;
                }
                let middle = self.space.middles[other as usize];
                let covers = || {
                    let center = self.centers[witness as usize];
                    self.radius(other) < least && middle.distance(center) < self.ball(witness)
                };
                if self.passes(l) >= least {
                    queue.push_back((other, other));
                } else if covers() {
                    queue.push_back((other, witness));
                } else {
                    continue;
                }
                self.give(other, region);
            }
        }
    }

    /// Whether a limb goes on from its largest ball by the ball's radius or more: others are not looked at.
    fn is_long(&self, limb: u32) -> bool {
        let limb = &self.regions[limb as usize];
        let from = self.centers[limb.parts[0] as usize];
        let far = |&t: &u32| self.centers[t as usize].distance(from) >= limb.radius;
        limb.parts.iter().any(far)
    }

    fn dissolve(&mut self, region: u32) {
        for t in std::mem::take(&mut self.regions[region as usize].parts) {
            self.owner[t as usize] = NONE;
        }
    }

    fn merge(&mut self, region: u32, into: u32) {
        for t in std::mem::take(&mut self.regions[region as usize].parts) {
            self.give(t, into);
        }
    }

    /// Gives parts without an owner to the region that comes to them from `seeds` by the widest way.
    fn flood(&mut self, seeds: &[u32]) {
        // Radii are not negative, so their bits are in order. Ties go to the least numbers.
        let mut heap: BinaryHeap<(u64, Reverse<(u32, u32)>)> = BinaryHeap::new();
        let push = |heap: &mut BinaryHeap<_>, this: &Self, t: u32| {
            for &(other, l) in this.ways(t) {
                if this.owner[other as usize] == NONE {
                    let owner = this.owner[t as usize];
                    heap.push((this.passes(l).to_bits(), Reverse((other, owner))));
                }
            }
        };
        for &t in seeds {
            push(&mut heap, self, t);
        }
        while let Some((_, Reverse((t, owner)))) = heap.pop() {
            if self.owner[t as usize] == NONE {
                self.give(t, owner);
                push(&mut heap, self, t);
            }
        }
    }

    /// The ways out of a region, widest first. Branches of its own, which are known by then, are none.
    fn mouths(&self, region: u32) -> Vec<Mouth> {
        let mut contacts: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &t in &self.regions[region as usize].parts {
            for &(other, l) in self.ways(t) {
                let owner = self.owner[other as usize];
                if owner == NONE || owner == region || self.regions[owner as usize].branch.is_some()
                {
                    continue;
                }
                contacts.entry(owner).or_default().push(l);
            }
        }
        let mut mouths: Vec<Mouth> = Vec::new();
        for (owner, links) in contacts {
            let patches = connected(self.space, &links);
            mouths.extend(patches.into_iter().map(|p| self.mouth(region, owner, p)));
        }
        mouths.sort_by(|a, b| b.radius.total_cmp(&a.radius));
        mouths
    }

    fn mouth(&self, region: u32, parent: u32, links: Vec<u32>) -> Mouth {
        let facets = links.iter().map(|&l| {
            let link = &self.space.links[l as usize];
            let outline = self.space.outline(link);
            let middle = outline.iter().sum::<DVec3>() / outline.len() as f64;
            let vector = self.space.area_vector(link);
            let is_outward = self.owner[link.parts[0] as usize] == region;
            (middle, if is_outward { vector } else { -vector })
        });
        let facets: Vec<(DVec3, DVec3)> = facets.collect();
        let area = facets.iter().map(|f| f.1.length()).sum::<f64>().max(1e-300);
        let center = facets.iter().map(|f| f.0 * f.1.length()).sum::<DVec3>() / area;
        let square = |f: &(DVec3, DVec3)| f.0.distance_squared(center) * f.1.length();
        Mouth {
            parent,
            radius: links.iter().map(|&l| self.passes(l)).fold(0.0, f64::max),
            center,
            area: facets.iter().map(|f| f.1).sum::<DVec3>().length(),
            spread: (facets.iter().map(square).sum::<f64>() / area).sqrt(),
            links,
        }
    }

    /// Radius of the largest ball of a region that is a diameter of each of its mouths or more away from that, if that
    /// is known.
    fn body(&self, region: u32, mouths: &[Mouth]) -> Option<f64> {
        let parts = self.regions[region as usize].parts.iter();
        let is_within = |t: u32| mouths.iter().all(|m| self.far(t, m) >= 2.0 * m.radius);
        let radius = parts
            .filter(|&&t| is_within(t))
            .map(|&t| self.radius(t))
            .fold(0.0, f64::max);
        (radius >= self.space.finest).then_some(radius)
    }

    /// Which of the ways out of a limb are its mouths: the widest, and outdoors all that let balls through nearly as wide.
    fn main<'m>(&self, limb: u32, mouths: &'m [Mouth]) -> &'m [Mouth] {
        let n = match mouths.first() {
            Some(first) if self.is_in_outdoors(limb) => {
                mouths.partition_point(|m| m.radius * NARROWS >= first.radius)
            }
            first => usize::from(first.is_some()),
        };
        &mouths[..n]
    }

    fn is_in_outdoors(&self, limb: u32) -> bool {
        self.is_outdoors(self.regions[limb as usize].parts[0])
    }

    fn far(&self, t: u32, mouth: &Mouth) -> f64 {
        self.centers[t as usize].distance(mouth.center)
    }

    /// Gives what lies between the mouth of a limb and where the limb has its own width to what it leaves.
    /// The rest may fall to several limbs, narrow ones first: the legs of a pair of trousers.
    fn without_flare(&mut self, limb: u32) -> Vec<u32> {
        let mouths = self.mouths(limb);
        let mouths = self.main(limb, &mouths);
        let Some(mouth) = mouths.first() else {
            return Vec::new();
        };
        let Some(body) = self.body(limb, mouths) else {
            self.merge(limb, mouth.parent);
            return Vec::new();
        };
        if self.is_in_outdoors(limb) && mouths.iter().all(|m| m.radius <= body * FLARES) {
            return vec![limb];
        }
        let parts = self.regions[limb as usize].parts.clone();
        self.dissolve(limb);
        // Nobody else is without an owner by now, except in rooms that nothing reaches into from here.
        let outer = |&l: &u32| {
            let [a, b] = self.space.links[l as usize].parts;
            let t = if self.owner[a as usize] == NONE { b } else { a };
            (t, t)
        };
        let queues: Vec<VecDeque<(u32, u32)>> = mouths
            .iter()
            .map(|m| m.links.iter().map(outer).collect())
            .collect();
        for (m, queue) in mouths.iter().zip(queues) {
            self.reach(m.parent, queue, body * FLARES);
        }
        let free = |this: &Self| -> Vec<u32> {
            let is_free = |&&t: &&u32| this.owner[t as usize] == NONE;
            parts.iter().filter(is_free).copied().collect()
        };
        let mut limbs = Vec::new();
        for b in self.by_radius(free(self).into_iter()) {
            if self.owner[b as usize] == NONE {
                let limb = self.limb(b);
                if self.is_long(limb) {
                    limbs.push(limb);
                } else {
                    self.dissolve(limb);
                }
            }
        }
        let has_owner = |&&t: &&u32| self.owner[t as usize] != NONE;
        let seeds: Vec<u32> = parts.iter().filter(has_owner).copied().collect();
        self.flood(&seeds);
        for t in free(self) {
            self.give(t, mouth.parent);
        }
        limbs.reverse();
        limbs
    }

    /// What is known of a branch, or else the region that the limb is part of.
    fn judged(&self, limb: u32) -> Result<Found, Option<u32>> {
        let mouths = self.mouths(limb);
        let mouth = mouths.first().ok_or(None)?;
        let no = Some(mouth.parent);
        let main = self.main(limb, &mouths);
        let radius = self.body(limb, main).ok_or(no)?;
        let is_outdoors = self.is_in_outdoors(limb);
        let (is_alone, is_deep) = if is_outdoors {
            (true, self.holds(limb, &mouths))
        } else {
            let is_only = mouths[1..].iter().all(|m| m.is_chink_beside(mouth));
            (
                is_only && !self.leads_on(limb, mouth.radius),
                self.is_deep(limb, mouth),
            )
        };
        // A taper narrows elsewhere, too. Outdoors, where there are few points, balls may be near and their middles far.
        let near = 2.0 * DEEP * mouth.radius;
        let is_near = |t: u32| {
            let ball = if is_outdoors { self.ball(t) } else { 0.0 };
            self.far(t, mouth) - ball <= near
        };
        let trunk = self.regions[mouth.parent as usize].parts.iter();
        let trunk = trunk
            .filter(|&&t| is_near(t))
            .map(|&t| self.radius(t))
            .fold(0.0, f64::max);
        let weight = trunk / radius;
        let is_branch =
            is_alone && is_deep && weight >= NARROWS && !main.iter().any(Mouth::is_slit);
        if is_branch {
            Ok(Found { weight, radius })
        } else {
            Err(no)
        }
    }

    /// Whether a limb goes on for [`DEEP`] diameters of its mouth. Balls in its corners are no part of its depth.
    fn is_deep(&self, limb: u32, mouth: &Mouth) -> bool {
        self.regions[limb as usize]
            .parts
            .iter()
            .filter(|&&t| self.radius(t) * NARROWS >= mouth.radius)
            .any(|&t| self.far(t, mouth) + self.radius(t) >= 2.0 * DEEP * mouth.radius)
    }

    /// Whether a limb has place for [`DEEP`] diameters of each of its mouths.
    fn holds(&self, limb: u32, mouths: &[Mouth]) -> bool {
        let parts = self.regions[limb as usize].parts.iter();
        let volume: f64 = parts.map(|&t| self.space.volumes[t as usize]).sum();
        let needs = |m: &Mouth| 2.0 * DEEP * m.radius * m.area;
        volume >= mouths.iter().map(needs).sum()
    }

    /// Whether openings lead from a region to rooms with balls wider than `radius`. Cracks do not count: what
    /// is open together is less than the disk of the least ball that is known. By area and not by the balls that pass,
    /// since a door leaf or a pane in the opening lets none.
    fn leads_on(&self, region: u32, radius: f64) -> bool {
        let mut open = 0.0;
        for t in &self.regions[region as usize].parts {
            for &l in self.exits.get(t).into_iter().flatten() {
                let link = &self.space.links[l as usize];
                let other = link.parts[usize::from(link.parts[0] == *t)];
                if self.radius_of_room[&self.room_of_part[other as usize]] > radius {
                    open += self.space.area_vector(link).length();
                }
            }
        }
        open > PI * self.space.finest.powi(2)
    }

    fn finished(self) -> Branches {
        let mut mouths = Vec::new();
        let mut labels = vec![0; self.regions.len()];
        for (label, region) in labels.iter_mut().zip(&self.regions) {
            if let Some(found) = region.branch {
                mouths.push(found);
                *label = mouths.len() as u32;
            }
        }
        // Without an owner, it has none.
        let label = |&o: &u32| labels.get(o as usize).copied().unwrap_or(0);
        Branches {
            label_of_part: self.owner.iter().map(label).collect(),
            mouths,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::space::divide;
    use super::*;
    use crate::pipeline::structural_triangles;
    use enfilade_testkit::{Tube, tubes};

    #[test]
    fn less_than_a_ball_goes_with_its_cell() {
        let tube = Tube {
            ends: [DVec3::X * -4.0, DVec3::X * 4.0],
            radius: 0.7,
        };
        let walls = structural_triangles(&tubes(&[tube], 0.2).scene).1;
        let space = divide(&walls, &[], &Bvh::build(&walls), 0.6).unwrap();
        let n = space.radii.len();
        let is_in = |t: usize| {
            space.middles[t].with_x(0.0).length() < 0.6 && space.middles[t].x.abs() < 4.0
        };
        let cell_of_part: Vec<u32> = (0..n).map(|t| u32::from(is_in(t))).collect();
        // One half is a branch, and so is one tetrahedron in the other: across the tube, and much less than its ball.
        let lone = (0..n)
            .filter(|&t| is_in(t) && space.middles[t].x < -1.0)
            .max_by(|&a, &b| space.radii[a].total_cmp(&space.radii[b]))
            .unwrap();
        let label = |t: usize| match t {
            t if t == lone => 2,
            t => u32::from(is_in(t) && space.middles[t].x > 1.0),
        };
        let labels: Vec<u32> = (0..n).map(label).collect();
        let found = Found {
            weight: 2.0,
            radius: 0.7,
        };
        let branches = Branches {
            label_of_part: labels.clone(),
            mouths: vec![found; 2],
        };
        let mended = branches
            .without_leftovers(&space, &cell_of_part)
            .label_of_part;
        for t in 0..n {
            let expected = if t == lone { 0 } else { labels[t] };
            assert_eq!(mended[t], expected, "{t}");
        }
    }
}
