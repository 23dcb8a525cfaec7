//! Hand-made files and scenes, independent of the code under test.
#![allow(dead_code, unused_imports, reason = "each test file uses its own part")]

use enfilade_geom::DMat4;
use enfilade_geom::scene::{Material, Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{DVec3, Triangle};

pub(crate) use enfilade_testkit::glb;

pub(crate) fn f32_bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Binary chunk of [`triangle_json`]: one triangle in the plane z = 0, then indices 0 1 2.
pub(crate) fn triangle_bin() -> Vec<u8> {
    let mut bin = f32_bytes(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 3.0, 0.0]);
    bin.extend([0u8, 0, 1, 0, 2, 0, 0, 0]);
    bin
}

/// A document with the mesh of [`triangle_bin`], and the given members besides.
pub(crate) fn triangle_json(members: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},{members},
        "meshes":[{{"name":"m","primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[
          {{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
            "min":[0,0,0],"max":[4,3,0]}},
          {{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},
          {{"buffer":0,"byteOffset":36,"byteLength":6}}],
        "buffers":[{{"byteLength":44}}]}}"#
    )
}

/// World triangles of all roles, in order.
pub(crate) fn world(scene: &Scene) -> Vec<Triangle> {
    [Role::Structural, Role::Detail]
        .into_iter()
        .flat_map(|role| scene.triangle_sources(role))
        .map(|source| scene.world_triangle(source))
        .collect()
}

/// Triangles in canonical order, each starting at its least vertex.
pub(crate) fn sorted(triangles: impl IntoIterator<Item = Triangle>) -> Vec<Triangle> {
    let by = |a: &Triangle, b: &Triangle| {
        let numbers = |t: &Triangle| t.map(|p| p.to_array());
        numbers(a).partial_cmp(&numbers(b)).expect("finite corners")
    };
    let starts = |[a, b, c]: Triangle| [[a, b, c], [b, c, a], [c, a, b]];
    let mut out: Vec<Triangle> = (triangles.into_iter())
        .filter_map(|t| starts(t).into_iter().min_by(by))
        .collect();
    out.sort_by(by);
    out
}

/// A closed box from 0 to `size`, front faces outwards, 8 vertices and 12 triangles.
pub(crate) fn box_primitive(size: [f32; 3]) -> Primitive {
    let corner = |i: usize| [0, 1, 2].map(|k| if i >> k & 1 == 1 { size[k] } else { 0.0 });
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    Primitive {
        positions: (0..8).map(corner).collect(),
        indices: quads
            .iter()
            .flat_map(|q| [q[0], q[1], q[2], q[0], q[2], q[3]])
            .collect(),
        ..Primitive::default()
    }
}

pub(crate) fn scene_of(primitive: Primitive, transforms: &[DMat4]) -> Scene {
    Scene {
        meshes: vec![Mesh {
            name: "mesh".into(),
            primitives: vec![primitive],
        }],
        objects: transforms
            .iter()
            .map(|&transform| Object {
                name: "thing".into(),
                mesh: 0,
                transform,
                role: Role::Structural,
                reason: String::new(),
                filling: None,
                node: None,
            })
            .collect(),
        ..Scene::default()
    }
}

pub(crate) fn material(name: &str, gltf: &str) -> Material {
    Material {
        name: name.into(),
        gltf: gltf.into(),
        ..Material::default()
    }
}

pub(crate) fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}
