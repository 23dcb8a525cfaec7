//! Inserts points into Delaunay tetrahedra.
//!
//! Bowyer 1981 and Watson 1981: each point removes the tetrahedra whose circumspheres contain it, which leaves a
//! cavity; new tetrahedra connect the point with each facet of the cavity's boundary. A point at infinity closes the
//! hull, so that a point outside is not a special case. Points are inserted in Hilbert order in rounds (`order`), and
//! located by a walk that begins where the last one ended.
//!
//! **Ties need no perturbation.** A tetrahedron conflicts with a point *strictly* inside its sphere, and one at
//! infinity whose facet's plane contains the point conflicts if its finite neighbor does. All spheres through a facet
//! meet the facet's plane in one circle, so a facet coplanar with the new point is in conflict on both sides or on
//! neither: it is never part of the boundary, and no flat tetrahedron can arise.

use std::collections::BTreeMap;

use enfilade_geom::{Allowance, DVec3};

use super::order::insertion_order;
use super::predicate::{LARGEST, LEAST, Predicates};
use super::tetrahedra::{Delaunay, INFINITE, Tetrahedron, walk};
use crate::budget::WORK_A_LOOK;
use crate::error::DelaunayError;

/// Most points: seven tetrahedra per point, with four facets each, must fit in 32 bits with room to spare.
const MOST_POINTS: usize = 100_000_000;
/// Cost of each tetrahedron that a point makes, in units of [`Allowance`].
const WORK_A_FAN: u64 = 2;

/// For a new point in slot `i`, the edge that remains when vertex `j` is dropped, in the direction opposite to that of
/// the neighbor across.
const EDGES: [[[usize; 2]; 4]; 4] = [
    [[0, 0], [2, 3], [3, 1], [1, 2]],
    [[3, 2], [0, 0], [0, 3], [2, 0]],
    [[1, 3], [3, 0], [0, 0], [0, 1]],
    [[2, 1], [0, 2], [1, 0], [0, 0]],
];

/// Finds the Delaunay tetrahedra of `points`.
///
/// If several results are correct (points on one sphere), the choice depends on the coordinates alone.
///
/// # Errors
/// If there are too many points, a coordinate is out of limits, or all points lie in one plane.
pub fn tetrahedralize(points: &[DVec3]) -> Result<Delaunay, DelaunayError> {
    tetrahedralize_within(points, &Allowance::default())
}

/// [`tetrahedralize`] within an allowance: once that is spent, points are left out.
pub(super) fn tetrahedralize_within(
    points: &[DVec3],
    allowance: &Allowance,
) -> Result<Delaunay, DelaunayError> {
    if points.len() > MOST_POINTS {
        return Err(DelaunayError::TooMany {
            n_points: points.len(),
        });
    }
    // NaN is not within any limits.
    let within = |x: f64| x == 0.0 || (x.abs() >= LEAST && x.abs() <= LARGEST);
    for (index, p) in points.iter().enumerate() {
        if let Some(value) = p.to_array().into_iter().find(|&x| !within(x)) {
            return Err(DelaunayError::Coordinate { index, value });
        }
    }
    // Adding 0 turns -0 into +0, so that equal coordinates have equal bits.
    let points: Vec<DVec3> = points.iter().map(|&p| p + DVec3::ZERO).collect();
    let mut vertices: Vec<DVec3> = Vec::with_capacity(points.len());
    let mut vertex_of_point = vec![0; points.len()];
    for i in insertion_order(&points) {
        let p = points[i as usize];
        if vertices.last() != Some(&p) {
            vertices.push(p);
        }
        vertex_of_point[i as usize] = vertices.len() as u32 - 1;
    }
    let n_points = points.len();
    drop(points);
    let predicates = Predicates::of(&vertices);
    let first = first_four(&vertices, predicates).ok_or(DelaunayError::Flat { n_points })?;
    let mut builder = Insertion::new(vertices, predicates, first);
    for v in 0..builder.vertices.len() as u32 {
        if !first.contains(&v) && !builder.insert_within(v, allowance) {
            break;
        }
    }
    Ok(builder.finished(vertex_of_point))
}

/// Tetrahedra to which points are added, round by round.
pub(super) struct Growing {
    builder: Insertion,
    vertex_of_point: Vec<u32>,
}

impl Growing {
    /// Begins with the tetrahedra of `points`, as [`tetrahedralize`] finds them.
    pub(super) fn begin(points: &[DVec3], allowance: &Allowance) -> Result<Self, DelaunayError> {
        let d = tetrahedralize_within(points, allowance)?;
        Ok(Self {
            vertex_of_point: d.vertex_of_point,
            builder: Insertion::of(d.vertices, d.tetrahedra, d.predicates),
        })
    }

    /// Adds a round of points, which must differ from all points before and from each other.
    ///
    /// # Errors
    /// If there are more points than indices.
    pub(super) fn add(
        &mut self,
        points: &[DVec3],
        allowance: &Allowance,
    ) -> Result<(), DelaunayError> {
        let b = &mut self.builder;
        let n_points = b.vertices.len() + points.len();
        if n_points > MOST_POINTS {
            return Err(DelaunayError::TooMany { n_points });
        }
        b.fresh.clear();
        for i in insertion_order(points) {
            b.vertices.push(points[i as usize] + DVec3::ZERO);
            b.place.push(0);
        }
        b.predicates = Predicates::of(&b.vertices);
        for v in n_points - points.len()..n_points {
            if !b.insert_within(v as u32, allowance) {
                break;
            }
        }
        Ok(())
    }

    /// Returns the finite tetrahedra.
    pub(super) fn all(&self) -> Vec<u32> {
        let tets = &self.builder.tets;
        (0..tets.len() as u32)
            .filter(|&t| self.is_finite(t))
            .collect()
    }

    /// Returns the finite tetrahedra that the last round made.
    pub(super) fn fresh(&self) -> Vec<u32> {
        let fresh = self.builder.fresh.iter().copied();
        let mut fresh: Vec<u32> = fresh.filter(|&t| self.is_finite(t)).collect();
        fresh.sort_unstable();
        fresh.dedup();
        fresh
    }

    /// Returns `true` if the slot has a tetrahedron with finite vertices only. Vacant slots have none.
    fn is_finite(&self, t: u32) -> bool {
        !self.builder.tets[t as usize].vertices.contains(&INFINITE)
    }

    pub(super) fn tetrahedron(&self, t: u32) -> &Tetrahedron {
        &self.builder.tets[t as usize]
    }

    pub(super) fn vertices(&self) -> &[DVec3] {
        &self.builder.vertices
    }

    /// Returns the tetrahedra. [`Delaunay::vertex_of_point`] covers the initial points only.
    pub(super) fn finished(self) -> Delaunay {
        self.builder.finished(self.vertex_of_point)
    }
}

/// Returns four vertices that are not coplanar, positively oriented, found early in the order.
fn first_four(vertices: &[DVec3], predicates: Predicates) -> Option<[u32; 4]> {
    let (&a, rest) = vertices.split_first()?;
    let b = *rest.first()?;
    let on_line = |p: DVec3| {
        // Three points are collinear if they are coplanar with each of three others that do not all lie in one plane
        // through two of the points; unit steps scaled to the points are such others.
        let reach = (b - a).abs().max_element().max((p - a).abs().max_element());
        [DVec3::X, DVec3::Y, DVec3::Z]
            .into_iter()
            .all(|axis| predicates.orient(a, b, p, a + axis * reach) == 0)
    };
    let c = (2..vertices.len()).find(|&i| !on_line(vertices[i]))?;
    let d =
        (2..vertices.len()).find(|&i| predicates.orient(a, b, vertices[c], vertices[i]) != 0)?;
    let (c, d) = (c as u32, d as u32);
    if predicates.orient(a, b, vertices[c as usize], vertices[d as usize]) > 0 {
        Some([0, 1, c, d])
    } else {
        Some([1, 0, c, d])
    }
}

/// A boundary facet of the cavity: the tetrahedron inside, with the new point in place of a vertex.
#[derive(Clone, Copy)]
struct Fan {
    vertices: [u32; 4],
    /// Slot of the new point.
    slot: u32,
    /// Tetrahedron and slot across.
    outer: u32,
    /// The new tetrahedron.
    tet: u32,
}

/// Vertices of a cavity's boundary for which the table of edges has room.
const TABLE: usize = 64;

struct Insertion {
    vertices: Vec<DVec3>,
    predicates: Predicates,
    tets: Vec<Tetrahedron>,
    /// For each tetrahedron, twice the number of the insertion that last tested it, plus 1 if there was no conflict.
    marks: Vec<u32>,
    /// Slots without a tetrahedron.
    free: Vec<u32>,
    cavity: Vec<u32>,
    fans: Vec<Fan>,
    /// Place of each vertex in `local_vertices`, valid if the two agree; the infinite vertex comes first.
    place: Vec<u32>,
    local_vertices: Vec<u32>,
    table: Vec<u32>,
    epoch: u32,
    last: u32,
    /// If `is_tracked`, the tetrahedra made since this was cleared; some may no longer exist.
    fresh: Vec<u32>,
    is_tracked: bool,
}

/// Returns the index of a vertex in the table of places.
fn slot_of(v: u32) -> usize {
    v.wrapping_add(1) as usize
}

/// Marks a slot without a tetrahedron.
const VACANT: u32 = u32::MAX;

impl Insertion {
    fn new(vertices: Vec<DVec3>, predicates: Predicates, first: [u32; 4]) -> Self {
        let mut tets = vec![Tetrahedron {
            vertices: first,
            neighbors: [0; 4],
        }];
        for i in 0..4 {
            // With infinity in place of a vertex, the others must reverse, since infinity lies on the other side.
            let mut vertices = first;
            vertices[i] = INFINITE;
            vertices.swap((i + 1) % 4, (i + 2) % 4);
            tets.push(Tetrahedron {
                vertices,
                neighbors: [0; 4],
            });
        }
        let sorted = |t: &Tetrahedron, i: usize| {
            let mut f = t.facet(i);
            f.sort_unstable();
            f
        };
        for t in 0..5 {
            for i in 0..4 {
                let facet = sorted(&tets[t], i);
                let other = (0..20)
                    .find(|&o| o / 4 != t && sorted(&tets[o / 4], o % 4) == facet)
                    .expect("five tetrahedra share each facet in pairs");
                tets[t].neighbors[i] = other as u32;
            }
        }
        tets.reserve(vertices.len() * 7 + 64);
        Self {
            is_tracked: false,
            ..Self::of(vertices, tets, predicates)
        }
    }

    /// Continues from finished tetrahedra.
    fn of(vertices: Vec<DVec3>, tets: Vec<Tetrahedron>, predicates: Predicates) -> Self {
        let mut marks = Vec::with_capacity(tets.capacity());
        marks.resize(tets.len(), 0);
        Self {
            place: vec![0; vertices.len() + 1],
            vertices,
            predicates,
            tets,
            marks,
            free: Vec::new(),
            cavity: Vec::new(),
            fans: Vec::new(),
            local_vertices: Vec::new(),
            table: vec![0; TABLE * TABLE],
            epoch: 0,
            last: 0,
            fresh: Vec::new(),
            is_tracked: true,
        }
    }

    fn finished(mut self, vertex_of_point: Vec<u32>) -> Delaunay {
        let (vertices, predicates) = (std::mem::take(&mut self.vertices), self.predicates);
        let (tetrahedra, n_finite) = self.compacted();
        Delaunay {
            vertices,
            vertex_of_point,
            tetrahedra,
            n_finite,
            predicates,
        }
    }

    fn at(&self, v: u32) -> DVec3 {
        self.vertices[v as usize]
    }

    /// Returns `true` if `p` lies strictly inside the sphere of a tetrahedron.
    fn conflicts(&self, t: u32, p: DVec3) -> bool {
        let tet = &self.tets[t as usize];
        let Some(slot) = tet.infinite_slot() else {
            let [a, b, c, d] = tet.vertices.map(|v| self.at(v));
            return self.predicates.in_sphere(a, b, c, d, p) > 0;
        };
        let position = |i: usize| {
            if i == slot {
                p
            } else {
                self.at(tet.vertices[i])
            }
        };
        match self
            .predicates
            .orient(position(0), position(1), position(2), position(3))
        {
            0 => self.conflicts(tet.neighbor(slot), p),
            side => side > 0,
        }
    }

    /// Returns the tetrahedron that contains `p`: a finite one, or one at infinity if `p` is outside.
    fn locate(&self, p: DVec3) -> u32 {
        walk(&self.tets, &self.vertices, self.predicates, self.last, p)
    }

    /// Inserts a vertex; returns `true` if the allowance has room for more. An insertion costs the tetrahedra that it
    /// makes.
    fn insert_within(&mut self, v: u32, allowance: &Allowance) -> bool {
        self.insert(v);
        allowance.spend(WORK_A_LOOK + WORK_A_FAN * self.fans.len() as u64)
    }

    fn insert(&mut self, v: u32) {
        self.carve(v);
        self.fill();
        self.join_fan();
        self.last = self.fans[0].tet;
    }

    /// Finds the cavity of a new point (the tetrahedra that conflict with it) and the facets that bound it.
    fn carve(&mut self, v: u32) {
        let p = self.at(v);
        let start = self.locate(p);
        self.epoch += 2;
        let (inside, outside) = (self.epoch, self.epoch + 1);
        self.cavity.clear();
        self.fans.clear();
        self.cavity.push(start);
        self.marks[start as usize] = inside;
        let mut next = 0;
        while next < self.cavity.len() {
            let tet = self.tets[self.cavity[next] as usize];
            next += 1;
            for slot in 0..4 {
                let code = tet.neighbors[slot];
                let other = code >> 2;
                let mark = self.marks[other as usize];
                if mark == inside {
                    continue;
                }
                if mark != outside && self.conflicts(other, p) {
                    self.marks[other as usize] = inside;
                    self.cavity.push(other);
                    continue;
                }
                self.marks[other as usize] = outside;
                let mut vertices = tet.vertices;
                vertices[slot] = v;
                self.fans.push(Fan {
                    vertices,
                    slot: slot as u32,
                    outer: code,
                    tet: 0,
                });
            }
        }
    }

    /// Puts a new tetrahedron on each facet that bounds the cavity.
    fn fill(&mut self) {
        // They take the slots of the cavity, then free slots, then new ones.
        for i in 0..self.fans.len() {
            let t = self
                .cavity
                .pop()
                .or_else(|| self.free.pop())
                .unwrap_or_else(|| {
                    self.tets.push(Tetrahedron {
                        vertices: [VACANT; 4],
                        neighbors: [0; 4],
                    });
                    self.marks.push(0);
                    self.tets.len() as u32 - 1
                });
            let fan = &mut self.fans[i];
            fan.tet = t;
            if self.is_tracked {
                self.fresh.push(t);
            }
            let slot = fan.slot as usize;
            let tet = &mut self.tets[t as usize];
            tet.vertices = fan.vertices;
            tet.neighbors[slot] = fan.outer;
            self.tets[(fan.outer >> 2) as usize].neighbors[(fan.outer & 3) as usize] =
                t << 2 | slot as u32;
        }
        for &t in &self.cavity {
            self.tets[t as usize].vertices = [VACANT; 4];
        }
        self.free.append(&mut self.cavity);
    }

    /// Makes new tetrahedra neighbors if they share an edge of the cavity's boundary.
    fn join_fan(&mut self) {
        // A closed surface of n vertices has 2n - 4 triangles; the new point is one more vertex.
        if self.fans.len() > 2 * (TABLE - 1) - 4 {
            return self.join_large_fan();
        }
        self.local_vertices.clear();
        let mut local = |v: u32| -> usize {
            let slot = &mut self.place[slot_of(v)];
            if self.local_vertices.get(*slot as usize) != Some(&v) {
                *slot = self.local_vertices.len() as u32;
                self.local_vertices.push(v);
            }
            *slot as usize
        };
        for fan in &self.fans {
            let slot = fan.slot as usize;
            let mut places = [0; 4];
            for (place, v) in places.iter_mut().zip(fan.vertices) {
                *place = local(v);
            }
            for (j, &[k, l]) in EDGES[slot].iter().enumerate() {
                if j != slot {
                    self.table[places[k] * TABLE + places[l]] = fan.tet << 2 | j as u32;
                }
            }
        }
        for fan in &self.fans {
            let slot = fan.slot as usize;
            let mut places = [0; 4];
            for (place, v) in places.iter_mut().zip(fan.vertices) {
                *place = self.place[slot_of(v)] as usize;
            }
            for (j, &[k, l]) in EDGES[slot].iter().enumerate() {
                if j != slot {
                    self.tets[fan.tet as usize].neighbors[j] =
                        self.table[places[l] * TABLE + places[k]];
                }
            }
        }
    }

    #[cold]
    fn join_large_fan(&mut self) {
        let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for fan in &self.fans {
            let slot = fan.slot as usize;
            for j in (0..4).filter(|&j| j != slot) {
                let [k, l] = EDGES[slot][j].map(|k| fan.vertices[k]);
                edges.insert((k, l), fan.tet << 2 | j as u32);
            }
        }
        for (&(k, l), &code) in &edges {
            self.tets[(code >> 2) as usize].neighbors[(code & 3) as usize] = edges[&(l, k)];
        }
    }

    /// Returns the tetrahedra without gaps, finite ones first, and the number of those.
    fn compacted(self) -> (Vec<Tetrahedron>, usize) {
        let mut number = self.marks;
        let mut n = 0;
        for finite in [true, false] {
            for (t, tet) in self.tets.iter().enumerate() {
                let vacant = tet.vertices[0] == VACANT && tet.vertices[1] == VACANT;
                if !vacant && tet.infinite_slot().is_none() == finite {
                    number[t] = n;
                    n += 1;
                }
            }
        }
        let mut out = vec![
            Tetrahedron {
                vertices: [VACANT; 4],
                neighbors: [0; 4],
            };
            n as usize
        ];
        let mut n_finite = 0;
        for (t, tet) in self.tets.iter().enumerate() {
            if tet.vertices[0] == VACANT && tet.vertices[1] == VACANT {
                continue;
            }
            n_finite += usize::from(tet.infinite_slot().is_none());
            out[number[t] as usize] = Tetrahedron {
                vertices: tet.vertices,
                neighbors: tet
                    .neighbors
                    .map(|code| number[(code >> 2) as usize] << 2 | code & 3),
            };
        }
        (out, n_finite)
    }
}
