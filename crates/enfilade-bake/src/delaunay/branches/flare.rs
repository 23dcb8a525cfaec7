//! Flares: the space from the mouth of a limb to where the limb has its own width.

use std::collections::VecDeque;

use super::measure::Mouth;
use super::regions::{NONE, TubeRegions};
use super::rule::FLARES;

impl TubeRegions<'_> {
    /// Gives the flare of a limb to the regions that the limb leaves. The rest may fall apart into several limbs, like
    /// the legs of a pair of trousers; returns them narrowest first.
    pub(super) fn without_flare(&mut self, limb: u32) -> Vec<u32> {
        let mouths = self.mouths(limb);
        let mouths = self.main(limb, &mouths);
        let Some(widest) = mouths.first() else {
            return Vec::new();
        };
        let Some(body) = self.body(limb, mouths) else {
            self.merge(limb, widest.parent);
            return Vec::new();
        };
        let narrow = body * FLARES;
        if self.is_in_outdoors(limb) && mouths.iter().all(|m| m.facts.radius <= narrow) {
            return vec![limb];
        }
        let parts = self.regions[limb as usize].parts.clone();
        self.dissolve(limb);
        self.reach_in(mouths, narrow);
        let mut limbs = self.limbs_of(&parts);
        let is_owned = |t: u32| self.owner[t as usize] != NONE;
        let seeds: Vec<u32> = parts.iter().copied().filter(|&t| is_owned(t)).collect();
        self.flood(&seeds);
        for t in parts {
            if self.owner[t as usize] == NONE {
                self.give(t, widest.parent);
            }
        }
        limbs.reverse();
        limbs
    }

    /// Extends the regions beyond some mouths into parts without an owner, as far as balls of radius `least` pass.
    fn reach_in(&mut self, mouths: &[Mouth], least: f64) {
        // No other part is without an owner by now, except in rooms that nothing reaches from here.
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
            self.reach(m.parent, queue, least);
        }
    }

    /// Opens limbs among parts that have no owner; returns them widest first.
    fn limbs_of(&mut self, parts: &[u32]) -> Vec<u32> {
        let free = |t: &u32| self.owner[*t as usize] == NONE;
        let mut limbs = Vec::new();
        for b in self.by_radius(parts.iter().copied().filter(free)) {
            if self.owner[b as usize] != NONE {
                continue;
            }
            let limb = self.open_limb(b);
            if self.is_long(limb) {
                limbs.push(limb);
            } else {
                self.dissolve(limb);
            }
        }
        limbs
    }
}
