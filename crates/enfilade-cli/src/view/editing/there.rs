//! Operations on what is there: pieces that are moved, turned and taken away, changes by hand that go.

use enfilade::edit::{EditOperation, HandEditKind};
use enfilade::geom::DVec3;
use enfilade::kit::InstanceId;

use super::aim::{EditRay, end_at, turned};
use super::editor::{Editor, Outcome};
use super::tool::Tool;

/// Distance from the ray up to which a lamp, a crate or a mirror is meant. [Units: wu]
const NEAR: f64 = 0.6;
/// Distance of the middles of one doorway, as its pieces have it. [Units: wu]
const SAME: f64 = 0.05;

impl Editor {
    /// Returns the piece there, or the one through whose open doorway the pointer leads outdoors.
    fn piece_at(&self, ray: &EditRay<'_>) -> Option<InstanceId> {
        let level = self.session.level();
        let through = || end_at(level, ray, None).map(|end| end.instance);
        ray.instance(level).or_else(through)
    }

    /// Takes the piece there in hand, or leaves it.
    pub(super) fn grab(&mut self, ray: &EditRay<'_>) -> Outcome {
        if self.grabbed.take().is_some() {
            return Outcome::Said("left where it was".into());
        }
        match self.piece_at(ray) {
            Some(id) => {
                self.corners.clear();
                self.turn = 0;
                self.grabbed = Some(id);
                Outcome::Said(format!("{} is in hand", self.name(id)))
            }
            None => Outcome::Refused("no piece there".into()),
        }
    }

    /// Turns the piece there.
    pub(super) fn turn_there(&mut self, ray: &EditRay<'_>) -> Outcome {
        let Some(id) = self.piece_at(ray) else {
            return Outcome::Refused("no piece there".into());
        };
        let name = self.name(id);
        match turned(self.session.level(), id) {
            Some(pose) => self.apply(EditOperation::Move(id, pose), format!("turned {name}")),
            None => Outcome::Refused(format!("{name} fits its doorway in one way only")),
        }
    }

    /// Takes away what is there, as the tool in hand means it.
    pub(super) fn delete(&mut self, ray: &EditRay<'_>) -> Outcome {
        match self.tool() {
            Tool::Piece(_) => match self.piece_at(ray) {
                Some(id) => {
                    let words = format!("took {} away", self.name(id));
                    self.apply(EditOperation::Take(id), words)
                }
                None => Outcome::Refused("no piece there".into()),
            },
            Tool::Portal | Tool::Door => self.delete_portal(ray),
            Tool::Mirror => self.delete_nearest(ray, "mirror"),
            Tool::Lamp => self.delete_nearest(ray, "lamp"),
            Tool::Crate => self.delete_nearest(ray, "crate"),
        }
    }

    /// Returns the number of the change by hand that made a door of the doorway of another, so that a second click takes that away.
    pub(super) fn made_door(&self, kind: &HandEditKind) -> Option<usize> {
        let HandEditKind::Door(at) = kind else {
            return None;
        };
        let mut edits = self.session.hand_edits().iter();
        edits.position(|edit| {
            matches!(self.session.placed(edit), Ok(HandEditKind::Door(made)) if made.distance(*at) < SAME)
        })
    }

    /// Deletes the portal there: takes it away if it was drawn, or else joins its two cells.
    fn delete_portal(&mut self, ray: &EditRay<'_>) -> Outcome {
        let Some(at) = ray.portal else {
            return Outcome::Refused("no portal there".into());
        };
        let edits = self.session.hand_edits().iter();
        let drawn = edits.enumerate().find(|(_, edit)| {
            matches!(self.session.placed(edit), Ok(HandEditKind::Portal(corners)) if is_in(&corners, at))
        });
        match drawn {
            Some((number, _)) => {
                let words = "took the portal away".to_owned();
                self.apply(EditOperation::Unmake(number), words)
            }
            None => {
                let edit = self.session.hosted(&HandEditKind::NoPortal(at));
                self.apply(EditOperation::Make(edit), "deleted the portal".into())
            }
        }
    }

    /// Takes away the change by hand of a kind that is nearest to the pointer.
    fn delete_nearest(&mut self, ray: &EditRay<'_>, word: &str) -> Outcome {
        let edits = self.session.hand_edits().iter().enumerate();
        let placed = edits.filter_map(|(number, edit)| {
            let kind = self.session.placed(edit).ok()?;
            (kind.word() == word).then(|| (ray.distance(kind.at()), number))
        });
        let nearest = placed.min_by(|a, b| a.0.total_cmp(&b.0));
        match nearest {
            Some((by, number)) if by <= NEAR => {
                let words = format!("took the {word} away");
                self.apply(EditOperation::Unmake(number), words)
            }
            _ => Outcome::Refused(format!("no {word} there that was made by hand")),
        }
    }
}

/// Returns `true` if a point lies in a convex polygon, or near it.
fn is_in(corners: &[DVec3], at: DVec3) -> bool {
    let [a, b, c, ..] = corners else {
        return false;
    };
    let normal = (*b - *a).cross(*c - *a).normalize_or_zero();
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    normal.dot(at - *a).abs() < 0.05
        && edges
            .map(|(p, q)| normal.dot((*q - *p).cross(at - *p)))
            .all(|side| side >= 0.0)
}
