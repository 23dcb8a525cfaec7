//! The structural triangles as one surface: vertices with attributes over shared points.

use std::cmp::Ordering;
use std::collections::HashMap;

use enfilade_geom::scene::{Mesh, Primitive, Role, Scene};
use enfilade_geom::{DMat3, DMat4, DVec3, triangle_area_normal};

/// The vertices of one primitive of one object, in world space.
pub(super) struct Part {
    pub(super) object: u32,
    /// Attributes of each vertex, with the points as positions and without indices.
    pub(super) vertices: Primitive,
    /// Point of each vertex.
    pub(super) points: Vec<u32>,
}

/// A triangle.
#[derive(Clone, Copy)]
pub(super) struct Face {
    /// Index into [`Surface::parts`].
    pub(super) part: u32,
    /// Indices into the part's vertices.
    pub(super) corners: [u32; 3],
}

/// One triangle's use of an edge.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Use {
    /// Points, the lesser first.
    pub(super) ends: [u32; 2],
    pub(super) object: u32,
    pub(super) face: u32,
    /// Traversed from the greater end to the lesser.
    pub(super) is_reverse: bool,
}

/// All structural triangles of a scene.
pub(super) struct Surface {
    /// Distinct positions, each a triple of `f32`. [Units: wu]
    pub(super) points: Vec<DVec3>,
    pub(super) parts: Vec<Part>,
    pub(super) faces: Vec<Face>,
    /// Objects with any change.
    pub(super) is_changed: Vec<bool>,
}

impl Surface {
    /// Collects the structural triangles of a scene. Linear in vertices and triangles.
    pub(super) fn of_scene(scene: &Scene) -> Self {
        let mut surface = Self {
            points: Vec::new(),
            parts: Vec::new(),
            faces: Vec::new(),
            is_changed: vec![false; scene.objects.len()],
        };
        let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
        for (o, object) in scene.objects.iter().enumerate() {
            if object.role != Role::Structural {
                continue;
            }
            for primitive in &scene.meshes[object.mesh as usize].primitives {
                let vertices = placed(primitive, &object.transform);
                let mut point = |p: &[f32; 3]| {
                    // Turns -0 into 0.
                    let key = p.map(|c| (c + 0.0).to_bits());
                    *numbers.entry(key).or_insert_with(|| {
                        surface.points.push(DVec3::from_array(p.map(f64::from)));
                        surface.points.len() as u32 - 1
                    })
                };
                let points = vertices.positions.iter().map(&mut point).collect();
                let part = surface.parts.len() as u32;
                let faces = primitive.triples().iter();
                surface
                    .faces
                    .extend(faces.map(|&corners| Face { part, corners }));
                surface.parts.push(Part {
                    object: o as u32,
                    vertices,
                    points,
                });
            }
        }
        surface.number_by_place();
        surface
    }

    /// Numbers the points by position, so that no choice between equals depends on the order of the input.
    fn number_by_place(&mut self) {
        let mut order: Vec<u32> = (0..self.points.len() as u32).collect();
        let place = |p: u32| self.points[p as usize].to_array();
        order.sort_unstable_by(|&p, &q| {
            let (a, b) = (place(p), place(q));
            let unequal = (0..3).map(|k| a[k].total_cmp(&b[k])).find(|o| o.is_ne());
            unequal.unwrap_or(Ordering::Equal)
        });
        let mut new = vec![0; order.len()];
        for (i, &p) in order.iter().enumerate() {
            new[p as usize] = i as u32;
        }
        self.points = order.iter().map(|&p| self.points[p as usize]).collect();
        let points = self.parts.iter_mut().flat_map(|part| &mut part.points);
        points.for_each(|p| *p = new[*p as usize]);
    }

    /// Puts the triangles back: changed objects get a mesh of their own in world space, others stay unchanged, shared
    /// meshes included. Objects without triangles are removed.
    pub(super) fn into_scene(self, scene: &mut Scene) {
        let mut faces_of: Vec<Vec<[u32; 3]>> = vec![Vec::new(); self.parts.len()];
        for face in &self.faces {
            faces_of[face.part as usize].push(face.corners);
        }
        let mut made: Vec<Vec<Primitive>> = vec![Vec::new(); scene.objects.len()];
        for (part, faces) in self.parts.iter().zip(&faces_of) {
            if self.is_changed[part.object as usize] && !faces.is_empty() {
                made[part.object as usize].push(compacted(part, faces, &self.points));
            }
        }
        let mut place = vec![None; scene.objects.len()];
        let mut n_kept = 0;
        for (o, primitives) in made.into_iter().enumerate() {
            if self.is_changed[o] {
                if primitives.is_empty() {
                    continue;
                }
                let name = scene.meshes[scene.objects[o].mesh as usize].name.clone();
                scene.objects[o].mesh = scene.meshes.len() as u32;
                scene.objects[o].transform = DMat4::IDENTITY;
                scene.meshes.push(Mesh { name, primitives });
            }
            place[o] = Some(n_kept);
            n_kept += 1;
        }
        let mut index = 0;
        scene.objects.retain(|_| {
            index += 1;
            place[index - 1].is_some()
        });
        for entity in &mut scene.entities {
            entity.object = entity.object.and_then(|o| place[o as usize]);
        }
        drop_unplaced(scene);
    }

    pub(super) fn object(&self, face: usize) -> u32 {
        self.parts[self.faces[face].part as usize].object
    }

    /// Returns the points of a face.
    pub(super) fn ends(&self, face: usize) -> [u32; 3] {
        let Face { part, corners } = self.faces[face];
        corners.map(|c| self.parts[part as usize].points[c as usize])
    }

    /// Returns the positions of the vertices of a face.
    pub(super) fn corners(&self, face: usize) -> [DVec3; 3] {
        self.ends(face).map(|p| self.points[p as usize])
    }

    pub(super) fn change(&mut self, face: usize) {
        let object = self.object(face);
        self.is_changed[object as usize] = true;
    }

    /// Keeps the faces that are not marked, and returns the number removed.
    pub(super) fn remove(&mut self, is_gone: &[bool]) -> u64 {
        for (face, _) in is_gone.iter().enumerate().filter(|(_, gone)| **gone) {
            self.change(face);
        }
        let before = self.faces.len();
        let mut face = 0;
        self.faces.retain(|_| {
            face += 1;
            !is_gone[face - 1]
        });
        (before - self.faces.len()) as u64
    }

    /// Returns every use of an edge, sorted by edge and then by object. `n log n`.
    pub(super) fn uses(&self) -> Vec<Use> {
        let mut uses = Vec::with_capacity(3 * self.faces.len());
        for face in 0..self.faces.len() {
            let ends = self.ends(face);
            for k in 0..3 {
                let (a, b) = (ends[k], ends[(k + 1) % 3]);
                uses.push(Use {
                    ends: [a.min(b), a.max(b)],
                    object: self.object(face),
                    face: face as u32,
                    is_reverse: a > b,
                });
            }
        }
        uses.sort_unstable();
        uses
    }

    /// Adds a vertex at `point` with the interpolated attributes of two of its part: `share` is the weight of the
    /// second.
    pub(super) fn mix(&mut self, part: u32, [a, b]: [u32; 2], share: f64, point: u32) -> u32 {
        let part = &mut self.parts[part as usize];
        let (a, b, t) = (a as usize, b as usize, share as f32);
        let v = &mut part.vertices;
        v.positions
            .push(self.points[point as usize].as_vec3().to_array());
        mix_last(&mut v.normals, a, b, t);
        mix_last(&mut v.tangents, a, b, t);
        mix_last(&mut v.colors, a, b, t);
        v.uvs.iter_mut().for_each(|set| mix_last(set, a, b, t));
        if let Some(n) = v.normals.last_mut() {
            *n = unit(DVec3::from_array(n.map(f64::from)));
        }
        if let Some(x) = v.tangents.last_mut() {
            let side = if x[3] < 0.0 { -1.0 } else { 1.0 };
            let [p, q, r] = unit(DVec3::new(x[0].into(), x[1].into(), x[2].into()));
            *x = [p, q, r, side];
        }
        part.points.push(point);
        part.points.len() as u32 - 1
    }

    /// Returns the height of a face over its longest edge, and the vertex opposite that edge. [Units: wu]
    pub(super) fn height(&self, face: usize) -> (f64, usize) {
        let corners = self.corners(face);
        let length = |k: usize| corners[(k + 1) % 3].distance(corners[(k + 2) % 3]);
        let apex = (0..3).fold(0, |best, k| if length(k) > length(best) { k } else { best });
        let area = triangle_area_normal(&corners).length();
        (area / length(apex).max(f64::MIN_POSITIVE), apex)
    }
}

/// Returns the first use of each open edge: one of an odd number of triangles, over all objects.
///
/// Open edges are the boundary of all triangles as a chain modulo 2. So an even number of them meets in each point,
/// and they form closed loops.
pub(super) fn open_of(uses: &[Use]) -> Vec<Use> {
    uses.chunk_by(|a, b| a.ends == b.ends)
        .filter(|edge| edge.len() % 2 == 1 && edge[0].ends[0] != edge[0].ends[1])
        .map(|edge| edge[0])
        .collect()
}

fn mix_last<const N: usize>(values: &mut Vec<[f32; N]>, a: usize, b: usize, t: f32) {
    if !values.is_empty() {
        let (x, y) = (values[a], values[b]);
        values.push(std::array::from_fn(|k| x[k] + (y[k] - x[k]) * t));
    }
}

/// Returns a direction rounded to `f32`; +X for a zero vector.
pub(super) fn unit(v: DVec3) -> [f32; 3] {
    v.try_normalize().unwrap_or(DVec3::X).as_vec3().to_array()
}

/// Returns a primitive's vertices in world space, with positions rounded as in [`Scene::world_triangle`].
fn placed(primitive: &Primitive, transform: &DMat4) -> Primitive {
    let linear = DMat3::from_mat4(*transform);
    // A flattened object has no inverse; any normals do.
    let for_normals = if linear.determinant() == 0.0 {
        linear
    } else {
        linear.inverse().transpose()
    };
    let mut vertices = Primitive {
        indices: Vec::new(),
        ..primitive.clone()
    };
    for p in &mut vertices.positions {
        let local = DVec3::from_array(p.map(f64::from));
        *p = transform.transform_point3(local).as_vec3().to_array();
    }
    if *transform == DMat4::IDENTITY {
        return vertices;
    }
    for n in &mut vertices.normals {
        *n = unit(for_normals * DVec3::from_array(n.map(f64::from)));
    }
    for t in &mut vertices.tangents {
        let [x, y, z] = unit(linear * DVec3::new(t[0].into(), t[1].into(), t[2].into()));
        *t = [x, y, z, t[3]];
    }
    vertices
}

/// Returns the vertices that faces use, at their points.
fn compacted(part: &Part, faces: &[[u32; 3]], points: &[DVec3]) -> Primitive {
    let mut new = vec![u32::MAX; part.points.len()];
    let mut kept: Vec<usize> = Vec::new();
    let mut indices = Vec::with_capacity(3 * faces.len());
    for &corner in faces.iter().flatten() {
        let slot = &mut new[corner as usize];
        if *slot == u32::MAX {
            *slot = kept.len() as u32;
            kept.push(corner as usize);
        }
        indices.push(*slot);
    }
    fn pick<T: Copy>(values: &[T], kept: &[usize]) -> Vec<T> {
        if values.is_empty() {
            return Vec::new();
        }
        kept.iter().map(|&i| values[i]).collect()
    }
    let v = &part.vertices;
    let position = |&i: &usize| points[part.points[i] as usize].as_vec3().to_array();
    Primitive {
        positions: kept.iter().map(position).collect(),
        normals: pick(&v.normals, &kept),
        tangents: pick(&v.tangents, &kept),
        uvs: v.uvs.iter().map(|set| pick(set, &kept)).collect(),
        colors: pick(&v.colors, &kept),
        indices,
        material: v.material,
    }
}

/// Drops unplaced meshes.
fn drop_unplaced(scene: &mut Scene) {
    let mut new = vec![u32::MAX; scene.meshes.len()];
    let mut kept = Vec::new();
    for object in &mut scene.objects {
        let slot = &mut new[object.mesh as usize];
        if *slot == u32::MAX {
            *slot = kept.len() as u32;
            kept.push(std::mem::take(&mut scene.meshes[object.mesh as usize]));
        }
        object.mesh = *slot;
    }
    scene.meshes = kept;
}
