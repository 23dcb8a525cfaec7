//! Ways of actors: paths of walkers, cut where they pass portals, so that an actor is listed in the cell where it is.

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;

use crate::actors::plan::WayPoint;
use crate::layout::Layout;
use crate::paths::Path;

impl Path {
    /// Adds the points after the start, and those where the path passes portals, each with the cell on the way to it: for
    /// [`Errands::plan`](crate::Errands::plan). `here` is the cell of a path that passes no portal. The path stays in the part of
    /// `layout`: an actor's way is in one frame. O(points + portals).
    pub fn add_way_points(&self, layout: &Layout, here: CellId, way: &mut Vec<WayPoint>) {
        let mut cell = self.portals.first().map_or(here, |first| {
            let [a, b] = layout.opening(first.exit.portal).cells();
            if a == first.exit.to { b } else { a }
        });
        let mut next = self.portals.iter().peekable();
        for (i, leg) in self.points.windows(2).enumerate() {
            let mut at = 0.0;
            while let Some(passed) = next.peek() {
                let own = share_of(leg[0].at, leg[1].at, passed.at).filter(|share| *share >= at);
                // Rounding may leave one on no leg: it is passed at the end at the latest.
                let is_last = i + 2 == self.points.len();
                let Some(share) = own.or(is_last.then_some(1.0)) else {
                    break;
                };
                let point = leg[0].at.lerp(leg[1].at, share);
                way.push(WayPoint { at: point, cell });
                (at, cell) = (share, passed.exit.to);
                next.next();
            }
            let at = leg[1].at;
            way.push(WayPoint { at, cell });
        }
    }
}

/// Farthest a passage may be from its leg by rounding. [Units: wu]
const ROUNDING: f64 = 1e-6;
/// Farthest it may be above or below: more than a path cuts off a step, less than a storey, as stairs lead over one another.
/// [Units: wu]
const STOREY: f64 = 1.0;

/// Returns the share of a leg after which it is at a point, in plan; `None` if it does not pass it.
fn share_of(from: DVec3, to: DVec3, p: DVec3) -> Option<f64> {
    let [along, by] = [to - from, p - from].map(|v| v.with_y(0.0));
    let share = (by.dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
    let is_there = by.distance(along * share) <= ROUNDING;
    let up = p.y - from.lerp(to, share).y;
    (is_there && up.abs() <= STOREY).then_some(share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::LayoutExit;
    use crate::paths::{PathPoint, PathPortal};
    use crate::space::PartId;
    use enfilade_cpg::PortalId;
    use enfilade_testkit::{GridParams, room_grid};

    fn on_root(at: DVec3) -> PathPoint {
        PathPoint {
            part: PartId::ROOT,
            at,
        }
    }

    #[test]
    fn a_portal_on_the_next_flight_of_stairs_is_not_passed_on_this_one() {
        let layout = Layout::new(&room_grid(&GridParams::two_rooms()));
        let [here, there] = layout.opening(PortalId(0)).cells();
        let path = Path {
            // Up, across, and back above the first flight.
            points: [
                DVec3::ZERO,
                DVec3::new(4.0, 1.5, 0.0),
                DVec3::new(0.0, 3.0, 0.0),
            ]
            .map(on_root)
            .to_vec(),
            portals: vec![PathPortal {
                part: PartId::ROOT,
                exit: LayoutExit {
                    portal: PortalId(0),
                    to: there,
                },
                at: DVec3::new(1.0, 2.7, 0.0),
            }],
            ..Path::default()
        };
        let mut way = Vec::new();
        path.add_way_points(&layout, here, &mut way);
        let cells: Vec<CellId> = way.iter().map(|w| w.cell).collect();
        assert_eq!(cells, [here, here, there]);
        assert_eq!(way[1].at, DVec3::new(1.0, 2.625, 0.0));
    }

    #[test]
    fn a_straight_path_through_a_door_is_listed_in_both_rooms() {
        let layout = Layout::new(&room_grid(&GridParams::two_rooms()));
        let door = layout.opening(PortalId(0));
        let [here, there] = door.cells();
        let at = |x: f64| (door.center() + door.normal() * x).with_y(0.0);
        let path = Path {
            points: [at(-1.0), at(1.5), at(1.5) + DVec3::Z]
                .map(on_root)
                .to_vec(),
            portals: vec![PathPortal {
                part: PartId::ROOT,
                exit: LayoutExit {
                    portal: PortalId(0),
                    to: there,
                },
                // On the floor behind a sill: above the line between the ends.
                at: at(0.0) + DVec3::Y * 0.1,
            }],
            ..Path::default()
        };
        let mut way = Vec::new();
        path.add_way_points(&layout, there, &mut way);
        let cells: Vec<CellId> = way.iter().map(|w| w.cell).collect();
        assert_eq!(cells, [here, there, there]);
        assert!(way[0].at.distance(at(0.0)) < 1e-9, "{}", way[0].at);
        assert_eq!(way[2].at, path.points[2].at);
        // Without a portal, in the given cell.
        way.clear();
        let path = Path {
            points: path.points,
            ..Path::default()
        };
        path.add_way_points(&layout, there, &mut way);
        assert!(way.len() == 2 && way.iter().all(|w| w.cell == there));
    }
}
