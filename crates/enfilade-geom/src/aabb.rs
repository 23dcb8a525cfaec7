//! Axis-aligned boxes.

use crate::{DVec3, Triangle};

/// An axis-aligned box. [Units: wu] Empty when any `min` exceeds its `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Least corner.
    pub min: DVec3,
    /// Greatest corner.
    pub max: DVec3,
}

impl Aabb {
    /// The box that holds nothing; growing it by a point gives that point.
    pub const EMPTY: Self = Self {
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
    };

    /// The box from two corners.
    #[must_use]
    pub const fn new(min: DVec3, max: DVec3) -> Self {
        Self { min, max }
    }

    /// The smallest box around `points`.
    #[must_use]
    pub fn of_points<'a>(points: impl IntoIterator<Item = &'a DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, &p| b.including(p))
    }

    /// This box, grown to hold `p`.
    #[must_use]
    pub fn including(self, p: DVec3) -> Self {
        Self {
            min: self.min.min(p),
            max: self.max.max(p),
        }
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// What both share; may be empty.
    #[must_use]
    pub fn intersection(self, other: Self) -> Self {
        Self {
            min: self.min.max(other.min),
            max: self.max.min(other.max),
        }
    }

    /// Grown by `margin` on every side.
    #[must_use]
    pub fn expanded(self, margin: f64) -> Self {
        Self {
            min: self.min - margin,
            max: self.max + margin,
        }
    }

    /// Whether nothing is inside.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// The corners of each face by their indices in [`Self::corners`], counter-clockwise from outside: low and high
    /// of x, of y, of z.
    pub const FACES: [[usize; 4]; 6] = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];

    /// The eight corners: bit `k` of an index says whether axis `k` is at its greatest.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |k: usize| [self.min[k], self.max[k]][i >> k & 1];
            DVec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// The six faces, see [`Self::FACES`].
    #[must_use]
    pub fn faces(&self) -> [[DVec3; 4]; 6] {
        let corners = self.corners();
        Self::FACES.map(|face| face.map(|c| corners[c]))
    }

    /// Two triangles for each face, counter-clockwise from outside.
    #[must_use]
    pub fn triangles(&self) -> Vec<Triangle> {
        let halves = |[a, b, c, d]: [DVec3; 4]| [[a, b, c], [a, c, d]];
        self.faces().into_iter().flat_map(halves).collect()
    }

    /// Edge lengths; negative where empty.
    #[must_use]
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }

    /// Middle.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Whether the closed boxes touch.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Whether `p` lies in the closed box.
    #[must_use]
    pub fn contains(&self, p: DVec3) -> bool {
        self.min.cmple(p).all() && p.cmple(self.max).all()
    }

    /// Squared distance from `p` to the box; 0 inside.
    #[must_use]
    pub fn distance_squared(&self, p: DVec3) -> f64 {
        (self.min - p)
            .max(p - self.max)
            .max(DVec3::ZERO)
            .length_squared()
    }

    /// Surface area; 0 when empty.
    #[must_use]
    pub fn surface_area(&self) -> f64 {
        let s = self.size().max(DVec3::ZERO);
        2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
    }

    /// Volume; 0 when empty.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let s = self.size().max(DVec3::ZERO);
        s.x * s.y * s.z
    }
}
