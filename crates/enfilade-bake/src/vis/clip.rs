//! Polygons clipped by planes, and the planes that separate two polygons.
//!
//! Everything here errs outwards: a clip keeps [`Tolerance::outward`] more than the plane says, a plane
//! that rounding has spoilt is not used.

use enfilade_geom::DVec3;

use super::dirs::sine;

/// How far numbers are trusted. [Units: wu]
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    /// A clip keeps this much more.
    pub(super) outward: f64,
    /// Rounding of `normal · point`.
    pub(super) rounding: f64,
    /// A sight line that stays this far inside every opening's edges is never lost.
    pub(super) clearance: f64,
}

impl Tolerance {
    pub(super) fn new(scale: f64, clearance: f64) -> Self {
        Self {
            outward: 1e-9 * scale,
            rounding: 1e-13 * scale,
            clearance,
        }
    }
}

/// A polygon in an [`Arena`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Poly {
    start: u32,
    len: u32,
    /// Direction whose opening it is part of.
    pub(super) dir: u32,
}

/// Corners of the polygons of a search path, as a stack.
#[derive(Default)]
pub(super) struct Arena {
    points: Vec<DVec3>,
    heights: Vec<f64>,
}

/// The part of space where `normal · p >= offset`.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    pub(super) normal: DVec3,
    pub(super) offset: f64,
}

/// A plane with one polygon behind it and a later one in front of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Separator {
    pub(super) normal: DVec3,
    /// Greatest `normal · p` over the earlier polygon.
    pub(super) behind: f64,
    /// Least `normal · p` over the later one; not less than `behind` but for rounding.
    pub(super) front: f64,
}

impl Separator {
    /// Where a line that has crossed both polygons goes.
    #[inline]
    pub(super) fn after(&self) -> HalfSpace {
        HalfSpace {
            normal: self.normal,
            offset: self.front,
        }
    }

    /// Where a line that will cross both polygons comes from.
    #[inline]
    pub(super) fn before(&self) -> HalfSpace {
        HalfSpace {
            normal: -self.normal,
            offset: -self.behind,
        }
    }
}

impl Arena {
    #[inline]
    pub(super) fn mark(&self) -> usize {
        self.points.len()
    }

    #[inline]
    pub(super) fn release(&mut self, mark: usize) {
        self.points.truncate(mark);
    }

    #[inline]
    pub(super) fn push(&mut self, points: &[DVec3], dir: u32) -> Poly {
        let start = self.points.len() as u32;
        self.points.extend_from_slice(points);
        Poly {
            start,
            len: points.len() as u32,
            dir,
        }
    }

    #[inline]
    pub(super) fn get(&self, poly: Poly) -> &[DVec3] {
        &self.points[poly.start as usize..][..poly.len as usize]
    }

    #[inline]
    pub(super) fn mean(&self, poly: Poly) -> DVec3 {
        let points = self.get(poly);
        points.iter().sum::<DVec3>() / points.len() as f64
    }

    /// The part of `poly` in a half-space, and [`Tolerance::outward`] more; the same polygon where nothing
    /// is cut off. `None` where no line with clearance meets it. `turn` is the polygon's unit normal.
    #[inline]
    pub(super) fn clip(
        &mut self,
        poly: Poly,
        keep: HalfSpace,
        turn: DVec3,
        tolerance: &Tolerance,
    ) -> Option<Poly> {
        self.heights.clear();
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for p in &self.points[poly.start as usize..][..poly.len as usize] {
            let h = keep.normal.dot(*p) - keep.offset;
            low = low.min(h);
            high = high.max(h);
            self.heights.push(h);
        }
        if low >= -tolerance.outward {
            return Some(poly);
        }
        // A disc of radius `clearance` around the crossing lies inside the opening, so the opening
        // reaches that far past the plane, foreshortened by the angle between them.
        if high < tolerance.clearance && high < tolerance.clearance * sine(keep.normal, turn) {
            return None;
        }
        if high < -tolerance.outward {
            return None;
        }
        let start = self.points.len();
        let n = poly.len as usize;
        for i in 0..n {
            let j = if i + 1 == n { 0 } else { i + 1 };
            let (hi, hj) = (
                self.heights[i] + tolerance.outward,
                self.heights[j] + tolerance.outward,
            );
            let p = self.points[poly.start as usize + i];
            if hi >= 0.0 {
                self.points.push(p);
            }
            if (hi > 0.0 && hj < 0.0) || (hi < 0.0 && hj > 0.0) {
                let q = self.points[poly.start as usize + j];
                // From the inner end, so that both directions of an edge give the same point.
                let cut = if hi > 0.0 {
                    p + (q - p) * (hi / (hi - hj))
                } else {
                    q + (p - q) * (hj / (hj - hi))
                };
                self.points.push(cut);
            }
        }
        Some(Poly {
            start: start as u32,
            len: (self.points.len() - start) as u32,
            dir: poly.dir,
        })
    }
}

/// Shape of an opening: what [`separators`] needs beside the corners.
#[derive(Clone, Copy)]
pub(super) struct Facing {
    /// Unit normal that the corners run counter-clockwise about.
    pub(super) turn: DVec3,
    /// Unit normal the way it is crossed.
    pub(super) normal: DVec3,
}

/// Planes through an edge of one polygon and a corner of the other, `a` behind and `b` in front.
///
/// Around each edge the polygon lies on a half-line of the perpendicular cross-section, and the first corner
/// of the other met when turning from there gives the only such plane. Dirkse, section 7.4, and the Quake
/// tools try all corners; time here is the product of the corner counts.
///
/// A plane that holds an edge of each comes twice. Giving it once would spare a little, but then a checker that
/// cuts by both keeps polygons that differ by rounding, and finds planes that differ by more.
pub(super) fn separators(
    a: (&[DVec3], Facing),
    b: (&[DVec3], Facing),
    tolerance: &Tolerance,
    out: &mut Vec<Separator>,
) {
    let heights = Heights::new(b.0, a.1.normal);
    for i in 0..a.0.len() {
        out.extend(through_edge::<true>(a.0, i, b.0, &heights, a.1, tolerance));
    }
    let heights = Heights::new(a.0, -b.1.normal);
    for i in 0..b.0.len() {
        out.extend(through_edge::<false>(b.0, i, a.0, &heights, b.1, tolerance));
    }
}

/// Heights of corners along a direction; those of the first few are at hand.
struct Heights {
    ahead: DVec3,
    first: [f64; 12],
}

impl Heights {
    #[inline]
    fn new(points: &[DVec3], ahead: DVec3) -> Self {
        let mut first = [0.0; 12];
        for (height, &p) in first.iter_mut().zip(points) {
            *height = ahead.dot(p);
        }
        Self { ahead, first }
    }

    #[inline]
    fn of(&self, i: usize, p: DVec3) -> f64 {
        match self.first.get(i) {
            Some(&height) => height,
            None => self.ahead.dot(p),
        }
    }
}

/// The plane through edge `i` of `own` and a corner of `other`, of which `heights` are those ahead of `own`;
/// `FIRST` where `own` is to be behind the plane.
#[inline]
fn through_edge<const FIRST: bool>(
    own: &[DVec3],
    i: usize,
    other: &[DVec3],
    heights: &Heights,
    facing: Facing,
    tolerance: &Tolerance,
) -> Option<Separator> {
    let p = own[i];
    let edge = own[if i + 1 == own.len() { 0 } else { i + 1 }] - p;
    let inward = facing.turn.cross(edge);
    let rounding = tolerance.rounding;
    // A corner on the edge's line lies in every plane through it, and says nothing about which to take.
    let near = 1e2 * rounding;
    let (base, across) = (heights.ahead.dot(p), inward.dot(p));
    let (mut x, mut y, mut best) = (f64::NEG_INFINITY, 0.0, DVec3::ZERO);
    for (j, &corner) in other.iter().enumerate() {
        // The inward axis is longer than a unit by the edge's length; angles are compared only
        // among themselves, so that does not matter.
        let (cx, cy) = (
            inward.dot(corner) - across,
            (heights.of(j, corner) - base).max(0.0),
        );
        if cy <= near && cx * cx <= (near * near - cy * cy) * edge.length_squared() {
            continue;
        }
        if x == f64::NEG_INFINITY || cx * y - cy * x > 0.0 {
            (x, y, best) = (cx, cy, corner);
        }
    }
    if y <= rounding {
        return None;
    }
    let normal = edge.cross(best - p);
    let length = normal.length();
    // Shorter ones have no direction left.
    if length <= rounding * rounding {
        return None;
    }
    // The way that `own` has the least of.
    let turned = if normal.dot(inward) > 0.0 { -1.0 } else { 1.0 };
    let toward = normal * (turned / length);
    let mut highest = f64::NEG_INFINITY;
    for &q in own {
        highest = highest.max(toward.dot(q));
    }
    let mut lowest = f64::INFINITY;
    for &q in other {
        lowest = lowest.min(toward.dot(q));
    }
    if lowest < highest - rounding {
        return None;
    }
    Some(if FIRST {
        Separator {
            normal: toward,
            behind: highest,
            front: lowest,
        }
    } else {
        Separator {
            normal: -toward,
            behind: -lowest,
            front: -highest,
        }
    })
}
