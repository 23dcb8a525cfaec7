//! Slow, plain checks that share no code with the kernels under test.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use enfilade_cpg::{CellPortalGraph, CellSet, Pvs};
use enfilade_geom::ray::segment_to_triangle_distance;
use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{
    Aabb, DMat3, DQuat, DVec3, Plane, Triangle, Winding, closest_point_on_triangle,
    triangle_area_normal,
};

/// Returns the world triangles of all structural objects.
#[must_use]
pub fn structural_triangles(scene: &Scene) -> Vec<Triangle> {
    scene
        .triangle_sources(Role::Structural)
        .map(|s| scene.world_triangle(s))
        .collect()
}

/// Returns the world triangles of one object.
#[must_use]
pub fn object_triangles(scene: &Scene, object: usize) -> Vec<Triangle> {
    [Role::Structural, Role::Detail]
        .into_iter()
        .flat_map(|role| scene.triangle_sources(role))
        .filter(|s| s.object as usize == object)
        .map(|s| scene.world_triangle(s))
        .collect()
}

/// Returns the number of directed edges without an opposite edge; 0 for closed, well-oriented surfaces.
///
/// Vertices are equal if all bits are.
#[must_use]
pub fn n_open_edges(triangles: &[Triangle]) -> usize {
    balance(triangles)
        .values()
        .map(|n| n.unsigned_abs() as usize)
        .sum()
}

fn bits(p: DVec3) -> [u64; 3] {
    // Adding zero makes -0.0 and 0.0 one vertex.
    p.to_array().map(|x| (x + 0.0).to_bits())
}

fn balance(triangles: &[Triangle]) -> HashMap<[[u64; 3]; 2], i64> {
    let mut edges: HashMap<[[u64; 3]; 2], i64> = HashMap::new();
    for t in triangles {
        for i in 0..3 {
            let (a, b) = (bits(t[i]), bits(t[(i + 1) % 3]));
            let (key, one) = if a < b { ([a, b], 1) } else { ([b, a], -1) };
            *edges.entry(key).or_default() += one;
        }
    }
    edges
}

/// Returns the numbers of distinct vertices and of distinct undirected edges.
#[must_use]
pub fn n_corners_and_edges(triangles: &[Triangle]) -> (usize, usize) {
    let corners: std::collections::HashSet<_> =
        triangles.iter().flatten().map(|&p| bits(p)).collect();
    (corners.len(), balance(triangles).len())
}

/// Returns the volume enclosed by a closed surface with outward faces; negative if they face inwards.
#[must_use]
pub fn signed_volume(triangles: &[Triangle]) -> f64 {
    triangles
        .iter()
        .map(|t| t[0].dot(t[1].cross(t[2])))
        .sum::<f64>()
        / 6.0
}

/// Returns `true` if the closed segment meets any triangle, edges included. O(triangles).
#[must_use]
pub fn segment_is_blocked(triangles: &[Triangle], from: DVec3, to: DVec3) -> bool {
    first_hit(triangles, from, to).is_some()
}

/// Returns the fraction of the segment before its first hit, with the index of the triangle. O(triangles).
///
/// Möller and Trumbore 1997, in `f64`, widened by 1e-9 so that no segment slips through a seam between two
/// triangles.
#[must_use]
pub fn first_hit(triangles: &[Triangle], from: DVec3, to: DVec3) -> Option<(f64, usize)> {
    let along = to - from;
    let mut best: Option<(f64, usize)> = None;
    for (i, t) in triangles.iter().enumerate() {
        let (e1, e2) = (t[1] - t[0], t[2] - t[0]);
        let p = along.cross(e2);
        let det = e1.dot(p);
        if det == 0.0 {
            continue;
        }
        let s = from - t[0];
        let q = s.cross(e1);
        let (u, v, w) = (s.dot(p) / det, along.dot(q) / det, e2.dot(q) / det);
        let slack = -1e-9;
        let inside = u >= slack && v >= slack && u + v <= 1.0 - slack;
        if inside && (0.0..=1.0).contains(&w) && best.is_none_or(|(b, _)| w < b) {
            best = Some((w, i));
        }
    }
    best
}

/// Returns the number of times that outward-facing surfaces enclose `p`: positive in a solid, 0 in the open
/// air, -1 in a cave that is modelled by its inner surface alone. O(triangles).
///
/// Signed crossings along one ray, in a direction that is not parallel to any wall.
#[must_use]
pub fn winding_number(triangles: &[Triangle], p: DVec3) -> i32 {
    let along = DVec3::new(0.301_511_3, 0.904_534_1, 0.301_931_7);
    let mut winding = 0;
    for t in triangles {
        // Containment of the origin in the triangle's projection along the ray, with orientation.
        let [a, b, c] = t.map(|q| q - p);
        let [u, v, w] = [b.cross(c), c.cross(a), a.cross(b)].map(|n| n.dot(along));
        let front = u > 0.0 && v > 0.0 && w > 0.0;
        let back = u < 0.0 && v < 0.0 && w < 0.0;
        let ahead = a.dot(triangle_area_normal(t)) * (u + v + w) > 0.0;
        if ahead && (front || back) {
            winding += if front { 1 } else { -1 };
        }
    }
    winding
}

/// Air regions of a coarse voxel grid: voxels that no triangle touches, joined through faces.
///
/// Rasterization is conservative, so a region never leaks through a crack narrower than a voxel.
#[derive(Clone, Debug)]
pub struct FloodGrid {
    origin: DVec3,
    voxel: f64,
    n: [usize; 3],
    labels: Vec<u32>,
}

const SOLID: u32 = u32::MAX;
const UNSEEN: u32 = u32::MAX - 1;

impl FloodGrid {
    /// Floods the box `bounds` in voxels of edge `voxel`.
    #[must_use]
    pub fn new(triangles: &[Triangle], bounds: Aabb, voxel: f64) -> Self {
        let n = (bounds.size() / voxel)
            .ceil()
            .to_array()
            .map(|x| (x as usize).max(1));
        let mut grid = Self {
            origin: bounds.min,
            voxel,
            n,
            labels: vec![UNSEEN; n[0] * n[1] * n[2]],
        };
        for t in triangles {
            grid.mark(t);
        }
        let mut next = 0;
        for start in 0..grid.labels.len() {
            if grid.labels[start] == UNSEEN {
                grid.flood(start, next);
                next += 1;
            }
        }
        grid
    }

    fn mark(&mut self, t: &Triangle) {
        let bounds = Aabb::of_points(t);
        let low = ((bounds.min - self.origin) / self.voxel - 1e-6).floor();
        let high = ((bounds.max - self.origin) / self.voxel + 1e-6).floor();
        let span = [0, 1, 2].map(|a: usize| {
            low[a].max(0.0) as usize..((high[a] + 1.0).max(0.0) as usize).min(self.n[a])
        });
        for z in span[2].clone() {
            for y in span[1].clone() {
                for x in span[0].clone() {
                    let center =
                        self.origin + (DVec3::new(x as f64, y as f64, z as f64) + 0.5) * self.voxel;
                    if touches_cube(t, center, self.voxel * 0.5 + 1e-7) {
                        self.labels[(z * self.n[1] + y) * self.n[0] + x] = SOLID;
                    }
                }
            }
        }
    }

    fn flood(&mut self, start: usize, label: u32) {
        let [nx, ny, nz] = self.n;
        let mut stack = vec![start];
        self.labels[start] = label;
        while let Some(i) = stack.pop() {
            let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
            let neighbors = [
                (x > 0).then(|| i - 1),
                (x + 1 < nx).then_some(i + 1),
                (y > 0).then(|| i - nx),
                (y + 1 < ny).then_some(i + nx),
                (z > 0).then(|| i - nx * ny),
                (z + 1 < nz).then_some(i + nx * ny),
            ];
            for j in neighbors.into_iter().flatten() {
                if self.labels[j] == UNSEEN {
                    self.labels[j] = label;
                    stack.push(j);
                }
            }
        }
    }

    /// Returns the region of the voxel that contains `p`; `None` if a triangle touches it, or off the grid.
    #[must_use]
    pub fn region_at(&self, p: DVec3) -> Option<u32> {
        let c = ((p - self.origin) / self.voxel).floor();
        if (0..3).any(|a| c[a] < 0.0 || c[a] >= self.n[a] as f64) {
            return None;
        }
        let [x, y, z] = c.to_array().map(|x| x as usize);
        let label = self.labels[(z * self.n[1] + y) * self.n[0] + x];
        (label != SOLID).then_some(label)
    }
}

/// Returns `true` if a box, rotated by `turn` and then moved to `at`, meets a convex polygon: a part of it lies between
/// the box's sides.
#[must_use]
pub fn box_meets(half: DVec3, turn: DQuat, at: DVec3, polygon: &[DVec3]) -> bool {
    let mut left = Some(Winding::new(polygon.to_vec()));
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for side in [axis, -axis] {
            let plane = Plane::through(at + turn * (side * half), -(turn * side));
            left = left.and_then(|w| w.clipped(&plane, 0.0));
        }
    }
    left.is_some()
}

/// Returns `true` if a ball meets a convex polygon, by its triangles.
#[must_use]
pub fn ball_meets(radius: f64, center: DVec3, polygon: &[DVec3]) -> bool {
    (2..polygon.len()).any(|i| {
        let triangle = [polygon[0], polygon[i - 1], polygon[i]];
        center.distance(closest_point_on_triangle(center, &triangle)) <= radius
    })
}

/// Returns the distance of a triangle from a box, rotated by `turn` and then moved to `at`; 0 if they touch.
#[must_use]
pub fn box_to_triangle_distance(half: DVec3, turn: DQuat, at: DVec3, t: &Triangle) -> f64 {
    // In the box's own axes.
    let turn = DMat3::from_quat(turn).transpose();
    let t = t.map(|p| turn * (p - at));
    let own = Aabb::new(-half, half);
    if t.iter().any(|p| own.contains(*p)) {
        return 0.0;
    }
    let corners = own.corners();
    let mut least = f64::INFINITY;
    for i in 0..8 {
        for k in [1, 2, 4] {
            if i & k == 0 {
                let d = segment_to_triangle_distance(corners[i], corners[i | k], &t);
                least = least.min(d);
            }
        }
    }
    for face in own.triangles() {
        for i in 0..3 {
            least = least.min(segment_to_triangle_distance(t[i], t[(i + 1) % 3], &face));
        }
    }
    least
}

/// Returns `true` if a triangle meets a cube, so that none of the 13 candidate axes separates them.
fn touches_cube(t: &Triangle, center: DVec3, half: f64) -> bool {
    let c = t.map(|p| p - center);
    let separates = |axis: DVec3| {
        let d = c.map(|p| p.dot(axis));
        let reach = half * (axis.x.abs() + axis.y.abs() + axis.z.abs());
        d.iter().all(|&x| x > reach) || d.iter().all(|&x| x < -reach)
    };
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    if axes.into_iter().any(separates) || separates(triangle_area_normal(&c)) {
        return false;
    }
    let edges = [c[1] - c[0], c[2] - c[1], c[0] - c[2]];
    !edges
        .into_iter()
        .any(|e| axes.into_iter().any(|a| separates(a.cross(e))))
}

/// Returns the least lengths from a cell to all of `n_cells` after Dijkstra, given the cells and steps beside each; `None` where no way
/// leads.
pub fn least_lengths<I: IntoIterator<Item = (u32, u64)>>(
    n_cells: usize,
    from: u32,
    beside: impl Fn(u32) -> I,
) -> Vec<Option<u64>> {
    let mut lengths = vec![None; n_cells];
    let mut heap = BinaryHeap::from([Reverse((0, from))]);
    while let Some(Reverse((length, cell))) = heap.pop() {
        if lengths[cell as usize].is_none() {
            lengths[cell as usize] = Some(length);
            let beside = beside(cell).into_iter();
            heap.extend(beside.map(|(to, step)| Reverse((length + step, to))));
        }
    }
    lengths
}

/// Returns the cells behind up to two portals of each cell, as visible sets of worlds whose own would take long to find.
#[must_use]
pub fn near_sets(graph: &CellPortalGraph) -> Pvs {
    let row = |cell| {
        let mut set = CellSet::new(graph.cells.len());
        set.insert(cell);
        for exit in graph.exits(cell) {
            set.insert(exit.to);
            for next in graph.exits(exit.to) {
                set.insert(next.to);
            }
        }
        set
    };
    Pvs::of_rows(&graph.cell_ids().map(row).collect::<Vec<_>>())
}
