//! Obstacles around special portals: what a body that stands in one can hit on either side.
//!
//! A body in a special portal is in two places (Dirkse 2002, section 6.1.5). On the far side, only what lies beyond the plane of
//! the opening is there for it. On the near side, the part of the body beyond the plane has left, so what lies behind the plane is
//! not there, except the wall around the opening: that is in the plane, or a little behind it, and stops a body wider than the
//! opening. It is moved into the plane, so that the part that passes obliquely does not catch on it. So both images of a body meet
//! disjoint obstacles, as the halves of one body that is cut at the plane would.

use enfilade_geom::{DVec3, Triangle, triangle_area_normal};

/// Greatest depth of the wall around a special portal behind its plane. [Units: wu]
pub(super) const FLUSH: f64 = 0.01;

/// Square of twice the area of a triangle that cutting leaves by rounding. [Units: wu⁴]
const SLIVER: f64 = 1e-24;

/// The obstacles that count, in the frame of one part.
#[derive(Clone, Debug, Default)]
pub(super) struct Carver {
    cuts: Vec<Cut>,
    n_cuts: usize,
    /// Polygons under work: those before a cut, and those after it.
    before: Polygons,
    after: Polygons,
    scratch: [Vec<DVec3>; 2],
}

#[derive(Clone, Debug, Default)]
struct Cut {
    /// Unit normal: towards what counts for a far side, away from it for a near one.
    normal: DVec3,
    height: f64,
    /// Tolerance of the plane. [Units: wu]
    margin: f64,
    /// For a near side, the inward planes of the edges of each convex piece, and the number of edges of each.
    edges: Vec<(DVec3, f64)>,
    pieces: Vec<usize>,
    is_near: bool,
}

#[derive(Clone, Debug, Default)]
struct Polygons {
    corners: Vec<DVec3>,
    ends: Vec<usize>,
}

impl Polygons {
    fn clear(&mut self) {
        self.corners.clear();
        self.ends.clear();
    }

    fn push(&mut self, polygon: &[DVec3]) {
        if polygon.len() >= 3 {
            self.corners.extend_from_slice(polygon);
            self.ends.push(self.corners.len());
        }
    }

    fn iter(&self) -> impl Iterator<Item = &[DVec3]> {
        let mut first = 0;
        self.ends.iter().map(move |&end| {
            let polygon = &self.corners[first..end];
            first = end;
            polygon
        })
    }
}

impl Carver {
    /// Forgets all cuts.
    pub(super) fn clear(&mut self) {
        self.n_cuts = 0;
    }

    /// Returns `true` if everything counts.
    pub(super) fn is_empty(&self) -> bool {
        self.n_cuts == 0
    }

    fn add(&mut self, normal: DVec3, height: f64, margin: f64, is_near: bool) -> &mut Cut {
        if self.n_cuts == self.cuts.len() {
            self.cuts.push(Cut::default());
        }
        let cut = &mut self.cuts[self.n_cuts];
        self.n_cuts += 1;
        (cut.normal, cut.height, cut.margin, cut.is_near) = (normal, height, margin, is_near);
        cut.edges.clear();
        cut.pieces.clear();
        cut
    }

    /// Adds the far side of an opening: what lies beyond its plane by more than a margin, `normal · p >= height + margin`, counts.
    pub(super) fn add_far(&mut self, normal: DVec3, height: f64, margin: f64) {
        self.add(normal, height, margin, false);
    }

    /// Adds the near side of an opening, whose normal points away from it. `pieces` are counter-clockwise about the normal.
    pub(super) fn add_near<'a>(
        &mut self,
        normal: DVec3,
        height: f64,
        margin: f64,
        pieces: impl Iterator<Item = &'a [DVec3]>,
        to_frame: impl Fn(DVec3) -> DVec3,
    ) {
        let cut = self.add(normal, height, margin, true);
        for piece in pieces {
            let middle = piece.iter().sum::<DVec3>() / piece.len() as f64;
            let middle = to_frame(middle);
            for k in 0..piece.len() {
                let (a, b) = (to_frame(piece[k]), to_frame(piece[(k + 1) % piece.len()]));
                let inward = normal.cross(b - a).normalize_or_zero();
                // A reflection turns the order of the vertices.
                let inward = inward * inward.dot(middle - a).signum();
                cut.edges.push((inward, inward.dot(a)));
            }
            cut.pieces.push(cut.edges.len());
        }
    }

    /// Calls `visit` for the triangles that are left of one.
    pub(super) fn carve(&mut self, triangle: &Triangle, mut visit: impl FnMut(Triangle)) {
        if self.n_cuts == 0 {
            return visit(*triangle);
        }
        self.after.clear();
        self.after.push(triangle);
        for cut in &self.cuts[..self.n_cuts] {
            std::mem::swap(&mut self.before, &mut self.after);
            self.after.clear();
            for polygon in self.before.iter() {
                cut.apply(polygon, &mut self.scratch, &mut self.after);
            }
        }
        for polygon in self.after.iter() {
            for k in 2..polygon.len() {
                let t = [polygon[0], polygon[k - 1], polygon[k]];
                if triangle_area_normal(&t).length_squared() > SLIVER {
                    visit(t);
                }
            }
        }
    }
}

impl Cut {
    fn apply(&self, polygon: &[DVec3], scratch: &mut [Vec<DVec3>; 2], out: &mut Polygons) {
        let (n, h) = (self.normal, self.height);
        let [rest, part] = scratch;
        if !self.is_near {
            clip(polygon, n, h + self.margin, part);
            out.push(part);
            return;
        }
        // In front of the plane.
        clip(polygon, -n, -(h - self.margin), part);
        out.push(part);
        // In the plane, or a little behind it: around each piece.
        clip(polygon, n, h - self.margin, part);
        clip(part, -n, -(h + FLUSH), rest);
        if rest.len() < 3 {
            return;
        }
        for p in rest.iter_mut() {
            *p -= n * (n.dot(*p) - h);
        }
        let mut left = Polygons::default();
        left.push(rest);
        let mut first = 0;
        for &end in &self.pieces {
            let mut next = Polygons::default();
            for polygon in left.iter() {
                rest.clear();
                rest.extend_from_slice(polygon);
                for &(inward, least) in &self.edges[first..end] {
                    // Outside this edge it stays; the inside goes on to the next edge.
                    clip(rest, -inward, -least, part);
                    next.push(part);
                    clip(rest, inward, least, part);
                    std::mem::swap(rest, part);
                }
            }
            (left, first) = (next, end);
        }
        for polygon in left.iter() {
            out.push(polygon);
        }
    }
}

/// Clips a convex polygon to `normal · p >= least`.
fn clip(polygon: &[DVec3], normal: DVec3, least: f64, out: &mut Vec<DVec3>) {
    out.clear();
    let n = polygon.len();
    for k in 0..n {
        let (a, b) = (polygon[k], polygon[(k + 1) % n]);
        let (ha, hb) = (normal.dot(a) - least, normal.dot(b) - least);
        if ha >= 0.0 {
            out.push(a);
        }
        if (ha > 0.0) != (hb > 0.0) && ha != 0.0 && hb != 0.0 {
            out.push(a.lerp(b, ha / (ha - hb)));
        }
    }
    if out.len() < 3 {
        out.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::Rng;

    fn area(triangles: &[Triangle]) -> f64 {
        let area = |t| triangle_area_normal(t).length() * 0.5;
        triangles.iter().map(area).sum()
    }

    fn carved(carver: &mut Carver, t: &Triangle) -> Vec<Triangle> {
        let mut left = Vec::new();
        carver.carve(t, |t| left.push(t));
        left
    }

    /// Covers W9.
    #[test]
    fn the_wall_around_an_opening_stays_and_nothing_behind_it() {
        // An opening of 1 m by 2 m in the plane z = 0; one looks along +z.
        let piece = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]];
        let piece = piece.map(|[x, y]| DVec3::new(x, y, 0.0));
        let mut carver = Carver::default();
        let pieces = [&piece[..]];
        carver.add_near(DVec3::Z, 0.0, 1e-6, pieces.into_iter(), |p| p);
        let square = |z: f64| {
            let at = |x, y| DVec3::new(x, y, z);
            [
                [at(-1.0, -1.0), at(3.0, -1.0), at(3.0, 3.0)],
                [at(-1.0, -1.0), at(3.0, 3.0), at(-1.0, 3.0)],
            ]
        };
        let left_at = |z: f64, carver: &mut Carver| {
            let left: Vec<_> = square(z).iter().flat_map(|t| carved(carver, t)).collect();
            (area(&left), left)
        };
        assert!(
            (left_at(-0.5, &mut carver).0 - 16.0).abs() < 1e-9,
            "in front"
        );
        for z in [0.0, 0.001, 0.009] {
            let (area, left) = left_at(z, &mut carver);
            assert!(
                (area - 14.0).abs() < 1e-9,
                "around the opening: {area} at {z}"
            );
            assert!(
                left.iter().flatten().all(|p| p.z.abs() < 1e-12),
                "in the plane"
            );
        }
        assert_eq!(left_at(0.02, &mut carver).0, 0.0, "behind");
        // Beyond the plane, of the far side.
        carver.clear();
        carver.add_far(DVec3::Z, 0.0, 1e-6);
        assert!((left_at(0.02, &mut carver).0 - 16.0).abs() < 1e-9);
        assert_eq!(left_at(-0.02, &mut carver).0, 0.0);
    }

    #[test]
    fn a_triangle_across_the_plane_is_cut_there() {
        let mut carver = Carver::default();
        carver.add_far(DVec3::X, 1.0, 0.0);
        let mut rng = Rng::new(4);
        for _ in 0..1000 {
            let t = [0, 1, 2].map(|_| DVec3::from_array([0, 1, 2].map(|_| rng.range(0.0, 2.0))));
            let left = carved(&mut carver, &t);
            assert!(left.iter().flatten().all(|p| p.x >= 1.0 - 1e-12));
            // The other half, too, makes the whole.
            let mut other = Carver::default();
            other.add_far(-DVec3::X, -1.0, 0.0);
            let both = area(&left) + area(&carved(&mut other, &t));
            assert!((both - area(&[t])).abs() < 1e-12);
        }
    }
}
