//! Measures how much of an upright opening an object covers, seen from the front.

use enfilade_cpg::Portal;
use enfilade_geom::{Aabb, DVec2, DVec3, Triangle};

/// Samples along each side of a rectangle.
const SAMPLES: usize = 32;

/// The rectangle around an upright opening or a plate, and coordinates along it.
#[derive(Clone, Debug)]
pub(crate) struct Rectangle {
    /// Horizontal direction along it.
    pub(crate) across: DVec3,
    /// Upward direction along it.
    pub(crate) up: DVec3,
    /// Direction out of it.
    pub(crate) normal: DVec3,
    /// Least and greatest coordinate along `across`, `up` and `normal`. [Units: wu]
    pub(crate) low: DVec3,
    pub(crate) high: DVec3,
}

impl Rectangle {
    /// Returns the rectangle around a portal's pieces; `None` if the portal is not upright.
    pub(crate) fn of_portal(portal: &Portal) -> Option<Self> {
        if portal.is_level() {
            return None;
        }
        let normal = DVec3::from(portal.normal.map(f64::from));
        let corners = portal.pieces.iter().flatten();
        let corners: Vec<DVec3> = corners.map(|p| DVec3::from(p.map(f64::from))).collect();
        Some(Self::around(normal, &corners))
    }

    /// Returns the rectangle around points, with `normal` pointing out of it.
    pub(crate) fn around(normal: DVec3, points: &[DVec3]) -> Self {
        let across = DVec3::Y.cross(normal).normalize_or(DVec3::X);
        let up = normal.cross(across);
        let mut out = Self {
            across,
            up,
            normal,
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
        };
        for p in points {
            let q = out.place(*p);
            (out.low, out.high) = (out.low.min(q), out.high.max(q));
        }
        out
    }

    /// Returns the coordinates of a point along its three directions. [Units: wu]
    pub(crate) fn place(&self, p: DVec3) -> DVec3 {
        DVec3::new(self.across.dot(p), self.up.dot(p), self.normal.dot(p))
    }

    /// Returns the point with these coordinates.
    pub(crate) fn point(&self, place: DVec3) -> DVec3 {
        self.across * place.x + self.up * place.y + self.normal * place.z
    }

    /// Returns width, height and depth. [Units: wu]
    pub(crate) fn size(&self) -> DVec3 {
        self.high - self.low
    }

    /// Returns the bounding box of triangles along its directions.
    pub(crate) fn bounds(&self, triangles: &[Triangle]) -> Aabb {
        let corners = triangles.iter().flatten();
        corners.fold(Aabb::EMPTY, |b, p| b.including(self.place(*p)))
    }

    /// Returns the samples that the triangles cover, seen along its normal.
    pub(crate) fn mask(&self, triangles: impl Iterator<Item = Triangle>) -> Mask {
        let mut mask = Mask::default();
        let size = self.size().truncate();
        let step = size / SAMPLES as f64;
        if step.min_element() <= 0.0 || step.is_nan() {
            return mask;
        }
        for t in triangles {
            let p = t.map(|c| (self.place(c).truncate() - self.low.truncate()) / step);
            mask.add(p);
        }
        mask
    }

    /// Returns the samples that a portal's pieces cover.
    pub(crate) fn open(&self, portal: &Portal) -> Mask {
        let corner = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        let fans = portal.pieces.iter().flat_map(|piece| {
            (2..piece.len()).map(move |i| [piece[0], piece[i - 1], piece[i]].map(corner))
        });
        self.mask(fans)
    }
}

/// One bit per sample; rows from the bottom up.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Mask([u32; SAMPLES]);

impl Mask {
    /// Adds a triangle, in units of samples.
    fn add(&mut self, p: [DVec2; 3]) {
        let area = (p[1] - p[0]).perp_dot(p[2] - p[0]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let low = p[0].min(p[1]).min(p[2]).max(DVec2::ZERO);
        let high = p[0].max(p[1]).max(p[2]).min(DVec2::splat(SAMPLES as f64));
        if low.cmpgt(high).any() {
            return;
        }
        let range = |k: usize| {
            let first = (low[k] - 0.5).ceil().max(0.0) as usize;
            let last = (high[k] - 0.5).floor().max(-1.0) + 1.0;
            first..(last as usize).min(SAMPLES)
        };
        // Edges count as covered, so that no seam between two triangles stays open.
        let is_in = |q: DVec2| {
            (0..3).all(|k| {
                let (a, b) = (p[k], p[(k + 1) % 3]);
                (b - a).perp_dot(q - a) * area.signum() >= -1e-9
            })
        };
        for row in range(1) {
            for column in range(0) {
                if is_in(DVec2::new(column as f64 + 0.5, row as f64 + 0.5)) {
                    self.0[row] |= 1 << column;
                }
            }
        }
    }

    pub(super) fn n(&self) -> u32 {
        self.0.iter().map(|row| row.count_ones()).sum()
    }

    /// Returns the share of these samples that `other` covers; 0 if there are none.
    pub(super) fn share_in(&self, other: &Self) -> f64 {
        let both = self
            .0
            .iter()
            .zip(&other.0)
            .map(|(a, b)| (a & b).count_ones());
        f64::from(both.sum::<u32>()) / f64::from(self.n().max(1))
    }

    /// Returns these samples as a share of the whole rectangle.
    pub(crate) fn share(&self) -> f64 {
        f64::from(self.n()) / (SAMPLES * SAMPLES) as f64
    }

    /// Returns the share of the lowest row that these samples cover.
    pub(super) fn share_at_foot(&self) -> f64 {
        f64::from(self.0[0].count_ones()) / SAMPLES as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_covers_its_rim_and_a_leaf_the_rest() {
        let of = |low: [f64; 3], high: [f64; 3]| Aabb::new(low.into(), high.into()).triangles();
        let posts = [
            of([0.0, 0.0, 0.0], [0.1, 2.0, 0.1]),
            of([0.9, 0.0, 0.0], [1.0, 2.0, 0.1]),
            of([0.1, 1.9, 0.0], [0.9, 2.0, 0.1]),
        ]
        .concat();
        let corners: Vec<DVec3> = posts.iter().flatten().copied().collect();
        let r = Rectangle::around(DVec3::Z, &corners);
        assert!((r.size() - DVec3::new(1.0, 2.0, 0.1)).length() < 1e-12);
        let frame = r.mask(posts.into_iter());
        // 0.2 of 1 m are posts, and 0.05 of the rest is the head.
        assert!((frame.share() - 0.24).abs() < 0.03, "{}", frame.share());
        assert!(frame.share_at_foot() < 0.3);
        let leaf = r.mask(of([0.1, 0.0, 0.04], [0.9, 1.9, 0.08]).into_iter());
        assert!((leaf.share() - 0.76).abs() < 0.04, "{}", leaf.share());
        assert!(leaf.share_in(&frame) < 0.01);
        let p = DVec3::new(0.3, 1.2, -4.0);
        assert!(r.point(r.place(p)).distance(p) < 1e-12);
    }
}
