//! What surfaces look like: the part of glTF's materials that is drawn.

use enfilade_cpg::World;
use enfilade_geom::scene::Material;
use serde_json::Value;

/// A texture of more texels than this a side is scaled down: 8 bytes a texel add up.
const MAX_SIDE: u32 = 2048;

/// What is drawn of one material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    pub(crate) base_color: [f32; 4],
    pub(crate) emissive: [f32; 3],
    /// Texels with less alpha are not drawn; 0 for all are.
    pub(crate) cutoff: f32,
    pub(crate) is_transparent: bool,
    /// Index into `World::textures`.
    pub(crate) texture: Option<u32>,
    /// Which set of texture coordinates.
    pub(crate) uv_set: usize,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            base_color: [0.8, 0.8, 0.78, 1.0],
            emissive: [0.0; 3],
            cutoff: 0.0,
            is_transparent: false,
            texture: None,
            uv_set: 0,
        }
    }
}

/// Whether a material is a pane by its name, though it says nothing of what shows through: converters of building
/// models name materials by the class of the object, and lose the rest.
fn is_pane(name: &str) -> bool {
    const PANES: [&str; 5] = ["ifcwindow", "window", "glass", "glazing", "pane"];
    let is_part = |c: char| !c.is_alphanumeric();
    let words = || name.split(is_part).filter(|w| !w.is_empty());
    // Of one word, or one beside a number: "glass wool" is no glass.
    let mut named = words().filter(|w| !w.chars().all(|c| c.is_ascii_digit()));
    let first = named
        .next()
        .is_some_and(|w| PANES.contains(&w.to_lowercase().as_str()));
    first && named.next().is_none()
}

impl Look {
    pub(crate) fn of(material: &Material) -> Self {
        let value: Value = serde_json::from_str(&material.gltf).unwrap_or(Value::Null);
        let number = |v: &Value, or: f32| v.as_f64().map_or(or, |x| x as f32);
        let masks = value["alphaMode"] == "MASK";
        let mut look = Self {
            base_color: material.base_color,
            is_transparent: material.transparent,
            cutoff: if masks {
                number(&value["alphaCutoff"], 0.5)
            } else {
                0.0
            },
            ..Self::default()
        };
        for (k, e) in look.emissive.iter_mut().enumerate() {
            *e = number(&value["emissiveFactor"][k], 0.0);
        }
        let transmission = &value["extensions"]["KHR_materials_transmission"]["transmissionFactor"];
        if let Some(t) = transmission.as_f64() {
            // Glass that says it transmits all is seen by what it reflects: a tenth.
            look.base_color[3] = look.base_color[3].min(1.0 - 0.85 * t as f32);
        }
        let texture = &value["pbrMetallicRoughness"]["baseColorTexture"];
        look.texture = texture["index"]
            .as_u64()
            .and_then(|i| u32::try_from(i).ok());
        look.uv_set = texture["texCoord"].as_u64().unwrap_or(0) as usize;
        for c in look.base_color.iter_mut().chain(&mut look.emissive) {
            if !c.is_finite() {
                *c = 1.0;
            }
        }
        look
    }
}

/// The looks of a world's materials.
///
/// What is a pane by its name is seen through, unless structure is made of it, too: structure that hides was baked as such, and
/// what is behind it is not drawn.
pub(crate) fn looks_of(world: &World) -> Vec<Look> {
    let mut looks: Vec<Look> = world.materials.iter().map(Look::of).collect();
    let mut is_structural = vec![false; looks.len()];
    for batch in &world.batches {
        let material = batch.primitive.material.map_or(usize::MAX, |m| m as usize);
        if let Some(is_so) = is_structural.get_mut(material) {
            *is_so = true;
        }
    }
    for ((look, material), is_structural) in
        looks.iter_mut().zip(&world.materials).zip(is_structural)
    {
        let is_plain = look.cutoff <= 0.0 && look.texture.is_none();
        if !is_structural && is_plain && !look.is_transparent && is_pane(&material.name) {
            look.is_transparent = true;
            // Its frame is drawn alike, and in depth there are several faces.
            look.base_color[3] = look.base_color[3].min(0.12);
        }
    }
    looks
}

/// A picture decoded: RGBA, and smaller and smaller copies.
pub(crate) struct Decoded {
    pub(crate) levels: Vec<image::RgbaImage>,
}

/// Decodes the picture of a texture; `None` where it is missing or damaged, which is drawn without.
pub(crate) fn decode(world: &World, texture: u32) -> Option<Decoded> {
    let image = world.textures.get(texture as usize)?.image?;
    let bytes = &world.images.get(image as usize)?.bytes;
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .ok()?;
    // A picture of a few bytes may claim to be of any size.
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(1 << 14);
    limits.max_image_height = Some(1 << 14);
    limits.max_alloc = Some(1 << 30);
    reader.limits(limits);
    let mut picture = reader.decode().ok()?.into_rgba8();
    let (w, h) = picture.dimensions();
    if w == 0 || h == 0 {
        return None;
    }
    let filter = image::imageops::FilterType::Triangle;
    if w.max(h) > MAX_SIDE {
        let scale = |n: u32| (n * MAX_SIDE / w.max(h)).max(1);
        picture = image::imageops::resize(&picture, scale(w), scale(h), filter);
    }
    let mut levels = vec![picture];
    while let Some(last) = levels.last()
        && last.width().max(last.height()) > 1
    {
        let (w, h) = ((last.width() / 2).max(1), (last.height() / 2).max(1));
        levels.push(image::imageops::resize(last, w, h, filter));
    }
    Some(Decoded { levels })
}

/// Whether a texture repeats beyond 0 … 1 along u and v, or is clamped or mirrored.
pub(crate) fn wrapping(world: &World, texture: u32) -> [wgpu::AddressMode; 2] {
    let sampler = world
        .textures
        .get(texture as usize)
        .map_or("", |t| &t.sampler);
    let value: Value = serde_json::from_str(sampler).unwrap_or(Value::Null);
    ["wrapS", "wrapT"].map(|key| match value[key].as_u64() {
        Some(33071) => wgpu::AddressMode::ClampToEdge,
        Some(33648) => wgpu::AddressMode::MirrorRepeat,
        _ => wgpu::AddressMode::Repeat,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::scene::{Image, Texture};

    fn look(gltf: &str) -> Look {
        Look::of(&Material {
            gltf: gltf.into(),
            base_color: [1.0; 4],
            ..Material::default()
        })
    }

    #[test]
    fn what_a_material_says_is_read() {
        let l = look(
            r#"{"alphaMode":"MASK","emissiveFactor":[1,0.5,0],
            "pbrMetallicRoughness":{"baseColorTexture":{"index":3,"texCoord":1}}}"#,
        );
        assert_eq!((l.cutoff, l.emissive), (0.5, [1.0, 0.5, 0.0]));
        assert_eq!((l.texture, l.uv_set), (Some(3), 1));
        assert_eq!(look("no JSON").texture, None);
    }

    #[test]
    fn a_window_that_says_nothing_of_its_pane_is_seen_through() {
        let seen_through = |names: &[&str], structural: Option<u32>| -> Vec<bool> {
            let material = |name: &&str| Material {
                name: (*name).into(),
                base_color: [0.5, 0.7, 0.9, 1.0],
                ..Material::default()
            };
            let mut world = World {
                materials: names.iter().map(material).collect(),
                ..World::default()
            };
            if structural.is_some() {
                let mut batch = enfilade_cpg::Batch::default();
                batch.primitive.material = structural;
                world.batches.push(batch);
            }
            looks_of(&world).iter().map(|l| l.is_transparent).collect()
        };
        let panes = ["IfcWindow", "Glass.001", "glazing 2"];
        assert_eq!(seen_through(&panes, None), [true; 3]);
        let others = ["Glass wool", "IfcWall", "Window frame", ""];
        assert_eq!(seen_through(&others, None), [false; 4]);
        assert_eq!(
            seen_through(&panes, Some(1)),
            [true, false, true],
            "structure hides"
        );
    }

    #[test]
    fn missing_and_damaged_pictures_are_drawn_without() {
        let mut world = World {
            textures: vec![
                Texture::default(),
                Texture {
                    image: Some(0),
                    ..Texture::default()
                },
            ],
            ..World::default()
        };
        assert!(decode(&world, 0).is_none(), "no image");
        assert!(decode(&world, 1).is_none(), "no such image");
        assert!(decode(&world, 9).is_none(), "no such texture");
        world.images.push(Image {
            bytes: b"\x89PNG\r\n\x1a\n and nothing".to_vec(),
            ..Image::default()
        });
        assert!(decode(&world, 1).is_none(), "cut off");
    }

    #[test]
    fn levels_end_at_one_texel() {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::RgbaImage::new(5, 3)
            .write_to(&mut bytes, image::ImageFormat::Png)
            .unwrap();
        let world = World {
            textures: vec![Texture {
                image: Some(0),
                ..Texture::default()
            }],
            images: vec![Image {
                bytes: bytes.into_inner(),
                ..Image::default()
            }],
            ..World::default()
        };
        let sizes: Vec<_> = decode(&world, 0)
            .unwrap()
            .levels
            .iter()
            .map(image::RgbaImage::dimensions)
            .collect();
        assert_eq!(sizes, [(5, 3), (2, 1), (1, 1)]);
    }
}
