//! OBJ's material libraries, converted to glTF materials.
//!
//! MTL describes the shading of the 1990s. Properties with a counterpart in glTF's metallic-roughness model are kept:
//! diffuse and emissive color, opacity, pictures, and the `Pr`/`Pm` extension.

use crate::builder::Builder;
use crate::gltf::read_picture_file;
use crate::soup::shortened;
use crate::{ImportError, files, soup};
use enfilade_geom::scene::{Image, Material, Texture};
use serde_json::{Map, Value, json};
use std::collections::HashMap;

/// Returns a material with nothing but a name.
pub(crate) fn plain(name: &str) -> Material {
    MaterialDraft {
        name: name.to_owned(),
        ..MaterialDraft::default()
    }
    .finish()
}

#[derive(Default)]
struct MaterialDraft {
    name: String,
    color: Option<[f32; 3]>,
    emissive: Option<[f32; 3]>,
    opacity: Option<f32>,
    roughness: Option<f32>,
    metallic: Option<f32>,
    color_texture: Option<u32>,
    opacity_texture: bool,
    normal_texture: Option<u32>,
    emissive_texture: Option<u32>,
}

impl MaterialDraft {
    fn finish(self) -> Material {
        let alpha = self.opacity.unwrap_or(1.0).clamp(0.0, 1.0);
        let [r, g, b] = self.color.unwrap_or([1.0; 3]);
        let base_color = [r, g, b, alpha];
        let mut pbr = Map::new();
        if base_color != [1.0; 4] {
            pbr.insert("baseColorFactor".into(), json!(base_color));
        }
        pbr.insert("metallicFactor".into(), json!(self.metallic.unwrap_or(0.0)));
        if let Some(roughness) = self.roughness {
            pbr.insert("roughnessFactor".into(), json!(roughness));
        }
        let mut fields = Map::new();
        if !self.name.is_empty() {
            fields.insert("name".into(), json!(self.name));
        }
        if let Some(index) = self.color_texture {
            pbr.insert("baseColorTexture".into(), json!({ "index": index }));
        }
        fields.insert("pbrMetallicRoughness".into(), pbr.into());
        if let Some(index) = self.normal_texture {
            fields.insert("normalTexture".into(), json!({ "index": index }));
        }
        if let Some(index) = self.emissive_texture {
            fields.insert("emissiveTexture".into(), json!({ "index": index }));
        }
        if let Some(emissive) = self.emissive {
            fields.insert("emissiveFactor".into(), json!(emissive));
        }
        let transparent = alpha < 1.0 || self.opacity_texture;
        if transparent {
            fields.insert("alphaMode".into(), json!("BLEND"));
        }
        // OBJ does not define back faces: its surfaces are seen from both sides.
        fields.insert("doubleSided".into(), json!(true));
        Material {
            name: self.name,
            gltf: Value::Object(fields).to_string(),
            double_sided: true,
            transparent,
            base_color,
        }
    }
}

/// Reads a library into `library`; notes one that cannot be read.
pub(crate) fn read_library(
    reference: &str,
    number: usize,
    builder: &mut Builder<'_>,
    library: &mut HashMap<String, u32>,
) -> Result<(), ImportError> {
    let place = format!("line {number}");
    let limit = builder
        .limits()
        .max_json_bytes
        .min(builder.limits().max_file_bytes);
    match builder.read_reference(reference, limit) {
        Ok(bytes) => read_materials(&bytes, reference, builder, library),
        Err(problem) => {
            builder.note(place, format!("material library: {problem}; left out"));
            Ok(())
        }
    }
}

/// Reads the text of a library.
pub(crate) fn read_materials(
    bytes: &[u8],
    reference: &str,
    builder: &mut Builder<'_>,
    library: &mut HashMap<String, u32>,
) -> Result<(), ImportError> {
    let mut textures = HashMap::new();
    let mut draft: Option<MaterialDraft> = None;
    let mut close = |draft: Option<MaterialDraft>, builder: &mut Builder<'_>| {
        if let Some(draft) = draft {
            let name = draft.name.clone();
            let material = builder.push_material(draft.finish());
            library.entry(name).or_insert(material);
        }
    };
    for (i, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let line = String::from_utf8_lossy(line.trim_ascii());
        let line = line.split('#').next().unwrap_or("").trim();
        let (word, rest) = line
            .split_once(|c: char| c.is_whitespace())
            .map_or((line, ""), |(word, rest)| (word, rest.trim()));
        if word == "newmtl" {
            close(draft.take(), builder);
            draft = Some(MaterialDraft {
                name: rest.to_owned(),
                ..MaterialDraft::default()
            });
            continue;
        }
        let Some(draft) = &mut draft else {
            continue;
        };
        let place = || format!("{} line {}", shortened(reference), i + 1);
        let mut texture = || read_texture(rest, &place(), builder, &mut textures);
        let numbers = || {
            rest.split_ascii_whitespace()
                .map_while(|w| w.parse::<f32>().ok())
        };
        let number = || numbers().next().filter(|x| x.is_finite());
        let color = || {
            let mut values = numbers().map(|c| soup::srgb_to_linear(c.clamp(0.0, 1.0)));
            let r = values.next().filter(|c| c.is_finite())?;
            // A single number is a gray.
            let g = values.next().unwrap_or(r);
            Some([r, g, values.next().unwrap_or(r)]).filter(|c| c.iter().all(|c| c.is_finite()))
        };
        match word {
            "Kd" => draft.color = color(),
            "Ke" => draft.emissive = color(),
            "d" => {
                // `d -halo x` fades towards the rim; `x` is the opacity that it fades from.
                let rest = rest.strip_prefix("-halo").unwrap_or(rest).trim();
                draft.opacity = rest.parse().ok().filter(|x: &f32| x.is_finite());
            }
            "Tr" => draft.opacity = number().map(|t| 1.0 - t),
            "Pr" => draft.roughness = number().map(|x| x.clamp(0.0, 1.0)),
            "Pm" => draft.metallic = number().map(|x| x.clamp(0.0, 1.0)),
            "map_Kd" => draft.color_texture = texture()?,
            "map_Ke" => draft.emissive_texture = texture()?,
            "norm" => draft.normal_texture = texture()?,
            "map_d" => {
                draft.opacity_texture = true;
                builder.note(
                    place(),
                    "an opacity picture; the material counts as see-through, the picture is left out",
                );
            }
            "map_Bump" | "map_bump" | "bump" => {
                builder.note(
                    place(),
                    "a bump picture; left out, glTF knows normal maps only",
                );
            }
            _ => {}
        }
    }
    close(draft, builder);
    Ok(())
}

/// Returns the texture of a `map_` line; `None`, with a note, if its picture cannot be read.
fn read_texture(
    rest: &str,
    place: &str,
    builder: &mut Builder<'_>,
    textures: &mut HashMap<String, Option<u32>>,
) -> Result<Option<u32>, ImportError> {
    let file = without_options(rest);
    if let Some(&known) = textures.get(file) {
        return Ok(known);
    }
    let plain = || file.rsplit(['/', '\\']).next().unwrap_or(file);
    let bytes = read_picture_file(file, builder).or_else(|problem| {
        // Exporters often write the path on the author's disk.
        read_picture_file(plain(), builder).map_err(|_| problem)
    });
    let texture = match bytes {
        Ok(bytes) => {
            builder.add_read_bytes(bytes.len() as u64);
            builder.charge_image(place, bytes.len() as u64)?;
            let image = builder.push_image(Image {
                name: plain().to_owned(),
                mime: files::sniff_image(&bytes).unwrap_or_default().to_owned(),
                bytes,
            });
            Some(builder.push_texture(Texture {
                image: Some(image),
                sampler: String::new(),
            }))
        }
        Err(problem) => {
            builder.note(place, format!("{problem}; left out"));
            None
        }
    };
    textures.insert(file.to_owned(), texture);
    Ok(texture)
}

/// Returns the file name behind options such as `-s 1 1 1` or `-bm 0.5`; it may contain blanks.
fn without_options(rest: &str) -> &str {
    let mut rest = rest.trim();
    while rest.starts_with('-') {
        let (option, mut tail) = rest
            .split_once(char::is_whitespace)
            .map_or((rest, ""), |(o, t)| (o, t.trim_start()));
        let n_most = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            "-blendu" | "-blendv" | "-boost" | "-texres" | "-clamp" | "-bm" | "-imfchan"
            | "-type" | "-cc" => 1,
            _ => break,
        };
        let takes_words = matches!(option, "-imfchan" | "-type" | "-blendu" | "-blendv")
            || matches!(option, "-clamp" | "-cc");
        for _ in 0..n_most {
            let (word, after) = tail
                .split_once(char::is_whitespace)
                .map_or((tail, ""), |(w, t)| (w, t.trim_start()));
            if !takes_words && word.parse::<f32>().is_err() {
                break;
            }
            tail = after;
        }
        rest = tail;
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImportOptions;

    #[test]
    fn options_before_a_picture_are_skipped() {
        assert_eq!(without_options("a b.png"), "a b.png");
        assert_eq!(without_options("-s 1 2 3 -bm 0.5 a.png"), "a.png");
        assert_eq!(without_options("-o 1 a.png"), "a.png");
        assert_eq!(without_options("-clamp on a.png"), "a.png");
        assert_eq!(without_options("-dash.png"), "-dash.png");
        assert_eq!(without_options("-s"), "");
    }

    #[test]
    fn a_material_keeps_color_opacity_and_name() {
        let options = ImportOptions::default();
        let mut builder = Builder::new(&options).unwrap();
        let mut library = HashMap::new();
        let text = b"newmtl a\nKd 1 0 0\nd 0.5\nnewmtl b\nKe 1\nmap_Kd x.png\nTr 0\nKd nan";
        read_materials(text, "x.mtl", &mut builder, &mut library).unwrap();
        let a = builder.material(library["a"]).unwrap();
        assert_eq!(a.base_color, [1.0, 0.0, 0.0, 0.5]);
        assert!(a.transparent && a.gltf.contains("BLEND"), "{}", a.gltf);
        let b = builder.material(library["b"]).unwrap();
        assert!(
            !b.transparent && b.gltf.contains("emissiveFactor"),
            "{}",
            b.gltf
        );
        assert_eq!(builder.report.notes.len(), 1, "the picture is missing");
    }
}
