//! Planes that separate two polygons, stored four at a time.
//!
//! With four lanes a choice is a selection rather than a jump, which the processor would mispredict half of the time;
//! and most planes are only tested for whether they cut a polygon at all.
//!
//! Everything here errs outwards: a plane spoilt by rounding is not used.

use enfilade_geom::DVec3;
use fearless_simd::{Level, Simd, dispatch, f64x4, mask64x4, prelude::*};

use crate::dirs::Dirs;
use crate::tolerance::{HalfSpace, Tolerance};

/// Number of planes side by side.
pub(crate) const LANES: usize = 4;

/// Four planes, each with one polygon behind it and a later one in front of it. A lane without a plane has everything
/// both behind and in front of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Four {
    x: [f64; LANES],
    y: [f64; LANES],
    z: [f64; LANES],
    /// Greatest `normal · p` over the earlier polygon.
    behind: [f64; LANES],
    /// Least `normal · p` over the later polygon; at least `behind`, up to rounding.
    front: [f64; LANES],
}

/// Side of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// The side from which a line comes that will cross both polygons.
    Before,
    /// The side to which a line goes that has crossed both polygons.
    After,
}

impl Four {
    #[inline(always)]
    fn normals<S: Simd>(&self, simd: S) -> Lanes<S> {
        Lanes {
            x: f64x4::load_array_ref(simd, &self.x),
            y: f64x4::load_array_ref(simd, &self.y),
            z: f64x4::load_array_ref(simd, &self.z),
        }
    }

    /// Returns the height of a point above each plane, on a side.
    #[inline(always)]
    fn height<S: Simd>(&self, simd: S, side: Side, p: DVec3) -> f64x4<S> {
        let height = self.normals(simd).dot(Lanes::splat(simd, p));
        match side {
            Side::Before => f64x4::load_array_ref(simd, &self.behind) - height,
            Side::After => height - f64x4::load_array_ref(simd, &self.front),
        }
    }

    /// Returns the least and greatest height of points above each plane, on a side.
    #[inline(always)]
    fn extent<S: Simd>(&self, simd: S, side: Side, points: &[DVec3]) -> [f64x4<S>; 2] {
        let mut low = f64x4::splat(simd, f64::INFINITY);
        let mut high = f64x4::splat(simd, f64::NEG_INFINITY);
        for &p in points {
            let h = self.height(simd, side, p);
            low = low.min(h);
            high = high.max(h);
        }
        [low, high]
    }

    /// Returns the sine of the angle between each plane and that of a polygon.
    #[inline(always)]
    fn sine<S: Simd>(&self, simd: S, turn: DVec3) -> f64x4<S> {
        let cosine = self.normals(simd).dot(Lanes::splat(simd, turn));
        let one = f64x4::splat(simd, 1.0);
        (one - cosine * cosine).max(f64x4::splat(simd, 0.0)).sqrt()
    }

    /// Returns the half-space on one side of a plane.
    #[inline]
    pub(crate) fn half_space(&self, side: Side, lane: usize) -> HalfSpace {
        let normal = DVec3::new(self.x[lane], self.y[lane], self.z[lane]);
        match side {
            Side::Before => HalfSpace {
                normal: -normal,
                offset: -self.behind[lane],
            },
            Side::After => HalfSpace {
                normal,
                offset: self.front[lane],
            },
        }
    }
}

/// Orientation of an opening, which [`separators`] needs besides its vertices.
#[derive(Clone, Copy)]
pub(crate) struct Facing {
    /// Unit normal about which the vertices run counter-clockwise.
    pub(crate) turn: DVec3,
    /// Unit normal in the direction in which it is crossed.
    pub(crate) normal: DVec3,
}

/// The vertices of an opening, and how it faces.
#[derive(Clone, Copy)]
pub(crate) struct FacedOutline<'p> {
    pub(crate) points: &'p [DVec3],
    pub(crate) facing: Facing,
}

impl<'p> FacedOutline<'p> {
    pub(crate) fn new(points: &'p [DVec3], facing: Facing) -> Self {
        Self { points, facing }
    }
}

/// Appends the planes through an edge of one polygon and a vertex of the other that have `a` behind and `b` in front.
///
/// In the cross-section perpendicular to an edge, its polygon is a half-line, and the first vertex of the other
/// polygon that it meets when turned gives the only such plane. Dirkse, section 7.4, and the Quake tools try all
/// vertices. Time: the product of the vertex counts.
///
/// A plane through an edge of each comes twice. Dropping one would save a little, but then a checker that cuts by
/// both would keep polygons that differ by rounding, and find planes that differ by more.
pub(crate) fn separators(
    a: FacedOutline<'_>,
    b: FacedOutline<'_>,
    tolerance: &Tolerance,
    out: &mut Vec<Four>,
) {
    dispatch!(Level::new(), simd => separators_by(simd, a, b, tolerance, out));
}

#[inline(always)]
fn separators_by<S: Simd>(
    simd: S,
    a: FacedOutline<'_>,
    b: FacedOutline<'_>,
    tolerance: &Tolerance,
    out: &mut Vec<Four>,
) {
    let other = Heights::new(b.points, a.facing.normal);
    for first in (0..a.points.len()).step_by(LANES) {
        through_edges::<S, true>(simd, a, first, &other, tolerance, out);
    }
    let other = Heights::new(a.points, -b.facing.normal);
    for first in (0..b.points.len()).step_by(LANES) {
        through_edges::<S, false>(simd, b, first, &other, tolerance, out);
    }
}

/// Heights of vertices along a direction, precomputed for the first few.
struct Heights<'p> {
    points: &'p [DVec3],
    ahead: DVec3,
    first: [f64; 12],
}

impl<'p> Heights<'p> {
    #[inline]
    fn new(points: &'p [DVec3], ahead: DVec3) -> Self {
        let mut first = [0.0; 12];
        for (height, &p) in first.iter_mut().zip(points) {
            *height = ahead.dot(p);
        }
        Self {
            points,
            ahead,
            first,
        }
    }

    #[inline]
    fn of(&self, i: usize, p: DVec3) -> f64 {
        match self.first.get(i) {
            Some(&height) => height,
            None => self.ahead.dot(p),
        }
    }
}

/// One vector per lane.
#[derive(Clone, Copy)]
struct Lanes<S: Simd> {
    x: f64x4<S>,
    y: f64x4<S>,
    z: f64x4<S>,
}

impl<S: Simd> Lanes<S> {
    #[inline(always)]
    fn new(simd: S, [a, b, c, d]: [DVec3; LANES]) -> Self {
        Self {
            x: f64x4::load_array(simd, [a.x, b.x, c.x, d.x]),
            y: f64x4::load_array(simd, [a.y, b.y, c.y, d.y]),
            z: f64x4::load_array(simd, [a.z, b.z, c.z, d.z]),
        }
    }

    #[inline(always)]
    fn splat(simd: S, v: DVec3) -> Self {
        Self {
            x: f64x4::splat(simd, v.x),
            y: f64x4::splat(simd, v.y),
            z: f64x4::splat(simd, v.z),
        }
    }

    /// Does not fuse multiplication and addition, so that all processors round alike.
    #[inline(always)]
    fn dot(self, v: Self) -> f64x4<S> {
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
    fn times(self, s: f64x4<S>) -> Self {
        Self {
            x: self.x * s,
            y: self.y * s,
            z: self.z * s,
        }
    }

    /// Returns `self` in the lanes where `mask` is set, else `other`.
    #[inline(always)]
    fn chosen(self, mask: mask64x4<S>, other: Self) -> Self {
        Self {
            x: mask.select(self.x, other.x),
            y: mask.select(self.y, other.y),
            z: mask.select(self.z, other.z),
        }
    }
}

/// Appends the planes through edges `first..first + LANES` of `own` and a vertex of the polygon whose
/// heights ahead of `own` are given; `FIRST` if `own` belongs behind the plane.
#[inline(always)]
fn through_edges<S: Simd, const FIRST: bool>(
    simd: S,
    FacedOutline {
        points: own,
        facing,
    }: FacedOutline<'_>,
    first: usize,
    heights: &Heights<'_>,
    tolerance: &Tolerance,
    out: &mut Vec<Four>,
) {
    let other = heights.points;
    let n = own.len();
    // Lanes past the last edge repeat it.
    let at = |l: usize| own[(first + l).min(n - 1)];
    let next = |l: usize| {
        if first + l + 1 < n {
            own[first + l + 1]
        } else {
            own[0]
        }
    };
    let p = Lanes::new(simd, [at(0), at(1), at(2), at(3)]);
    let edge = Lanes::new(simd, [next(0), next(1), next(2), next(3)]).minus(p);
    let inward = Lanes::splat(simd, facing.turn).cross(edge);
    let rounding = tolerance.rounding;
    // A vertex on the edge's line lies in every plane through it, so it does not help to choose one.
    let near = f64x4::splat(simd, 1e2 * rounding);
    let near_squared = near * near;
    let zero = f64x4::splat(simd, 0.0);
    let base = p.dot(Lanes::splat(simd, heights.ahead));
    let across = inward.dot(p);
    let length_squared = edge.dot(edge);
    let (mut x, mut y) = (f64x4::splat(simd, f64::NEG_INFINITY), zero);
    let mut best = p;
    for (j, &corner) in other.iter().enumerate() {
        // The inward axis is longer than a unit by the edge's length. This does not matter, as angles are only
        // compared with each other.
        let height = f64x4::splat(simd, heights.of(j, corner));
        let corner = Lanes::splat(simd, corner);
        let cx = inward.dot(corner) - across;
        let cy = (height - base).max(zero);
        let is_on_line =
            cy.simd_le(near) & (cx * cx).simd_le((near_squared - cy * cy) * length_squared);
        let is_first = x.simd_eq(f64x4::splat(simd, f64::NEG_INFINITY));
        let is_better = is_first | (cx * y - cy * x).simd_gt(zero);
        let takes = is_better & !is_on_line;
        x = takes.select(cx, x);
        y = takes.select(cy, y);
        best = corner.chosen(takes, best);
    }
    let normal = edge.cross(best.minus(p));
    let length = normal.dot(normal).sqrt();
    // Turn each normal away from `own`.
    let one = f64x4::splat(simd, 1.0);
    let turned = normal.dot(inward).simd_gt(zero).select(-one, one);
    let toward = normal.times(turned / length);
    let mut highest = f64x4::splat(simd, f64::NEG_INFINITY);
    for &q in own {
        highest = highest.max(toward.dot(Lanes::splat(simd, q)));
    }
    let mut lowest = f64x4::splat(simd, f64::INFINITY);
    for &q in other {
        lowest = lowest.min(toward.dot(Lanes::splat(simd, q)));
    }
    // Shorter normals are all rounding.
    let has_direction = length.simd_gt(f64x4::splat(simd, rounding * rounding));
    let is_ahead = y.simd_gt(f64x4::splat(simd, rounding));
    let is_between = lowest.simd_ge(highest - f64x4::splat(simd, rounding));
    let in_range = f64x4::load_array(simd, [0.0, 1.0, 2.0, 3.0])
        .simd_lt(f64x4::splat(simd, (n - first) as f64));
    let found = has_direction & is_ahead & is_between & in_range;
    if !found.any_true() {
        return;
    }
    let (toward, behind, front) = if FIRST {
        (toward, highest, lowest)
    } else {
        (toward.times(f64x4::splat(simd, -1.0)), -lowest, -highest)
    };
    let normals = toward.chosen(found, Lanes::splat(simd, DVec3::ZERO));
    let infinity = f64x4::splat(simd, f64::INFINITY);
    out.push(Four {
        x: normals.x.to_array(),
        y: normals.y.to_array(),
        z: normals.z.to_array(),
        behind: found.select(behind, infinity).to_array(),
        front: found.select(front, -infinity).to_array(),
    });
}

/// Computes [`admits`] for a single opening.
#[inline]
pub(crate) fn is_admitted(planes: &[Four], dirs: &Dirs, dir: usize, tolerance: &Tolerance) -> bool {
    dispatch!(Level::new(), simd => admits(simd, planes, dirs, dir, tolerance))
}

/// Returns `true` if an opening reaches in front of every plane.
#[inline(always)]
pub(crate) fn admits<S: Simd>(
    simd: S,
    planes: &[Four],
    dirs: &Dirs,
    dir: usize,
    tolerance: &Tolerance,
) -> bool {
    let [x, y, z, radius] = dirs.balls[dir];
    let center = DVec3::new(x, y, z);
    let radius = f64x4::splat(simd, radius);
    // Groups with a plane that cuts the ball.
    let mut unsure = 0u64;
    for (k, four) in planes.iter().enumerate() {
        let height = four.height(simd, Side::After, center);
        if height.simd_lt(-radius).any_true() {
            return false;
        }
        unsure |= u64::from(!height.simd_gt(radius).all_true()) << k.min(63);
    }
    unsure == 0 || admits_corners(simd, planes, unsure, dirs, dir, tolerance)
}

/// Uses loops, as closures would not be compiled for the processor that `simd` stands for.
#[inline(always)]
fn admits_corners<S: Simd>(
    simd: S,
    planes: &[Four],
    unsure: u64,
    dirs: &Dirs,
    dir: usize,
    tolerance: &Tolerance,
) -> bool {
    let winding = dirs.winding(dir);
    let wide = f64x4::splat(simd, tolerance.clearance - tolerance.outward);
    for (k, four) in planes.iter().enumerate() {
        if unsure >> k.min(63) & 1 == 0 {
            continue;
        }
        let [_, high] = four.extent(simd, Side::After, winding);
        if high.simd_ge(wide).all_true() {
            continue;
        }
        // A disc with the clearance as its radius reaches less far past a plane that meets it at an angle.
        let sine = four.sine(simd, dirs.all[dir].turn);
        let clearance = f64x4::splat(simd, tolerance.clearance);
        let least = clearance * sine - f64x4::splat(simd, tolerance.outward);
        if !high.simd_ge(least).all_true() {
            return false;
        }
    }
    true
}

/// Returns `true` if a ball (center, radius) lies behind a plane.
#[inline]
pub(crate) fn hide(planes: &[Four], ball: [f64; 4]) -> bool {
    dispatch!(Level::new(), simd => hide_by(simd, planes, ball))
}

#[inline(always)]
fn hide_by<S: Simd>(simd: S, planes: &[Four], [x, y, z, radius]: [f64; 4]) -> bool {
    let center = DVec3::new(x, y, z);
    for four in planes {
        let height = four.height(simd, Side::After, center);
        if height.simd_lt(f64x4::splat(simd, -radius)).any_true() {
            return true;
        }
    }
    false
}

/// Returns, as bits, which of four planes cut something off a polygon; `ball` (center, radius) encloses it.
#[inline]
pub(crate) fn cuts(
    four: &Four,
    side: Side,
    points: &[DVec3],
    ball: [f64; 4],
    tolerance: &Tolerance,
) -> u64 {
    dispatch!(Level::new(), simd => cuts_by(simd, four, side, points, ball, tolerance))
}

#[inline(always)]
fn cuts_by<S: Simd>(
    simd: S,
    four: &Four,
    side: Side,
    points: &[DVec3],
    [x, y, z, radius]: [f64; 4],
    tolerance: &Tolerance,
) -> u64 {
    let height = four.height(simd, side, DVec3::new(x, y, z));
    if height.simd_ge(f64x4::splat(simd, radius)).all_true() {
        return 0;
    }
    let [low, _] = four.extent(simd, side, points);
    let least = f64x4::splat(simd, -tolerance.outward);
    low.simd_lt(least).to_bitmask()
}

/// Packs the planes without empty lanes, dropping duplicates up to rounding (they hold an edge of each opening).
pub(crate) fn pack(planes: &mut Vec<Four>, tolerance: &Tolerance) {
    let mut kept: Vec<(HalfSpace, f64)> = Vec::with_capacity(planes.len() * LANES);
    for four in &*planes {
        for lane in 0..LANES {
            let plane = four.half_space(Side::After, lane);
            let is_twin = |(other, _): &(HalfSpace, f64)| {
                plane.normal.distance_squared(other.normal) < 1e-24
                    && (plane.offset - other.offset).abs() < tolerance.rounding
            };
            if plane.offset > f64::NEG_INFINITY && !kept.iter().any(is_twin) {
                kept.push((plane, four.behind[lane]));
            }
        }
    }
    planes.clear();
    for four in kept.chunks(LANES) {
        // Lanes past the last plane repeat it.
        let at = |l: usize| four[l.min(four.len() - 1)];
        let four = [at(0), at(1), at(2), at(3)];
        planes.push(Four {
            x: four.map(|(plane, _)| plane.normal.x),
            y: four.map(|(plane, _)| plane.normal.y),
            z: four.map(|(plane, _)| plane.normal.z),
            behind: four.map(|(_, behind)| behind),
            front: four.map(|(plane, _)| plane.offset),
        });
    }
}

#[cfg(test)]
mod tests;
