//! A person who walks by cells alone: walls and furniture of a streamed world may be absent.

use enfilade::cpg::{CellId, PortalKind, World};
use enfilade::geom::DVec3;
use enfilade::runtime::Sight;
use enfilade::world::{PartId, Space};
use enfilade_render::{Camera, EYE_HEIGHT, FOV};

/// Longest step without a look around. [Units: wu]
const STEP: f64 = 0.05;
/// Distance kept from walls. [Units: wu]
const RADIUS: f64 = 0.25;
/// Height of steps and sills that are climbed. [Units: wu]
const CLIMB: f64 = 0.45;
/// Speed up and down. [Units: wu/s]
const LIFT: f64 = 3.0;
/// Farthest floor that is fallen to. [Units: wu]
const DEEP: f64 = 100.0;

/// Finds a first camera: in the middle of the largest room that leads to another, or else of the largest, toward its first doorway.
pub(super) fn start_in(world: &World, sight: &Sight) -> Camera {
    let middle = |aabb: [[f32; 3]; 2]| [0, 1, 2].map(|k| (aabb[0][k] + aabb[1][k]) * 0.5);
    let rooms = world.graph.places();
    let rooms = rooms.filter(|(id, cell)| sight.locate(middle(cell.aabb)) == Some(*id));
    let door = |room: CellId| {
        let mut exits = world.graph.exits(room);
        exits.find(|e| is_walked(e.portal.kind) && world.graph[e.to].is_place())
    };
    let largest = rooms.max_by(|(a, x), (b, y)| {
        let leads = door(*a).is_some().cmp(&door(*b).is_some());
        leads.then(x.volume.total_cmp(&y.volume))
    });
    let eye = largest.map_or([0.0; 3], |(_, cell)| middle(cell.aabb));
    let ahead = largest
        .and_then(|(id, _)| door(id))
        .map(|e| e.portal.center());
    let toward = ahead.map_or([1.0, 0.0, 0.0], |p| [p[0] - eye[0], 0.0, p[2] - eye[2]]);
    Camera {
        eye,
        toward: if toward[0].hypot(toward[2]) > 1e-3 {
            toward
        } else {
            [1.0, 0.0, 0.0]
        },
        fov_y: FOV,
    }
}

/// Moves an eye by `wish` (meters per second) for `seconds`. Matter between the cells stops it, and so do shut portals; it follows
/// the floor.
pub(super) fn step_in_cells(eye: DVec3, wish: DVec3, seconds: f64, space: &Space) -> DVec3 {
    let seconds = seconds.clamp(0.0, 0.1);
    let by = DVec3::new(wish.x, 0.0, wish.z) * seconds;
    let n = (by.length() / STEP).ceil().max(1.0);
    let mut at = eye;
    for _ in 0..n as u32 {
        for part in [by.x * DVec3::X, by.z * DVec3::Z] {
            if part != DVec3::ZERO && is_way(at, part / n, space) {
                at += part / n;
            }
        }
    }
    let wanted = f64::from(EYE_HEIGHT) - height(at, space).unwrap_or(EYE_HEIGHT.into());
    let up = wanted.clamp(-LIFT * seconds, LIFT * seconds);
    let to = at + DVec3::Y * up;
    if cell(to, space).is_some() { to } else { at }
}

fn cell(p: DVec3, space: &Space) -> Option<CellId> {
    space.sight(PartId::ROOT).locate(p.as_vec3().to_array())
}

/// Returns the height of a point over the floor, if there is one.
fn height(at: DVec3, space: &Space) -> Option<f64> {
    let mut down = (1..(DEEP / STEP) as u32).map(|i| f64::from(i) * STEP);
    cell(at, space)?;
    down.find(|d| cell(at - DVec3::Y * *d, space).is_none())
}

/// Returns `true` if a person at a point may move by a short vector.
fn is_way(at: DVec3, by: DVec3, space: &Space) -> bool {
    // From solid matter, every way is one out of it.
    let Some(from) = cell(at, space) else {
        return true;
    };
    let ahead = at + by + by.normalize_or_zero() * RADIUS;
    let knee = ahead - DVec3::Y * (f64::from(EYE_HEIGHT) - CLIMB);
    let is_low = height(at, space).is_some_and(|h| h < f64::from(EYE_HEIGHT) - CLIMB);
    if cell(ahead, space).is_none() || !is_low && cell(knee, space).is_none() {
        return false;
    }
    let Some(to) = cell(at + by, space) else {
        return false;
    };
    let (graph, state) = (&space.world(PartId::ROOT).graph, space.state(PartId::ROOT));
    to == from
        || graph.exits(from).any(|exit| {
            let is_shut = || state.shut_portals().any(|p| p == exit.id);
            exit.to == to && is_walked(exit.portal.kind) && !is_shut()
        })
}

fn is_walked(kind: PortalKind) -> bool {
    matches!(kind, PortalKind::Open | PortalKind::Door)
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::runtime::SightSkeleton;
    use enfilade_testkit::{GridParams, room_grid};

    fn hollow(n: usize) -> Space {
        let world = room_grid(&GridParams {
            size: [n, 1, 1],
            doors: 1.0,
            windows: 0.0,
            furniture: 0,
            ..GridParams::offices(1, 1)
        });
        let skeleton = Sight::build(&world).unwrap().skeleton().clone();
        let shell = SightSkeleton::hollow(&world);
        let sight = Sight::build_hollow(&shell, skeleton).unwrap();
        Space::with_sight(shell, sight)
    }

    fn walk(mut eye: DVec3, wish: DVec3, space: &Space) -> DVec3 {
        for _ in 0..400 {
            eye = step_in_cells(eye, wish, 0.02, space);
        }
        eye
    }

    #[test]
    fn who_walks_in_a_hollow_room_stands_on_its_floor_and_is_held_by_its_walls() {
        let space = hollow(1);
        let world = space.world(PartId::ROOT).clone();
        let [low, high] = world.graph.cells[0].aabb.map(|p| p.map(f64::from));
        let start = start_in(&world, space.sight(PartId::ROOT));
        let eye = DVec3::from(start.eye.map(f64::from));
        let end = walk(eye, DVec3::new(3.0, 0.0, 1.0), &space);
        let floor = end.y - f64::from(EYE_HEIGHT);
        assert!((floor - low[1]).abs() < 2.0 * STEP, "{end} {low:?}");
        assert!(end.x < high[0] && end.x > high[0] - 0.5, "{end} {high:?}");
        assert!(end.z < high[2] && end.z > low[2]);
    }

    #[test]
    fn who_walks_through_a_doorway_is_stopped_once_it_is_shut() {
        let mut space = hollow(2);
        let world = space.world(PartId::ROOT).clone();
        let between = |p: &enfilade::cpg::Portal| p.cells.map(|c| c.0) == [0, 1];
        let at = world.graph.portals.iter().position(between).unwrap();
        let door = world.graph.portals[at].center().map(f64::from);
        let [low, high] = world.graph.cells[0].aabb.map(|p| p.map(f64::from));
        let eye = DVec3::new((low[0] + high[0]) * 0.5, low[1] + 1.6, door[2]);
        assert!(walk(eye, DVec3::X, &space).x > door[0] + 1.0);
        space.close(PartId::ROOT, enfilade::cpg::PortalId(at as u32));
        assert!(walk(eye, DVec3::X, &space).x < door[0]);
    }
}
