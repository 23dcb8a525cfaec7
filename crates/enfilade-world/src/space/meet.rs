//! Doors of different parts that meet.

use enfilade_cpg::PortalId;
use enfilade_geom::DVec3;

use super::{Buffers, Part, PartId, Space};
use crate::pose::Pose;
use crate::shape::is_near;

impl Space {
    /// Updates the doors of other parts that the doors of a part meet, both ways.
    pub(super) fn meet(&mut self, id: PartId, buffers: &mut Buffers) {
        self.part_from_all(id);
        let near = &mut buffers.near;
        near.clear();
        self.neighbors.near(self.neighbors.bounds(id), near);
        // In the order of their numbers, so that equal poses give equal answers.
        near.sort_unstable();
        for &other in near.iter().filter(|p| **p != id) {
            let to_own = self.between(other, id);
            let to_other = to_own.inverse();
            for a in 0..self.parts[id.idx()].doors.len() {
                let (own, its) = (&self.parts[id.idx()], &self.parts[other.idx()]);
                let opening = own.layout.opening(own.doors[a].portal);
                let margin = own.layout.tolerance() + its.layout.tolerance();
                let reach = opening.radius() + margin;
                let center = to_other.point(opening.center());
                if its.hull.distance_squared(center) > reach * reach {
                    continue;
                }
                for b in 0..its.doors.len() {
                    let (own, its) = (&self.parts[id.idx()], &self.parts[other.idx()]);
                    let portals = [own.doors[a].portal, its.doors[b].portal];
                    if !is_met([own, its], portals, &to_own, &mut buffers.other) {
                        continue;
                    }
                    let doors = &mut self.parts[id.idx()].doors;
                    doors[a].meets.push((other, portals[1]));
                    let doors = &mut self.parts[other.idx()].doors;
                    doors[b].meets.push((id, portals[0]));
                }
            }
        }
    }

    /// Removes the meetings of a part's doors, on both sides.
    fn part_from_all(&mut self, id: PartId) {
        for a in 0..self.parts[id.idx()].doors.len() {
            let mut meets = std::mem::take(&mut self.parts[id.idx()].doors[a].meets);
            for (other, portal) in meets.drain(..) {
                let mut doors = self.parts[other.idx()].doors.iter_mut();
                if let Some(door) = doors.find(|d| d.portal == portal) {
                    door.meets.retain(|m| m.0 != id);
                }
            }
            self.parts[id.idx()].doors[a].meets = meets;
        }
    }
}

/// Returns `true` if openings of two parts touch; `between` maps points of the second to the frame of the first.
fn is_met(
    parts: [&Part; 2],
    portals: [PortalId; 2],
    between: &Pose,
    buffer: &mut Vec<DVec3>,
) -> bool {
    let margin = parts[0].layout.tolerance() + parts[1].layout.tolerance();
    let opening = parts[0].layout.opening(portals[0]);
    let beyond = parts[1].layout.opening(portals[1]);
    let reach = opening.radius() + beyond.radius() + margin;
    let center = between.point(beyond.center());
    opening.center().distance(center) <= reach
        && beyond.pieces().any(|piece| {
            buffer.clear();
            buffer.extend(piece.iter().map(|p| between.point(*p)));
            opening.pieces().any(|p| is_near(p, buffer, margin))
        })
}
