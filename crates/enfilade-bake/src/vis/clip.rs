//! Polygons clipped by planes, and the planes that separate two polygons.
//!
//! Everything here errs outwards: a clip keeps [`Tolerance::outward`] more than the plane says, a plane
//! that rounding has spoilt is not used.

use enfilade_geom::DVec3;
use wide::f64x4;

use super::dirs::{Dirs, sine};

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
    for i in (0..a.0.len()).step_by(LANES) {
        through_edges::<true>(a.0, i, b.0, &heights, a.1, tolerance, out);
    }
    let heights = Heights::new(a.0, -b.1.normal);
    for i in (0..b.0.len()).step_by(LANES) {
        through_edges::<false>(b.0, i, a.0, &heights, b.1, tolerance, out);
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

/// Edges looked at together, in the lanes of vectors: a choice is a selection, not a jump that is mistaken for
/// the other one half of the time.
const LANES: usize = 4;

/// A vector a lane.
#[derive(Clone, Copy)]
struct Lanes {
    x: f64x4,
    y: f64x4,
    z: f64x4,
}

impl Lanes {
    #[inline(always)]
    fn new([a, b, c, d]: [DVec3; LANES]) -> Self {
        Self {
            x: f64x4::new([a.x, b.x, c.x, d.x]),
            y: f64x4::new([a.y, b.y, c.y, d.y]),
            z: f64x4::new([a.z, b.z, c.z, d.z]),
        }
    }

    #[inline(always)]
    fn splat(v: DVec3) -> Self {
        Self {
            x: f64x4::splat(v.x),
            y: f64x4::splat(v.y),
            z: f64x4::splat(v.z),
        }
    }

    #[inline(always)]
    fn dot(self, v: Self) -> f64x4 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    #[inline(always)]
    fn cross(self, v: Self) -> Self {
        Self {
            x: self.y * v.z - v.y * self.z,
            y: self.z * v.x - v.z * self.x,
            z: self.x * v.y - v.x * self.y,
        }
    }

    #[inline(always)]
    fn minus(self, v: Self) -> Self {
        Self {
            x: self.x - v.x,
            y: self.y - v.y,
            z: self.z - v.z,
        }
    }

    #[inline(always)]
    fn times(self, s: f64x4) -> Self {
        Self {
            x: self.x * s,
            y: self.y * s,
            z: self.z * s,
        }
    }

    /// This where `mask` is set, else `other`.
    #[inline(always)]
    fn chosen(self, mask: f64x4, other: Self) -> Self {
        Self {
            x: mask.bitselect(self.x, other.x),
            y: mask.bitselect(self.y, other.y),
            z: mask.bitselect(self.z, other.z),
        }
    }
}

/// The planes through edges `first..first + LANES` of `own` and a corner of `other`, of which `heights` are those
/// ahead of `own`; `FIRST` where `own` is to be behind the plane.
#[inline]
fn through_edges<const FIRST: bool>(
    own: &[DVec3],
    first: usize,
    other: &[DVec3],
    heights: &Heights,
    facing: Facing,
    tolerance: &Tolerance,
    out: &mut Vec<Separator>,
) {
    let n = own.len();
    // Lanes past the last edge do the last one again.
    let at = |l: usize| own[(first + l).min(n - 1)];
    let next = |l: usize| {
        if first + l + 1 < n {
            own[first + l + 1]
        } else {
            own[0]
        }
    };
    let p = Lanes::new([at(0), at(1), at(2), at(3)]);
    let edge = Lanes::new([next(0), next(1), next(2), next(3)]).minus(p);
    let inward = Lanes::splat(facing.turn).cross(edge);
    let rounding = tolerance.rounding;
    // A corner on the edge's line lies in every plane through it, and says nothing about which to take.
    let near = f64x4::splat(1e2 * rounding);
    let near_squared = near * near;
    let zero = f64x4::splat(0.0);
    let base = p.dot(Lanes::splat(heights.ahead));
    let across = inward.dot(p);
    let length_squared = edge.dot(edge);
    let (mut x, mut y) = (f64x4::splat(f64::NEG_INFINITY), zero);
    let mut best = p;
    for (j, &corner) in other.iter().enumerate() {
        // The inward axis is longer than a unit by the edge's length; angles are compared only
        // among themselves, so that does not matter.
        let height = f64x4::splat(heights.of(j, corner));
        let corner = Lanes::splat(corner);
        let cx = inward.dot(corner) - across;
        let cy = (height - base).fast_max(zero);
        let is_on_line =
            cy.simd_le(near) & (cx * cx).simd_le((near_squared - cy * cy) * length_squared);
        let is_first = x.simd_eq(f64x4::splat(f64::NEG_INFINITY));
        let is_better = is_first | (cx * y - cy * x).simd_gt(zero);
        let takes = is_better & !is_on_line;
        x = takes.bitselect(cx, x);
        y = takes.bitselect(cy, y);
        best = corner.chosen(takes, best);
    }
    let normal = edge.cross(best.minus(p));
    let length = normal.dot(normal).sqrt();
    // The way that `own` has the least of.
    let one = f64x4::splat(1.0);
    let turned = normal.dot(inward).simd_gt(zero).bitselect(-one, one);
    let toward = normal.times(turned / length);
    let mut highest = f64x4::splat(f64::NEG_INFINITY);
    for &q in own {
        highest = highest.fast_max(toward.dot(Lanes::splat(q)));
    }
    let mut lowest = f64x4::splat(f64::INFINITY);
    for &q in other {
        lowest = lowest.fast_min(toward.dot(Lanes::splat(q)));
    }
    // Shorter normals have no direction left.
    let has_direction = length.simd_gt(f64x4::splat(rounding * rounding));
    let is_ahead = y.simd_gt(f64x4::splat(rounding));
    let is_between = lowest.simd_ge(highest - f64x4::splat(rounding));
    let found = (has_direction & is_ahead & is_between).to_bitmask();
    let sign = if FIRST { 1.0 } else { -1.0 };
    let (nx, ny, nz) = (
        toward.x.to_array(),
        toward.y.to_array(),
        toward.z.to_array(),
    );
    let (lowest, highest) = (lowest.to_array(), highest.to_array());
    for l in 0..LANES.min(n - first) {
        if found >> l & 1 != 0 {
            let (behind, front) = if FIRST {
                (highest[l], lowest[l])
            } else {
                (-lowest[l], -highest[l])
            };
            out.push(Separator {
                normal: DVec3::new(nx[l], ny[l], nz[l]) * sign,
                behind,
                front,
            });
        }
    }
}

/// Planes to hold openings against, four at a time.
#[derive(Default)]
pub(super) struct Fence {
    planes: Vec<(Lanes, f64x4)>,
}

impl Fence {
    pub(super) fn set(&mut self, planes: &[Separator]) {
        self.planes.clear();
        for four in planes.chunks(LANES) {
            // Lanes past the last plane repeat it.
            let at = |l: usize| four[l.min(four.len() - 1)];
            let four = [at(0), at(1), at(2), at(3)];
            let front = f64x4::new(four.map(|plane| plane.front));
            self.planes
                .push((Lanes::new(four.map(|plane| plane.normal)), front));
        }
    }

    /// Whether an opening reaches in front of every plane.
    #[inline]
    pub(super) fn admits(&self, dirs: &Dirs, dir: usize, tolerance: &Tolerance) -> bool {
        let [x, y, z, radius] = dirs.balls[dir];
        let center = Lanes::splat(DVec3::new(x, y, z));
        let radius = f64x4::splat(radius);
        let mut is_sure = true;
        for &(normal, front) in &self.planes {
            let height = normal.dot(center) - front;
            if height.simd_lt(-radius).any() {
                return false;
            }
            is_sure &= height.simd_gt(radius).all();
        }
        is_sure || self.admits_corners(dirs, dir, tolerance)
    }

    fn admits_corners(&self, dirs: &Dirs, dir: usize, tolerance: &Tolerance) -> bool {
        let winding = dirs.winding(dir);
        let wide = f64x4::splat(tolerance.clearance - tolerance.outward);
        self.planes.iter().all(|&(normal, front)| {
            let mut high = f64x4::splat(f64::NEG_INFINITY);
            for &p in winding {
                high = high.fast_max(normal.dot(Lanes::splat(p)));
            }
            let high = high - front;
            high.simd_ge(wide).all() || {
                // A disc of the clearance's radius reaches less far past a plane that meets it at an angle.
                let turn = dirs.all[dir].turn;
                let cosine = normal.dot(Lanes::splat(turn));
                let one = f64x4::splat(1.0);
                let sine = (one - cosine * cosine).fast_max(f64x4::splat(0.0)).sqrt();
                let clearance = f64x4::splat(tolerance.clearance);
                high.simd_ge(clearance * sine - f64x4::splat(tolerance.outward))
                    .all()
            }
        })
    }
}
