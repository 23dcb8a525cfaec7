//! Materials, textures and samplers, kept as their glTF JSON.

use std::collections::BTreeSet;

use enfilade_geom::scene::{Material, Texture};
use serde_json::{Map, Value, json};

use crate::World;

/// Checks that materials and samplers are JSON objects and that every reference is in range.
pub(crate) fn check(world: &World, problem: &mut dyn FnMut(String, String)) {
    for (i, material) in world.materials.iter().enumerate() {
        let mut broken = |what| problem(format!("material {i} ({})", material.name), what);
        match object(&material_text(material)) {
            Err(why) => broken(why),
            Ok(value) => {
                let mut worst = None;
                each_texture_reference(&Value::Object(value), &mut |index| {
                    if index.is_none_or(|t| t >= world.textures.len() as u64) {
                        worst = Some(index);
                    }
                });
                if let Some(index) = worst {
                    let named = index.map_or_else(|| "without an index".into(), |t| t.to_string());
                    broken(format!(
                        "refers to texture {named}, but there are {}",
                        world.textures.len()
                    ));
                }
            }
        }
    }
    for (i, texture) in world.textures.iter().enumerate() {
        let mut broken = |what| problem(format!("texture {i}"), what);
        if let Some(image) = texture.image.filter(|&m| m as usize >= world.images.len()) {
            broken(format!(
                "refers to image {image}, but there are {}",
                world.images.len()
            ));
        }
        if let Some(Err(why)) = sampler_text(texture).map(object) {
            broken(format!("its sampler: {why}"));
        }
    }
}

/// Returns the material's JSON object, made from the other fields if the input had none.
pub(crate) fn material_text(material: &Material) -> String {
    let text = material.gltf.trim();
    if !text.is_empty() {
        return text.to_owned();
    }
    let mut value = json!({
        "pbrMetallicRoughness": { "baseColorFactor": material.base_color.map(f64::from) },
    });
    if !material.name.is_empty() {
        value["name"] = json!(material.name);
    }
    if material.double_sided {
        value["doubleSided"] = json!(true);
    }
    if material.transparent {
        value["alphaMode"] = json!("BLEND");
    }
    value.to_string()
}

/// Returns the sampler's JSON object; `None` for the default.
pub(crate) fn sampler_text(texture: &Texture) -> Option<&str> {
    Some(texture.sampler.trim()).filter(|s| !s.is_empty())
}

/// Parses the material in a JSON object.
pub(crate) fn material_of_text(text: &str) -> Result<Material, String> {
    let value = object(text)?;
    let name = value
        .get("name")
        .and_then(Value::as_str)
        .unwrap_or_default()
        .to_owned();
    let double_sided = value
        .get("doubleSided")
        .and_then(Value::as_bool)
        .unwrap_or(false);
    let blends = value.get("alphaMode").and_then(Value::as_str) == Some("BLEND");
    let transmits = value
        .get("extensions")
        .and_then(|e| e.get("KHR_materials_transmission"))
        .and_then(|t| t.get("transmissionFactor").and_then(Value::as_f64))
        .is_some_and(|f| f > 0.0);
    let mut base_color = [1.0; 4];
    let factor = value
        .get("pbrMetallicRoughness")
        .and_then(|p| p.get("baseColorFactor"));
    if let Some(Value::Array(factor)) = factor {
        for (to, from) in base_color.iter_mut().zip(factor) {
            *to = from.as_f64().unwrap_or(1.0) as f32;
        }
    }
    let transparent = blends || transmits;
    Ok(Material {
        name,
        gltf: text.to_owned(),
        double_sided,
        transparent,
        base_color,
    })
}

/// Adds the extensions that a material or sampler uses at any depth.
pub(crate) fn add_extensions(used: &mut BTreeSet<String>, text: &str) {
    fn visit(used: &mut BTreeSet<String>, value: &Value) {
        match value {
            Value::Object(map) => {
                for (key, inner) in map {
                    if key == "extensions"
                        && let Value::Object(extensions) = inner
                    {
                        used.extend(extensions.keys().cloned());
                    }
                    // Extras belong to the application; a key `extensions` in them does not count.
                    if key != "extras" {
                        visit(used, inner);
                    }
                }
            }
            Value::Array(items) => items.iter().for_each(|v| visit(used, v)),
            _ => {}
        }
    }
    if let Ok(value) = object(text) {
        visit(used, &Value::Object(value));
    }
}

/// Returns the number of texture coordinate sets that a texture of a material reads.
fn n_sets_of_texture(texture: &Value) -> u64 {
    let transformed = texture
        .get("extensions")
        .and_then(|e| e.get("KHR_texture_transform"))
        .and_then(|t| t.get("texCoord"));
    // A renderer without the transform reads the texture's own set.
    let own = texture.get("texCoord").and_then(Value::as_u64).unwrap_or(0);
    let sets = transformed.and_then(Value::as_u64).into_iter().chain([own]);
    let read = sets.filter(|&set| set < MAX_TEXCOORD_SETS);
    read.map(|set| set + 1).max().unwrap_or(0)
}

/// Returns the number of texture coordinate sets that a material reads; 0 without a texture.
///
/// Ignores sets beyond the eighth: no renderer has as many, and a damaged number must not make the writer fill
/// gigabytes.
pub(crate) fn n_texcoord_sets(text: &str) -> usize {
    fn visit(most: &mut u64, value: &Value) {
        match value {
            Value::Object(map) => {
                for (key, inner) in map {
                    if key == "extras" {
                        continue;
                    }
                    if key.ends_with("Texture") && inner.get("index").is_some() {
                        *most = (*most).max(n_sets_of_texture(inner));
                    }
                    visit(most, inner);
                }
            }
            Value::Array(items) => items.iter().for_each(|v| visit(most, v)),
            _ => {}
        }
    }
    let mut most = 0;
    if let Ok(value) = object(text) {
        visit(&mut most, &Value::Object(value));
    }
    most as usize
}

const MAX_TEXCOORD_SETS: u64 = 8;

/// Parses a JSON object. The parser limits nesting to 128 levels, so recursion over the result is safe.
fn object(text: &str) -> Result<Map<String, Value>, String> {
    match serde_json::from_str(text) {
        Ok(Value::Object(map)) => Ok(map),
        Ok(_) => Err("is not a JSON object".into()),
        Err(why) => Err(format!("is not JSON: {why}")),
    }
}

/// Returns the textures that a material, a JSON object, refers to: indices of [`World::textures`](crate::World::textures).
#[must_use]
pub fn used_textures(material: &str) -> Vec<u32> {
    let mut out = Vec::new();
    if let Ok(value) = object(material) {
        each_texture_reference(&Value::Object(value), &mut |index| {
            out.extend(index.and_then(|i| u32::try_from(i).ok()));
        });
    }
    out
}

/// Returns a material, a JSON object, whose references to textures are greater by `by`, for a world put together from several.
#[must_use]
pub fn shifted_textures(material: &str, by: u32) -> String {
    fn shift(value: &mut Value, by: u32) {
        match value {
            Value::Object(map) => {
                for (key, inner) in map.iter_mut().filter(|(key, _)| *key != "extras") {
                    if key.ends_with("Texture")
                        && let Some(index) = inner.get("index").and_then(Value::as_u64)
                    {
                        inner["index"] = json!(index + u64::from(by));
                    }
                    shift(inner, by);
                }
            }
            Value::Array(items) => items.iter_mut().for_each(|v| shift(v, by)),
            _ => {}
        }
    }
    match object(material) {
        Ok(object) if by > 0 => {
            let mut value = Value::Object(object);
            shift(&mut value, by);
            value.to_string()
        }
        _ => material.to_owned(),
    }
}

/// Calls `visit` with the index of every texture reference: glTF, its extensions included, keeps them in objects
/// whose key ends in `Texture`. `None` if the index is not an integer.
fn each_texture_reference(value: &Value, visit: &mut dyn FnMut(Option<u64>)) {
    match value {
        Value::Object(map) => {
            for (key, inner) in map {
                if key == "extras" {
                    continue;
                }
                if key.ends_with("Texture")
                    && let Some(index) = inner.get("index")
                {
                    visit(index.as_u64());
                }
                each_texture_reference(inner, visit);
            }
        }
        Value::Array(items) => items.iter().for_each(|v| each_texture_reference(v, visit)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_to_textures_are_shifted_wherever_they_are() {
        let text = r#"{"extras":{"aTexture":{"index":1}},"pbr":{"baseColorTexture":{"index":1}}}"#;
        let shifted = shifted_textures(text, 2);
        assert_eq!(used_textures(&shifted), [3]);
        assert!(shifted.contains(r#""aTexture":{"index":1}"#), "{shifted}");
        assert_eq!(shifted_textures("", 2), "");
    }

    #[test]
    fn texture_coordinate_sets_are_counted_wherever_a_texture_is_read() {
        for (text, n) in [
            ("{}", 0),
            (r#"{"normalTexture":{"index":0}}"#, 1),
            (
                r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0,"texCoord":1}}}"#,
                2,
            ),
            (
                r#"{"extensions":{"X":{"sheenTexture":{"index":0,"texCoord":2}}}}"#,
                3,
            ),
            (
                r#"{"normalTexture":{"index":0,"extensions":{"KHR_texture_transform":{"texCoord":3}}}}"#,
                4,
            ),
            (r#"{"normalTexture":{"index":0,"texCoord":4294967295}}"#, 0),
            (r#"{"extras":{"normalTexture":{"index":0}}}"#, 0),
        ] {
            assert_eq!(n_texcoord_sets(text), n, "{text}");
        }
    }

    #[test]
    fn a_material_is_transparent_when_it_blends_or_transmits() {
        for (text, transparent) in [
            ("{}", false),
            (r#"{"alphaMode":"MASK"}"#, false),
            (r#"{"alphaMode":"BLEND"}"#, true),
            (
                r#"{"extensions":{"KHR_materials_transmission":{"transmissionFactor":0.5}}}"#,
                true,
            ),
            (r#"{"extensions":{"KHR_materials_transmission":{}}}"#, false),
        ] {
            assert_eq!(
                material_of_text(text).unwrap().transparent,
                transparent,
                "{text}"
            );
        }
    }

    #[test]
    fn extensions_are_found_at_any_depth_but_not_in_extras() {
        let mut used = BTreeSet::new();
        let text = r#"{"extensions":{"A_a":{"t":{"extensions":{"B_b":{}}}}},
            "extras":{"extensions":{"no":{}}}}"#;
        add_extensions(&mut used, text);
        assert_eq!(used.into_iter().collect::<Vec<_>>(), ["A_a", "B_b"]);
    }
}
