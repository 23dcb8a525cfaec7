//! Looks of surfaces: the supported part of glTF materials.

use enfilade_cpg::World;
use enfilade_geom::scene::Material;
use image::ImageDecoder as _;
use serde_json::Value;

/// Larger textures are scaled down to this side, since a texel takes 8 bytes. [Units: texels]
const MAX_SIDE: u32 = 2048;

/// Largest texture image: 8192 × 8192 pixels of four bytes. [Units: bytes, decoded]
pub(crate) const MAX_PICTURE: u64 = 1 << 28;
/// Most bytes of all images of a world, and more per byte of them in the file: ten times the compression of JPEG.
const MAX_PICTURES: u64 = 1 << 29;
const MAX_EXPANSION: u64 = 128;

/// The supported part of one material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    pub(crate) base_color: [f32; 4],
    pub(crate) emissive: [f32; 3],
    /// Texels with less alpha are not drawn; 0 draws all.
    pub(crate) cutoff: f32,
    pub(crate) is_transparent: bool,
    /// Index into `World::textures`.
    pub(crate) texture: Option<u32>,
    /// Index of the set of texture coordinates.
    pub(crate) uv_set: usize,
    /// Without a material: the direction that a surface faces decides its color, as of a floor, a wall or a ceiling.
    pub(crate) is_bare: bool,
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
            is_bare: true,
        }
    }
}

/// Returns `true` if a material's name means a pane, even if its data do not make it transparent: converters of
/// building models name materials by the class of the object and lose the rest.
fn is_pane(name: &str) -> bool {
    const PANES: [&str; 5] = ["ifcwindow", "window", "glass", "glazing", "pane"];
    let is_part = |c: char| !c.is_alphanumeric();
    let words = || name.split(is_part).filter(|w| !w.is_empty());
    // One word, or one beside a number: "glass wool" is not glass.
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
            is_bare: false,
            ..Self::default()
        };
        for (k, e) in look.emissive.iter_mut().enumerate() {
            *e = number(&value["emissiveFactor"][k], 0.0);
        }
        let transmission = &value["extensions"]["KHR_materials_transmission"]["transmissionFactor"];
        if let Some(t) = transmission.as_f64() {
            // Fully transmitting glass is visible by its reflections: a tenth.
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

/// Returns the looks of a world's materials.
///
/// Materials with a pane's name become transparent, unless structure uses them, too: the bake took that structure as
/// opaque, and nothing behind it is drawn.
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
            // The frame is drawn the same way, and a pane has several faces in depth.
            look.base_color[3] = look.base_color[3].min(0.12);
        }
    }
    looks
}

/// A decoded image: RGBA, and its mipmaps.
pub(crate) struct Decoded {
    pub(crate) levels: Vec<image::RgbaImage>,
}

/// Why a texture is drawn without its image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoPicture {
    /// Missing or damaged.
    Broken,
    /// Beyond the limit: an image of a few bytes may declare any size.
    TooLarge,
}

/// Decodes images as long as they stay within their common limit.
pub(crate) struct Decoder<'w> {
    world: &'w World,
    /// [Units: bytes, decoded]
    left: u64,
}

impl<'w> Decoder<'w> {
    pub(crate) fn new(world: &'w World) -> Self {
        let encoded: u64 = world.images.iter().map(|i| i.bytes.len() as u64).sum();
        let left = MAX_PICTURES.saturating_add(encoded.saturating_mul(MAX_EXPANSION));
        Self { world, left }
    }

    /// Decodes the image of a texture. Checks its size before decoding.
    pub(crate) fn decode(&mut self, texture: u32) -> Result<Decoded, NoPicture> {
        let texture = self.world.textures.get(texture as usize);
        let image = texture.and_then(|t| self.world.images.get(t.image? as usize));
        let bytes = &image.ok_or(NoPicture::Broken)?.bytes;
        decode(bytes, &mut self.left)
    }
}

/// Decodes an image, which takes from the `left` bytes. Checks its size before decoding.
pub(crate) fn decode(bytes: &[u8], left: &mut u64) -> Result<Decoded, NoPicture> {
    let broken = |_| NoPicture::Broken;
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|_| NoPicture::Broken)?;
    let mut limits = image::Limits::default();
    // The decoder needs far less beside the image itself.
    limits.max_alloc = Some(2 * MAX_PICTURE);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(broken)?;
    let (w, h) = decoder.dimensions();
    // Size after conversion: four bytes per pixel, or more.
    let size = decoder.total_bytes().max(u64::from(w) * u64::from(h) * 4);
    if size > MAX_PICTURE.min(*left) {
        return Err(NoPicture::TooLarge);
    }
    *left -= size;
    let mut picture = image::DynamicImage::from_decoder(decoder).map_err(broken)?;
    if w == 0 || h == 0 {
        return Err(NoPicture::Broken);
    }
    if w.max(h) > MAX_SIDE {
        let scale = |n: u32| (n * MAX_SIDE / w.max(h)).max(1);
        // In integers: floats take four times as much.
        picture = picture.thumbnail_exact(scale(w), scale(h));
    }
    let mut levels = vec![picture.into_rgba8()];
    let filter = image::imageops::FilterType::Triangle;
    while let Some(last) = levels.last()
        && last.width().max(last.height()) > 1
    {
        let (w, h) = ((last.width() / 2).max(1), (last.height() / 2).max(1));
        levels.push(image::imageops::resize(last, w, h, filter));
    }
    Ok(Decoded { levels })
}

/// Returns the wrap modes of a texture along u and v: repeated, clamped or mirrored.
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
        let broken = |world: &World, texture| {
            matches!(Decoder::new(world).decode(texture), Err(NoPicture::Broken))
        };
        assert!(broken(&world, 0), "no image");
        assert!(broken(&world, 1), "no such image");
        assert!(broken(&world, 9), "no such texture");
        world.images.push(Image {
            bytes: b"\x89PNG\r\n\x1a\n and nothing".to_vec(),
            ..Image::default()
        });
        assert!(broken(&world, 1), "cut off");
    }

    /// Returns a world with one texture for each of the given image files.
    fn textured(pictures: Vec<Vec<u8>>) -> World {
        World {
            textures: (0..pictures.len() as u32)
                .map(|i| Texture {
                    image: Some(i),
                    ..Texture::default()
                })
                .collect(),
            images: (pictures.into_iter())
                .map(|bytes| Image {
                    bytes,
                    ..Image::default()
                })
                .collect(),
            ..World::default()
        }
    }

    fn png(w: u32, h: u32) -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::GrayImage::new(w, h)
            .write_to(&mut bytes, image::ImageFormat::Png)
            .unwrap();
        bytes.into_inner()
    }

    #[test]
    fn levels_end_at_one_texel() {
        let world = textured(vec![png(5, 3)]);
        let decoded = Decoder::new(&world).decode(0);
        let levels = decoded.map_or_else(|why| panic!("{why:?}"), |d| d.levels);
        let sizes: Vec<_> = levels.iter().map(image::RgbaImage::dimensions).collect();
        assert_eq!(sizes, [(5, 3), (2, 1), (1, 1)]);
    }

    #[test]
    fn pictures_that_claim_to_be_huge_are_told_before_they_are_decoded() {
        // The header declares a huge image; the data after it are those of one pixel.
        let mut claims = std::io::Cursor::new(Vec::new());
        image::GrayImage::new(1, 1)
            .write_to(&mut claims, image::ImageFormat::Jpeg)
            .unwrap();
        let mut claims = claims.into_inner();
        let frame = claims.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
        claims[frame + 5..frame + 9].copy_from_slice(&[0x80, 0, 0x80, 0]);
        let world = textured(vec![claims]);
        let found = Decoder::new(&world).decode(0).map(|d| d.levels.len());
        assert_eq!(found, Err(NoPicture::TooLarge));
        // Each image is within its limit, all together are not.
        let sheet = png(4096, 4096);
        let world = textured(vec![sheet; 12]);
        let mut decoder = Decoder::new(&world);
        // No image has been decoded so far.
        let all = decoder.left;
        assert!(
            all > 8 * 4 * 4096 * 4096 && all < 12 * 4 * 4096 * 4096,
            "{all}"
        );
        decoder.left = 4 * 4096 * 4096;
        let found = decoder.decode(0).map(|d| d.levels[0].dimensions());
        assert_eq!(found, Ok((2048, 2048)));
        let found = decoder.decode(1).map(|d| d.levels.len());
        assert_eq!(found, Err(NoPicture::TooLarge));
    }
}
