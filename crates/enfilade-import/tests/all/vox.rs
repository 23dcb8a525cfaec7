//! Models of MagicaVoxel: cubes, transforms, glass, damage.

use enfilade_geom::scene::{Object, Role, Scene};
use enfilade_geom::{Aabb, Triangle};
use enfilade_import::{ImportOptions, decode_vox};
use proptest::prelude::*;

fn chunk(name: &str, content: &[u8]) -> Vec<u8> {
    let length = content.len() as u32;
    [name.as_bytes(), &length.to_le_bytes(), &[0; 4], content].concat()
}

fn file(chunks: &[Vec<u8>]) -> Vec<u8> {
    let all = chunks.concat();
    let length = all.len() as u32;
    [
        &b"VOX \x96\0\0\0MAIN"[..],
        &[0; 4],
        &length.to_le_bytes(),
        &all,
    ]
    .concat()
}

/// A model of cubes: x, y, z, entry of the palette from 1.
fn model(size: [u32; 3], cubes: &[[u8; 4]]) -> Vec<u8> {
    let size: Vec<u8> = size.iter().flat_map(|s| s.to_le_bytes()).collect();
    let n = (cubes.len() as u32).to_le_bytes();
    let cubes = [&n[..], cubes.as_flattened()].concat();
    [chunk("SIZE", &size), chunk("XYZI", &cubes)].concat()
}

fn dict(pairs: &[(&str, &str)]) -> Vec<u8> {
    let text = |t: &str| [&(t.len() as u32).to_le_bytes()[..], t.as_bytes()].concat();
    let pairs_of = pairs.iter().flat_map(|(k, v)| [text(k), text(v)].concat());
    let n = (pairs.len() as u32).to_le_bytes();
    n.into_iter().chain(pairs_of).collect()
}

fn transform(id: u32, own: &[(&str, &str)], child: u32, frame: &[(&str, &str)]) -> Vec<u8> {
    let numbers = [child, u32::MAX, 0, 1].map(u32::to_le_bytes).concat();
    let all = [&id.to_le_bytes()[..], &dict(own), &numbers, &dict(frame)];
    chunk("nTRN", &all.concat())
}

fn group(id: u32, children: &[u32]) -> Vec<u8> {
    let list: Vec<u8> = children.iter().flat_map(|c| c.to_le_bytes()).collect();
    let n = (children.len() as u32).to_le_bytes();
    chunk(
        "nGRP",
        &[&id.to_le_bytes()[..], &dict(&[]), &n, &list].concat(),
    )
}

fn shape(id: u32, model: u32) -> Vec<u8> {
    let one = [1, model].map(u32::to_le_bytes).concat();
    let all = [&id.to_le_bytes()[..], &dict(&[]), &one, &dict(&[])];
    chunk("nSHP", &all.concat())
}

fn read(bytes: &[u8]) -> Scene {
    decode_vox(bytes, &ImportOptions::default()).unwrap().scene
}

fn problem(bytes: &[u8]) -> String {
    let read = decode_vox(bytes, &ImportOptions::default());
    read.unwrap_err().to_string()
}

fn triangles(scene: &Scene, object: &Object) -> Vec<Triangle> {
    let primitives = scene.meshes[object.mesh as usize].primitives.iter();
    primitives
        .flat_map(|p| p.placed_triangles(object.transform))
        .collect()
}

/// Six times the volume that faces enclose, as their fronts show.
fn volume(triangles: &[Triangle]) -> f64 {
    triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c))).sum()
}

fn around(scene: &Scene, object: &Object) -> [[f64; 3]; 2] {
    let b = Aabb::of_points(triangles(scene, object).as_flattened());
    [b.min, b.max].map(|p| p.to_array().map(|c| (c * 1e6).round() / 1e6))
}

proptest! {
    #[test]
    fn faces_enclose_the_cubes(cubes in prop::collection::vec(prop::array::uniform3(0_u8..5), 1..60)) {
        let listed: Vec<[u8; 4]> = cubes.iter().map(|&[x, y, z]| [x, y, z, 1 + x % 2]).collect();
        let scene = read(&file(&[model([5; 3], &listed)]));
        let all: Vec<Triangle> = scene.objects.iter().flat_map(|o| triangles(&scene, o)).collect();
        let distinct: std::collections::BTreeSet<_> = cubes.iter().collect();
        let expected = distinct.len() as f64 * 1e-3;
        prop_assert!((volume(&all) / 6.0 - expected).abs() < 1e-8);
    }
}

#[test]
fn cubes_are_a_tenth_of_a_meter_with_z_up_and_rectangles_as_large_as_they_can_be() {
    // A slab of 4 x 3 cubes, 2 high.
    let cubes: Vec<[u8; 4]> = (0..24).map(|i| [i % 4, i / 4 % 3, i / 12, 7]).collect();
    let scene = read(&file(&[model([4, 3, 2], &cubes)]));
    assert_eq!(triangles(&scene, &scene.objects[0]).len(), 12);
    assert_eq!(
        around(&scene, &scene.objects[0]),
        [[-0.2, -0.1, -0.2], [0.2, 0.1, 0.1]]
    );
    assert_eq!(scene.materials[0].name, "color 7");
}

#[test]
fn the_tree_places_turns_names_and_hides_models() {
    let bar = model([3, 1, 1], &[[0, 0, 0, 1], [1, 0, 0, 1], [2, 0, 0, 1]]);
    // The second row takes x, the first takes -y: a quarter turn around z.
    let quarter = (1 | 1 << 4).to_string();
    let tree = [
        transform(0, &[], 1, &[]),
        group(1, &[2, 4, 6]),
        transform(
            2,
            &[("_name", "beam")],
            3,
            &[("_t", "10 0 5"), ("_r", &quarter)],
        ),
        shape(3, 0),
        transform(4, &[("_hidden", "1"), ("_name", "ghost")], 5, &[]),
        shape(5, 0),
        transform(6, &[], 7, &[("_t", "0 0 -5")]),
        shape(7, 0),
    ];
    let imported = decode_vox(&file(&[bar, tree.concat()]), &ImportOptions::default()).unwrap();
    let scene = &imported.scene;
    let names: Vec<&str> = scene.objects.iter().map(|o| &*o.name).collect();
    assert_eq!(names, ["beam", "model 0"]);
    // The bar reaches from -1 to 2 along x around its middle, after the turn along y, which is -z here.
    let beam = around(scene, &scene.objects[0]);
    assert_eq!(beam, [[0.9, 0.5, -0.2], [1.0, 0.6, 0.1]]);
    assert!(volume(&triangles(scene, &scene.objects[0])) > 0.0);
    let [low, high] = around(scene, &scene.objects[1]);
    assert_eq!((low, high), ([-0.1, -0.5, -0.1], [0.2, -0.4, 0.0]));
    assert_eq!(imported.report.left_out[0].names, ["ghost"]);
}

#[test]
fn glass_is_see_through_and_hides_no_face_behind_it() {
    let glass = [
        &2_u32.to_le_bytes()[..],
        &dict(&[("_type", "_glass"), ("_trans", "0.75")]),
    ];
    let bytes = file(&[
        model([2, 1, 1], &[[0, 0, 0, 1], [1, 0, 0, 2]]),
        chunk("MATL", &glass.concat()),
    ]);
    let scene = read(&bytes);
    let count = |role| {
        let of = scene.objects.iter().filter(|o| o.role == role);
        of.map(|o| triangles(&scene, o).len()).sum::<usize>()
    };
    assert_eq!([count(Role::Structural), count(Role::Detail)], [12, 10]);
    let clear = scene.materials.iter().find(|m| m.transparent).unwrap();
    assert!((clear.base_color[3] - 0.25).abs() < 1e-6);
}

#[test]
fn damaged_files_are_refused_with_their_place_and_end_soon() {
    let tree = [
        transform(0, &[], 1, &[]),
        group(1, &[0, 2, 9]),
        transform(2, &[], 3, &[]),
        shape(3, 4),
    ];
    let whole = file(&[model([1; 3], &[[0, 0, 0, 1]]), tree.concat()]);
    assert!(
        problem(&whole).contains("below two nodes"),
        "{}",
        problem(&whole)
    );
    for n in 0..whole.len() {
        assert!(decode_vox(&whole[..n], &ImportOptions::default()).is_err());
    }
    assert!(problem(&whole[..60]).contains("cut off"));
    for at in 20..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x5a;
        let _ = decode_vox(&bytes, &ImportOptions::default());
    }
    // Chunks in chunks in chunks would be read by recursion.
    let mut nested = Vec::new();
    for _ in 0..100_000 {
        nested.extend(b"MAIN\0\0\0\0\xff\xff\0\0");
    }
    assert!(problem(&file(&[nested])).contains("holds others"));
    // Models with two cubes far apart cost what two cubes cost.
    let far: Vec<Vec<u8>> = (0..20_000)
        .map(|_| model([256; 3], &[[0, 0, 0, 1], [255, 255, 255, 1]]))
        .collect();
    assert_eq!(read(&file(&far)).objects.len(), 20_000);
}
