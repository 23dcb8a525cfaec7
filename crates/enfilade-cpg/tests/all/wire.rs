//! Encoding and decoding the world file preserve the world; equal worlds give equal bytes.

use std::sync::Arc;

use crate::common;

use common::{floor, nasty_rooms, room_facts, two_rooms};
use enfilade_cpg::wire::{EXTENSION, WireError, decode_glb, encode_glb};
use enfilade_cpg::{Batch, CellId, CellSet, Pvs, SourceRuns, World};
use enfilade_geom::scene::Primitive;
use enfilade_geom::{DMat4, DVec3};
use proptest::prelude::*;
use serde_json::Value;

/// Everything but materials and images, whose form changes in the first round trip.
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
    assert!(geometry(&back) == geometry(&world), "{}", geometry(&back));
    assert_eq!(encode_glb(&back).unwrap(), bytes);
    let runs = |w: &World| {
        w.batches
            .iter()
            .map(|b| b.sources.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(runs(&back), runs(&world));
    let of_details = |w: &World| {
        let details = w.details.iter();
        details.map(|d| (d.source, d.part_of)).collect::<Vec<_>>()
    };
    assert_eq!(of_details(&back), of_details(&world));
    assert_eq!(back.sources, world.sources);
    assert_eq!(back.fixtures, world.fixtures);
    assert_eq!(back.about, world.about);
    assert_eq!(
        back.graph.locator.locate(DVec3::new(5.0, 1.0, 1.0)),
        Some(CellId(1))
    );
}

#[test]
fn viewers_find_details_below_the_names_they_had_and_lights_once() {
    let root = json(&encode_glb(&two_rooms()).unwrap());
    let nodes = root["nodes"].as_array().unwrap();
    let below = |name: &str| -> Vec<&Value> {
        let node = nodes.iter().find(|n| n["name"] == name).unwrap();
        let children = node["children"].as_array().unwrap().iter();
        children
            .map(|c| &nodes[c.as_u64().unwrap() as usize])
            .collect()
    };
    assert_eq!(below("details").len(), 3);
    let storey = below("house")[0];
    assert_eq!(storey["extras"]["storey"], 0);
    let chair = &nodes[storey["children"][0].as_u64().unwrap() as usize];
    assert_eq!(
        (&chair["name"], &chair["extras"]),
        (&"chair".into(), &"oak".into())
    );
    let lights = &root["extensions"]["KHR_lights_punctual"]["lights"];
    assert_eq!(lights.as_array().unwrap().len(), 1);
    let used = root["extensionsUsed"].as_array().unwrap();
    assert!(used.contains(&"EXT_shutter".into()) && used.contains(&"KHR_lights_punctual".into()));
    let fixtures = below("fixtures");
    assert_eq!(fixtures.len(), 4);
    assert_eq!(fixtures[1]["camera"], 0);
    assert_eq!(fixtures[2]["extras"]["team"], 1);
}

#[test]
fn a_leak_path_comes_back_as_a_line_that_is_no_surface() {
    let mut world = two_rooms();
    let without = json(&encode_glb(&world).unwrap());
    world.leak_path = vec![[1.0, 1.5, 2.0], [4.0, 1.0, 2.5], [12.0, 1.0, 2.5]];
    let bytes = encode_glb(&world).unwrap();
    let back = decode_glb(&bytes).unwrap();
    assert_eq!(back.leak_path, world.leak_path);
    assert!(geometry(&back) == geometry(&world));
    assert_eq!(encode_glb(&back).unwrap(), bytes);
    // Any viewer finds it as a line of its own in the world.
    let root = json(&bytes);
    let nodes = root["nodes"].as_array().unwrap();
    let node = nodes
        .iter()
        .position(|n| n["name"] == "enfilade leak path")
        .unwrap();
    assert!(
        nodes[0]["children"]
            .as_array()
            .unwrap()
            .contains(&node.into())
    );
    let primitive =
        &root["meshes"][nodes[node]["mesh"].as_u64().unwrap() as usize]["primitives"][0];
    assert_eq!(primitive["mode"], 3);
    assert!(primitive.get("indices").is_none());
    let position = primitive["attributes"]["POSITION"].as_u64().unwrap() as usize;
    assert_eq!(root["accessors"][position]["count"], 3);
    // Without a leak path, the file does not mention it.
    assert!(!without.to_string().contains("leak"));
}

#[test]
fn facts_of_rooms_come_back_and_cost_nothing_where_there_are_none() {
    let mut world = two_rooms();
    let without = encode_glb(&world).unwrap();
    assert!(
        json(&without)["extensions"][EXTENSION]
            .get("rooms")
            .is_none()
    );
    world.room_facts = Some(room_facts(&world));
    let bytes = encode_glb(&world).unwrap();
    let read = decode_glb(&bytes).unwrap();
    assert_eq!(read.room_facts, world.room_facts);
    assert_eq!(encode_glb(&read).unwrap(), bytes);
    let plain = World {
        room_facts: None,
        ..read
    };
    assert_eq!(encode_glb(&plain).unwrap(), without);
}

#[test]
fn what_is_seen_from_each_cell_comes_back_and_costs_nothing_where_there_is_none() {
    let mut world = two_rooms();
    let without = encode_glb(&world).unwrap();
    let n = world.graph.cells.len();
    let mut rows: Vec<CellSet> = (0..n).map(|_| CellSet::new(n)).collect();
    for (c, row) in rows.iter_mut().enumerate() {
        row.insert(CellId(c as u32));
        row.insert(CellId(0));
    }
    world.pvs = Some(Pvs::of_rows(&rows));
    let bytes = encode_glb(&world).unwrap();
    let read = decode_glb(&bytes).unwrap();
    assert_eq!(read.pvs, world.pvs);
    assert!(json(&without)["extensions"][EXTENSION].get("pvs").is_none());
    // Everything else is unchanged.
    let plain = World { pvs: None, ..read };
    assert_eq!(encode_glb(&plain).unwrap(), without);
    // The set of another graph is not written.
    world.pvs = Some(Pvs::of_rows(&rows[1..]));
    assert!(matches!(encode_glb(&world), Err(WireError::Invalid(_))));
    let nothing = World {
        pvs: Some(Pvs::default()),
        ..World::default()
    };
    let read = decode_glb(&encode_glb(&nothing).unwrap()).unwrap();
    assert_eq!(read.pvs, nothing.pvs);
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
    let many = 70_000;
    let mut p = floor(0.0, 1.0);
    p.positions = (0..many).map(|i| [i as f32, 0.0, (i % 7) as f32]).collect();
    p.normals = vec![[0.0, 1.0, 0.0]; many];
    p.uvs.clear();
    p.material = None;
    p.indices = vec![0, 1, 69_999];
    world.batches[0].primitive = p;
    world.batches[0].sources = SourceRuns::from_runs(vec![[1, 1]]);
    let back = decode_glb(&encode_glb(&world).unwrap()).unwrap();
    assert!(geometry(&back) == geometry(&world));
}

/// World-space triangles of a detail object, with their normals.
fn drawn(world: &World, detail: usize) -> Vec<([DVec3; 3], Option<DVec3>)> {
    let detail = &world.details[detail];
    let m = DMat4::from_cols_array(&detail.transform.map(f64::from));
    let vec = |v: [f32; 3]| DVec3::from(v.map(f64::from));
    let mut all = Vec::new();
    for p in &world.detail_meshes[detail.mesh as usize].primitives {
        for t in p.indices.chunks_exact(3) {
            let corners = [0, 1, 2].map(|k| m.transform_point3(vec(p.positions[t[k] as usize])));
            // The textbook formula: the inverse transpose.
            let normal = p.normals.get(t[0] as usize).map(|&n| {
                m.inverse()
                    .transpose()
                    .transform_vector3(vec(n))
                    .normalize()
            });
            all.push((corners, normal));
        }
    }
    all
}

#[test]
fn what_gltf_forbids_is_mended_once() {
    let world = nasty_rooms();
    let bytes = encode_glb(&world).unwrap();
    let back = decode_glb(&bytes).unwrap();
    assert_eq!(encode_glb(&back).unwrap(), bytes);

    let (before, after) = (&world.batches[0].primitive, &back.batches[0].primitive);
    assert_eq!(after.positions, before.positions);
    assert!(
        after.normals.is_empty(),
        "a zero normal takes the others with it"
    );
    assert_eq!(after.uvs[0][1], [0.0, 0.0]);
    assert_eq!(after.uvs[0][2], before.uvs[0][2]);
    assert_eq!(after.colors, vec![[1.0, 0.0, 0.0, 0.5]; 4]);
    assert_eq!(back.batches[1].primitive.uvs, vec![vec![[0.0, 0.0]; 4]]);
    assert_eq!(back.batches[2].primitive.indices, [65_534, 65_533, 0]);
    assert_eq!(back.batches.last().unwrap().cells, [CellId(1)]);
    let chair = &back.detail_meshes[0].primitives;
    assert!(chair.len() == 1 && chair[0].tangents.is_empty() && !chair[0].normals.is_empty());
    let counts = &back.graph.statistics.counts;
    // The vanished and the flat chair also lose their normals, and every copy loses its tangents.
    assert_eq!(counts["flattened_details"], 5.0);
    assert!(
        counts["dropped_normals"] >= 1.0 && counts["dropped_tangents"] >= 1.0,
        "{counts:?}"
    );
}

#[test]
fn a_detail_that_gltf_cannot_place_is_drawn_where_it_was() {
    let world = nasty_rooms();
    let back = decode_glb(&encode_glb(&world).unwrap()).unwrap();
    for (i, detail) in world.details.iter().enumerate() {
        let (before, after) = (drawn(&world, i), drawn(&back, i));
        assert_eq!(before.len(), after.len(), "{}", detail.name);
        let m = DMat4::from_cols_array(&detail.transform.map(f64::from));
        for ((a, n), (b, m_n)) in before.iter().zip(&after) {
            let (mut a, b) = (*a, *b);
            // A mirror that is no longer in the node flips the triangle, so that its front stays its front.
            let is_flattened = back.details[i].transform != detail.transform;
            if is_flattened && m.determinant() < 0.0 {
                a.swap(1, 2);
            }
            for k in 0..3 {
                // Rounded to f32 once, at up to 50 km.
                assert!(
                    a[k].distance(b[k]) <= 1e-7 * (1.0 + a[k].length()),
                    "{}",
                    detail.name
                );
            }
            if let (Some(n), Some(m_n)) = (n, m_n)
                && m.determinant() != 0.0
            {
                assert!(n.distance(*m_n) < 1e-6, "{}: {n} became {m_n}", detail.name);
            }
        }
    }
}

#[test]
fn pictures_keep_their_bytes_and_get_their_true_type() {
    let world = nasty_rooms();
    let back = decode_glb(&encode_glb(&world).unwrap()).unwrap();
    assert_eq!(back.images[1].bytes, world.images[1].bytes);
    assert_eq!(back.images[1].mime, "image/webp");
    assert_eq!(back.textures[3].image, Some(1));
    assert_eq!(back.textures[4].image, None);
    assert!(back.images[0].bytes.starts_with(b"\x89PNG"));
}

/// The JSON of an encoded world.
fn json(bytes: &[u8]) -> Value {
    let len = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&bytes[20..20 + len]).unwrap()
}

#[test]
fn buffer_views_start_at_multiples_of_eight_whatever_lies_before_them() {
    let mut world = two_rooms();
    let node = world.graph.locator.nodes[1];
    for n in 1..20 {
        world.images[0].bytes = vec![7; n];
        Arc::make_mut(&mut world.graph.locator).nodes = vec![node; n];
        Arc::make_mut(&mut world.graph.locator).root = n as i32 - 1;
        let bytes = encode_glb(&world).unwrap();
        let root = json(&bytes);
        for view in root["bufferViews"].as_array().unwrap() {
            assert_eq!(view["byteOffset"].as_u64().unwrap() % 8, 0, "{view}");
        }
        let header = u32::from_le_bytes(bytes[8..12].try_into().unwrap());
        assert_eq!((header as usize, bytes.len() % 4), (bytes.len(), 0));
        let back = decode_glb(&bytes).unwrap();
        assert_eq!(back.images[0].bytes, world.images[0].bytes);
        assert_eq!(back.graph, world.graph);
    }
}

#[test]
fn equal_worlds_give_equal_bytes() {
    assert_eq!(
        encode_glb(&nasty_rooms()).unwrap(),
        encode_glb(&nasty_rooms()).unwrap()
    );
}

fn primitive() -> impl Strategy<Value = Primitive> {
    let finite = -1e6_f32..1e6;
    prop::collection::vec((prop::array::uniform3(finite), any::<[f32; 2]>()), 1..12)
        .prop_flat_map(|rows| {
            let n = rows.len();
            let triangles = prop::collection::vec(prop::array::uniform3(0..n as u32), 0..6);
            let normals = prop_oneof![
                Just(Vec::new()),
                Just(vec![[0.0, 0.0, -1.0]; n]),
                prop::collection::vec(any::<[f32; 3]>(), n),
            ];
            let material = prop::option::of(0..2_u32);
            (Just(rows), triangles, normals, material, any::<bool>())
        })
        .prop_map(|(rows, triangles, normals, material, has_uvs)| Primitive {
            positions: rows.iter().map(|r| r.0).collect(),
            normals,
            uvs: if has_uvs {
                vec![rows.iter().map(|r| r.1).collect()]
            } else {
                Vec::new()
            },
            indices: triangles.into_flattened(),
            material,
            ..Primitive::default()
        })
}

proptest! {
    /// For any geometry, the file reads back, the drawn triangles are the same one by one, and writing it again
    /// changes nothing.
    #[test]
    fn any_geometry_comes_back(
        batches in prop::collection::vec(
            (prop::collection::btree_set(0_u32..3, 0..=3), primitive(), any::<bool>()), 0..6),
        mesh in prop::collection::vec(primitive(), 0..3),
        transform in prop::array::uniform12(-10.0_f32..10.0),
    ) {
        let mut world = two_rooms();
        world.batches = batches
            .into_iter()
            .map(|(cells, primitive, is_seal)| {
                Batch { cells: cells.into_iter().map(CellId).collect(), primitive, is_seal, sources: SourceRuns::default(), }
            })
            .collect();
        world.detail_meshes[0].primitives = mesh;
        let [a, b, c, d, e, f, g, h, i, x, y, z] = transform;
        world.details[1].transform =
            [a, b, c, 0.0, d, e, f, 0.0, g, h, i, 0.0, x, y, z, 1.0];
        let bytes = encode_glb(&world).unwrap();
        let back = decode_glb(&bytes).unwrap();
        prop_assert_eq!(back.batches.len(), world.batches.len());
        for (after, before) in back.batches.iter().zip(&world.batches) {
            prop_assert_eq!(&after.cells, &before.cells);
            prop_assert_eq!(&after.primitive.indices, &before.primitive.indices);
            if !before.primitive.indices.is_empty() {
                prop_assert_eq!(&after.primitive.positions, &before.primitive.positions);
                prop_assert_eq!(after.primitive.material, before.primitive.material);
            }
        }
        prop_assert_eq!(drawn(&back, 0).len(), drawn(&world, 0).len());
        prop_assert!(encode_glb(&back).unwrap() == bytes);
    }
}
