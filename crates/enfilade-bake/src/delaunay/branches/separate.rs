//! Separates forks: the arms become branches; the widest arm keeps the middle of the fork.

use std::cmp::Reverse;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use enfilade_geom::{Allowance, DVec3, Sets};

use super::super::labels::BranchMouth;
use super::regions::{NONE, TubeRegions};
use super::rule::ARM_WEIGHS;
use crate::tubes::{Arm, Balls, Fork, Walls, find_forks, reach};

impl Balls for TubeRegions<'_> {
    fn n_parts(&self) -> usize {
        self.owner.len()
    }

    fn radius(&self, t: u32) -> f64 {
        Self::radius(self, t)
    }

    fn center(&self, t: u32) -> DVec3 {
        self.centers[t as usize]
    }

    fn owner(&self, t: u32) -> u32 {
        self.owner[t as usize]
    }

    fn ways(&self, t: u32) -> impl Iterator<Item = (u32, f64)> {
        Self::ways(self, t).iter().map(|w| (w.0, self.passes(w.1)))
    }

    fn allowance(&self) -> &Allowance {
        self.allowance
    }
}

impl TubeRegions<'_> {
    /// Makes the arms of forks regions of their own.
    pub(super) fn separate_forks(&mut self, walls: &Walls<'_>) {
        let places = self.by_radius(0..self.owner.len() as u32);
        let places = places.into_iter().filter(|&t| self.is_enclosed(t));
        let forks = find_forks(self, places, walls);
        let mut closed = BTreeSet::new();
        for fork in &forks {
            self.close_mouths(fork, &mut closed);
        }
        let touched: BTreeSet<u32> = forks.iter().map(|f| self.owner[f.part as usize]).collect();
        for region in touched {
            self.divide(region, &closed, &forks);
        }
    }

    /// Returns `true` if a part lies in a room, or in a branch of the outdoors.
    fn is_enclosed(&self, t: u32) -> bool {
        let owner = self.owner[t as usize];
        owner != NONE && (self.regions[owner as usize].branch.is_some() || !self.is_outdoors(t))
    }

    /// Closes the mouths of a fork's arms, except the widest: floods arms and middle at once, and closes the links
    /// where two floods meet.
    fn close_mouths(&self, fork: &Fork, closed: &mut BTreeSet<u32>) {
        let region = self.owner[fork.part as usize];
        let center = self.centers[fork.part as usize];
        let reach = reach(fork.removed, fork.radius);
        // Arms have labels from 1 on; the middle has 0, and so have the widest arm and the corridors.
        let mut label: BTreeMap<u32, u32> = fork.middle.iter().map(|&t| (t, 0)).collect();
        for (i, arm) in fork.arms.iter().enumerate() {
            let l = if arm.kind == Arm::Tube { i as u32 } else { 0 };
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
            if !self.allowance.spend(5) {
                return;
            }
            if let Entry::Vacant(entry) = label.entry(t) {
                entry.insert(l);
                push(&mut heap, &label, t);
            }
        }
        for (&t, &one) in &label {
            let ways = self.ways(t).iter();
            let differs = |w: &&(u32, u32)| label.get(&w.0).is_some_and(|&l| l != one);
            closed.extend(ways.filter(differs).map(|w| w.1));
        }
    }

    /// Divides a region along closed links: a piece that contains an arm becomes a branch, unless it contains the
    /// widest ball.
    fn divide(&mut self, region: u32, closed: &BTreeSet<u32>, forks: &[Fork]) {
        let parts = std::mem::take(&mut self.regions[region as usize].parts);
        let places = parts.iter().enumerate();
        let place: BTreeMap<u32, u32> = places.map(|(i, &t)| (t, i as u32)).collect();
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
        for arm in forks.iter().flat_map(|f| &f.arms) {
            if let Some(&i) = place.get(&arm.parts[0]) {
                let radius = radius_of_piece.entry(sets.find(i)).or_insert(0.0);
                *radius = radius.max(arm.radius);
            }
        }
        let mut region_of_piece: BTreeMap<u32, u32> = BTreeMap::new();
        for (piece, radius) in radius_of_piece {
            if Some(piece) != widest {
                let mouth = BranchMouth {
                    weight: ARM_WEIGHS,
                    radius,
                    is_limb: false,
                };
                region_of_piece.insert(piece, self.push(radius, Some(mouth)));
            }
        }
        for (i, &t) in parts.iter().enumerate() {
            let piece = sets.find(i as u32);
            self.give(t, region_of_piece.get(&piece).copied().unwrap_or(region));
        }
    }
}
