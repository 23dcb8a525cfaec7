//! Floors of all parts of a space for one kind of walker, and lengths between their portals.

use std::sync::Arc;

use enfilade_cpg::{CellId, FittingPart, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_runtime::DetailId;

use super::floors::Floors;
use super::strides::Strides;
use super::ways::Ways;
use crate::bodies::Agent;
use crate::layout::Layout;
use crate::space::{PartId, Space};

/// Walkable paths of one kind of walker in the parts of a space, each in its own frame. Made once, read by all searches; a part
/// that moves changes nothing in it.
#[derive(Clone, Debug)]
pub struct WalkMap {
    pub(super) parts: Arc<Vec<Arc<PartMap>>>,
}

/// The map of a part.
#[derive(Debug)]
pub(super) struct PartMap {
    pub(super) floors: Floors,
    pub(super) ways: Ways,
    /// Per point of the ways, the floors on either side of the portal: in its first cell, in its second.
    pub(super) sides: Vec<[u32; 2]>,
    /// Per object, `true` if it stops walkers; leaves of doors do not.
    pub(super) stops: Vec<bool>,
}

/// A point on a floor, in the frame of its part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stand {
    pub(super) part: PartId,
    pub(super) at: DVec3,
    pub(super) floor: u32,
}

/// Distance between the points at which walkers cross a portal. [Units: wu]
///
/// Doorways have two or three; taut paths through a gate of 10 m bend by less than a hundredth more for it.
const SPACING: f64 = 1.0;

impl WalkMap {
    /// Prepares all parts with their objects, except leaves of doors, which walkers open. Takes seconds for a large building:
    /// floors are laid out in squares of a quarter of the walker's radius, and searched in each cell from each of its portals.
    /// Parts of one world share its floors. Parts that are added later have none.
    #[must_use]
    pub fn new(space: &Space, walker: Agent) -> Self {
        let mut maps: Vec<Arc<PartMap>> = Vec::new();
        for part in (0..space.n_parts() as u32).map(PartId) {
            let is_same = |p: &PartId| Arc::ptr_eq(space.world(*p), space.world(part));
            // The outdoors of the root is a place, unlike those of others.
            let known = (1..part.0).map(PartId).find(is_same);
            maps.push(match known {
                Some(p) => maps[p.idx()].clone(),
                None => Arc::new(PartMap::new(space, part, walker, |_| true)),
            });
        }
        Self {
            parts: Arc::new(maps),
        }
    }

    /// As [`WalkMap::new`], with those objects only for which `counts` returns `true`.
    #[must_use]
    pub fn with_objects(
        space: &Space,
        walker: Agent,
        mut counts: impl FnMut(PartId, DetailId) -> bool,
    ) -> Self {
        let parts = (0..space.n_parts() as u32).map(PartId);
        let maps = parts.map(|p| Arc::new(PartMap::new(space, p, walker, |d| counts(p, d))));
        Self {
            parts: Arc::new(maps.collect()),
        }
    }

    /// Makes the maps of all parts but the root.
    pub(super) fn around(
        root: PartMap,
        space: &Space,
        walker: Agent,
        mut counts: impl FnMut(PartId, DetailId) -> bool,
    ) -> Self {
        let others = (1..space.n_parts() as u32).map(PartId);
        let others = others.map(|p| Arc::new(PartMap::new(space, p, walker, |d| counts(p, d))));
        Self {
            parts: Arc::new(std::iter::once(Arc::new(root)).chain(others).collect()),
        }
    }

    /// Returns the floors of a part.
    ///
    /// # Panics
    ///
    /// If there was no such part when it was made; likewise in the other queries of one.
    #[must_use]
    pub fn floors(&self, part: PartId) -> &Floors {
        &self.parts[part.idx()].floors
    }

    /// Returns a part's points and lengths, for custom searches.
    #[must_use]
    pub fn ways(&self, part: PartId) -> &Ways {
        &self.parts[part.idx()].ways
    }

    /// Returns `true` if the walker fits through a portal within a part: wide and high enough, not a window or crack, with floors
    /// on both sides.
    #[must_use]
    pub fn is_walkable(&self, part: PartId, portal: PortalId) -> bool {
        !self.ways(part).points(portal).is_empty()
    }

    /// Returns where a walker with any part, from the feet to the head, at a point of a frame stands.
    pub(super) fn stand(&self, space: &Space, frame: PartId, p: DVec3) -> Option<Stand> {
        let half = DVec3::Y * 0.5 * self.floors(PartId::ROOT).walker().height;
        let located = [p + half, p].map(|p| space.locate(frame, p).map(|place| place.part));
        let parts = located.into_iter().chain([Some(frame), Some(PartId::ROOT)]);
        parts.flatten().find_map(|part| {
            let at = space.between(frame, part).point(p);
            let floor = self.parts.get(part.idx())?.floors.below(at)?;
            Some(Stand { part, at, floor })
        })
    }
}

/// Returns per object whether it stops walkers: if it counts, and is not a leaf that moves.
pub(super) fn stops_of(world: &World, mut counts: impl FnMut(DetailId) -> bool) -> Vec<bool> {
    let n = world.details.len() as u32;
    let mut stops: Vec<bool> = (0..n).map(|i| counts(DetailId(i))).collect();
    for fitting in world.graph.portals.iter().flat_map(|p| &p.fittings) {
        if fitting.part == FittingPart::Leaf && fitting.motion.is_some() {
            stops[fitting.detail as usize] = false;
        }
    }
    stops
}

impl PartMap {
    fn new(
        space: &Space,
        part: PartId,
        walker: Agent,
        mut counts: impl FnMut(DetailId) -> bool,
    ) -> Self {
        let (layout, world) = (space.layout(part), space.world(part));
        let n = world.details.len() as u32;
        let counted: Vec<bool> = (0..n).map(|i| counts(DetailId(i))).collect();
        let stops = stops_of(world, |d| counted[d.0 as usize]);
        let border = space.parts[part.idx()].border;
        let floors = Floors::new(layout, border, world, walker, |d| counted[d.0 as usize]);
        let mut chosen: Vec<(PortalId, [u32; 2])> = Vec::new();
        let mut by_portal: Vec<(PortalId, u32, u32)> = Vec::new();
        for c in floors.crossings().iter().filter(|c| c.direction < 2) {
            let to = floors.floor(c.from).steps[c.direction as usize];
            // Not where its own leaf stands.
            let is_free = |floor| {
                let is_edge = floors.floor(floor).is_edge;
                !is_edge && floors.leaves_at(floor).all(|p| p != c.portal)
            };
            if is_free(c.from) && is_free(to) {
                by_portal.push((c.portal, c.from, to));
            }
        }
        by_portal.sort_unstable();
        for all in by_portal.chunk_by(|a, b| a.0 == b.0) {
            choose_points(&floors, all, |from, to| {
                let first = layout.opening(all[0].0).cells()[0];
                let is_turned = floors.floor(from).cell != first;
                let pair = if is_turned { [to, from] } else { [from, to] };
                chosen.push((all[0].0, pair));
            });
        }
        let mut ways = Ways::with_points(layout, |portal, points| {
            let first = chosen.partition_point(|c| c.0 < portal);
            let own = chosen[first..].iter().take_while(|c| c.0 == portal);
            points.extend(own.map(|(_, [a, b])| (floors.point(*a) + floors.point(*b)) * 0.5));
        });
        let sides = chosen.iter().map(|c| c.1).collect();
        let mut map = Self {
            floors,
            ways: ways.clone(),
            sides,
            stops,
        };
        let mut strides = Strides::default();
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            let mut lengths = Vec::new();
            map.each_point(layout, cell, |portal, from| {
                strides.spread(&map.floors, from, None, &[portal], &[]);
                map.each_point(layout, cell, |_, to| {
                    lengths.push(strides.length(to) + map.floors.squares().side);
                });
            });
            // The leaves at both ends may be in the way.
            let n = lengths.len().isqrt();
            for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
                let longest = lengths[i * n + j].max(lengths[j * n + i]);
                (lengths[i * n + j], lengths[j * n + i]) = (longest, longest);
            }
            ways.set_lengths(cell, lengths);
        }
        map.ways = ways;
        map
    }

    /// Writes the lengths from a floor to the points of its cell, also over the `edges` that joints lead over.
    pub(super) fn measure(
        &self,
        strides: &mut Strides,
        layout: &Layout,
        from: u32,
        edges: &[u32],
        lengths: &mut Vec<f64>,
    ) {
        let half = 0.5 * self.floors.squares().side;
        strides.spread(&self.floors, from, None, &[], edges);
        lengths.clear();
        self.each_point(layout, self.floors.floor(from).cell, |_, floor| {
            lengths.push(strides.length(floor) + half);
        });
    }

    /// Calls `visit` with each point of a cell: its portal, and the floor on the cell's side, in the order of its ways.
    pub(super) fn each_point(
        &self,
        layout: &Layout,
        cell: CellId,
        mut visit: impl FnMut(PortalId, u32),
    ) {
        for exit in layout.exits(cell) {
            let side = usize::from(layout.opening(exit.portal).cells()[1] == cell);
            for k in self.ways.range(exit.portal) {
                visit(exit.portal, self.sides[k as usize][side]);
            }
        }
    }
}

/// Calls `choose` with some of all steps through a portal.
fn choose_points(floors: &Floors, all: &[(PortalId, u32, u32)], mut choose: impl FnMut(u32, u32)) {
    let mut points: Vec<(DVec3, u32, u32)> = (all.iter())
        .map(|&(_, a, b)| ((floors.point(a) + floors.point(b)) * 0.5, a, b))
        .collect();
    let low = points.iter().fold(DVec3::INFINITY, |m, p| m.min(p.0));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(p.0));
    let axis = if (high - low).x > (high - low).z {
        0
    } else {
        2
    };
    // Storey by storey, along the portal.
    let key = |p: &(DVec3, u32, u32)| ((p.0.y / floors.walker().height).round(), p.0[axis]);
    points.sort_by(|a, b| {
        key(a)
            .partial_cmp(&key(b))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    let gap = 4.0 * floors.squares().side + floors.walker().step;
    for group in points.chunk_by(|a, b| a.0.distance(b.0) < gap) {
        let length = group[0].0.distance(group[group.len() - 1].0);
        let n = ((length / SPACING).ceil() as usize).clamp(1, group.len());
        // At the middle of each part, and at both ends.
        for i in 0..=2 * n {
            let is_wanted = i % 2 == 1 || (length > 0.2 && (i == 0 || i == 2 * n));
            if is_wanted {
                let (_, a, b) = group[i * (group.len() - 1) / (2 * n)];
                choose(a, b);
            }
        }
    }
}
