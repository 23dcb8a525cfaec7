//! Collapses of edges.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use enfilade_geom::{DVec3, Purse, Tab, closest_point_on_triangle};

use super::quadric::Quadric;

/// Most triangles around a vertex after a collapse; more take longer to check than they save.
const MAX_FAN: usize = 16;
/// Longest edge after a collapse, in tolerances: a triangle has to be checked against all vertices of the input near it.
const MAX_EDGE: f64 = 2000.0;
/// Least cosine between the normals of a triangle before and after a collapse: far from a fold.
const LEAST_TURN: f64 = 0.3;
/// Least height of a triangle after a collapse, in its longest edge.
const LEAST_HEIGHT: f64 = 0.01;

/// A collapse that may be made: cost, ends of the edge, and how often each had changed.
type Wish = Reverse<(u64, [u32; 2], [u32; 2])>;

/// Work of a vertex or a wish, in the units of an allowance; and the distances of vertices from triangles in one such unit.
const WORK: u64 = 10;
const DISTANCES: usize = 4;

pub(super) struct Mesh<'p> {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    is_alive: Vec<bool>,
    /// Triangles around each vertex.
    fans: Vec<Vec<u32>>,
    quadrics: Vec<Quadric>,
    /// How often each vertex changed.
    versions: Vec<u32>,
    /// Vertices with an edge of other than two triangles: they stay.
    is_fixed: Vec<bool>,
    originals: Vec<DVec3>,
    /// Original vertices nearest to each triangle.
    carried: Vec<Vec<u32>>,
    heap: BinaryHeap<Wish>,
    tolerance: f64,
    tab: Tab<'p>,
}

impl<'p> Mesh<'p> {
    pub(super) fn new(
        positions: &[DVec3],
        triangles: &[[u32; 3]],
        tolerance: f64,
        purse: Purse<'p>,
    ) -> Self {
        let n = positions.len();
        let mut mesh = Self {
            positions: positions.to_vec(),
            triangles: triangles.to_vec(),
            is_alive: vec![true; triangles.len()],
            fans: vec![Vec::new(); n],
            quadrics: vec![Quadric::ZERO; n],
            versions: vec![0; n],
            is_fixed: vec![false; n],
            originals: positions.to_vec(),
            carried: vec![Vec::new(); triangles.len()],
            heap: BinaryHeap::new(),
            tolerance,
            tab: purse.into(),
        };
        for (t, corners) in (0..).zip(triangles) {
            let quadric = Quadric::of_triangle(corners.map(|i| positions[i as usize]));
            for &v in corners {
                mesh.fans[v as usize].push(t);
                mesh.quadrics[v as usize] = mesh.quadrics[v as usize].plus(&quadric);
            }
        }
        for v in 0..n as u32 {
            if !mesh.tab.spend(WORK) {
                return mesh;
            }
            if let Some(&first) = mesh.fans[v as usize].first() {
                mesh.carried[first as usize].push(v);
            }
            let is_pair = |w: &u32| mesh.shared(v, *w).count() == 2;
            let is_fixed = !mesh.neighbors(v).iter().all(is_pair) || !mesh.is_one_fan(v);
            mesh.is_fixed[v as usize] = is_fixed;
        }
        for v in 0..n as u32 {
            if !mesh.tab.spend(WORK) {
                return mesh;
            }
            mesh.wish_around(v, |v, w| v < w);
        }
        mesh
    }

    fn corners(&self, t: u32) -> [DVec3; 3] {
        self.triangles[t as usize].map(|i| self.positions[i as usize])
    }

    /// Returns the triangles at both vertices.
    fn shared(&self, v: u32, w: u32) -> impl Iterator<Item = u32> + '_ {
        let fan = self.fans[v as usize].iter().copied();
        fan.filter(move |&t| self.triangles[t as usize].contains(&w))
    }

    /// Returns the vertices that share an edge with one, ascending.
    fn neighbors(&self, v: u32) -> Vec<u32> {
        let fan = self.fans[v as usize].iter();
        let all = fan.flat_map(|&t| self.triangles[t as usize]);
        let mut found: Vec<u32> = all.filter(|&w| w != v).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Returns `true` if the triangles around a vertex form one disk.
    fn is_one_fan(&self, v: u32) -> bool {
        let fan = &self.fans[v as usize];
        let Some(&first) = fan.first() else {
            return false;
        };
        let next = |t: u32| {
            let c = self.triangles[t as usize];
            let i = c.iter().position(|&w| w == v).unwrap_or(0);
            let w = c[(i + 2) % 3];
            let follows = |&&u: &&u32| {
                let d = self.triangles[u as usize];
                (0..3).any(|k| d[k] == v && d[(k + 1) % 3] == w)
            };
            fan.iter().find(follows).copied()
        };
        let (mut at, mut n) = (first, 0);
        while let Some(t) = next(at) {
            n += 1;
            if t == first || n > fan.len() {
                break;
            }
            at = t;
        }
        n == fan.len()
    }

    fn wish_around(&mut self, v: u32, wants: impl Fn(u32, u32) -> bool) {
        for w in self.neighbors(v) {
            if wants(v, w) {
                let edge = [v.min(w), v.max(w)];
                let (_, cost) = self.target(edge);
                let versions = edge.map(|i| self.versions[i as usize]);
                // Costs are not negative, so their bits are in order.
                self.heap.push(Reverse((cost.to_bits(), edge, versions)));
            }
        }
    }

    /// Returns where the vertex of a collapsed edge goes, and the cost.
    fn target(&self, [v, w]: [u32; 2]) -> (DVec3, f64) {
        let [p, q] = [v, w].map(|i| self.positions[i as usize]);
        let quadric = self.quadrics[v as usize].plus(&self.quadrics[w as usize]);
        let length = p.distance_squared(q);
        // Among equals, short edges first: even triangles.
        let cost = |x: DVec3| quadric.at(x) + 1e-9 * length * length;
        let fixed = [v, w].map(|i| self.is_fixed[i as usize]);
        match fixed {
            [true, _] => (p, cost(p)),
            [_, true] => (q, cost(q)),
            _ => {
                let best = quadric.least((p + q) * 0.5);
                let is_near = best.distance_squared((p + q) * 0.5) <= length;
                let at = if is_near {
                    best
                } else if quadric.at(p) <= quadric.at(q) {
                    p
                } else {
                    q
                };
                (at, cost(at))
            }
        }
    }

    pub(super) fn collapse_all(&mut self) {
        while let Some(Reverse((_, edge, versions))) = self.heap.pop() {
            if !self.tab.spend(1) {
                return;
            }
            if edge.map(|i| self.versions[i as usize]) == versions {
                self.try_collapse(edge);
            }
        }
    }

    fn try_collapse(&mut self, edge: [u32; 2]) {
        let [v, w] = edge;
        if edge.iter().all(|&i| self.is_fixed[i as usize]) {
            return;
        }
        // The link condition: the surface keeps its shape.
        let (around_v, around_w) = (self.neighbors(v), self.neighbors(w));
        let n_common = around_v
            .iter()
            .filter(|x| around_w.binary_search(x).is_ok())
            .count();
        let gone: Vec<u32> = self.shared(v, w).collect();
        let n_left = self.fans[v as usize].len() + self.fans[w as usize].len();
        if n_common != 2 || gone.len() != 2 || !(7..=MAX_FAN + 4).contains(&n_left) {
            return;
        }
        let (best, _) = self.target(edge);
        if self.is_allowed(edge, best, &gone) {
            return;
        }
        // Where the best place is too far from a vertex, an end may do.
        for (i, other) in [(v, w), (w, v)] {
            if !self.is_fixed[other as usize]
                && self.is_allowed(edge, self.positions[i as usize], &gone)
            {
                return;
            }
        }
    }

    /// Collapses an edge to a point, unless that folds the surface or leaves a vertex too far.
    fn is_allowed(&mut self, [v, w]: [u32; 2], at: DVec3, gone: &[u32]) -> bool {
        let around = self.fans[v as usize].iter().chain(&self.fans[w as usize]);
        let stay: Vec<u32> = around.copied().filter(|t| !gone.contains(t)).collect();
        let mut moved: Vec<[DVec3; 3]> = Vec::with_capacity(stay.len());
        for &t in &stay {
            let before = self.corners(t);
            let corners = self.triangles[t as usize];
            let after = [0, 1, 2].map(|i| {
                if corners[i] == v || corners[i] == w {
                    at
                } else {
                    before[i]
                }
            });
            if !is_sound(before, after, self.tolerance * MAX_EDGE) {
                return false;
            }
            moved.push(after);
        }
        let of_each = stay.iter().chain(gone);
        let n_carried: usize = of_each.map(|&t| self.carried[t as usize].len()).sum();
        let n_distances = n_carried * moved.len();
        if !self.tab.spend(WORK + (n_distances / DISTANCES) as u64) {
            return false;
        }
        let near = self.tolerance * self.tolerance;
        let mut assigned: Vec<Vec<u32>> = vec![Vec::new(); stay.len()];
        for (own, &t) in stay.iter().chain(gone).enumerate() {
            for &o in &self.carried[t as usize] {
                let p = self.originals[o as usize];
                // Mostly the triangle that had it before is near enough.
                if let Some(corners) = moved.get(own) {
                    let d = closest_point_on_triangle(p, corners).distance_squared(p);
                    if d <= near * 0.25 {
                        assigned[own].push(o);
                        continue;
                    }
                }
                let mut best = (f64::INFINITY, 0);
                for (i, corners) in moved.iter().enumerate() {
                    let d = closest_point_on_triangle(p, corners).distance_squared(p);
                    if d < best.0 {
                        best = (d, i);
                    }
                }
                if best.0 > near {
                    return false;
                }
                assigned[best.1].push(o);
            }
        }
        self.make([v, w], at, gone, &stay, assigned);
        true
    }

    fn make(
        &mut self,
        [v, w]: [u32; 2],
        at: DVec3,
        gone: &[u32],
        stay: &[u32],
        assigned: Vec<Vec<u32>>,
    ) {
        for (&t, originals) in stay.iter().zip(assigned) {
            for i in &mut self.triangles[t as usize] {
                if *i == w {
                    *i = v;
                }
            }
            self.carried[t as usize] = originals;
        }
        for &t in gone {
            self.is_alive[t as usize] = false;
            self.carried[t as usize] = Vec::new();
            for i in self.triangles[t as usize] {
                self.fans[i as usize].retain(|&u| u != t);
            }
        }
        self.fans[v as usize] = stay.to_vec();
        self.fans[w as usize] = Vec::new();
        self.positions[v as usize] = at;
        self.is_fixed[v as usize] |= self.is_fixed[w as usize];
        self.quadrics[v as usize] = self.quadrics[v as usize].plus(&self.quadrics[w as usize]);
        self.versions[v as usize] += 1;
        self.versions[w as usize] += 1;
        self.wish_around(v, |_, _| true);
    }

    /// Returns the vertices in use, the triangles left, and the largest distance of an original vertex from its triangle.
    pub(super) fn finish(self) -> (Vec<DVec3>, Vec<[u32; 3]>, f64) {
        let mut farthest: f64 = 0.0;
        let mut number = vec![u32::MAX; self.positions.len()];
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (t, corners) in self
            .triangles
            .iter()
            .enumerate()
            .filter(|(t, _)| self.is_alive[*t])
        {
            let at = corners.map(|i| self.positions[i as usize]);
            for &o in &self.carried[t] {
                let p = self.originals[o as usize];
                farthest = farthest.max(closest_point_on_triangle(p, &at).distance(p));
            }
            triangles.push(corners.map(|i| {
                let n = &mut number[i as usize];
                if *n == u32::MAX {
                    *n = positions.len() as u32;
                    positions.push(self.positions[i as usize]);
                }
                *n
            }));
        }
        (positions, triangles, farthest)
    }
}

/// Returns `true` if a triangle neither turns over nor degenerates, nor becomes longer than some length.
fn is_sound(before: [DVec3; 3], after: [DVec3; 3], most: f64) -> bool {
    let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
    let (n, m) = (normal(before), normal(after));
    let edges = [0, 1, 2].map(|i| after[i].distance_squared(after[(i + 1) % 3]));
    let longest = edges.into_iter().fold(0.0, f64::max);
    if m.length() < LEAST_HEIGHT * longest || longest > most * most {
        return false;
    }
    // A sliver of rounding has no direction to keep.
    n.length() <= 1e-9 * longest || n.dot(m) >= LEAST_TURN * n.length() * m.length()
}
