//! The beginning of a walk: the order of pieces, and the first picture.

use enfilade_cpg::World;
use enfilade_cpg::wire::encode_glb;
use enfilade_runtime::{Sight, SightState, Start};
use enfilade_stream::{PackError, PackedHead, PackedWorld, PieceId, first_picture};
use enfilade_testkit::{GridParams, room_grid};
use serde_json::Value;

fn world() -> World {
    room_grid(&GridParams {
        furniture: 4,
        outdoors: true,
        ..GridParams::offices(12, 3)
    })
}

fn start_of(world: &World) -> (Sight, Start) {
    let sight = Sight::build(world).unwrap();
    let start = Start::find(world, &sight, &SightState::as_modeled(&sight)).unwrap();
    (sight, start)
}

#[test]
fn pieces_of_the_room_in_which_a_walk_begins_lie_first_and_together() {
    let world = world();
    let head = PackedWorld::pack(&encode_glb(&world).unwrap())
        .unwrap()
        .head;
    let mut laid: Vec<PieceId> = (0..head.places.len() as u32).map(PieceId).collect();
    laid.sort_by_key(|piece| head.places[piece.idx()].offset);
    let (sight, start) = start_of(&world);
    let own = head.catalog.pieces_of(sight.locate(start.eye).unwrap());
    assert!(own.len() > 3);
    let mut first = laid[..own.len()].to_vec();
    first.sort();
    assert_eq!(first, own);
    // So they do not lie in the order of their numbers.
    assert!(!laid.is_sorted());
}

#[test]
fn heads_of_version_1_are_read_and_those_of_no_version_are_told() {
    let packed = PackedWorld::pack(&encode_glb(&world()).unwrap()).unwrap();
    let head = packed.head.encode().unwrap();
    let of_version = |version: u32| {
        let mut head = head.clone();
        head[8..12].copy_from_slice(&version.to_le_bytes());
        PackedHead::decode(&head)
    };
    for version in [1, 2] {
        assert_eq!(of_version(version).unwrap().places, packed.head.places);
    }
    for version in [0, 3] {
        let why = of_version(version).unwrap_err();
        assert!(
            matches!(why, PackError::Version(v) if v == version),
            "{why}"
        );
        assert!(why.to_string().contains("pack the world again"));
    }
}

/// Returns the JSON and the buffer of a GLB.
fn parts(glb: &[u8]) -> (Value, &[u8]) {
    let n = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    assert_eq!(
        glb.len(),
        u32::from_le_bytes(glb[8..12].try_into().unwrap()) as usize
    );
    (
        serde_json::from_slice(&glb[20..20 + n]).unwrap(),
        &glb[20 + n + 8..],
    )
}

#[test]
fn the_first_picture_has_what_is_seen_from_the_beginning_and_not_the_rest() {
    let world = world();
    let packed = first_picture(&world).unwrap().unwrap();
    assert_eq!(packed, first_picture(&world).unwrap().unwrap());
    let glb = zstd::bulk::decompress(&packed, 1 << 24).unwrap();
    let (json, bin) = parts(&glb);
    let (sight, start) = start_of(&world);
    let extras = &json["scenes"][0]["extras"];
    for k in 0..3 {
        assert!((extras["eye"][k].as_f64().unwrap() as f32 - start.eye[k]).abs() < 1e-4);
    }
    let count = |of: &Value| json["accessors"][of.as_u64().unwrap() as usize]["count"].clone();
    let primitives = json["meshes"][0]["primitives"].as_array().unwrap();
    let indices = primitives
        .iter()
        .map(|p| count(&p["indices"]).as_u64().unwrap());
    let n = indices.sum::<u64>() / 3;
    assert!(n > 100 && n < sight.n_triangles() / 2, "{n} triangles");
    // All vertices lie in the world, to the rounding of 16 bits.
    let [node, scale] = ["translation", "scale"].map(|name| json["nodes"][0][name].clone());
    let mut seen = 0;
    for primitive in primitives {
        let accessor =
            &json["accessors"][primitive["attributes"]["POSITION"].as_u64().unwrap() as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let first = view["byteOffset"].as_u64().unwrap() as usize;
        for i in 0..accessor["count"].as_u64().unwrap() as usize {
            let row = &bin[first + 8 * i..];
            let p = [0, 1, 2].map(|k| {
                let step = f64::from(u16::from_le_bytes([row[2 * k], row[2 * k + 1]]));
                node[k].as_f64().unwrap() + scale[k].as_f64().unwrap() * step
            });
            let near = |v: &[f32; 3]| (0..3).all(|k| (f64::from(v[k]) - p[k]).abs() < 2e-3);
            let walls = world.batches.iter().flat_map(|b| &b.primitive.positions);
            seen += usize::from(walls.clone().any(near));
        }
    }
    assert!(seen > 50, "{seen} vertices of walls");
}

#[test]
fn a_world_without_cells_has_no_first_picture() {
    assert!(first_picture(&World::default()).unwrap().is_none());
}
