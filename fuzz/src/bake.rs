//! Small bakes by all builders.

use std::time::Duration;

use enfilade::bake::{BakeConfig, BakeContext, Budget, Method, SmallestHole, bake as bake_scene};
use enfilade::verify::{VerifyOptions, structural_triangles, verify_world};
use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_geom::scene::{Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{Aabb, DMat4};

use crate::Numbers;

const METHODS: [Option<Method>; 4] = [
    None,
    Some(Method::Watershed),
    Some(Method::Bsp),
    Some(Method::Delaunay),
];

/// Most triangles.
const MOST: usize = 40;

/// A byte of choices, then vertices: a bake fails, or its world is valid, survives encoding, and keeps its promises.
pub fn bake(data: &[u8]) {
    let mut numbers = Numbers(data);
    let kind = numbers.byte();
    let scene = scene(&mut numbers, kind & 4 == 4);
    let config = BakeConfig {
        max_voxels: 8_000,
        smallest_hole: if kind & 8 == 8 {
            SmallestHole::Open(0.01)
        } else {
            SmallestHole::Auto
        },
        budget: Budget {
            memory: Some(256 << 20),
            time: Some(Duration::from_secs(4)),
            ..Budget::default()
        },
        method: METHODS[usize::from(kind & 3)],
        ..BakeConfig::default()
    };
    let baked = match bake_scene(&scene, &config, &BakeContext::default()) {
        Ok(baked) => baked,
        Err(error) => {
            assert!(!error.to_string().contains("(a bug)"), "{error}");
            return;
        }
    };
    assert_eq!(baked.world.validate(), Ok(()));
    let bytes = encode_glb(&baked.world).expect("a valid world can be written");
    let world = decode_glb(&bytes).expect("what was written can be read");
    let options = VerifyOptions {
        rays: 200,
        ..VerifyOptions::default()
    };
    let report = verify_world(&world, None, &options);
    assert!(report.holds(), "{report}");
    assert!(structural_triangles(&world).len() <= 100_000);
}

/// Returns triangles on a grid of an eighth of a meter, where many are coplanar, or anywhere.
fn scene(numbers: &mut Numbers<'_>, is_any: bool) -> Scene {
    let mut positions = Vec::new();
    while !numbers.0.is_empty() && positions.len() < 3 * MOST {
        let corner = if is_any {
            numbers.point(true)
        } else {
            numbers.take().map(|b: u8| f32::from(b as i8) / 8.0)
        };
        // The importer rejects other values.
        positions.push(corner.map(|x| {
            if x.is_finite() {
                x.clamp(-1000.0, 1000.0)
            } else {
                0.0
            }
        }));
    }
    positions.truncate(positions.len() / 3 * 3);
    let indices = (0..positions.len() as u32).collect();
    let primitive = Primitive {
        positions,
        indices,
        ..Primitive::default()
    };
    Scene {
        meshes: vec![Mesh {
            primitives: vec![primitive],
            ..Mesh::default()
        }],
        objects: vec![Object {
            name: "walls".to_owned(),
            mesh: 0,
            transform: DMat4::IDENTITY,
            role: Role::Structural,
            reason: String::new(),
            filling: None,
            node: None,
        }],
        ..Scene::default()
    }
}

/// Returns two rooms with a doorway, on the grid: 38 triangles, for each method.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    let boxes: [[[i8; 3]; 2]; 4] = [
        [[0, 0, 0], [64, 24, 40]],
        [[32, 0, 0], [33, 24, 16]],
        [[32, 0, 24], [33, 24, 40]],
        [[32, 17, 16], [33, 24, 24]],
    ];
    let mut corners = Vec::new();
    for [low, high] in boxes {
        let corner =
            |c: usize| [0, 1, 2].map(|k| if c >> k & 1 == 1 { high[k] } else { low[k] } as u8);
        for [a, b, c, d] in Aabb::FACES {
            corners.extend([a, b, c, a, c, d].map(corner));
        }
    }
    corners.truncate(3 * MOST);
    (0..16)
        .filter(|kind| kind & 4 == 0)
        .map(|kind| [&[kind][..], corners.as_flattened()].concat())
        .collect()
}
