//! Doors that open as somebody nears, and gates of lifts that open when the lift is there.

use enfilade::cpg::PortalId;
use enfilade::geom::DVec3;
use enfilade::world::{PartId, Space};

use super::lift::{Lift, LiftPlace};

/// Distance at which a door opens. [Units: wu]
const NEAR: f64 = 1.7;
/// Time from shut to open. [Units: s]
const TIME: f64 = 0.7;
/// Farthest distance of a gate from the lift's door at a stop. [Units: wu]
const GATE: f64 = 0.5;

/// The doors of a world that have leaves.
#[derive(Default)]
pub(super) struct AutoDoors {
    doors: Vec<Door>,
}

struct Door {
    portal: PortalId,
    center: DVec3,
    share: f64,
    /// The lift that it is a gate of, and the stop.
    gate: Option<(usize, usize)>,
}

impl AutoDoors {
    /// Finds the doors of the root; those in front of a lift's door at a stop are its gates.
    pub(super) fn new(space: &Space, lifts: &[Lift]) -> Self {
        let layout = space.layout(PartId::ROOT);
        let mut doors = Vec::new();
        for portal in (0..layout.n_portals() as u32).map(PortalId) {
            let leaves = space.sight(PartId::ROOT).leaves(portal);
            let opening = layout.opening(portal);
            // Windows do not open by themselves.
            if leaves.is_empty() || opening.kind() != enfilade::cpg::PortalKind::Door {
                continue;
            }
            let center = opening.center();
            doors.push(Door {
                portal,
                center,
                share: 0.0,
                gate: gate_at(space, lifts, center),
            });
        }
        Self { doors }
    }

    /// Returns `true` if a portal is a gate of a lift.
    pub(super) fn is_gate(&self, portal: PortalId) -> bool {
        let known = self.doors.binary_search_by_key(&portal, |d| d.portal);
        known.is_ok_and(|i| self.doors[i].gate.is_some())
    }

    /// Moves the leaves: open where somebody is near, or the lift's door is.
    pub(super) fn step(
        &mut self,
        space: &mut Space,
        near: &[DVec3],
        lifts: &[LiftPlace],
        seconds: f64,
    ) {
        let by = seconds / TIME;
        for door in &mut self.doors {
            let before = door.share;
            door.share = match door.gate {
                Some((lift, stop)) => match lifts[lift].stop {
                    Some((at, open)) if at == stop => open,
                    _ => 0.0,
                },
                None => {
                    let is_near = near.iter().any(|p| p.distance(door.center) < NEAR);
                    let target = if is_near { 1.0 } else { 0.0 };
                    before + (target - before).clamp(-by, by)
                }
            };
            if door.share != before {
                space.set_leaves(PartId::ROOT, door.portal, door.share as f32);
            }
        }
    }

    /// Leaves a door as it is from now on.
    pub(super) fn leave_alone(&mut self, portal: PortalId) {
        self.doors
            .retain(|d| d.portal != portal || d.gate.is_some());
    }

    /// Shuts all.
    pub(super) fn shut(&self, space: &mut Space) {
        for door in &self.doors {
            space.set_leaves(PartId::ROOT, door.portal, 0.0);
        }
    }
}

/// Returns the lift and the stop at which one of the lift's doors is at a point.
fn gate_at(space: &Space, lifts: &[Lift], p: DVec3) -> Option<(usize, usize)> {
    for (i, lift) in lifts.iter().enumerate() {
        let layout = space.layout(lift.part);
        let Some(border) = layout.outdoors() else {
            continue;
        };
        for exit in layout.exits(border) {
            let door = layout.opening(exit.portal).center();
            let is_there = |stop: &DVec3| p.distance(*stop + door) < GATE;
            if let Some(stop) = lift.stops.iter().position(is_there) {
                return Some((i, stop));
            }
        }
    }
    None
}
