//! The world file: what goes in comes out, equal worlds give equal bytes.

mod common;

use common::{floor, two_rooms};
use enfilade_cpg::wire::{WireError, decode_glb, encode_glb};
use enfilade_cpg::{CellId, World};
use enfilade_geom::DVec3;

/// Everything but materials and images, whose form changes on the first way through.
fn geometry(world: &World) -> String {
    format!(
        "{:#?} {:#?} {:#?} {:#?}",
        world.graph, world.batches, world.details, world.detail_meshes
    )
}

#[test]
fn a_world_comes_back_as_it_was() {
    let world = two_rooms();
    let bytes = encode_glb(&world).unwrap();
    let back = decode_glb(&bytes).unwrap();
    assert_eq!(geometry(&back), geometry(&world));
    assert_eq!(encode_glb(&back).unwrap(), bytes);
    assert_eq!(
        back.graph.locator.locate(DVec3::new(5.0, 1.0, 1.0)),
        Some(CellId(1))
    );
}

#[test]
fn materials_come_back_verbatim() {
    let world = two_rooms();
    let back = decode_glb(&encode_glb(&world).unwrap()).unwrap();
    assert_eq!(back.materials[0].gltf, world.materials[0].gltf);
    for (a, b) in back.materials.iter().zip(&world.materials) {
        assert_eq!(
            (&a.name, a.double_sided, a.transparent, a.base_color),
            (&b.name, b.double_sided, b.transparent, b.base_color)
        );
    }
    assert_eq!(back.textures[2].sampler, world.textures[2].sampler);
    assert_eq!(back.textures[1].sampler, "");
}

#[test]
fn an_empty_world_comes_back() {
    let bytes = encode_glb(&World::default()).unwrap();
    let back = decode_glb(&bytes).unwrap();
    assert_eq!(geometry(&back), geometry(&World::default()));
    assert_eq!(encode_glb(&back).unwrap(), bytes);
}

#[test]
fn a_world_that_breaks_an_invariant_is_not_written() {
    let mut world = two_rooms();
    world.batches[0].cells = vec![CellId(7)];
    assert!(matches!(encode_glb(&world), Err(WireError::Invalid(_))));
}

#[test]
fn a_batch_with_more_corners_than_u16_comes_back() {
    let mut world = two_rooms();
    let many = 65_536;
    let mut p = floor(0.0, 1.0);
    p.positions = (0..many).map(|i| [i as f32, 0.0, (i % 7) as f32]).collect();
    p.normals = vec![[0.0, 1.0, 0.0]; many];
    p.uvs.clear();
    p.indices = vec![0, 1, 65_535];
    world.batches[0].primitive = p;
    let back = decode_glb(&encode_glb(&world).unwrap()).unwrap();
    assert_eq!(geometry(&back), geometry(&world));
}
