//! Axis-aligned boxes.

use crate::{DVec3, Triangle};

/// An axis-aligned box. [Units: wu] Empty when any `min` exceeds its `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Minimum along each axis.
    pub min: DVec3,
    /// Maximum along each axis.
    pub max: DVec3,
}

impl Aabb {
    /// The empty box; growing it by a point gives the box of that point.
    pub const EMPTY: Self = Self {
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
    };

    /// Makes the box from its minimum and maximum.
    #[must_use]
    pub const fn new(min: DVec3, max: DVec3) -> Self {
        Self { min, max }
    }

    /// Returns the smallest box around `points`.
    #[must_use]
    pub fn of_points<'a>(points: impl IntoIterator<Item = &'a DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, &p| b.including(p))
    }

    /// Returns this box grown to contain `p`.
    #[must_use]
    pub fn including(self, p: DVec3) -> Self {
        Self {
            min: self.min.min(p),
            max: self.max.max(p),
        }
    }

    /// Returns the smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Returns the common part of both; may be empty.
    #[must_use]
    #[doc(hidden)]
    pub fn intersection(self, other: Self) -> Self {
        Self {
            min: self.min.max(other.min),
            max: self.max.min(other.max),
        }
    }

    /// Returns the box grown by `margin` on every side.
    #[must_use]
    #[doc(hidden)]
    pub fn expanded(self, margin: f64) -> Self {
        Self {
            min: self.min - margin,
            max: self.max + margin,
        }
    }

    /// Returns `true` if the box contains no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// Vertices of each face as indices into [`Self::corners`], counter-clockwise from outside: low and high
    /// side of x, of y, of z.
    pub const FACES: [[usize; 4]; 6] = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];

    /// Returns the eight vertices: bit `k` of an index is set if axis `k` is at its maximum.
    #[must_use]
    #[doc(hidden)]
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |k: usize| [self.min[k], self.max[k]][i >> k & 1];
            DVec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// Returns the six faces, in the order of [`Self::FACES`].
    #[must_use]
    #[doc(hidden)]
    pub fn faces(&self) -> [[DVec3; 4]; 6] {
        let corners = self.corners();
        Self::FACES.map(|face| face.map(|c| corners[c]))
    }

    /// Returns two triangles per face, counter-clockwise from outside.
    #[must_use]
    #[doc(hidden)]
    pub fn triangles(&self) -> Vec<Triangle> {
        let halves = |[a, b, c, d]: [DVec3; 4]| [[a, b, c], [a, c, d]];
        self.faces().into_iter().flat_map(halves).collect()
    }

    /// Returns the edge lengths; negative if empty.
    #[must_use]
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }

    /// Returns the center.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Returns `true` if the closed boxes intersect.
    #[must_use]
    #[doc(hidden)]
    pub fn overlaps(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Returns `true` if `p` lies in the closed box.
    #[must_use]
    pub fn contains(&self, p: DVec3) -> bool {
        self.min.cmple(p).all() && p.cmple(self.max).all()
    }

    /// Returns the squared distance from `p` to the box; 0 inside.
    #[must_use]
    #[doc(hidden)]
    pub fn distance_squared(&self, p: DVec3) -> f64 {
        (self.min - p)
            .max(p - self.max)
            .max(DVec3::ZERO)
            .length_squared()
    }

    /// Returns the surface area; 0 if empty.
    #[must_use]
    #[doc(hidden)]
    pub fn surface_area(&self) -> f64 {
        let s = self.size().max(DVec3::ZERO);
        2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
    }

    /// Returns the volume; 0 if empty.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let s = self.size().max(DVec3::ZERO);
        s.x * s.y * s.z
    }
}
