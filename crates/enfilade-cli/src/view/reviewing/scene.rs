//! A scene as it is, as a world of one cell: to look at before anything is baked.

use std::collections::BTreeMap;
use std::sync::Arc;

use enfilade::cpg::{Batch, Cell, CellId, CellPortalGraph, Locator, World};
use enfilade::geom::scene::{Primitive, Scene};
use enfilade::geom::{Aabb, DMat3, DVec3};

/// Makes the world of a scene: all of its triangles, details included, in one cell without walls.
pub(crate) fn scene_world(scene: &Scene) -> World {
    let mut merged: BTreeMap<(Option<u32>, [usize; 3]), Primitive> = BTreeMap::new();
    let mut bounds = Aabb::EMPTY;
    for object in &scene.objects {
        let to_world = object.transform;
        let of_normals = DMat3::from_mat4(to_world).inverse().transpose();
        let is_mirrored = to_world.determinant() < 0.0;
        for primitive in &scene.meshes[object.mesh as usize].primitives {
            let attributes = [
                primitive.uvs.len(),
                usize::from(!primitive.normals.is_empty()),
                usize::from(!primitive.colors.is_empty()),
            ];
            let all = merged.entry((primitive.material, attributes)).or_default();
            all.material = primitive.material;
            let first = all.positions.len() as u32;
            for p in &primitive.positions {
                let p = to_world.transform_point3(vector(p));
                bounds = bounds.including(p);
                all.positions.push(p.as_vec3().to_array());
            }
            let normals = primitive.normals.iter();
            let normals = normals.map(|n| (of_normals * vector(n)).normalize_or(DVec3::Y));
            all.normals.extend(normals.map(|n| n.as_vec3().to_array()));
            all.uvs.resize(primitive.uvs.len(), Vec::new());
            for (all, own) in all.uvs.iter_mut().zip(&primitive.uvs) {
                all.extend(own);
            }
            all.colors.extend(&primitive.colors);
            for [a, b, c] in primitive.triples() {
                let triangle = if is_mirrored { [a, c, b] } else { [a, b, c] };
                all.indices.extend(triangle.map(|i| first + i));
            }
        }
    }
    let batch = |primitive| Batch {
        cells: vec![CellId(0)],
        primitive,
        ..Batch::default()
    };
    let cell = Cell {
        name: "scene".into(),
        aabb: [bounds.min, bounds.max].map(|p| p.as_vec3().to_array()),
        outdoor: true,
        ..Cell::default()
    };
    World {
        graph: CellPortalGraph {
            cells: vec![cell],
            locator: Arc::new(Locator {
                bounds,
                outside: Some(CellId(0)),
                root: Locator::leaf(Some(CellId(0))),
                ..Locator::default()
            }),
            ..CellPortalGraph::default()
        },
        batches: merged.into_values().map(batch).collect(),
        materials: scene.materials.clone(),
        textures: scene.textures.clone(),
        images: scene.images.clone(),
        ..World::default()
    }
}

fn vector(p: &[f32; 3]) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::geom::DMat4;
    use enfilade::geom::scene::{Mesh, Object, Role};
    use enfilade::world::Space;

    #[test]
    fn a_scene_is_shown_with_all_objects_where_they_are_and_mirrored_ones_the_right_way_round() {
        let corner = Primitive {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0]; 3],
            indices: vec![0, 1, 2],
            ..Primitive::default()
        };
        let object = |transform, role| Object {
            name: String::new(),
            mesh: 0,
            transform,
            role,
            reason: String::new(),
            filling: None,
            node: None,
        };
        let scene = Scene {
            meshes: vec![Mesh {
                primitives: vec![corner],
                ..Mesh::default()
            }],
            objects: vec![
                object(DMat4::from_translation(DVec3::X), Role::Structural),
                object(DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0)), Role::Detail),
            ],
            ..Scene::default()
        };
        let world = scene_world(&scene);
        let [batch] = &world.batches[..] else {
            panic!("{} batches", world.batches.len());
        };
        let triangles: Vec<_> = batch.primitive.triangles().collect();
        assert_eq!(triangles.len(), 2);
        assert_eq!(triangles[0][1], DVec3::new(2.0, 0.0, 0.0));
        for (triangle, normal) in triangles
            .iter()
            .zip([&batch.primitive.normals[0], &batch.primitive.normals[3]])
        {
            let [a, b, c] = triangle;
            assert!((*b - *a).cross(*c - *a).dot(vector(normal)) > 0.0);
        }
        assert!(Space::new(world).is_ok());
    }
}
