//! Connected sets of the parts of a room, grown by balls.
//!
//! A limb is the space that a ball a little smaller than the largest free one reaches: a morphological opening
//! (Matheron, "Random sets and integral geometry", 1975, on size distributions).

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};

use enfilade_geom::{Aabb, Allowance, DVec3};

use super::super::balls::circumsphere;
use super::super::cells::OUTDOOR_CELL;
use super::super::labels::{BranchMouth, Branches};
use super::super::space::Space;
use crate::tubes::NARROWS;

/// Marks the absence of a region.
pub(super) const NONE: u32 = u32::MAX;

/// A connected set of parts.
pub(super) struct Region {
    pub(super) parts: Vec<u32>,
    /// Radius of its largest ball. [Units: wu]
    pub(super) radius: f64,
    /// Set once it is known to be a branch.
    pub(super) branch: Option<BranchMouth>,
}

/// The parts of all rooms, and the region that owns each.
pub(super) struct TubeRegions<'a> {
    pub(super) space: &'a Space,
    pub(super) room_of_part: &'a [u32],
    /// Radius of the largest ball of each room. [Units: wu]
    pub(super) radius_of_room: BTreeMap<u32, f64>,
    /// Links that leave a room, by part.
    pub(super) exits: BTreeMap<u32, Vec<u32>>,
    /// Centers of the parts' balls. [Units: wu]
    pub(super) centers: Vec<DVec3>,
    /// Region of each part, or [`NONE`].
    pub(super) owner: Vec<u32>,
    pub(super) regions: Vec<Region>,
    /// Start of each part's ways in `ways`.
    starts: Vec<u32>,
    /// Ways from each part to others of its room: neighbor and link.
    ways: Vec<(u32, u32)>,
    /// Radius to use for infinite balls. [Units: wu]
    most: f64,
    /// Allowance of work for growing regions.
    pub(super) allowance: &'a Allowance,
}

impl<'a> TubeRegions<'a> {
    pub(super) fn new(space: &'a Space, room_of_part: &'a [u32], allowance: &'a Allowance) -> Self {
        let n = space.radii.len();
        let mut radius_of_room: BTreeMap<u32, f64> = BTreeMap::new();
        for (t, &room) in room_of_part.iter().enumerate() {
            let r = radius_of_room.entry(room).or_insert(0.0);
            *r = r.max(space.radii[t]);
        }
        let (starts, ways) = ways_within_rooms(space, room_of_part);
        let mut exits: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (l, link) in space.links.iter().enumerate() {
            let [a, b] = link.parts.map(|t| room_of_part[t as usize]);
            if a != b {
                for t in link.parts {
                    exits.entry(t).or_default().push(l as u32);
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
            space,
            room_of_part,
            radius_of_room,
            exits,
            centers: (0..n as u32).map(center).collect(),
            owner: vec![NONE; n],
            regions: Vec::new(),
            starts,
            ways,
            most: bounds.size().max_element(),
            allowance,
        }
    }

    /// Returns the radius of a part's ball. [Units: wu]
    pub(super) fn radius(&self, t: u32) -> f64 {
        self.space.radii[t as usize].min(self.most)
    }

    /// Returns the radius of the ball about the center of a part; 0 if it is infinite, and so has no center.
    /// [Units: wu]
    pub(super) fn ball(&self, t: u32) -> f64 {
        let radius = self.space.radii[t as usize];
        if radius.is_finite() { radius } else { 0.0 }
    }

    /// Returns the radius of the widest ball that passes a link. [Units: wu]
    pub(super) fn passes(&self, l: u32) -> f64 {
        self.space.links[l as usize].radius.min(self.most)
    }

    /// Returns the ways from a part to others of its room: neighbor and link.
    pub(super) fn ways(&self, t: u32) -> &[(u32, u32)] {
        let [from, to] = [t as usize, t as usize + 1].map(|i| self.starts[i] as usize);
        &self.ways[from..to]
    }

    pub(super) fn is_outdoors(&self, t: u32) -> bool {
        self.room_of_part[t as usize] == OUTDOOR_CELL
    }

    /// Returns those parts whose balls are known well enough to begin a limb, in rooms with space for a branch, widest
    /// first.
    pub(super) fn by_radius(&self, parts: impl Iterator<Item = u32>) -> Vec<u32> {
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

    /// Makes a new region of the parts that a ball [`NARROWS`] times narrower than that of part `b` reaches.
    pub(super) fn open_limb(&mut self, b: u32) -> u32 {
        let radius = self.radius(b);
        let region = self.push(radius, None);
        self.give(b, region);
        self.reach(region, [(b, b)].into(), radius / NARROWS);
        region
    }

    /// Adds a region without parts; returns its index.
    pub(super) fn push(&mut self, radius: f64, branch: Option<BranchMouth>) -> u32 {
        self.regions.push(Region {
            parts: Vec::new(),
            radius,
            branch,
        });
        self.regions.len() as u32 - 1
    }

    pub(super) fn give(&mut self, t: u32, region: u32) {
        self.owner[t as usize] = region;
        self.regions[region as usize].parts.push(t);
    }

    /// Extends a region into parts without an owner: across links that balls of radius `least` pass, and to parts whose
    /// middle is covered by the region's balls. `queue` contains parts, each with the part whose ball covers it.
    pub(super) fn reach(&mut self, region: u32, mut queue: VecDeque<(u32, u32)>, least: f64) {
        while let Some((t, witness)) = queue.pop_front() {
            if !self.allowance.spend(2) {
                return;
            }
            for i in self.starts[t as usize]..self.starts[t as usize + 1] {
                let (other, l) = self.ways[i as usize];
                if self.owner[other as usize] != NONE {
                    continue;
                }
                if self.passes(l) >= least {
                    queue.push_back((other, other));
                } else if self.radius(other) < least && self.covers(witness, other) {
                    queue.push_back((other, witness));
                } else {
                    continue;
                }
                self.give(other, region);
            }
        }
    }

    /// Returns `true` if the ball of one part contains the middle of another.
    fn covers(&self, t: u32, other: u32) -> bool {
        let middle = self.space.middles[other as usize];
        middle.distance(self.centers[t as usize]) < self.ball(t)
    }

    /// Returns `true` if a limb extends from its largest ball by the ball's radius or more. Shorter ones are ignored.
    pub(super) fn is_long(&self, limb: u32) -> bool {
        let limb = &self.regions[limb as usize];
        let from = self.centers[limb.parts[0] as usize];
        let far = |&t: &u32| self.centers[t as usize].distance(from) >= limb.radius;
        limb.parts.iter().any(far)
    }

    /// Leaves the parts of a region without an owner.
    pub(super) fn dissolve(&mut self, region: u32) {
        for t in std::mem::take(&mut self.regions[region as usize].parts) {
            self.owner[t as usize] = NONE;
        }
    }

    pub(super) fn merge(&mut self, region: u32, into: u32) {
        for t in std::mem::take(&mut self.regions[region as usize].parts) {
            self.give(t, into);
        }
    }

    /// Gives parts without an owner to the region that reaches them from `seeds` by the widest way.
    pub(super) fn flood(&mut self, seeds: &[u32]) {
        // Radii are not negative, so their bits sort like them. Ties go to the least ids.
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
            if !self.allowance.spend(2) {
                return;
            }
            if self.owner[t as usize] == NONE {
                self.give(t, owner);
                push(&mut heap, self, t);
            }
        }
    }

    /// Numbers the branches.
    pub(super) fn finished(self) -> Branches {
        let mut mouths = Vec::new();
        let mut labels = vec![0; self.regions.len()];
        for (label, region) in labels.iter_mut().zip(&self.regions) {
            if let Some(mouth) = region.branch {
                mouths.push(mouth);
                *label = mouths.len() as u32;
            }
        }
        // A part without an owner is in no branch.
        let label = |&o: &u32| labels.get(o as usize).copied().unwrap_or(0);
        Branches {
            label_of_part: self.owner.iter().map(label).collect(),
            mouths,
        }
    }
}

/// Returns the start of each part's ways, and all ways, part by part: neighbor and link of a part within its room.
fn ways_within_rooms(space: &Space, room_of_part: &[u32]) -> (Vec<u32>, Vec<(u32, u32)>) {
    let n = space.radii.len();
    let is_within = |parts: [u32; 2]| {
        let [a, b] = parts.map(|t| room_of_part[t as usize]);
        a == b
    };
    let mut starts = vec![0; n + 1];
    for link in space.links.iter().filter(|l| is_within(l.parts)) {
        for t in link.parts {
            starts[t as usize + 1] += 1;
        }
    }
    for t in 0..n {
        starts[t + 1] += starts[t];
    }
    let mut next = starts.clone();
    let mut ways = vec![(0, 0); starts[n] as usize];
    for (l, link) in space.links.iter().enumerate() {
        if is_within(link.parts) {
            let [a, b] = link.parts;
            for (t, other) in [(a, b), (b, a)] {
                ways[next[t as usize] as usize] = (other, l as u32);
                next[t as usize] += 1;
            }
        }
    }
    (starts, ways)
}
