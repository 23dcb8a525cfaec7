//! Operations by chance, for tests of sessions and of programs on top of them.

use std::f64::consts::FRAC_PI_2;

use enfilade_geom::{Aabb, DVec3};
use enfilade_kit::{Assembly, End, InstanceId};
use enfilade_world::Pose;

use crate::hand::{HandEdit, HandEditKind};
use crate::operation::EditOperation;
use crate::session::EditSession;

/// Number of instances from which on more are taken away than placed.
const FULL: usize = 12;
/// Number of changes by hand from which on one is taken away for each that is made.
const MANY: usize = 6;

/// Returns an operation for a session by chance, which may be refused; `below(n)` returns a number from 0 to `n - 1`.
///
/// Levels stay at about a dozen instances and half a dozen changes by hand. Needs a kit with pieces.
#[must_use]
pub fn random_operation(
    session: &EditSession,
    below: &mut impl FnMut(usize) -> usize,
) -> EditOperation {
    let level = session.level();
    let standing: Vec<InstanceId> = level.instances().map(|i| i.0).collect();
    let n_edits = session.hand_edits().len();
    let pick = |below: &mut dyn FnMut(usize) -> usize| standing[below(standing.len())];
    let choice = below(100);
    if standing.is_empty() {
        return put(level, below, None);
    }
    match choice {
        0..2 if n_edits > 0 && below(MANY) < n_edits => EditOperation::Unmake(below(n_edits)),
        0..2 => EditOperation::Make(hand_edit(level, pick(below), below)),
        2..25 => EditOperation::Take(pick(below)),
        25..45 => moved(level, pick(below), below),
        45..55 => {
            let id = pick(below);
            let turn = Pose::about(middle(level, id), DVec3::Y, FRAC_PI_2);
            EditOperation::Move(id, turn.after(&pose_of(level, id)))
        }
        _ if standing.len() > FULL => EditOperation::Take(pick(below)),
        _ => {
            let ends: Vec<End> = level.open_ends().collect();
            let onto = ends.get(below(ends.len().max(1))).copied();
            put(level, below, onto)
        }
    }
}

fn pose_of(level: &Assembly, id: InstanceId) -> Pose {
    level.standing(id).map_or(Pose::IDENTITY, |i| i.pose)
}

fn middle(level: &Assembly, id: InstanceId) -> DVec3 {
    let bounds = level.piece(id).bounds();
    pose_of(level, id).point(DVec3::new(bounds.center().x, 0.0, bounds.center().z))
}

/// Places a piece onto an end if one of its attachments fits, or somewhere.
fn put(
    level: &Assembly,
    below: &mut impl FnMut(usize) -> usize,
    onto: Option<End>,
) -> EditOperation {
    let number = below(level.kit().pieces().len());
    let piece = &level.kit().pieces()[number];
    let own = below(piece.attachments().len().max(1));
    let fitted = onto.and_then(|end| level.pose_onto(number, own, end, 0.0).ok());
    let somewhere = |below: &mut dyn FnMut(usize) -> usize| {
        let at = [below(200), below(200)].map(|x| x as f64 - 100.0);
        Pose::from_translation(DVec3::new(at[0], 0.0, at[1]))
    };
    let pose = fitted.unwrap_or_else(|| somewhere(below));
    EditOperation::put(piece.name(), None, pose)
}

/// Moves an instance onto an open end of another.
fn moved(
    level: &Assembly,
    id: InstanceId,
    below: &mut impl FnMut(usize) -> usize,
) -> EditOperation {
    let ends: Vec<End> = level.open_ends().filter(|e| e.instance != id).collect();
    let onto = ends.get(below(ends.len().max(1))).copied();
    let own = below(level.piece(id).attachments().len().max(1));
    let piece = level.standing(id).map_or(0, |i| i.piece);
    let pose = onto.and_then(|end| level.pose_onto(piece, own, end, 0.0).ok());
    EditOperation::Move(id, pose.unwrap_or(pose_of(level, id)))
}

fn hand_edit(level: &Assembly, id: InstanceId, below: &mut impl FnMut(usize) -> usize) -> HandEdit {
    let piece = level.piece(id);
    let rooms: Vec<Aabb> = (piece.world().graph.rooms())
        .map(|(_, cell)| {
            let [low, high] = cell.aabb.map(|p| DVec3::from(p.map(f64::from)));
            Aabb::new(low, high)
        })
        .collect();
    let room = rooms.get(below(rooms.len().max(1))).copied();
    let Aabb { min, max } = room.unwrap_or(*piece.bounds());
    let center = (min + max) * 0.5;
    let doorway = |below: &mut dyn FnMut(usize) -> usize| {
        let portals = &piece.world().graph.portals;
        let portal = portals.get(below(portals.len().max(1)));
        portal.map_or(center, |p| DVec3::from(p.center().map(f64::from)))
    };
    let kind = match below(6) {
        0 => HandEditKind::Lamp(center),
        1 => HandEditKind::Crate(DVec3::new(center.x, min.y, center.z), below(6) as f64),
        2 => HandEditKind::Door(doorway(below)),
        3 => HandEditKind::NoPortal(doorway(below)),
        4 => {
            let x = center.x + (max.x - min.x) * 0.4;
            let corner = |y, z| DVec3::new(x, y, z);
            let [low, high] = [min - DVec3::splat(0.1), max + DVec3::splat(0.1)];
            HandEditKind::Portal(vec![
                corner(low.y, low.z),
                corner(high.y, low.z),
                corner(high.y, high.z),
                corner(low.y, high.z),
            ])
        }
        _ => {
            let corner = |y: f64, z: f64| DVec3::new(min.x, min.y + y, min.z + z);
            HandEditKind::Mirror(vec![
                corner(0.5, 0.2),
                corner(1.5, 0.2),
                corner(1.5, 0.8),
                corner(0.5, 0.8),
            ])
        }
    };
    HandEdit {
        host: Some(id),
        kind,
    }
}
