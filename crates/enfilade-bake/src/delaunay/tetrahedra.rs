//! Delaunay tetrahedra of points: who neighbors whom, and which one holds a point.
//!
//! A point at infinity closes the hull: each facet of the hull bounds an infinite tetrahedron, so that every facet
//! has two sides. `insert` makes them, exact whatever the points are.
//!
//! Expected `O(n log n)` for points spread out; 32 bytes a tetrahedron, about 7 tetrahedra a point.

use enfilade_geom::DVec3;

use super::predicate::Predicates;

/// The vertex at infinity.
pub const INFINITE: u32 = u32::MAX;

/// A tetrahedron: vertices, and across the facet opposite each vertex, which facet of which
/// tetrahedron, as four times the tetrahedron plus the facet.
///
/// With vertices `[a, b, c, d]`, seen from the side away from `d`, `a b c` run counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(32))]
pub struct Tetrahedron {
    /// At most one is [`INFINITE`].
    pub vertices: [u32; 4],
    /// Four times the neighbor across the facet opposite each vertex, plus its facet.
    pub neighbors: [u32; 4],
}

impl Tetrahedron {
    /// The neighbor across the facet opposite vertex `i`.
    #[must_use]
    pub fn neighbor(&self, i: usize) -> u32 {
        self.neighbors[i] >> 2
    }

    /// The vertices of the facet opposite vertex `i`, counter-clockwise seen from outside.
    #[must_use]
    pub fn facet(&self, i: usize) -> [u32; 3] {
        FACETS[i].map(|k| self.vertices[k])
    }

    /// Where among the vertices the infinite one stands.
    pub(super) fn infinite_slot(&self) -> Option<usize> {
        self.vertices.iter().position(|&v| v == INFINITE)
    }
}

/// Vertices of the facet opposite each vertex, counter-clockwise seen from outside.
const FACETS: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// Why points have no tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DelaunayError {
    /// A coordinate is not finite, or too large or too small for exact products.
    #[error(
        "point {index} has the coordinate {value}; coordinates must be 0 or between 1e-40 and 1e50"
    )]
    Coordinate {
        /// Which point.
        index: usize,
        /// The coordinate.
        value: f64,
    },
    /// All points lie in one plane, or there are fewer than four.
    #[error("all {n_points} points lie in one plane, so there is no volume to divide")]
    Flat {
        /// How many points there are.
        n_points: usize,
    },
    /// More points than indices.
    #[error("{n_points} points are more than the 100 million that indices of 32 bits allow")]
    TooMany {
        /// How many points there are.
        n_points: usize,
    },
}

/// The Delaunay tetrahedra of a set of points.
#[derive(Clone, Debug)]
pub struct Delaunay {
    /// Distinct points, in the order of insertion. [Units: wu]
    pub vertices: Vec<DVec3>,
    /// The vertex of each point given; equal points share one.
    pub vertex_of_point: Vec<u32>,
    /// Tetrahedra, finite ones first.
    pub tetrahedra: Vec<Tetrahedron>,
    /// How many of them are finite.
    pub n_finite: usize,
    pub(super) predicates: Predicates,
}

impl Delaunay {
    /// The finite tetrahedra.
    #[must_use]
    pub fn finite(&self) -> &[Tetrahedron] {
        &self.tetrahedra[..self.n_finite]
    }

    /// Positions of the vertices of a finite tetrahedron. [Units: wu]
    ///
    /// # Panics
    /// When there is no such tetrahedron, or it is infinite.
    #[must_use]
    pub fn corners(&self, t: u32) -> [DVec3; 4] {
        self.tetrahedra[t as usize]
            .vertices
            .map(|v| self.vertices[v as usize])
    }

    /// The tetrahedron that holds `p`, an infinite one if `p` is outside the hull; `hint` is where to
    /// begin, the nearer the faster. On a facet that several share, one of them.
    ///
    /// # Panics
    /// When there is no tetrahedron `hint`. Coordinates of `p` that are not finite find any.
    #[must_use]
    pub fn locate(&self, p: DVec3, hint: u32) -> u32 {
        walk(&self.tetrahedra, &self.vertices, self.predicates, hint, p)
    }
}

/// Walks from `start` to the tetrahedron that holds `p`, across facets that have `p` on their far side. In Delaunay
/// tetrahedra such a walk never returns to where it was (Edelsbrunner 1990).
pub(super) fn walk(
    tets: &[Tetrahedron],
    vertices: &[DVec3],
    predicates: Predicates,
    start: u32,
    p: DVec3,
) -> u32 {
    let mut t = start;
    if let Some(slot) = tets[t as usize].infinite_slot() {
        t = tets[t as usize].neighbor(slot);
    }
    let mut from = 4;
    loop {
        let tet = &tets[t as usize];
        if tet.vertices.contains(&INFINITE) {
            return t;
        }
        let corners = tet.vertices.map(|v| vertices[v as usize]);
        let beyond = (0..4).find(|&i| {
            if i == from {
                return false;
            }
            let mut c = corners;
            c[i] = p;
            predicates.orient(c[0], c[1], c[2], c[3]) < 0
        });
        let Some(i) = beyond else { return t };
        from = (tet.neighbors[i] & 3) as usize;
        t = tet.neighbor(i);
    }
}
