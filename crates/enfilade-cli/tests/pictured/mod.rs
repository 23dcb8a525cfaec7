//! Worlds whose surfaces show pictures.

use enfilade_cpg::World;
use enfilade_geom::scene::{Image, Material, Texture};
use enfilade_render::Picture;
use enfilade_testkit::Rng;

/// Number of pictures.
const N: u32 = 6;

/// Gives most surfaces pictures at random, one of them damaged.
pub(crate) fn pictured(mut world: World) -> World {
    let mut rng = Rng::new(3);
    let first = world.materials.len() as u32;
    for i in 0..N {
        let (width, height) = (32, 16);
        let rgba = (0..width * height * 4).map(|k| match k % 4 {
            3 => 255,
            _ => rng.below(256) as u8,
        });
        let rgba = rgba.collect();
        let picture = Picture {
            width,
            height,
            rgba,
        };
        let mut bytes = picture.to_png().unwrap();
        if i == N - 1 {
            bytes.truncate(60);
        }
        world.images.push(Image {
            bytes,
            mime: "image/png".into(),
            ..Image::default()
        });
        world.textures.push(Texture {
            image: Some(i),
            ..Texture::default()
        });
        world.materials.push(Material {
            gltf: format!(r#"{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":{i}}}}}}}"#),
            base_color: [0.9, 0.8, 0.9, 1.0],
            ..Material::default()
        });
    }
    let batches = world.batches.iter_mut().map(|b| &mut b.primitive);
    let meshes = world.detail_meshes.iter_mut();
    let meshes = meshes.flat_map(|m| &mut m.primitives);
    for (i, primitive) in (0..).zip(batches.chain(meshes)) {
        if i % 3 < 2 {
            primitive.material = Some(first + i % N);
            let uv = |p: &[f32; 3]| [p[0] + 0.3 * p[1], p[2] + 0.7 * p[1]];
            primitive.uvs = vec![primitive.positions.iter().map(uv).collect()];
        }
    }
    world
}
