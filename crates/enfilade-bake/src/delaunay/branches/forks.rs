//! Forks: where three or more tubes of one width meet.
//!
//! No ball tells an arm from its stem there. What does: take a ball a little wider than the tubes away, and what is left nearby
//! falls into three pieces or more that each go on for [`DEEP`] diameters. In a tube it falls into two, in a
//! hall, around a pillar or in a bend into fewer. Only what is near is looked at, so that arms that meet again further on are arms all the
//! same. The widest arm keeps the middle of the fork, the others are branches.
//!
//! Crossing corridors of a building are forks, too, and one room to their architect. Corridors have flat walls
//! at right angles: with θ the directions of normals about the axis, the mean of `exp(4iθ)` has length one there and
//! zero in any tube that is round, whichever its roundness (a circle, an ellipse, a regular polygon of other than four
//! corners). Below [`SQUARE`], an arm is a branch.
//!
//! `O(n log n)` in the parts of tubes; in halls one ball in hundreds is tried.

use std::cmp::Reverse;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};
use std::f64::consts::TAU;

use enfilade_geom::{Bvh, DVec3, Ray, Sets, Triangle, triangle_area_normal};

use super::{DEEP, Found, NARROWS, NONE, Region, Search};

/// Radii of the balls that are taken away, least first, ÷ that of the ball in the middle of the fork. Arms at a right angle
/// are apart from 1.42 on, at 40° from 2.75.
const TAKEN: [f64; 4] = [1.5, 2.0, 2.5, 3.0];
/// Balls beside the one in the middle are at most this many times as wide: balls of one tube differ by that much.
const WIDEST: f64 = 1.1;
/// Balls nearer than this to one that was tried are not. [Units: radii]
const STRIDE: f64 = 0.5;
/// Length of the mean of `exp(4iθ)` about the axis of an arm that is a corridor, at least: 1 between four walls, 0.5 under a barrel vault.
const SQUARE: f64 = 0.5;
/// Rays about an axis.
const RAYS: usize = 32;
/// What the mouth of an arm weighs: as much as that of a branch half as wide as its trunk.
const WEIGHS: f64 = 2.0;

/// A place where tubes meet.
struct Fork {
    /// The ball in its middle.
    part: u32,
    /// Radius of that ball. [Units: wu]
    radius: f64,
    /// Of the ball that is taken away. [Units: wu]
    taken: f64,
    /// Parts in that one.
    middle: Vec<u32>,
    /// Widest first.
    arms: Vec<Arm>,
    /// How far the mouths of its arms are apart, at least. [Units: radii]
    spread: f64,
}

/// A piece of what is around a fork.
struct Arm {
    parts: Vec<u32>,
    /// Mean radius of its balls. [Units: wu]
    radius: f64,
    /// Middle of where it begins. [Units: wu]
    mouth: DVec3,
    is_round: bool,
}

/// The walls around, for normals.
pub(super) struct Walls<'a> {
    pub(super) triangles: &'a [Triangle],
    pub(super) bvh: &'a Bvh,
}

/// Places of parts in a list, for one list at a time.
struct Places {
    round: u32,
    /// Round and place of each part.
    of_part: Vec<(u32, u32)>,
}

impl Places {
    fn new(n_parts: usize) -> Self {
        Self {
            round: 0,
            of_part: vec![(0, 0); n_parts],
        }
    }

    fn clear(&mut self) {
        self.round += 1;
    }

    fn get(&self, t: u32) -> Option<u32> {
        let (round, place) = self.of_part[t as usize];
        (round == self.round).then_some(place)
    }

    fn set(&mut self, t: u32, place: usize) {
        self.of_part[t as usize] = (self.round, place as u32);
    }
}

impl Search<'_> {
    /// Makes the arms of forks regions of their own.
    pub(super) fn part_forks(&mut self, walls: &Walls<'_>) {
        let forks = self.forks(walls);
        if forks.is_empty() {
            return;
        }
        let mut closed = BTreeSet::new();
        for fork in &forks {
            self.close_mouths(fork, &mut closed);
        }
        let touched: BTreeSet<u32> = forks.iter().map(|f| self.owner[f.part as usize]).collect();
        for region in touched {
            self.part(region, &closed, &forks);
        }
    }

    /// Those whose balls do not meet.
    fn forks(&self, walls: &Walls<'_>) -> Vec<Fork> {
        let n = self.owner.len();
        let mut was_tried = vec![false; n];
        let mut places = Places::new(n);
        let mut found: Vec<Fork> = Vec::new();
        for c in self.by_radius(0..n as u32) {
            if self.is_enclosed(c) && !was_tried[c as usize] {
                found.extend(self.fork_at(c, walls, &mut was_tried, &mut places));
            }
        }
        // The best first: a ball beside the middle of a crossing may leave two of its arms in one piece.
        found.sort_by(|a, b| {
            (b.arms.len().cmp(&a.arms.len()))
                .then((a.taken / a.radius).total_cmp(&(b.taken / b.radius)))
                .then(b.spread.total_cmp(&a.spread))
                .then(a.part.cmp(&b.part))
        });
        let mut forks: Vec<Fork> = Vec::new();
        for fork in found {
            let is_near = |other: &Fork| {
                let off =
                    self.centers[fork.part as usize].distance(self.centers[other.part as usize]);
                off < fork.taken + other.taken
            };
            if !forks.iter().any(is_near) {
                forks.push(fork);
            }
        }
        forks
    }

    /// Whether a part lies in a room, or in what branches off the outdoors.
    fn is_enclosed(&self, t: u32) -> bool {
        let owner = self.owner[t as usize];
        owner != NONE && (self.regions[owner as usize].branch.is_some() || !self.is_outdoors(t))
    }

    /// Parts that one gets to through openings for balls at most [`NARROWS`] times less than `radius`.
    fn wide_ways(&self, t: u32, radius: f64) -> impl Iterator<Item = u32> {
        let ways = self.ways(t).iter();
        ways.filter(move |w| self.passes(w.1) * NARROWS >= radius)
            .map(|w| w.0)
    }

    /// Parts of a region with the distances of their balls from that of one of them, nearest first: what one gets to through openings
    /// for balls [`NARROWS`] times less. `None` if something as much wider is nearer than a fork with it can be; also gives
    /// how near that is.
    fn around(
        &self,
        c: u32,
        was_tried: &mut [bool],
        places: &mut Places,
    ) -> Option<(Vec<(f64, u32)>, f64)> {
        let (radius, region) = (self.radius(c), self.owner[c as usize]);
        let center = self.centers[c as usize];
        let reach = |taken: f64| (taken + 2.0 * DEEP) * radius;
        let [least, .., most] = TAKEN.map(reach);
        let mut wide = f64::INFINITY;
        places.clear();
        places.set(c, 0);
        let mut out = vec![(0.0, c)];
        let mut next = 0;
        while let Some(&(distance, t)) = out.get(next) {
            next += 1;
            if distance < STRIDE * radius {
                was_tried[t as usize] = true;
            }
            if distance < TAKEN[0] * radius && self.radius(t) > WIDEST * radius {
                return None;
            }
            if self.radius(t) > NARROWS * radius {
                if distance < least {
                    return None;
                }
                wide = wide.min(distance);
            }
            for other in self.wide_ways(t, radius) {
                if self.owner[other as usize] == region && places.get(other).is_none() {
                    let distance = self.centers[other as usize].distance(center);
                    if distance <= most {
                        places.set(other, out.len());
                        out.push((distance, other));
                    }
                }
            }
        }
        out.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Some((out, wide))
    }

    /// The fork about a ball, if there is one.
    fn fork_at(
        &self,
        c: u32,
        walls: &Walls<'_>,
        was_tried: &mut [bool],
        places: &mut Places,
    ) -> Option<Fork> {
        let radius = self.radius(c);
        let (around, wide) = self.around(c, was_tried, places)?;
        for taken in TAKEN.map(|t| t * radius) {
            let reach = taken + 2.0 * DEEP * radius;
            if wide < reach {
                return None;
            }
            let around = &around[..around.partition_point(|a| a.0 <= reach)];
            let (middle, outer) = around.split_at(around.partition_point(|a| a.0 <= taken));
            let mut pieces = self.pieces(outer, radius, places);
            places.clear();
            for (i, a) in middle.iter().enumerate() {
                places.set(a.1, i);
            }
            let at_middle = |&(_, t): &(f64, u32)| {
                let mut ways = self.wide_ways(t, radius);
                ways.any(|other| places.get(other).is_some())
            };
            pieces.retain(|piece| {
                let goes_on = |&(d, t): &(f64, u32)| d + self.radius(t) >= reach;
                piece.iter().any(goes_on) && piece.iter().any(at_middle)
            });
            match pieces.len() {
                0 | 1 => return None,
                // A pair of arms that are not apart yet may be one of them.
                2 => {}
                _ => {
                    let middle = middle.iter().map(|a| a.1).collect();
                    return self.fork_of(c, taken, middle, &pieces, walls);
                }
            }
        }
        None
    }

    /// The connected pieces of some parts, with what goes with them, in their order.
    fn pieces(
        &self,
        parts: &[(f64, u32)],
        radius: f64,
        places: &mut Places,
    ) -> Vec<Vec<(f64, u32)>> {
        places.clear();
        let mut sets = Sets::new(parts.len());
        for (i, &(_, t)) in parts.iter().enumerate() {
            places.set(t, i);
            for other in self.wide_ways(t, radius) {
                if let Some(j) = places.get(other) {
                    sets.join(i as u32, j);
                }
            }
        }
        let mut pieces: BTreeMap<u32, Vec<(f64, u32)>> = BTreeMap::new();
        for (i, &part) in parts.iter().enumerate() {
            pieces.entry(sets.find(i as u32)).or_default().push(part);
        }
        pieces.into_values().collect()
    }

    fn fork_of(
        &self,
        c: u32,
        taken: f64,
        middle: Vec<u32>,
        pieces: &[Vec<(f64, u32)>],
        walls: &Walls<'_>,
    ) -> Option<Fork> {
        let radius = self.radius(c);
        let arm = |piece: &Vec<(f64, u32)>| self.arm(piece, taken, radius, walls);
        let mut arms: Vec<Arm> = pieces.iter().filter_map(arm).collect();
        if arms.len() < 3 {
            return None;
        }
        arms.sort_by(|a, b| {
            b.radius
                .total_cmp(&a.radius)
                .then_with(|| a.parts.cmp(&b.parts))
        });
        if !arms[1..].iter().any(|a| a.is_round) {
            return None;
        }
        let mut spread = f64::INFINITY;
        for (i, a) in arms.iter().enumerate() {
            for b in &arms[..i] {
                spread = spread.min(a.mouth.distance(b.mouth) / radius);
            }
        }
        Some(Fork {
            part: c,
            radius,
            taken,
            middle,
            arms,
            spread,
        })
    }

    /// `piece` holds its parts, nearest first, with their distances from the middle of the fork. `None` if they are no deeper
    /// than an alcove: the ball that was taken may lie off the fork's middle.
    fn arm(&self, piece: &[(f64, u32)], taken: f64, radius: f64, walls: &Walls<'_>) -> Option<Arm> {
        // Middle of the balls of a stretch, by their distances in radii from where the arm begins.
        let stretch = |from: f64, to: f64| {
            let at = |d: f64| piece.partition_point(|p| (p.0 - taken) / radius < d);
            let from = at(from).min(piece.len() - 1);
            let within = &piece[from..at(to).max(from + 1)];
            let sum: DVec3 = within.iter().map(|p| self.centers[p.1 as usize]).sum();
            sum / within.len() as f64
        };
        let [mouth, middle, far] = [0.0, 1.0, 2.0].map(|d| stretch(d, d + 1.0));
        let depth = |p: &(f64, u32)| self.centers[p.1 as usize].distance(mouth) + self.radius(p.1);
        let depth = piece.iter().map(depth).fold(0.0, f64::max);
        let sum: f64 = piece.iter().map(|p| self.radius(p.1)).sum();
        (depth >= 2.0 * DEEP * radius).then(|| Arm {
            parts: piece.iter().map(|p| p.1).collect(),
            radius: sum / piece.len() as f64,
            mouth,
            is_round: is_round(middle, far - mouth, walls),
        })
    }

    /// Closes the mouths of a fork's arms but for the widest: the links between what floods from each of them meets.
    fn close_mouths(&self, fork: &Fork, closed: &mut BTreeSet<u32>) {
        let region = self.owner[fork.part as usize];
        let center = self.centers[fork.part as usize];
        let reach = fork.taken + 2.0 * DEEP * fork.radius;
        // Arms count from 1 on; the middle, and with it the widest and those that are corridors, is 0.
        let mut label: BTreeMap<u32, u32> = fork.middle.iter().map(|&t| (t, 0)).collect();
        for (i, arm) in fork.arms.iter().enumerate() {
            let l = if i > 0 && arm.is_round { i as u32 } else { 0 };
            label.extend(arm.parts.iter().map(|&t| (t, l)));
        }
        let mut heap: BinaryHeap<(u64, Reverse<(u32, u32)>)> = BinaryHeap::new();
        let is_near = |t: u32| {
            self.owner[t as usize] == region
                && self.space.middles[t as usize].distance(center) <= reach
        };
        let push = |heap: &mut BinaryHeap<_>, label: &BTreeMap<u32, u32>, t: u32| {
            for &(other, l) in self.ways(t) {
                if !label.contains_key(&other) && is_near(other) {
                    heap.push((self.passes(l).to_bits(), Reverse((other, label[&t]))));
                }
            }
        };
        for &t in label.keys() {
            push(&mut heap, &label, t);
        }
        while let Some((_, Reverse((t, l)))) = heap.pop() {
            if let Entry::Vacant(entry) = label.entry(t) {
                entry.insert(l);
                push(&mut heap, &label, t);
            }
        }
        for (&t, &one) in &label {
            let ways = self.ways(t).iter();
            closed.extend(
                ways.filter(|w| label.get(&w.0).is_some_and(|&l| l != one))
                    .map(|w| w.1),
            );
        }
    }

    /// Parts a region along closed links: what holds an arm becomes a branch, unless it is what holds the widest ball.
    fn part(&mut self, region: u32, closed: &BTreeSet<u32>, forks: &[Fork]) {
        let parts = std::mem::take(&mut self.regions[region as usize].parts);
        let place: BTreeMap<u32, u32> = parts
            .iter()
            .enumerate()
            .map(|(i, &t)| (t, i as u32))
            .collect();
        let mut sets = Sets::new(parts.len());
        for (i, &t) in parts.iter().enumerate() {
            for (other, l) in self.ways(t) {
                if let Some(&j) = place.get(other)
                    && !closed.contains(l)
                {
                    sets.join(i as u32, j);
                }
            }
        }
        let wider = |&i: &usize, &j: &usize| {
            let [p, q] = [i, j].map(|i| self.radius(parts[i]));
            p.total_cmp(&q).then(parts[j].cmp(&parts[i]))
        };
        let widest = (0..parts.len()).max_by(wider).map(|i| sets.find(i as u32));
        let mut radius_of_piece: BTreeMap<u32, f64> = BTreeMap::new();
        for fork in forks {
            for arm in &fork.arms {
                if let Some(&i) = place.get(&arm.parts[0]) {
                    let radius = radius_of_piece.entry(sets.find(i)).or_insert(0.0);
                    *radius = radius.max(arm.radius);
                }
            }
        }
        let mut region_of_piece: BTreeMap<u32, u32> = BTreeMap::new();
        for (piece, radius) in radius_of_piece {
            if Some(piece) != widest {
                region_of_piece.insert(piece, self.regions.len() as u32);
                self.regions.push(Region {
                    parts: Vec::new(),
                    radius,
                    branch: Some(Found {
                        weight: WEIGHS,
                        radius,
                    }),
                });
            }
        }
        for (i, &t) in parts.iter().enumerate() {
            let piece = sets.find(i as u32);
            self.give(t, region_of_piece.get(&piece).copied().unwrap_or(region));
        }
    }
}

/// Whether the walls about an axis are other than four at right angles.
fn is_round(origin: DVec3, axis: DVec3, walls: &Walls<'_>) -> bool {
    let Some(axis) = axis.try_normalize() else {
        return false;
    };
    let (u, v) = axis.any_orthonormal_pair();
    let (mut re, mut im, mut n_hits) = (0.0, 0.0, 0);
    for i in 0..RAYS {
        let (sin, cos) = (TAU * i as f64 / RAYS as f64).sin_cos();
        let ray = Ray {
            origin,
            direction: u * cos + v * sin,
            t_max: f64::INFINITY,
        };
        if let Some(hit) = walls.bvh.closest_hit(&ray, |_| false) {
            let normal = triangle_area_normal(&walls.triangles[hit.triangle as usize]);
            let (sin, cos) = (4.0 * normal.dot(v).atan2(normal.dot(u))).sin_cos();
            re += cos;
            im += sin;
            n_hits += 1;
        }
    }
    2 * n_hits >= RAYS && f64::hypot(re, im) < SQUARE * f64::from(n_hits as u32)
}
