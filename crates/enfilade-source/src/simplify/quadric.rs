//! Sums of squared distances from planes.

use enfilade_geom::{DMat3, DVec3};

use crate::qef::eigen;

/// A sum of squared distances from planes, each weighted by an area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quadric {
    a: DMat3,
    b: DVec3,
    c: f64,
}

impl Quadric {
    pub(super) const ZERO: Self = Self {
        a: DMat3::ZERO,
        b: DVec3::ZERO,
        c: 0.0,
    };

    pub(super) fn of_triangle([p, q, r]: [DVec3; 3]) -> Self {
        let n = (q - p).cross(r - p);
        let area = n.length();
        let Some(n) = n.try_normalize() else {
            return Self::ZERO;
        };
        let d = -n.dot(p);
        Self {
            a: DMat3::from_cols(n * n.x, n * n.y, n * n.z) * area,
            b: n * (d * area),
            c: d * d * area,
        }
    }

    pub(super) fn plus(self, o: &Self) -> Self {
        Self {
            a: self.a + o.a,
            b: self.b + o.b,
            c: self.c + o.c,
        }
    }

    pub(super) fn at(&self, p: DVec3) -> f64 {
        (p.dot(self.a * p) + 2.0 * self.b.dot(p) + self.c).max(0.0)
    }

    /// Returns the point of least sum nearest to `near`: along directions that the planes leave free it does not move.
    pub(super) fn least(&self, near: DVec3) -> DVec3 {
        let (values, vectors) = eigen(self.a);
        let most = values.into_iter().fold(0.0, f64::max);
        let right = -(self.b + self.a * near);
        let mut p = near;
        for (value, vector) in values.into_iter().zip(vectors) {
            if value > 0.003 * most {
                p += vector * (vector.dot(right) / value);
            }
        }
        p
    }
}
