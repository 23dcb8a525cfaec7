//! Fills holes: closed loops of open edges get triangles.
//!
//! Finds the triangulation of least area of a loop in space by dynamic programming (Barequet & Sharir 1995, §4; the
//! first step of Liepa 2003). Excludes triangles without area and edges that the surface already has, so that the
//! result is a 2-manifold. A loop whose triangles would lie folded on the surface is the outer rim of a sheet, not a
//! hole.

use std::collections::{HashMap, HashSet};

use enfilade_geom::{Aabb, DVec3, Sets, triangle_area_normal};

use super::surface::{Face, Surface, Use, open_of, unit};
use super::weld::ONE_POINT;

/// Loops to fill.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    /// Largest diagonal of their box. [Units: wu]
    size: f64,
    /// Most vertices.
    corners: usize,
    /// Fills only where the surface continues straight, see [`Hole::is_torn`].
    is_torn_only: bool,
    /// Steps for all loops together; a loop of n vertices takes n³.
    steps: u64,
}

impl Limits {
    /// Loops of up to 128 vertices, as the time grows with the cube of their number.
    pub(super) fn up_to(size: f64, steps: u64) -> Self {
        Self {
            size,
            corners: 128,
            is_torn_only: false,
            steps,
        }
    }

    /// Loops that one triangle closes, as its neighbor beside it does: it was there.
    pub(super) const ONE_TRIANGLE: Self = Self {
        size: f64::INFINITY,
        corners: 3,
        is_torn_only: true,
        steps: u64::MAX,
    };
}

/// Cosine of 45 degrees, the angle below which triangles at an edge count as folded on each other.
const FOLDED: f64 = 0.7;

/// Result of filling.
#[derive(Default)]
pub(super) struct Filled {
    pub(super) n_holes: u64,
    pub(super) n_triangles: u64,
    /// Number of loops that stay open.
    pub(super) n_left: u64,
    /// The filled holes, one by one.
    pub(super) holes: Vec<Hole>,
    /// The steps sufficed for all loops.
    pub(super) is_complete: bool,
}

/// A loop of open edges across which the surface could be continued.
pub(crate) struct Hole {
    /// The mean of its vertices. [Units: wu]
    pub(crate) position: DVec3,
    /// Area of the triangles that fill it. [Units: wu²]
    pub(crate) area: f64,
    /// The object of one of its edges.
    pub(crate) object: u32,
    /// The surface continues straight, within 45 degrees, across at least one edge: a part of a face is missing, not
    /// a whole face of a box that was meant to be open.
    pub(crate) is_torn: bool,
}

/// A loop of open edges: vertices, and the use of the edge from each to the next.
struct Loop {
    points: Vec<u32>,
    edges: Vec<Use>,
}

/// Fills each loop of open edges within the limits, as long as steps are left.
///
/// Time: `n log n` for all triangles, plus the cube of each loop's vertices.
pub(super) fn fill_holes(surface: &mut Surface, limits: Limits) -> Filled {
    let mut steps = limits.steps;
    let uses = surface.uses();
    let loops = loops(&uses, &open_of(&uses));
    let mut filled = Filled {
        is_complete: true,
        ..Filled::default()
    };
    if loops.is_empty() {
        return filled;
    }
    let mut edges: HashSet<[u32; 2]> = uses.iter().map(|u| u.ends).collect();
    let mut known: HashSet<[u32; 3]> = (0..surface.faces.len())
        .map(|f| sorted(surface.ends(f)))
        .collect();
    for mut rim in loops {
        let at = |p: &u32| surface.points[*p as usize];
        let bounds = rim
            .points
            .iter()
            .fold(Aabb::EMPTY, |b, p| b.including(at(p)));
        let is_small = bounds.size().length() <= limits.size && rim.points.len() <= limits.corners;
        if is_small {
            match steps.checked_sub((rim.points.len() as u64).pow(3)) {
                Some(left) => steps = left,
                None => {
                    filled.is_complete = false;
                    break;
                }
            }
        }
        turn_against_faces(surface, &mut rim);
        let triangles = is_small
            .then(|| triangulated(surface, &rim.points, &edges))
            .flatten()
            .filter(|t| !is_folded(surface, &rim, t))
            .filter(|t| {
                t.iter()
                    .all(|t| !known.contains(&sorted(t.map(|i| rim.points[i]))))
            });
        let filling = triangles.map(|t| (hole_of(surface, &rim, &t), t));
        let wanted = filling.filter(|(hole, _)| hole.is_torn || !limits.is_torn_only);
        let Some((hole, triangles)) = wanted else {
            filled.n_left += 1;
            continue;
        };
        for t in &triangles {
            let ends = t.map(|i| rim.points[i]);
            known.insert(sorted(ends));
            edges.extend([0, 1, 2].map(|k| {
                let (a, b) = (ends[k], ends[(k + 1) % 3]);
                [a.min(b), a.max(b)]
            }));
        }
        filled.n_holes += 1;
        filled.n_triangles += triangles.len() as u64;
        filled.holes.push(hole);
        add(surface, &rim, &triangles);
    }
    filled
}

fn hole_of(surface: &Surface, rim: &Loop, triangles: &[[usize; 3]]) -> Hole {
    let at = |i: usize| surface.points[rim.points[i] as usize];
    let sum: DVec3 = (0..rim.points.len()).map(at).sum();
    let area = |t: &[usize; 3]| 0.5 * triangle_area_normal(&t.map(at)).length();
    Hole {
        position: sum / rim.points.len() as f64,
        area: triangles.iter().map(area).sum(),
        object: rim.edges[0].object,
        is_torn: bends(surface, rim, triangles)
            .iter()
            .any(|b| b.cos < -FOLDED),
    }
}

fn sorted(mut corners: [u32; 3]) -> [u32; 3] {
    corners.sort_unstable();
    corners
}

/// Returns `true` if the triangle at an edge traverses it from its lesser end to its greater.
fn is_forward(edge: &Use) -> bool {
    edge.is_reverse
}

/// The fan of each triangle around a point, where several fans meet in the point alone.
struct Fans {
    /// Numbers of the pairs of point and face.
    numbers: HashMap<(u32, u32), u32>,
    sets: Sets,
}

impl Fans {
    /// Finds the fans around points with more than two open edges.
    fn new(uses: &[Use], at: &HashMap<u32, Vec<usize>>) -> Self {
        let mut numbers = HashMap::new();
        let is_shared = |p: &u32| at.get(p).is_some_and(|edges| edges.len() > 2);
        for u in uses {
            for p in u.ends.into_iter().filter(is_shared) {
                let n = numbers.len() as u32;
                numbers.entry((p, u.face)).or_insert(n);
            }
        }
        let mut sets = Sets::new(numbers.len());
        for edge in uses.chunk_by(|a, b| a.ends == b.ends) {
            if let [one, other] = edge {
                for p in one.ends.into_iter().filter(is_shared) {
                    sets.join(numbers[&(p, one.face)], numbers[&(p, other.face)]);
                }
            }
        }
        Self { numbers, sets }
    }

    fn of(&mut self, point: u32, face: u32) -> Option<u32> {
        let number = self.numbers.get(&(point, face))?;
        Some(self.sets.find(*number))
    }
}

/// Divides open edges into simple loops: a walk along unused edges completes one whenever it meets itself.
///
/// An even number of open edges meets in each point, so that every walk ends where it began. If there is a choice,
/// the next edge is one that its triangle traverses in the same direction, and across the gap: not the other rim of
/// the same fan of triangles. Linear.
fn loops(uses: &[Use], open: &[Use]) -> Vec<Loop> {
    let mut at: HashMap<u32, Vec<usize>> = HashMap::new();
    for (i, edge) in open.iter().enumerate() {
        edge.ends
            .iter()
            .for_each(|&p| at.entry(p).or_default().push(i));
    }
    let mut fans = Fans::new(uses, &at);
    let mut is_used = vec![false; open.len()];
    let mut out = Vec::new();
    for start in 0..open.len() {
        if is_used[start] {
            continue;
        }
        let first = open[start].ends[usize::from(!is_forward(&open[start]))];
        let mut points = vec![first];
        let mut edges: Vec<Use> = Vec::new();
        let mut place = HashMap::from([(first, 0)]);
        while let Some(&from) = points.last() {
            let leaves = |i: &usize| (open[*i].ends[0] == from) == is_forward(&open[*i]);
            let last = edges.last().and_then(|e| fans.of(from, e.face));
            let next = at[&from].iter().copied().filter(|&i| !is_used[i]);
            let Some(i) = next.min_by_key(|i| {
                let is_same_fan = last.is_some() && last == fans.of(from, open[*i].face);
                (is_same_fan, !leaves(i), *i)
            }) else {
                break;
            };
            is_used[i] = true;
            let [a, b] = open[i].ends;
            let to = if a == from { b } else { a };
            edges.push(open[i]);
            if let Some(&k) = place.get(&to) {
                let of_loop = points.split_off(k);
                of_loop.iter().skip(1).for_each(|p| {
                    place.remove(p);
                });
                points.push(to);
                out.push(Loop {
                    points: of_loop,
                    edges: edges.split_off(k),
                });
            } else {
                place.insert(to, points.len());
                points.push(to);
            }
        }
    }
    out
}

/// Turns a loop so that its triangles agree in winding with most of their neighbors, by length.
fn turn_against_faces(surface: &Surface, rim: &mut Loop) {
    let against: f64 = (rim.points.iter().zip(&rim.edges))
        .map(|(&p, e)| {
            let [a, b] = e.ends.map(|i| surface.points[i as usize]);
            let is_along = (e.ends[0] == p) == is_forward(e);
            a.distance(b) * if is_along { 1.0 } else { -1.0 }
        })
        .sum();
    if against < 0.0 {
        rim.points.reverse();
        // Edge `i` leads from vertex `i` to the next one, before and after.
        rim.edges.reverse();
        rim.edges.rotate_left(1);
    }
}

/// Returns the triangulation of least area of a loop, as triples of positions in it. `None` if each has a triangle
/// lower than [`ONE_POINT`] or an inner edge that already exists. Time: the cube of the vertices.
fn triangulated(
    surface: &Surface,
    points: &[u32],
    edges: &HashSet<[u32; 2]>,
) -> Option<Vec<[usize; 3]>> {
    let n = points.len();
    let at: Vec<DVec3> = points.iter().map(|&p| surface.points[p as usize]).collect();
    let area = |t: [usize; 3]| {
        let corners = t.map(|i| at[i]);
        let [a, b, c] = corners;
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let double = triangle_area_normal(&corners).length();
        if double <= ONE_POINT * longest {
            f64::INFINITY
        } else {
            double
        }
    };
    let is_free = |i: usize, j: usize| {
        let (a, b) = (points[i], points[j]);
        let is_rim = j - i == 1 || j - i == n - 1;
        is_rim || !edges.contains(&[a.min(b), a.max(b)])
    };
    // For the part of the loop from vertex `i` to `j`: the least area, and the apex of the triangle on both.
    let mut least = vec![0.0; n * n];
    let mut middle = vec![0; n * n];
    for length in 2..n {
        for i in 0..n - length {
            let j = i + length;
            let mut best = (f64::INFINITY, 0);
            let apexes = if is_free(i, j) { i + 1..j } else { 0..0 };
            for k in apexes {
                let parts = least[i * n + k] + least[k * n + j];
                if parts >= best.0 {
                    continue;
                }
                let sum = parts + area([i, k, j]);
                if sum < best.0 {
                    best = (sum, k);
                }
            }
            least[i * n + j] = best.0;
            middle[i * n + j] = best.1;
        }
    }
    if !least[n - 1].is_finite() {
        return None;
    }
    let mut out = Vec::with_capacity(n - 2);
    let mut open = vec![(0, n - 1)];
    while let Some((i, j)) = open.pop() {
        if j - i > 1 {
            let k = middle[i * n + j];
            out.push([i, k, j]);
            open.extend([(i, k), (k, j)]);
        }
    }
    Some(out)
}

/// Returns `true` if the new triangles lie folded on the old ones along most of the loop.
fn is_folded(surface: &Surface, rim: &Loop, triangles: &[[usize; 3]]) -> bool {
    let bends = bends(surface, rim, triangles);
    let all: f64 = bends.iter().map(|b| b.length).sum();
    let folded = bends.iter().filter(|b| b.cos > FOLDED);
    2.0 * folded.map(|b| b.length).sum::<f64>() > all
}

/// Continuation of the surface across an edge of a loop.
struct Bend {
    length: f64,
    /// 1 where the new triangle would lie folded on the old one, -1 where it continues straight.
    cos: f64,
}

fn bends(surface: &Surface, rim: &Loop, triangles: &[[usize; 3]]) -> Vec<Bend> {
    let n = rim.points.len();
    let at = |p: u32| surface.points[p as usize];
    let mut bends = Vec::with_capacity(n);
    for t in triangles {
        for k in 0..3 {
            let (i, j, apex) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            if (i + 1) % n != j {
                continue;
            }
            let edge = &rim.edges[i];
            let ends = edge.ends;
            let old = surface.ends(edge.face as usize);
            let Some(other) = old.iter().find(|p| !ends.contains(p)) else {
                continue;
            };
            let from = at(ends[0]);
            let along = (at(ends[1]) - from).normalize_or_zero();
            let away = |p: DVec3| {
                let v = p - from;
                (v - along * v.dot(along)).normalize_or_zero()
            };
            let length = at(ends[1]).distance(from);
            let cos = away(at(rim.points[apex])).dot(away(at(*other)));
            bends.push(Bend { length, cos });
        }
    }
    bends
}

/// Adds the triangles to the part with most of the rim. Vertices take the attributes that the part has there or
/// nearest along the rim, and normals of their own.
fn add(surface: &mut Surface, rim: &Loop, triangles: &[[usize; 3]]) {
    let mut lengths: Vec<(u32, f64)> = Vec::new();
    for edge in &rim.edges {
        let part = surface.faces[edge.face as usize].part;
        let [a, b] = edge.ends.map(|p| surface.points[p as usize]);
        match lengths.iter_mut().find(|(p, _)| *p == part) {
            Some((_, length)) => *length += a.distance(b),
            None => lengths.push((part, a.distance(b))),
        }
    }
    lengths.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let part = lengths[0].0;
    let n = rim.points.len();
    let mut vertices: Vec<Option<u32>> = vec![None; n];
    for edge in &rim.edges {
        let face = surface.faces[edge.face as usize];
        if face.part != part {
            continue;
        }
        let ends = surface.ends(edge.face as usize);
        for (point, vertex) in ends.into_iter().zip(face.corners) {
            if let Some(i) = rim.points.iter().position(|&p| p == point) {
                vertices[i].get_or_insert(vertex);
            }
        }
    }
    let nearest =
        |i: usize| (0..n).find_map(|d| vertices[(i + d) % n].or(vertices[(i + n - d) % n]));
    for t in triangles {
        let corners = t.map(|i| surface.points[rim.points[i] as usize]);
        let normal = triangle_area_normal(&corners).normalize_or_zero();
        let corners = t.map(|i| {
            // Some edge of the rim belongs to the part, so there is a vertex.
            let from = nearest(i).unwrap_or_default();
            let v = surface.mix(part, [from, from], 0.0, rim.points[i]);
            let attributes = &mut surface.parts[part as usize].vertices;
            if let Some(of_vertex) = attributes.normals.last_mut() {
                *of_vertex = unit(normal);
            }
            if let Some(t) = attributes.tangents.last_mut() {
                let old = DVec3::new(t[0].into(), t[1].into(), t[2].into());
                let flat = old - normal * old.dot(normal);
                let flat = flat.try_normalize();
                let [x, y, z] = unit(flat.unwrap_or_else(|| normal.any_orthonormal_vector()));
                *t = [x, y, z, t[3]];
            }
            v
        });
        surface.faces.push(Face { part, corners });
    }
    let object = surface.parts[part as usize].object;
    surface.is_changed[object as usize] = true;
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::DMat4;
    use enfilade_geom::scene::{Mesh, Object, Primitive, Role, Scene};

    /// A tetrahedron without its base: one loop of three vertices.
    fn open_tetrahedron() -> Surface {
        let primitive = Primitive {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.3, 1.0, 0.3]],
            indices: vec![0, 3, 1, 1, 3, 2, 2, 3, 0],
            ..Primitive::default()
        };
        Surface::of_scene(&Scene {
            meshes: vec![Mesh {
                name: String::new(),
                primitives: vec![primitive],
            }],
            objects: vec![Object {
                name: String::new(),
                mesh: 0,
                transform: DMat4::IDENTITY,
                role: Role::Structural,
                reason: String::new(),
                filling: None,
                node: None,
            }],
            ..Scene::default()
        })
    }

    #[test]
    fn a_search_without_steps_left_ends_and_says_so() {
        let all = fill_holes(&mut open_tetrahedron(), Limits::up_to(10.0, 27));
        assert_eq!((all.n_holes, all.is_complete), (1, true));
        let none = fill_holes(&mut open_tetrahedron(), Limits::up_to(10.0, 26));
        assert_eq!((none.n_holes, none.is_complete), (0, false));
    }
}
