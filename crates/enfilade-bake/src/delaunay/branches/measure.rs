//! Measures limbs: their mouths, and the facts that the rule needs.

use std::collections::BTreeMap;

use enfilade_geom::DVec3;

use super::super::space::connected;
use super::regions::{NONE, TubeRegions};
use super::rule::{LimbFacts, MouthFacts, n_main_mouths};
use crate::tubes::{DEEP, NARROWS};

/// A way out of a region within its room.
pub(super) struct Mouth {
    /// The region to which it leads.
    pub(super) parent: u32,
    /// Links across it.
    pub(super) links: Vec<u32>,
    /// [Units: wu]
    center: DVec3,
    pub(super) facts: MouthFacts,
}

impl TubeRegions<'_> {
    /// Returns the ways out of a region, widest first. Branches that leave the region itself are known by then, and do
    /// not count.
    pub(super) fn mouths(&self, region: u32) -> Vec<Mouth> {
        let mut contacts: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        let parts = self.regions[region as usize].parts.iter();
        for &t in parts.filter(self.allowance.each(2)) {
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
        mouths.sort_by(|a, b| b.facts.radius.total_cmp(&a.facts.radius));
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
        let surface = facets.iter().map(|f| f.1.length()).sum::<f64>().max(1e-300);
        let center = facets.iter().map(|f| f.0 * f.1.length()).sum::<DVec3>() / surface;
        let square = |f: &(DVec3, DVec3)| f.0.distance_squared(center) * f.1.length();
        Mouth {
            parent,
            center,
            facts: MouthFacts {
                radius: links.iter().map(|&l| self.passes(l)).fold(0.0, f64::max),
                area: facets.iter().map(|f| f.1).sum::<DVec3>().length(),
                spread: (facets.iter().map(square).sum::<f64>() / surface).sqrt(),
            },
            links,
        }
    }

    /// Returns the first of the mouths: those that count for the width of a limb.
    pub(super) fn main<'m>(&self, limb: u32, mouths: &'m [Mouth]) -> &'m [Mouth] {
        let radii: Vec<f64> = mouths.iter().map(|m| m.facts.radius).collect();
        &mouths[..n_main_mouths(&radii, self.is_in_outdoors(limb))]
    }

    pub(super) fn is_in_outdoors(&self, limb: u32) -> bool {
        self.is_outdoors(self.regions[limb as usize].parts[0])
    }

    fn far(&self, t: u32, mouth: &Mouth) -> f64 {
        self.centers[t as usize].distance(mouth.center)
    }

    /// Returns the facts of a limb with the given mouths.
    pub(super) fn facts(&self, limb: u32, mouths: &[Mouth]) -> LimbFacts {
        let is_outdoors = self.is_in_outdoors(limb);
        let parts = self.regions[limb as usize].parts.iter();
        let widest = mouths.first();
        LimbFacts {
            is_outdoors,
            mouths: mouths.iter().map(|m| m.facts).collect(),
            body: self.body(limb, self.main(limb, mouths)),
            trunk: widest.map_or(0.0, |m| self.trunk(m, is_outdoors)),
            depth: widest.map_or(0.0, |m| self.depth(limb, m)),
            volume: parts.map(|&t| self.space.volumes[t as usize]).sum(),
            exits: widest.map_or(0.0, |m| self.exits(limb, m.facts.radius)),
            finest: self.space.finest,
        }
    }

    /// Returns [`LimbFacts::body`].
    pub(super) fn body(&self, region: u32, main: &[Mouth]) -> Option<f64> {
        let parts = self.regions[region as usize].parts.iter();
        let is_within = |t: u32| main.iter().all(|m| self.far(t, m) >= 2.0 * m.facts.radius);
        let radius = parts
            .filter(|&&t| is_within(t))
            .map(|&t| self.radius(t))
            .fold(0.0, f64::max);
        (radius >= self.space.finest).then_some(radius)
    }

    /// Returns [`LimbFacts::trunk`].
    fn trunk(&self, mouth: &Mouth, is_outdoors: bool) -> f64 {
        let near = 2.0 * DEEP * mouth.facts.radius;
        let is_near = |t: u32| {
            // Outdoors, where points are few, balls may be near and their centers far.
            let ball = if is_outdoors { self.ball(t) } else { 0.0 };
            self.far(t, mouth) - ball <= near
        };
        let parts = self.regions[mouth.parent as usize].parts.iter();
        parts
            .filter(|&&t| is_near(t))
            .map(|&t| self.radius(t))
            .fold(0.0, f64::max)
    }

    /// Returns [`LimbFacts::depth`].
    fn depth(&self, limb: u32, mouth: &Mouth) -> f64 {
        let parts = self.regions[limb as usize].parts.iter();
        parts
            .filter(|&&t| self.radius(t) * NARROWS >= mouth.facts.radius)
            .map(|&t| self.far(t, mouth) + self.radius(t))
            .fold(0.0, f64::max)
    }

    /// Returns the area of the openings from a region to rooms with balls wider than `radius`. [Units: wu²]
    fn exits(&self, region: u32, radius: f64) -> f64 {
        let mut area = 0.0;
        for t in &self.regions[region as usize].parts {
            for &l in self.exits.get(t).into_iter().flatten() {
                let link = &self.space.links[l as usize];
                let other = link.parts[usize::from(link.parts[0] == *t)];
                if self.radius_of_room[&self.room_of_part[other as usize]] > radius {
                    area += self.space.area_vector(link).length();
                }
            }
        }
        area
    }
}
