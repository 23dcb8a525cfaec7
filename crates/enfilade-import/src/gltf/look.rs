//! Materials, textures, samplers and pictures, kept unchanged.

use super::accessor::Document;
use super::json::TextureDef;
use crate::builder::Builder;
use crate::textures::map_textures;
use crate::{ImportError, files};
use enfilade_geom::scene::{Image, Material, Texture};
use serde_json::Value;

/// Extensions of a texture that name a picture in a newer format.
const TEXTURE_EXTENSIONS: [&str; 4] = [
    "EXT_texture_webp",
    "EXT_texture_avif",
    "KHR_texture_basisu",
    "MSFT_texture_dds",
];

/// Reads materials and textures. Returns the scene material of each document material.
pub(super) fn read_materials(
    document: &Document<'_>,
    builder: &mut Builder<'_>,
) -> Result<Vec<u32>, ImportError> {
    let root = &document.root;
    let mut images: Vec<Option<Option<u32>>> = vec![None; root.images.len()];
    let first_texture = builder.n_textures();
    let mut is_opaque_picture = Vec::new();
    for (i, def) in root.textures.iter().enumerate() {
        let place = format!("texture {i}");
        let sampler = match def.sampler {
            None => String::new(),
            Some(s) => match root.samplers.get(s as usize) {
                Some(sampler) => {
                    let text = sampler.to_string();
                    builder.charge_memory(&place, text.len() as u64, 1)?;
                    text
                }
                None => return Err(builder.malformed(place, format!("no sampler {s}"))),
            },
        };
        let image = match source_of(def) {
            None => None,
            Some(source) => match images.get(source as usize) {
                None => return Err(builder.malformed(place, format!("no image {source}"))),
                Some(Some(image)) => *image,
                Some(None) => {
                    let image = read_image(document, source, builder)?;
                    images[source as usize] = Some(image);
                    image
                }
            },
        };
        // JPEG has no alpha channel.
        is_opaque_picture.push(image.is_some_and(|i| builder.image_mime(i) == "image/jpeg"));
        builder.push_texture(Texture { image, sampler });
    }
    let mut materials = Vec::new();
    for (i, value) in root.materials.iter().enumerate() {
        let mut value = value.clone();
        if !value.is_object() {
            return Err(builder.malformed(format!("material {i}"), "is not an object"));
        }
        let mut number = |key: &str, index: &Value| {
            let known = index.as_u64().filter(|&t| t < root.textures.len() as u64);
            let known = known.ok_or_else(|| format!("{key}: no texture {index}"))?;
            Ok((known + u64::from(first_texture)).into())
        };
        map_textures(&mut value, &mut number)
            .map_err(|problem| builder.malformed(format!("material {i}"), problem))?;
        let pbr = &value["pbrMetallicRoughness"];
        let mut base_color = [1.0; 4];
        if let Some(factor) = pbr["baseColorFactor"].as_array() {
            for (c, v) in base_color.iter_mut().zip(factor) {
                *c = v.as_f64().unwrap_or(1.0) as f32;
            }
        }
        let may_have_holes = pbr["baseColorTexture"]["index"].as_u64().is_some_and(|t| {
            let t = (t as usize).wrapping_sub(first_texture as usize);
            !is_opaque_picture.get(t).copied().unwrap_or(false)
        });
        let cutoff = value["alphaCutoff"].as_f64().unwrap_or(0.5) as f32;
        let extensions = &value["extensions"];
        let transmission = [
            "KHR_materials_transmission",
            "KHR_materials_diffuse_transmission",
        ]
        .iter()
        .zip(["transmissionFactor", "diffuseTransmissionFactor"])
        .any(|(name, key)| extensions[*name][key].as_f64().is_some_and(|f| f > 0.0));
        let transparent = transmission
            || match value["alphaMode"].as_str() {
                Some("BLEND") => true,
                Some("MASK") => may_have_holes || base_color[3] < cutoff,
                _ => false,
            };
        materials.push(builder.push_material(Material {
            name: value["name"].as_str().unwrap_or("").to_owned(),
            double_sided: value["doubleSided"].as_bool().unwrap_or(false),
            transparent,
            base_color,
            gltf: value.to_string(),
        }));
    }
    Ok(materials)
}

/// Returns the picture of a texture; the plain one if there are two.
fn source_of(def: &TextureDef) -> Option<u32> {
    let extended = || {
        let extensions = def.extensions.as_ref()?;
        let source = TEXTURE_EXTENSIONS
            .iter()
            .find_map(|name| extensions.get(*name))?;
        u32::try_from(source["source"].as_u64()?).ok()
    };
    def.source.or_else(extended)
}

/// Reads a picture's bytes; `None`, with a note, for a missing file.
fn read_image(
    document: &Document<'_>,
    index: u32,
    builder: &mut Builder<'_>,
) -> Result<Option<u32>, ImportError> {
    let def = &document.root.images[index as usize];
    let name = def.name.clone().unwrap_or_default();
    let place = format!("image {index} '{name}'");
    let mut mime = def.mime_type.clone().unwrap_or_default();
    let bytes = if let Some(view) = def.buffer_view {
        let (bytes, _) = document
            .view(view)
            .map_err(|problem| builder.malformed(&place, problem))?;
        bytes.to_vec()
    } else if let Some(uri) = &def.uri {
        match files::decode_data_uri(uri) {
            Some(Ok((data_mime, bytes))) => {
                if mime.is_empty() {
                    mime = data_mime;
                }
                bytes
            }
            Some(Err(problem)) => return Err(builder.malformed(place, problem)),
            None => match read_picture_file(uri, builder) {
                Ok(bytes) => {
                    builder.add_read_bytes(bytes.len() as u64);
                    bytes
                }
                Err(problem) => {
                    builder.note(place, format!("{problem}; the texture stays empty"));
                    return Ok(None);
                }
            },
        }
    } else {
        builder.note(place, "a picture without bytes; the texture stays empty");
        return Ok(None);
    };
    builder.charge_image(&place, bytes.len() as u64)?;
    match files::sniff_image(&bytes) {
        Some(found) => mime = found.to_owned(),
        None => builder.note(place, "a picture of unknown format; kept unchanged"),
    }
    Ok(Some(builder.push_image(Image { name, mime, bytes })))
}

/// Reads a file beside the scene that must be a picture.
pub(crate) fn read_picture_file(uri: &str, builder: &mut Builder<'_>) -> Result<Vec<u8>, String> {
    let limit = builder.limits().max_image_bytes;
    let bytes = builder.read_reference(uri, limit)?;
    // A scene may carry only pictures, not any file of the reader's disk, into its output.
    match files::sniff_image(&bytes) {
        Some(_) => Ok(bytes),
        None => Err(format!("'{uri}' is not a picture of a known format")),
    }
}
