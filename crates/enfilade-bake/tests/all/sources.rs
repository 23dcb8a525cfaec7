//! Each triangle of a world records its source object, through all operations on the world.

use std::collections::BTreeMap;

use enfilade_bake::edit::add_portal;
use enfilade_bake::simplify::delete_portal;
use enfilade_bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_cpg::{PortalId, World};
use enfilade_geom::DVec3;
use enfilade_geom::scene::{Role, Scene, SourceNode};
use enfilade_testkit::furnished_house;

/// The house with its walls distributed over three objects, triangle by triangle, and one node per object.
fn scene() -> Scene {
    let mut scene = furnished_house().scene;
    let n = scene.objects.len();
    for i in (0..n)
        .filter(|&i| scene.objects[i].role == Role::Structural)
        .collect::<Vec<_>>()
    {
        let mesh = scene.meshes[scene.objects[i].mesh as usize].clone();
        for k in 0..3 {
            let mut part = mesh.clone();
            for p in &mut part.primitives {
                let triangles = p.indices.chunks_exact(3).enumerate();
                p.indices = triangles
                    .filter(|(t, _)| t % 3 == k)
                    .flat_map(|(_, t)| t.to_vec())
                    .collect();
            }
            scene.meshes.push(part);
            let mut object = scene.objects[i].clone();
            object.mesh = scene.meshes.len() as u32 - 1;
            if k == 0 {
                scene.objects[i] = object;
            } else {
                scene.objects.push(object);
            }
        }
    }
    for (i, object) in scene.objects.iter_mut().enumerate() {
        object.node = Some(i as u32);
        scene.nodes.push(SourceNode {
            name: format!("{} {i}", object.name),
            ..SourceNode::default()
        });
    }
    scene
}

type Bits = [[u32; 3]; 3];

/// Returns the triangles of each source, unordered.
fn by_source(world: &World) -> BTreeMap<u32, Vec<Bits>> {
    let mut found: BTreeMap<u32, Vec<Bits>> = BTreeMap::new();
    for batch in world.batches.iter().filter(|b| !b.is_seal) {
        let p = &batch.primitive;
        let mut sources = batch.sources.of_triangles();
        for t in p.indices.chunks_exact(3) {
            let corners = [0, 1, 2].map(|k| p.positions[t[k] as usize].map(f32::to_bits));
            let source = sources.next().expect("a source for each triangle");
            found.entry(source).or_default().push(corners);
        }
        assert_eq!(sources.next(), None);
    }
    found.values_mut().for_each(|t| t.sort_unstable());
    found
}

fn expected(scene: &Scene) -> BTreeMap<u32, Vec<Bits>> {
    let mut found: BTreeMap<u32, Vec<Bits>> = BTreeMap::new();
    for source in scene.triangle_sources(Role::Structural) {
        let corners = scene.world_triangle(source);
        let bits = corners.map(|p| p.as_vec3().to_array().map(f32::to_bits));
        found.entry(source.object).or_default().push(bits);
    }
    found.values_mut().for_each(|t| t.sort_unstable());
    found
}

#[test]
fn each_triangle_and_detail_knows_its_object_after_bake_file_merge_and_edit() {
    let scene = scene();
    let expected = expected(&scene);
    assert!(expected.len() >= 3);
    let context = BakeContext::new(&Silent, None);
    let world = bake(&scene, &BakeConfig::default(), &context)
        .unwrap()
        .world;
    assert!(by_source(&world) == expected);
    for detail in &world.details {
        let source = detail.source.expect("a detail's source");
        assert!(
            world.sources[source as usize]
                .name
                .starts_with(&detail.name)
        );
        assert_eq!(world.cells_of_source(source), detail.cells);
    }
    let read = decode_glb(&encode_glb(&world).unwrap()).unwrap();
    assert!(by_source(&read) == expected);
    let cells = read.graph.indoor_cells().map(|(id, _)| id);
    let seen: usize = cells.map(|c| read.sources_in(c).len()).sum();
    assert!(seen > expected.len());

    let merged = delete_portal(&world, PortalId(0)).unwrap().world;
    assert!(by_source(&merged) == expected);

    let (id, room) = world
        .graph
        .indoor_cells()
        .max_by(|a, b| a.1.volume.total_cmp(&b.1.volume))
        .expect("a room");
    let [low, high] = room.aabb.map(|p| DVec3::from(p.map(f64::from)));
    let middle = (low + high) / 2.0;
    let (across, along) = if high.x - low.x > high.z - low.z {
        (DVec3::Z * (high.z - low.z), DVec3::X)
    } else {
        (DVec3::X * (high.x - low.x), DVec3::Z)
    };
    let up = DVec3::Y * (high.y - low.y);
    let corner = middle - across / 2.0 - up / 2.0 + along * 0.1;
    let corners = [corner, corner + across, corner + across + up, corner + up];
    let divided = add_portal(&world, &corners).expect("a room cut near its middle");
    assert_eq!(divided.cell, id);
    assert!(by_source(&divided.world) == expected);
    assert!(divided.world.validate().is_ok());
}
