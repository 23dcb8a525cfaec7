//! Unsupported formats: detection, and the command that converts each to a supported one.

use std::path::Path;

use crate::ImportError;

/// A format, detected by its first bytes or, where they are ambiguous, by the ending of its name.
struct Foreign {
    name: &'static str,
    magic: &'static [&'static [u8]],
    endings: &'static [&'static str],
    /// The remedy; `{in}` stands for the file, `{out}` for its path without the ending.
    advice: &'static str,
}

const FOREIGN: [Foreign; 9] = [
    Foreign {
        name: "FBX",
        magic: &[b"Kaydara FBX Binary", b"; FBX"],
        endings: &["fbx"],
        advice: "convert it: FBX2glTF --binary --input {in} --output {out}.glb",
    },
    Foreign {
        name: "USD",
        magic: &[b"PXR-USDC", b"#usda"],
        endings: &["usd", "usda", "usdc", "usdz"],
        advice: "convert it: blender -b --python-expr \"import bpy; bpy.ops.wm.read_homefile(use_empty=True); \
                 bpy.ops.wm.usd_import(filepath='{in}'); bpy.ops.export_scene.gltf(filepath='{out}.glb')\"",
    },
    Foreign {
        name: "COLLADA",
        magic: &[],
        endings: &["dae"],
        advice: "convert it: assimp export {in} {out}.glb -fglb2",
    },
    Foreign {
        name: "3MF",
        magic: &[],
        endings: &["3mf"],
        advice: "convert it: assimp export {in} {out}.glb -fglb2",
    },
    Foreign {
        name: "3DS",
        magic: &[],
        endings: &["3ds"],
        advice: "convert it: assimp export {in} {out}.glb -fglb2",
    },
    Foreign {
        name: "a compiled map of Quake 3",
        magic: &[b"IBSP"],
        endings: &[],
        advice: "give its .map, or convert it: q3map2 -convert -format map {in}",
    },
    Foreign {
        name: "a compiled map (BSP)",
        magic: &[b"VBSP", b"BSP2"],
        endings: &["bsp"],
        advice: "give its .map, or convert it: bsputil --decompile {in}",
    },
    Foreign {
        name: "DWG",
        magic: &[b"AC10"],
        endings: &["dwg", "dxf"],
        advice: "export it from the CAD program as IFC, or its solids as STL (in AutoCAD: STLOUT)",
    },
    Foreign {
        name: "a Blender file",
        magic: &[b"BLENDER"],
        endings: &["blend"],
        advice: "convert it: blender -b {in} --python-expr \"import bpy; bpy.ops.export_scene.gltf(filepath='{out}.glb')\"",
    },
];

/// Returns the error for a known format that is not supported.
pub(crate) fn unsupported(bytes: &[u8], path: &Path) -> Option<ImportError> {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    let is_of = |f: &&Foreign| {
        f.magic.iter().any(|m| bytes.starts_with(m))
            || f.endings.iter().any(|e| ending.eq_ignore_ascii_case(e))
    };
    // Unambiguous bytes take precedence over the name.
    let by_magic = |f: &&Foreign| f.magic.iter().any(|m| bytes.starts_with(m));
    let found = FOREIGN.iter().find(by_magic);
    let found = found.or_else(|| FOREIGN.iter().find(is_of))?;
    let input = path.display().to_string();
    let output = path.with_extension("").display().to_string();
    Some(ImportError::Unsupported {
        path: path.to_path_buf(),
        feature: found.name.into(),
        advice: found
            .advice
            .replace("{out}", &output)
            .replace("{in}", &input),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_format_names_its_command_with_its_files() {
        for (bytes, path, name, command) in [
            (
                &b"Kaydara FBX Binary  \0"[..],
                "a.bin",
                "FBX",
                "--input a.bin --output a.glb",
            ),
            (b"", "my/a.FBX", "FBX", "--input my/a.FBX --output my/a.glb"),
            (
                b"#usda 1.0",
                "a.usda",
                "USD",
                "usd_import(filepath='a.usda')",
            ),
            (b"<?xml", "a.dae", "COLLADA", "assimp export a.dae a.glb"),
            (b"PK\x03\x04", "a.3mf", "3MF", "assimp export a.3mf a.glb"),
            (b"MM", "a.3ds", "3DS", "assimp export a.3ds a.glb"),
            (
                b"IBSP\x2e",
                "a.bsp",
                "Quake 3",
                "q3map2 -convert -format map a.bsp",
            ),
            (b"\x1d\0\0\0", "a.bsp", "BSP", "bsputil --decompile a.bsp"),
            (b"AC1032", "a.dwg", "DWG", "STLOUT"),
            (b"BLENDER", "a.blend", "Blender", "blender -b a.blend"),
        ] {
            let error = unsupported(bytes, Path::new(path)).unwrap().to_string();
            assert!(error.contains(name) && error.contains(command), "{error}");
        }
        assert!(unsupported(b"o cube", Path::new("a.txt")).is_none());
    }
}
