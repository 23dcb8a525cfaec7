//! Finds how a leaf opens: the side of its hinge and the direction of its turn, or that it slides.
//!
//! Models rarely record this. Criteria, in this order: a handle is opposite the hinge; a leaf opens where it has room;
//! it lies flush with its frame on the side to which it opens; doors open into the smaller of two rooms, against the
//! nearest wall.

use std::cmp::Ordering;
use std::f64::consts::FRAC_PI_2;

use enfilade_cpg::{CellId, Locator, Motion, MotionKind};
use enfilade_geom::{Bvh, DMat4, DVec3, Rectangle};

use super::parts::{Leaf, Pose};

/// A wider single leaf slides: hinged leaves are made up to 1.25 m wide (DIN 18101), plus some margin for other things
/// in a model. [Units: wu]
const WIDEST_TURN: f64 = 1.45;
/// Least offset of a handle from the middle, as a share of half the leaf's width.
const HANDLE: f64 = 0.3;
/// A leaf is flush with one side of its frame if its middle is off the frame's by more. [Units: wu]
const FLUSH: f64 = 0.01;
/// A leaf that the model turns by less is not fully open. [Units: rad]
const OPEN: f64 = 60.0 * std::f64::consts::PI / 180.0;
/// Samples across and up a leaf, to test how much of it has room.
const SAMPLES: [usize; 2] = [5, 4];
/// Greatest distance of a wall that an open leaf may lie against. [Units: wu]
const WALL_WITHIN: f64 = 1.5;

/// The surroundings of a door.
pub(super) struct Around<'a> {
    pub(super) locator: &'a Locator,
    pub(super) walls: &'a Bvh,
    /// The opening; its normal points from the first cell to the second.
    pub(super) opening: &'a Rectangle,
    pub(super) cells: [CellId; 2],
    /// Volumes of the two cells; infinite outdoors. [Units: wu³]
    pub(super) volumes: [f64; 2],
    /// The middle of the frame along the opening's normal, if there is one.
    pub(super) frame: Option<f64>,
    /// Number of leaves in this opening.
    pub(super) n_leaves: usize,
    /// Returns `true` if another object stands at a point.
    pub(super) is_furnished: &'a dyn Fn(DVec3) -> bool,
}

impl Around<'_> {
    pub(super) fn motion(&self, leaf: &Leaf) -> Motion {
        match leaf.pose {
            Pose::Open { hinge, angle } => {
                let open = if angle.abs() >= OPEN {
                    0.0
                } else {
                    FRAC_PI_2.copysign(angle) - angle
                };
                turning(hinge, -angle, open)
            }
            Pose::Shut => self.of_shut(leaf),
        }
    }

    fn of_shut(&self, leaf: &Leaf) -> Motion {
        // Measure along the opening's directions, whatever those of the plate.
        let o = self.opening;
        let corners = corners(&leaf.around);
        let r = Rectangle::around(o.normal, &corners);
        let size = r.size();
        if size.x > WIDEST_TURN && self.n_leaves == 1 {
            return self.sliding(&r);
        }
        let middle = (r.low.x + r.high.x) * 0.5;
        let same_way = leaf.around.across.dot(o.across);
        let handle = leaf.handle * same_way.signum();
        let mut best: Option<(Rank, Motion)> = None;
        for side in [-1.0, 1.0] {
            for toward in [-1.0, 1.0] {
                let x = if side < 0.0 { r.low.x } else { r.high.x };
                let z = if toward < 0.0 { r.low.z } else { r.high.z };
                let hinge = r.point(DVec3::new(x, r.low.y, z));
                // Seen from above with the normal ahead, `across` points right; a turn to the left takes it to the
                // normal.
                let angle = FRAC_PI_2 * side * toward * self.handedness();
                let motion = turning(hinge, 0.0, angle);
                let (blocked, wall) = self.room(&r, &motion, x);
                let of_two = if middle < (o.low.x + o.high.x) * 0.5 {
                    -1.0
                } else {
                    1.0
                };
                let cell = usize::from(toward > 0.0);
                let rank = Rank([
                    // Two leaves part in the middle.
                    flag(self.n_leaves > 1 && side != of_two),
                    flag(handle.abs() >= HANDLE && handle * side > 0.0),
                    blocked,
                    flag(self.frame.is_some_and(|f| {
                        let off = (r.low.z + r.high.z) * 0.5 - f;
                        off.abs() > FLUSH && off * toward < 0.0
                    })),
                    self.volumes[cell],
                    wall,
                ]);
                if best.as_ref().is_none_or(|(b, _)| rank.cmp(b).is_lt()) {
                    best = Some((rank, motion));
                }
            }
        }
        best.map_or_else(|| turning(o.point(o.low), 0.0, FRAC_PI_2), |(_, m)| m)
    }

    /// Returns 1 if a counter-clockwise turn, seen from above, takes `across` to the normal; else -1.
    fn handedness(&self) -> f64 {
        let o = self.opening;
        let turned = DVec3::new(o.across.z, 0.0, -o.across.x);
        // A leaf hinged at its lower side points along `across`.
        -turned.dot(o.normal).signum()
    }

    /// Returns how much of an open leaf has no room, and the distance of its middle from a wall. [Units: samples, wu]
    fn room(&self, leaf: &Rectangle, motion: &Motion, hinge: f64) -> (f64, f64) {
        let mut blocked = 0.0;
        for share in [0.5, 1.0] {
            let by = motion.at(share);
            for p in samples(leaf, hinge) {
                let p = by.transform_point3(p);
                let is_air = self
                    .locator
                    .locate(p)
                    .is_some_and(|c| self.cells.contains(&c));
                blocked += flag(!is_air || (self.is_furnished)(p));
            }
        }
        let middle = leaf.point((leaf.low + leaf.high) * 0.5);
        let middle = motion.at(1.0).transform_point3(middle);
        let wall = self.walls.nearest(middle, WALL_WITHIN);
        (blocked, wall.map_or(WALL_WITHIN, |n| n.distance))
    }

    /// Returns a slide along the wall, to the side where more of the leaf is hidden in solid matter.
    fn sliding(&self, leaf: &Rectangle) -> Motion {
        let width = leaf.size().x;
        let way = |side: f64| Motion {
            kind: MotionKind::Slide {
                along: (leaf.across * side).as_vec3().to_array(),
            },
            shut: 0.0,
            open: width as f32,
        };
        let shown = |motion: &Motion| {
            let by: DMat4 = motion.at(1.0);
            let all = samples(leaf, f64::NEG_INFINITY);
            let moved = all.map(|p| by.transform_point3(p));
            moved.filter(|p| self.locator.locate(*p).is_some()).count()
        };
        let (left, right) = (way(-1.0), way(1.0));
        if shown(&right) < shown(&left) {
            right
        } else {
            left
        }
    }
}

/// Objections to a way of opening, the most important first.
struct Rank([f64; 6]);

impl Rank {
    /// Less is better; values that differ only by rounding are equal.
    fn cmp(&self, other: &Self) -> Ordering {
        let pairs = self.0.iter().zip(&other.0);
        for (a, b) in pairs {
            let is_same = a == b || (a - b).abs() <= 1e-3 * a.abs().max(b.abs());
            if !is_same {
                return a.total_cmp(b);
            }
        }
        Ordering::Equal
    }
}

fn flag(is: bool) -> f64 {
    f64::from(u8::from(is))
}

fn turning(hinge: DVec3, shut: f64, open: f64) -> Motion {
    Motion {
        kind: MotionKind::Turn {
            through: hinge.as_vec3().to_array(),
            axis: [0.0, 1.0, 0.0],
        },
        shut: shut as f32,
        open: open as f32,
    }
}

fn corners(r: &Rectangle) -> Vec<DVec3> {
    let corner = |k: usize| {
        let pick = |bit: usize, i: usize| if k & bit == 0 { r.low[i] } else { r.high[i] };
        r.point(DVec3::new(pick(1, 0), pick(2, 1), pick(4, 2)))
    };
    (0..8).map(corner).collect()
}

/// Returns points in the middle plane of a leaf, none near its hinge, where the jamb is.
fn samples(leaf: &Rectangle, hinge: f64) -> impl Iterator<Item = DVec3> + '_ {
    let size = leaf.size();
    let z = (leaf.low.z + leaf.high.z) * 0.5;
    (0..SAMPLES[0] * SAMPLES[1]).filter_map(move |i| {
        let s = ((i % SAMPLES[0]) as f64 + 0.5) / SAMPLES[0] as f64;
        let t = ((i / SAMPLES[0]) as f64 + 0.5) / SAMPLES[1] as f64;
        let x = leaf.low.x + s * size.x;
        let is_far = (x - hinge).abs() > 0.15 * size.x;
        is_far.then(|| leaf.point(DVec3::new(x, leaf.low.y + t * size.y, z)))
    })
}
