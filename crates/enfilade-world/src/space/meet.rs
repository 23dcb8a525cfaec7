//! Doors of different parts that meet: that touch, or that face each other within a tolerance and overlap when seen along
//! their normal. The connection of the latter is the thin prism between them rather than a polygon.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;

use super::{Buffers, Part, PartId, Place, Space};
use crate::pose::Pose;
use crate::shape::is_near;

/// The error within which doors of two parts that face each other count as one opening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Docking {
    /// Greatest distance of the openings, apart or into each other. [Units: wu] [Limit: at least 0]
    pub gap: f64,
    /// Greatest angle between their planes. [Units: rad] [Limit: at least 0, well below 90°]
    pub angle: f64,
}

impl Default for Docking {
    /// 1 cm, the accuracy at which lifts stop (EN 81-20, 5.12.1.1.4), and 1°, by which a door 1 m wide opens by less than 2 cm.
    fn default() -> Self {
        Self {
            gap: 0.01,
            angle: 1.0_f64.to_radians(),
        }
    }
}

/// Error of the sine of an angle between poses composed in `f64`.
const ROUNDING: f64 = 1e-9;

impl Docking {
    /// Returns the greatest distance of a point of an opening from the plane of one that it meets. [Units: wu]
    pub(crate) fn depth(&self, radius: f64) -> f64 {
        self.gap + 2.0 * radius * (self.angle.sin() + ROUNDING)
    }
}

impl Space {
    /// Returns the tolerance within which doors of parts meet.
    #[must_use]
    #[doc(hidden)]
    pub fn docking(&self) -> Docking {
        self.docking
    }

    /// Sets the tolerance within which doors of parts meet. O(parts).
    pub fn set_docking(&mut self, docking: Docking) {
        self.docking = docking;
        let mut buffers = std::mem::take(&mut self.buffers);
        for part in (1..self.parts.len() as u32).map(PartId) {
            if !self.is_present(part) {
                continue;
            }
            self.meet(part, &mut buffers);
        }
        self.buffers = buffers;
        self.changes.reset();
    }

    /// Calls `visit` with the doors of other parts, and the cells inside, that a point of a part's cell may be in, too: beside a
    /// door of the cell, where parts overlap or leave a gap.
    pub(crate) fn for_each_beyond(
        &self,
        place: Place,
        p: DVec3,
        mut visit: impl FnMut(PartId, PortalId, CellId),
    ) {
        let part = &self.parts[place.part.idx()];
        for door in part.doors.iter().filter(|d| d.inner == place.cell) {
            let opening = part.layout.opening(door.portal);
            let depth = self.docking.depth(opening.radius());
            if door.meets.is_empty() || opening.height_of(p).abs() > depth {
                continue;
            }
            if !opening.pieces().any(|piece| is_near(&[p], piece, depth)) {
                continue;
            }
            for &(other, portal) in &door.meets {
                let its = &self.parts[other.idx()].doors;
                if let Some(beyond) = its.iter().find(|d| d.portal == portal) {
                    visit(other, portal, beyond.inner);
                }
            }
        }
    }

    /// Updates the doors of other parts that the doors of a part meet, both ways.
    pub(super) fn meet(&mut self, id: PartId, buffers: &mut Buffers) {
        self.part_from_all(id);
        let near = &mut buffers.near;
        near.clear();
        let bounds = self.neighbors.bounds(id.0).expanded(self.docking.gap);
        self.neighbors
            .for_each_near(&bounds, |part| near.push(PartId(part)));
        // In the order of their numbers, so that equal poses give equal answers.
        near.sort_unstable();
        for &other in near.iter().filter(|p| **p != id) {
            let to_own = self.between(other, id);
            let to_other = to_own.inverse();
            for a in 0..self.parts[id.idx()].doors.len() {
                let (own, its) = (&self.parts[id.idx()], &self.parts[other.idx()]);
                let opening = own.layout.opening(own.doors[a].portal);
                let margin = own.layout.tolerance() + its.layout.tolerance();
                let reach = opening.radius() + margin + self.docking.gap;
                let center = to_other.point(opening.center());
                if its.hull.distance_squared(center) > reach * reach {
                    continue;
                }
                for b in 0..its.doors.len() {
                    let (own, its) = (&self.parts[id.idx()], &self.parts[other.idx()]);
                    let portals = [own.doors[a].portal, its.doors[b].portal];
                    if !is_met(
                        &self.docking,
                        [own, its],
                        portals,
                        &to_own,
                        &mut buffers.other,
                    ) {
                        continue;
                    }
                    let covers = covers([own, its], portals, &to_own, &to_other);
                    let doors = &mut self.parts[id.idx()].doors;
                    doors[a].meets.push((other, portals[1]));
                    doors[a].is_covered |= covers[0];
                    let doors = &mut self.parts[other.idx()].doors;
                    doors[b].meets.push((id, portals[0]));
                    doors[b].is_covered |= covers[1];
                }
            }
        }
    }

    /// Removes the meetings of a part's doors, on both sides.
    pub(super) fn part_from_all(&mut self, id: PartId) {
        for a in 0..self.parts[id.idx()].doors.len() {
            let mut meets = std::mem::take(&mut self.parts[id.idx()].doors[a].meets);
            for (other, portal) in meets.drain(..) {
                let mut doors = self.parts[other.idx()].doors.iter_mut();
                if let Some(door) = doors.find(|d| d.portal == portal) {
                    door.meets.retain(|m| m.0 != id);
                    // Met by others, it may still be covered by one; that is found when either moves.
                    door.is_covered = false;
                }
            }
            let door = &mut self.parts[id.idx()].doors[a];
            (door.meets, door.is_covered) = (meets, false);
        }
    }
}

/// Returns whether the opening of each of two parts is covered by that of the other, without a gap that tolerances leave.
fn covers(parts: [&Part; 2], portals: [PortalId; 2], to_own: &Pose, to_other: &Pose) -> [bool; 2] {
    let margin = parts[0].layout.tolerance() + parts[1].layout.tolerance();
    let openings = [0, 1].map(|k| parts[k].layout.opening(portals[k]));
    [(0, 1, to_other), (1, 0, to_own)].map(|(own, its, map)| {
        // Several pieces have bars between them, and those of two parts need not agree.
        let is_one = openings[its].pieces().len() == 1;
        let mut vertices = openings[own].pieces().flatten().map(|p| map.point(*p));
        let its = openings[its];
        is_one && vertices.all(|p| its.height_of(p).abs() <= margin && its.is_over(p, margin))
    })
}

/// Returns `true` if openings of two parts touch or dock; `between` maps points of the second to the frame of the first.
fn is_met(
    docking: &Docking,
    parts: [&Part; 2],
    portals: [PortalId; 2],
    between: &Pose,
    buffer: &mut Vec<DVec3>,
) -> bool {
    let margin = parts[0].layout.tolerance() + parts[1].layout.tolerance();
    let opening = parts[0].layout.opening(portals[0]);
    let beyond = parts[1].layout.opening(portals[1]);
    let normal = opening.normal();
    let sine = normal.cross(between.direction(beyond.normal())).length();
    let is_parallel = sine <= docking.angle.sin() + ROUNDING;
    let gap = if is_parallel { docking.gap } else { 0.0 };
    let reach = opening.radius() + beyond.radius() + margin + gap;
    let center = between.point(beyond.center());
    opening.center().distance(center) <= reach
        && beyond.pieces().any(|piece| {
            opening.pieces().any(|own| {
                buffer.clear();
                buffer.extend(piece.iter().map(|p| between.point(*p)));
                if !is_near(own, buffer, gap + margin) {
                    return false;
                }
                // Side by side is not face to face.
                for p in buffer.iter_mut().filter(|_| is_parallel) {
                    *p -= normal * opening.height_of(*p);
                }
                is_near(own, buffer, margin)
            })
        })
}
