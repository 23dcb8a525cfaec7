//! Aiming: the place that the pointer means for a piece or a polygon.

use std::f64::consts::FRAC_PI_2;

use enfilade::geom::{DQuat, DVec3};
use enfilade::kit::{Assembly, End, InstanceId, Link};
use enfilade::world::{PartId, Pose, Space};

/// Distance up to which doorways are aimed at. [Units: wu]
const REACH: f64 = 40.0;
/// Distance before the eye at which a piece stands that is put nowhere. [Units: wu]
const AHEAD: f64 = 10.0;
/// Grid of pieces that are put nowhere, and steps by which they turn. [Units: wu, rad]
const GRID: f64 = 0.5;
const TURN: f64 = FRAC_PI_2 / 6.0;
/// Distance by which a drawn portal reaches into walls around it. [Units: wu]
const INTO: f64 = 0.25;
/// Distance beyond a surface at which its wall begins. [Units: wu]
const SKIN: f64 = 0.02;

/// A ray from the eye through the pointer.
#[derive(Clone, Copy)]
pub(crate) struct EditRay<'a> {
    pub(crate) eye: DVec3,
    /// Unit vector.
    pub(crate) toward: DVec3,
    /// The first surface: its point and its normal.
    pub(crate) hit: Option<[DVec3; 2]>,
    /// Middle of the portal there.
    pub(crate) portal: Option<DVec3>,
    /// The walls.
    pub(crate) space: &'a Space,
}

impl EditRay<'_> {
    fn wall(&self) -> f64 {
        self.hit.map_or(REACH, |[at, _]| at.distance(self.eye))
    }

    /// Returns the distance at which the ray passes a plane, if it does.
    fn meets(&self, at: DVec3, normal: DVec3) -> Option<f64> {
        let t = normal.dot(at - self.eye) / normal.dot(self.toward);
        (t.is_finite() && t > 0.0).then_some(t)
    }

    /// Returns the point where the ray passes a plane, or the surface before it.
    pub(super) fn on_plane(&self, at: DVec3, normal: DVec3) -> Option<DVec3> {
        self.meets(at, normal).map(|t| self.eye + self.toward * t)
    }

    /// Returns the instance that the ray hits: that of the wall, or that of the room before it.
    pub(super) fn instance(&self, level: &Assembly) -> Option<InstanceId> {
        let [at, normal] = self.hit?;
        let [inside, before] = [at - normal * SKIN, at + normal * SKIN];
        level
            .instance_at(before)
            .or_else(|| level.instance_at(inside))
    }

    /// Returns the distance of a point from the ray. [Units: wu]
    pub(super) fn distance(&self, p: DVec3) -> f64 {
        let along = (p - self.eye).dot(self.toward).max(0.0);
        p.distance(self.eye + self.toward * along)
    }
}

/// Returns the open end that a ray points at: the first whose outline it passes before any wall. Those of `except` do not count.
pub(super) fn end_at(
    level: &Assembly,
    ray: &EditRay<'_>,
    except: Option<InstanceId>,
) -> Option<End> {
    let ends = level.open_ends().filter(|e| Some(e.instance) != except);
    let hit = ends.filter_map(|end| {
        let pose = level.standing(end.instance).ok()?.pose;
        let mouth = &level.piece(end.instance).attachments()[end.attachment].mouth;
        let frame = pose.after(&mouth.frame);
        let t = ray.meets(frame.at, frame.direction(DVec3::Z))?;
        let own = frame.point_back(ray.eye + ray.toward * t);
        let edges = mouth
            .outline
            .iter()
            .zip(mouth.outline.iter().cycle().skip(1));
        let mut sides = edges.map(|(a, b)| (*b - *a).perp_dot(own.truncate() - *a));
        let is_in = sides.all(|s| s >= 0.0);
        (is_in && t < ray.wall() + INTO && t < REACH).then_some((t, end))
    });
    hit.min_by(|a, b| a.0.total_cmp(&b.0)).map(|h| h.1)
}

/// Returns the pose of a piece at an end: by the attachment that is `turn` further than the first that fits. A piece without
/// attachments, such as a wall, stands in front of the opening.
///
/// # Errors
///
/// Why no attachment fits.
pub(super) fn pose_at_end(
    level: &Assembly,
    piece: usize,
    end: End,
    turn: i32,
) -> Result<Pose, String> {
    let own = level.kit().pieces()[piece].attachments();
    if own.is_empty() {
        let host = level.standing(end.instance).map_err(|e| e.to_string())?;
        let mouth = &level.piece(end.instance).attachments()[end.attachment].mouth;
        return Ok(host.pose.after(&mouth.frame));
    }
    let fitted: Vec<Pose> = (0..own.len())
        .filter_map(|k| level.pose_onto(piece, k, end, 0.0).ok())
        .collect();
    match fitted.len() {
        0 => {
            let why = level.pose_onto(piece, 0, end, 0.0);
            Err(why.err().map_or_else(String::new, |e| e.to_string()))
        }
        n => Ok(fitted[turn.rem_euclid(n as i32) as usize]),
    }
}

/// Returns the pose of a piece that is put nowhere: on the surface there, or on the ground before the eye.
pub(super) fn pose_anywhere(ray: &EditRay<'_>, turn: i32) -> Pose {
    let floor = ray.hit.filter(|[_, normal]| normal.y > 0.7);
    let ground = || {
        let t = ray.meets(DVec3::ZERO, DVec3::Y).filter(|t| *t < REACH);
        ray.eye + ray.toward * t.unwrap_or(AHEAD)
    };
    let at = floor.map_or_else(ground, |[at, _]| at);
    let snapped = |x: f64| (x / GRID).round() * GRID;
    let height = floor.map_or(0.0, |[at, _]| at.y);
    Pose {
        turn: DQuat::from_rotation_y(f64::from(turn) * TURN),
        at: DVec3::new(snapped(at.x), height, snapped(at.z)),
    }
}

/// Returns the heading of a crate after so many turns. [Units: rad]
pub(super) fn heading(turn: i32) -> f64 {
    f64::from(turn) * TURN
}

/// Returns the pose of an instance turned where it stands: by its next attachment that fits the doorway to which it is joined,
/// or by a quarter about its middle.
pub(super) fn turned(level: &Assembly, id: InstanceId) -> Option<Pose> {
    let instance = level.standing(id).ok()?;
    let own = level.piece(id).attachments();
    let links = instance.links.iter().enumerate();
    let joined = links.filter_map(|(k, link)| match link {
        Link::Joined(end) => Some((k, *end)),
        _ => None,
    });
    let Some((k, end)) = joined.into_iter().next() else {
        let bounds = level.piece(id).bounds();
        let middle = instance.pose.point(bounds.center());
        return Some(Pose::about(middle, DVec3::Y, FRAC_PI_2).after(&instance.pose));
    };
    let host = level.standing(end.instance).ok()?.pose;
    let its = &level.piece(end.instance).attachments()[end.attachment].mouth;
    let next = (1..own.len()).map(|i| (k + i) % own.len());
    let mut fits = next.filter(|k| its.misfit(&own[*k].mouth, 0.0) <= level.tolerance());
    let next = fits.next()?;
    Some(host.after(&its.meeting(&own[next].mouth, 0.0)))
}

/// Returns the upright rectangle through two opposite vertices of a portal, out to the walls around it, and somewhat into them.
///
/// # Errors
///
/// If the vertices are above each other, or at one height.
pub(super) fn portal_rectangle([a, b]: [DVec3; 2], space: &Space) -> Result<Vec<DVec3>, String> {
    let along = DVec3::new(b.x - a.x, 0.0, b.z - a.z);
    if along.length() < 0.1 || (b.y - a.y).abs() < 0.1 {
        return Err(
            "the two corners must differ in place and in height, as the foot of one wall and the head of another".into(),
        );
    }
    let (middle, out) = ((a + b) * 0.5, along.normalize());
    // Where there is no wall, as out of a doorway, it ends at the vertices.
    let reach = |toward: DVec3, least: f64| {
        let hit = space.first_wall(PartId::ROOT, [middle, middle + toward * REACH]);
        hit.map_or(least, |t| least.max(t * REACH)) + INTO
    };
    let [half, rise] = [along.length() * 0.5, (b.y - a.y).abs() * 0.5];
    let [back, ahead] = [-out, out].map(|toward| reach(toward, half));
    let [down, up] = [DVec3::NEG_Y, DVec3::Y].map(|toward| reach(toward, rise));
    let at = |along: f64, up: f64| middle + out * along + DVec3::Y * up;
    Ok(vec![
        at(-back, -down),
        at(ahead, -down),
        at(ahead, up),
        at(-back, up),
    ])
}

/// Returns the rectangle between two opposite vertices in a plane, upright if the plane is.
///
/// # Errors
///
/// If it has no area to speak of.
pub(super) fn rectangle_in([a, b]: [DVec3; 2], normal: DVec3) -> Result<Vec<DVec3>, String> {
    let up = if normal.y.abs() > 0.9 {
        DVec3::Z
    } else {
        DVec3::Y
    };
    let right = up.cross(normal).normalize();
    let up = normal.cross(right);
    let [x, y] = [right, up].map(|axis| axis * axis.dot(b - a));
    if x.length() < 0.05 || y.length() < 0.05 {
        return Err("the two corners are too close to each other".into());
    }
    Ok(vec![a, a + x, a + x + y, a + y])
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::World;
    use enfilade_testkit::{GridParams, room_grid};

    #[test]
    fn rectangles_are_upright_and_flat_and_portals_reach_into_walls() {
        let [a, b] = [DVec3::new(0.0, 0.0, 1.0), DVec3::new(2.0, 3.0, 1.0)];
        let empty = Space::new(World::default()).unwrap();
        let portal = portal_rectangle([a, b], &empty).unwrap();
        assert!(portal[0].distance(DVec3::new(-INTO, -INTO, 1.0)) < 1e-9);
        assert!(portal[2].distance(DVec3::new(2.0 + INTO, 3.0 + INTO, 1.0)) < 1e-9);
        assert!(portal_rectangle([a, a + DVec3::Y], &empty).is_err());
        assert!(portal_rectangle([a, a + DVec3::X], &empty).is_err());
        // In a room, it reaches into all walls.
        let room = room_grid(&GridParams {
            size: [1, 1, 1],
            doors: 0.0,
            windows: 0.0,
            furniture: 0,
            ..GridParams::offices(1, 1)
        });
        let vector = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        let [low, high] = room.graph.cells[0].aabb.map(vector);
        let middle = (low + high) * 0.5;
        let by = DVec3::new(0.3, 0.4, 0.0);
        let space = Space::new(room.clone()).unwrap();
        let portal = portal_rectangle([middle - by, middle + by], &space).unwrap();
        let into = DVec3::new(INTO, INTO, 0.0);
        let corner = |p: DVec3| DVec3::new(p.x, p.y, middle.z);
        assert!(portal[0].distance(corner(low) - into) < 1e-3, "{portal:?}");
        assert!(portal[2].distance(corner(high) + into) < 1e-3, "{portal:?}");
        let wall = rectangle_in([b, a], DVec3::Z).unwrap();
        assert!(wall.iter().all(|p| p.z == 1.0));
        assert_eq!((wall[1].x, wall[1].y, wall[3].y), (0.0, 3.0, 0.0));
        assert!(rectangle_in([a, a + DVec3::X], DVec3::Z).is_err());
        let floor = rectangle_in([a, DVec3::new(2.0, 0.0, 3.0)], DVec3::Y).unwrap();
        assert!(floor.iter().all(|p| p.y == 0.0));
    }

    #[test]
    fn a_piece_put_nowhere_stands_on_the_grid_of_the_ground() {
        let mut ray = EditRay {
            eye: DVec3::new(0.1, 2.0, 0.0),
            toward: DVec3::new(0.0, -1.0, -2.0).normalize(),
            hit: None,
            portal: None,
            space: &Space::new(World::default()).unwrap(),
        };
        let pose = pose_anywhere(&ray, 6);
        assert!(pose.at.distance(DVec3::new(0.0, 0.0, -4.0)) < 1e-9);
        assert!(pose.direction(DVec3::X).distance(-DVec3::Z) < 1e-9);
        ray.toward = -DVec3::Z;
        assert!(pose_anywhere(&ray, 0).at.distance(DVec3::NEG_Z * AHEAD) < 1e-9);
        ray.hit = Some([DVec3::new(0.0, 3.2, -2.2), DVec3::Y]);
        assert!(
            pose_anywhere(&ray, 0)
                .at
                .distance(DVec3::new(0.0, 3.2, -2.0))
                < 1e-9
        );
    }
}
