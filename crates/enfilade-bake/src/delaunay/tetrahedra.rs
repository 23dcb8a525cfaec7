//! Delaunay tetrahedra of points: their neighbors, and the search for the one that contains a point.
//!
//! A point at infinity closes the hull: each facet of the hull bounds an infinite tetrahedron, so that every facet has
//! two sides. `insert` makes them, exact for any points.
//!
//! Expected `O(n log n)` for points spread out; 32 bytes per tetrahedron, about 7 tetrahedra per point.

use enfilade_geom::DVec3;

use super::predicate::Predicates;

/// The vertex at infinity.
pub const INFINITE: u32 = u32::MAX;

/// A tetrahedron: its vertices and, for the facet opposite each vertex, the tetrahedron and facet across.
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
    /// Returns the neighbor across the facet opposite vertex `i`.
    #[must_use]
    pub fn neighbor(&self, i: usize) -> u32 {
        self.neighbors[i] >> 2
    }

    /// Returns the vertices of the facet opposite vertex `i`, counter-clockwise seen from outside.
    #[must_use]
    pub fn facet(&self, i: usize) -> [u32; 3] {
        FACETS[i].map(|k| self.vertices[k])
    }

    /// Returns the index of the infinite one among the vertices, if any.
    pub(super) fn infinite_slot(&self) -> Option<usize> {
        self.vertices.iter().position(|&v| v == INFINITE)
    }
}

/// Vertices of the facet opposite each vertex, counter-clockwise seen from outside.
const FACETS: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// The Delaunay tetrahedra of a set of points.
#[derive(Clone, Debug)]
pub struct Delaunay {
    /// Distinct points, in the order of insertion. [Units: wu]
    pub vertices: Vec<DVec3>,
    /// The vertex of each given point; equal points share one.
    pub vertex_of_point: Vec<u32>,
    /// Tetrahedra, finite ones first.
    pub tetrahedra: Vec<Tetrahedron>,
    /// Number of finite ones.
    pub n_finite: usize,
    pub(super) predicates: Predicates,
}

impl Delaunay {
    /// Returns the finite tetrahedra.
    #[must_use]
    pub fn finite(&self) -> &[Tetrahedron] {
        &self.tetrahedra[..self.n_finite]
    }

    /// Returns the positions of the vertices of a finite tetrahedron. [Units: wu]
    ///
    /// # Panics
    /// If there is no such tetrahedron, or it is infinite.
    #[must_use]
    pub fn corners(&self, t: u32) -> [DVec3; 4] {
        self.tetrahedra[t as usize]
            .vertices
            .map(|v| self.vertices[v as usize])
    }

    /// Returns the tetrahedron that contains `p`, an infinite one if `p` is outside the hull; one of those that share a
    /// facet if `p` is on it. The search begins at `hint`: the nearer, the faster.
    ///
    /// # Panics
    /// If there is no tetrahedron `hint`. For coordinates of `p` that are not finite, the result is arbitrary.
    #[must_use]
    pub fn locate(&self, p: DVec3, hint: u32) -> u32 {
        walk(&self.tetrahedra, &self.vertices, self.predicates, hint, p)
    }
}

/// Walks from `start` to the tetrahedron that contains `p`, across facets that have `p` on their far side. In Delaunay
/// tetrahedra such a walk never returns to a tetrahedron (Edelsbrunner 1990).
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
