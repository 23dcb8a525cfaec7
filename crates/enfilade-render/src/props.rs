//! Things that move through worlds as copies of simple meshes: people, balls, boxes.

use enfilade_geom::scene::Primitive;
use enfilade_geom::{Aabb, DVec3};
use enfilade_world::PartId;
use glam::{Quat, Vec3};

use crate::copies::PropCopy;
use crate::gpu::Gpu;
use crate::prop::PropMesh;
use crate::resources::Grown;
use crate::scene::{Corner, Finish, Instance, Span};

/// Copies of one mesh in one world: a range of the buffer of instances.
pub(crate) struct PropDraw {
    pub(crate) span: Span,
    pub(crate) instances: std::ops::Range<u32>,
}

/// The meshes of props on the adapter.
pub(crate) struct PropMeshes {
    corners: Vec<Corner>,
    indices: Vec<u32>,
    spans: Vec<Span>,
    /// For each mesh, the center and radius of a sphere around it.
    spheres: Vec<(DVec3, f64)>,
    vertex_buffer: Grown,
    index_buffer: Grown,
    /// Numbers of vertices and indices of whole meshes; cut ones, of the current frame, follow.
    n_whole: [usize; 2],
    instances: Grown,
    drawn: Vec<Instance>,
}

impl PropMeshes {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let mut corners = Vec::new();
        let mut indices = Vec::new();
        let meshes = [cuboid(), ball(), person()];
        let spans = (meshes.iter())
            .map(|mesh| add(mesh, &mut corners, &mut indices))
            .collect();
        let mut out = Self {
            n_whole: [corners.len(), indices.len()],
            corners,
            indices,
            spans,
            spheres: meshes.iter().map(sphere_around).collect(),
            vertex_buffer: Grown::new(gpu, wgpu::BufferUsages::VERTEX),
            index_buffer: Grown::new(gpu, wgpu::BufferUsages::INDEX),
            instances: Grown::new(gpu, wgpu::BufferUsages::VERTEX),
            drawn: Vec::new(),
        };
        out.upload(gpu);
        out
    }

    pub(crate) fn add(&mut self, gpu: &Gpu, mesh: &Primitive) -> PropMesh {
        self.drop_cut();
        let span = add(mesh, &mut self.corners, &mut self.indices);
        self.spans.push(span);
        self.spheres.push(sphere_around(mesh));
        self.n_whole = [self.corners.len(), self.indices.len()];
        self.upload(gpu);
        PropMesh(self.spans.len() as u32 - 1)
    }

    fn drop_cut(&mut self) {
        self.corners.truncate(self.n_whole[0]);
        self.indices.truncate(self.n_whole[1]);
    }

    fn upload(&mut self, gpu: &Gpu) {
        self.vertex_buffer
            .write(gpu, bytemuck::cast_slice(&self.corners));
        self.index_buffer
            .write(gpu, bytemuck::cast_slice(&self.indices));
    }

    /// Returns the center and radius of a sphere around a mesh; of nothing for one that does not exist.
    pub(crate) fn sphere(&self, mesh: PropMesh) -> (DVec3, f64) {
        let own = self.spheres.get(mesh.0 as usize);
        own.copied().unwrap_or((DVec3::ZERO, 0.0))
    }

    /// Writes the instances of copies of props; returns their draws for each of `parts`. Copies in other parts are left out.
    pub(crate) fn write(
        &mut self,
        gpu: &Gpu,
        copies: &[PropCopy],
        parts: impl Iterator<Item = PartId>,
    ) -> Vec<Vec<PropDraw>> {
        self.drawn.clear();
        self.drop_cut();
        let mut out = Vec::new();
        for part in parts {
            let mut draws = Vec::new();
            let its = || copies.iter().filter(|c| c.prop.part == part);
            for (number, &span) in (0..).map(PropMesh).zip(&self.spans) {
                let first = self.drawn.len() as u32;
                let whole = its().filter(|c| c.prop.mesh == number && c.cuts.is_empty());
                self.drawn.extend(whole.map(PropCopy::instance));
                let instances = first..self.drawn.len() as u32;
                if !instances.is_empty() {
                    draws.push(PropDraw { span, instances });
                }
            }
            for copy in its().filter(|c| !c.cuts.is_empty()) {
                let Some(whole) = self.spans.get(copy.prop.mesh.0 as usize) else {
                    continue;
                };
                let first = self.indices.len() as u32;
                copy.cut(whole, &mut self.corners, &mut self.indices);
                let number = self.drawn.len() as u32;
                self.drawn.push(copy.instance());
                draws.push(PropDraw {
                    span: Span {
                        first,
                        n: self.indices.len() as u32 - first,
                        ..*whole
                    },
                    instances: number..number + 1,
                });
            }
            out.push(draws);
        }
        if self.indices.len() > self.n_whole[1] {
            self.upload(gpu);
        }
        if !self.drawn.is_empty() {
            self.instances.write(gpu, bytemuck::cast_slice(&self.drawn));
        }
        out
    }

    pub(crate) fn set_buffers(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_index_buffer(
            self.index_buffer.buffer.slice(..),
            wgpu::IndexFormat::Uint32,
        );
        pass.set_vertex_buffer(0, self.vertex_buffer.buffer.slice(..));
        pass.set_vertex_buffer(1, self.instances.buffer.slice(..));
    }
}

/// Appends a mesh to the contents of the buffers.
fn add(mesh: &Primitive, corners: &mut Vec<Corner>, indices: &mut Vec<u32>) -> Span {
    let (base, first) = (corners.len() as u32, indices.len() as u32);
    let is_smooth = mesh.normals.len() == mesh.positions.len();
    for (i, &position) in mesh.positions.iter().enumerate() {
        let normal = mesh.normals.get(i).copied().unwrap_or_default();
        corners.push(Corner::of_prop(position, normal));
    }
    let n = mesh.positions.len() as u32;
    let triangles = mesh.triples().iter();
    let sound = triangles.filter(|t| t.iter().all(|i| *i < n));
    indices.extend(sound.flatten().map(|i| base + i));
    Span {
        first,
        n: indices.len() as u32 - first,
        texture: 0,
        finish: Finish::Plain,
        is_smooth,
        is_transparent: false,
    }
}

/// Returns the center and radius of a sphere around a mesh.
fn sphere_around(mesh: &Primitive) -> (DVec3, f64) {
    let points = || mesh.positions.iter().map(|p| Vec3::from(*p).as_dvec3());
    let middle = Aabb::of_points(&points().collect::<Vec<_>>()).center();
    let middle = if middle.is_finite() {
        middle
    } else {
        DVec3::ZERO
    };
    let radius = points().map(|p| p.distance(middle)).fold(0.0, f64::max);
    (middle, radius)
}

/// Sides of a ring of the meshes below.
const SIDES: u32 = 20;

fn cuboid() -> Primitive {
    let mut mesh = Primitive::default();
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for side in [-0.5, 0.5] {
            let (u, v) = axis.any_orthonormal_pair();
            let base = mesh.positions.len() as u32;
            for [a, b] in [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]] {
                let p = axis * side + u * a + v * b;
                mesh.positions.push(p.to_array());
                mesh.normals.push((axis * side * 2.0).to_array());
            }
            (mesh.indices).extend([0, 1, 2, 0, 2, 3].map(|i| base + i));
        }
    }
    mesh
}

/// Adds a surface of revolution about +y: a closed line of radius and height, with normals in the same plane.
fn revolve(mesh: &mut Primitive, line: &[([f32; 2], [f32; 2])], stretch: Vec3, at: Vec3) {
    let base = mesh.positions.len() as u32;
    for ([r, y], [nr, ny]) in line {
        for i in 0..SIDES {
            let turn = Quat::from_rotation_y(i as f32 / SIDES as f32 * std::f32::consts::TAU);
            let p = turn * Vec3::new(*r, *y, 0.0) * stretch + at;
            let n = turn * Vec3::new(*nr, *ny, 0.0) / stretch;
            mesh.positions.push(p.to_array());
            mesh.normals.push(n.normalize_or_zero().to_array());
        }
    }
    for row in 1..line.len() as u32 {
        for i in 0..SIDES {
            let [a, b] = [i, (i + 1) % SIDES].map(|k| base + (row - 1) * SIDES + k);
            (mesh.indices).extend([a, b, b + SIDES, a, b + SIDES, a + SIDES]);
        }
    }
}

/// Returns the line of a capsule from `low` to `high`, with its normals.
fn capsule(radius: f32, low: f32, high: f32) -> Vec<([f32; 2], [f32; 2])> {
    const STEPS: u32 = 12;
    (0..=STEPS)
        .flat_map(|i| {
            let angle = (i as f32 / STEPS as f32 - 0.5) * std::f32::consts::PI;
            let (sin, cos) = angle.sin_cos();
            let at = |y: f32| ([radius * cos, y + radius * sin], [cos, sin]);
            // The middle of the turn is on both ends of the cylinder.
            let ends = [at(low + radius), at(high - radius)];
            match i.cmp(&(STEPS / 2)) {
                std::cmp::Ordering::Less => ends[..1].to_vec(),
                std::cmp::Ordering::Equal => ends.to_vec(),
                std::cmp::Ordering::Greater => ends[1..].to_vec(),
            }
        })
        .collect()
}

fn ball() -> Primitive {
    let mut mesh = Primitive::default();
    revolve(&mut mesh, &capsule(1.0, -1.0, 1.0), Vec3::ONE, Vec3::ZERO);
    mesh
}

fn person() -> Primitive {
    let mut mesh = Primitive::default();
    let mut limb = |radius: f32, [low, high]: [f32; 2], stretch: [f32; 3], at: [f32; 3]| {
        let line = capsule(radius, low, high);
        revolve(&mut mesh, &line, stretch.into(), at.into());
    };
    // Legs, trunk, arms, neck and head, and a nose that shows where it faces.
    for side in [-1.0, 1.0] {
        limb(0.085, [0.0, 0.92], [1.0, 1.0, 1.15], [0.1 * side, 0.0, 0.0]);
        limb(0.055, [0.72, 1.4], [1.0; 3], [0.225 * side, 0.0, 0.0]);
    }
    limb(0.2, [0.78, 1.46], [0.92, 1.0, 0.62], [0.0; 3]);
    limb(0.06, [1.36, 1.6], [1.0; 3], [0.0; 3]);
    limb(0.105, [1.51, 1.75], [0.9, 1.0, 1.05], [0.0; 3]);
    limb(0.02, [1.59, 1.65], [1.0; 3], [0.0, 0.0, -0.115]);
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_are_closed_and_their_normals_fit() {
        for (mesh, high) in [(cuboid(), 0.5), (ball(), 1.0), (person(), 1.75)] {
            let corner = |i: u32| Vec3::from(mesh.positions[i as usize]);
            let mut edges = std::collections::BTreeMap::new();
            for t in mesh.triples() {
                let [a, b, c] = t.map(corner);
                let face = (b - a).cross(c - a);
                for &i in t {
                    let n = Vec3::from(mesh.normals[i as usize]);
                    assert!((n.length() - 1.0).abs() < 1e-4);
                    // Triangles at a pole have no area.
                    let fits = face.dot(n).abs() >= face.length() * 0.5;
                    assert!(fits || face.length() < 1e-7, "{t:?}");
                }
                for k in 0..3 {
                    let key = |p: Vec3| (p * 1e4).round().as_ivec3().to_array();
                    let ends = [key(corner(t[k])), key(corner(t[(k + 1) % 3]))];
                    if ends[0] != ends[1] {
                        let (low, high) = (ends.iter().min(), ends.iter().max());
                        *edges.entry((low.copied(), high.copied())).or_insert(0) += 1;
                    }
                }
            }
            assert!(edges.values().all(|n| n % 2 == 0));
            let top = mesh.positions.iter().map(|p| p[1]).fold(0.0, f32::max);
            assert!((top - high).abs() < 1e-3, "{top}");
        }
    }
}
