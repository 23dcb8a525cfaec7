//! Leaves of doors: hinged at their edge, shut where they close their opening, open where they clear it.

use enfilade_cpg::{Motion, MotionKind};
use enfilade_geom::{Aabb, DVec3, Triangle};

use super::opening::{BESIDE, DEEP, FittedOpening};
use crate::subject::to_dvec;

/// Largest distance of a hinge from the edge of its leaf: the edge may be that of the glass, within rails. [Units: wu]
const AT_EDGE: f64 = 0.15;
/// The sine of about 6 degrees: tolerance for directions along, across or upright.
const ASKEW: f64 = 0.1;
/// Least share of an opening that a leaf closes: the narrower of two leaves, or one below a light, closes less than
/// half.
const CLOSES: f64 = 0.15;
/// Largest ratio of the area that a leaf covers fully open to that covered shut: 0.5 if it turns by 60 degrees.
const CLEARS: f64 = 0.6;
/// Largest turn of a leaf: beyond, it would be in the wall on its other side. [Units: rad]
const MOST_TURNED: f64 = 3.3;
/// Rounding of a leaf's pose in the file. [Units: rad or wu]
const ROUNDING: f64 = 1e-4;
/// Thickness below which the side to which a leaf opens is not judged. [Units: wu]
const THIN: f64 = 0.01;
/// A hinge is at a face of its leaf if its distance from the middle exceeds this share of the thickness.
const AT_FACE: f64 = 0.3;

/// Objects that move together in an opening.
pub(super) struct Leaf<'a> {
    pub(super) motion: &'a Motion,
    /// As the file poses them.
    pub(super) triangles: Vec<Triangle>,
}

impl Leaf<'_> {
    /// Returns its triangles at a share of its path, in the opening's directions.
    fn at(&self, share: f32, opening: &FittedOpening) -> Vec<Triangle> {
        let by = self.motion.at(share);
        let place = |p| opening.place(by.transform_point3(p));
        self.triangles.iter().map(|t| t.map(place)).collect()
    }

    /// Returns a fault of its motion in an opening.
    pub(super) fn problem(&self, opening: &FittedOpening) -> Option<String> {
        let [from, to] = [self.motion.shut, self.motion.open].map(f64::from);
        if from.min(to) > ROUNDING || from.max(to) < -ROUNDING {
            return Some("its pose in the file is not between shut and open".into());
        }
        let is_turn = matches!(self.motion.kind, MotionKind::Turn { .. });
        if is_turn && (to - from).abs() > MOST_TURNED {
            return Some("it turns by more than half a turn".into());
        }
        let [shut, open] = [0.0, 1.0].map(|share| self.at(share, opening));
        let [around, beyond] = [&shut, &open].map(|pose| Aabb::of_points(pose.iter().flatten()));
        if let Some(what) = way_problem(self.motion, opening, &around) {
            return Some(what);
        }
        let reach = opening.bounds.expanded(BESIDE);
        let is_off = around.min.z < -DEEP || around.max.z > DEEP;
        if is_off || !reach.contains(around.center().with_z(0.0)) {
            return Some("it does not stand in its opening when shut".into());
        }
        let plate = Plate::of(&shut);
        if let Some(askew) = plate.as_ref().map(Plate::askew).filter(|&a| a > ASKEW) {
            let degrees = askew.min(1.0).asin().to_degrees();
            return Some(format!(
                "it is not shut at `shut`, but off by {degrees:.0}°"
            ));
        }
        let [closes, covers] = [&shut, &open].map(|pose| opening.covered(pose));
        if closes < CLOSES {
            let percent = 100.0 * closes;
            return Some(format!(
                "it closes only {percent:.0} % of its opening when shut"
            ));
        }
        if covers > CLEARS * closes {
            let percent = 100.0 * covers / closes;
            return Some(format!(
                "open, it still covers {percent:.0} % of the area that it covers shut"
            ));
        }
        let hinge = match self.motion.kind {
            MotionKind::Turn { through, .. } => opening.place(to_dvec(through)),
            MotionKind::Slide { .. } => return None,
        };
        let toward = beyond.center().z - around.center().z;
        let is_into_jamb = plate.is_some_and(|p| p.is_beyond(hinge.z, toward));
        is_into_jamb.then(|| "it turns away from the side of its hinge, into the jamb".into())
    }
}

/// Returns a fault of a leaf's axis or direction; `around` is the box of the shut leaf.
fn way_problem(motion: &Motion, opening: &FittedOpening, around: &Aabb) -> Option<String> {
    match motion.kind {
        MotionKind::Slide { along } => {
            let off = opening.turn(to_dvec(along)).z.abs();
            (off > ASKEW).then(|| "it slides out of the plane of its opening".into())
        }
        MotionKind::Turn { through, axis } => {
            let (hinge, own) = (opening.place(to_dvec(through)), opening.turn(to_dvec(axis)));
            // Doors have upright hinges, even in a leaning opening; a hatch turns about one of its sides.
            let is_up = if opening.is_upright() {
                to_dvec(axis).with_y(0.0).length() <= ASKEW
            } else {
                own.x.abs() <= ASKEW
            };
            if opening.is_upright() && !is_up || !opening.is_upright() && own.z.abs() > ASKEW {
                return Some("its hinge is not upright".into());
            }
            let (low, high, at) = if is_up {
                (around.min.x, around.max.x, hinge.x)
            } else {
                (around.min.y, around.max.y, hinge.y)
            };
            // The middle of a narrow leaf is not its edge.
            let reach = AT_EDGE.min(0.25 * (high - low));
            let off = (at - low).abs().min((at - high).abs());
            let is_deep = hinge.z < around.min.z - reach || hinge.z > around.max.z + reach;
            if off > reach || is_deep {
                return Some(format!("its hinge is {off:.2} m from its edge"));
            }
            let height = hinge.y.clamp(around.min.y - reach, around.max.y + reach);
            (is_up && height != hinge.y).then(|| "its hinge is above or below it".into())
        }
    }
}

/// The large faces of a leaf.
struct Plate {
    /// Their direction, ignoring its vertical part.
    facing: DVec3,
    /// Range of heights over the opening's plane of most faces that point along its normal. [Units: wu]
    faces: [f64; 2],
}

impl Plate {
    /// Returns `None` for a shape without large faces: it points everywhere alike.
    fn of(leaf: &[Triangle]) -> Option<Self> {
        // Twice the angle, so that front and back are the same.
        let (mut cos, mut sin, mut all) = (0.0, 0.0, 0.0);
        let mut heights = Vec::new();
        for t in leaf {
            let n = (t[1] - t[0]).cross(t[2] - t[0]);
            let area = n.length();
            let Some(n) = n.try_normalize() else { continue };
            let level = area * (1.0 - n.y * n.y);
            let angle = 2.0 * n.x.atan2(n.z);
            cos += level * angle.cos();
            sin += level * angle.sin();
            all += level;
            if n.z.abs() > 0.9 {
                heights.push(((t[0].z + t[1].z + t[2].z) / 3.0, area));
            }
        }
        if cos.hypot(sin) < 0.1 * all || all == 0.0 {
            return None;
        }
        let (s, c) = (0.5 * sin.atan2(cos)).sin_cos();
        heights.sort_by(|a, b| a.0.total_cmp(&b.0));
        let whole: f64 = heights.iter().map(|h| h.1).sum();
        let at = |share: f64| {
            let mut below = 0.0;
            let found = heights.iter().find(|h| {
                below += h.1;
                below >= share * whole
            });
            found.map_or(0.0, |h| h.0)
        };
        Some(Self {
            facing: DVec3::new(s, 0.0, c),
            faces: [at(0.1), at(0.9)],
        })
    }

    /// Returns the sine of the angle between it and the opening.
    fn askew(&self) -> f64 {
        self.facing.x.abs()
    }

    /// Returns `true` if a hinge at this height lies at the face opposite to the side to which the leaf opens.
    fn is_beyond(&self, hinge: f64, toward: f64) -> bool {
        let [low, high] = self.faces;
        let off = hinge - (low + high) * 0.5;
        high - low > THIN && off * toward < 0.0 && off.abs() > AT_FACE * (high - low)
    }
}
