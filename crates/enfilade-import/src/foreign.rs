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

const FOREIGN: [Foreign; 20] = [
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
    Foreign {
        name: "a level of Doom (WAD)",
        magic: &[b"IWAD", b"PWAD"],
        endings: &["wad"],
        advice: "open the level in Ultimate Doom Builder, and File > Export > Wavefront .obj",
    },
    Foreign {
        name: "textures of Quake or Half-Life (WAD)",
        magic: &[b"WAD2", b"WAD3"],
        endings: &[],
        advice: "give the level, its .map",
    },
    Foreign {
        name: "an archive of a game",
        magic: &[b"PACK"],
        endings: &["pk3", "pk4", "pak"],
        advice: "unpack it, e.g. unzip {in}, and give a .map of its folder maps",
    },
    Foreign {
        name: "a level of the Unreal Engine",
        magic: &[b"\xC1\x83\x2A\x9E", b"Begin Map"],
        endings: &["umap", "uasset", "t3d"],
        advice: "in the Unreal Editor, with the plugin glTF Exporter: File > Export All, as .glb",
    },
    Foreign {
        name: "a scene of Godot",
        magic: &[b"[gd_scene"],
        endings: &["tscn", "escn"],
        advice: "in Godot: Scene > Export As > glTF 2.0 Scene",
    },
    Foreign {
        name: "a scene of Unity",
        magic: &[b"%YAML 1.1\n%TAG !u!", b"%YAML 1.1\r\n%TAG !u!"],
        endings: &["unity", "prefab"],
        advice: "in Unity, with the package glTFast: File > Export Scene > glTF-Binary (glb)",
    },
    Foreign {
        name: "a build of Minecraft",
        magic: &[],
        endings: &["schem", "schematic", "litematic"],
        advice: "export it as OBJ, e.g. with Mineways",
    },
    Foreign {
        name: "a model of SketchUp",
        magic: &[b"\xFF\xFE\xFF\x0E"],
        endings: &["skp"],
        advice: "in SketchUp: File > Export > 3D Model, as .glb",
    },
    Foreign {
        name: "a model of Revit",
        magic: &[],
        endings: &["rvt", "rfa"],
        advice: "in Revit: File > Export > IFC",
    },
    Foreign {
        name: "a model of Rhino",
        magic: &[b"3D Geometry File Format"],
        endings: &["3dm"],
        advice: "in Rhino: File > Export Selected, as .glb",
    },
    Foreign {
        name: "an energy model",
        magic: &[],
        endings: &["gbxml", "hbjson"],
        advice: "it is neither HBJSON nor gbXML that can be read here: export it again, or its geometry as IFC or OBJ",
    },
];

/// Returns the error for a known format that is not supported, by its first bytes alone, whatever it is called.
pub(crate) fn unsupported_bytes(bytes: &[u8], path: &Path) -> Option<ImportError> {
    FOREIGN.iter().find(|f| f.has(bytes)).map(|f| f.error(path))
}

/// Returns the error for a known format that is not supported. Its bytes take precedence over its name.
pub(crate) fn unsupported(bytes: &[u8], path: &Path) -> Option<ImportError> {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    let is_of = |f: &&Foreign| f.endings.iter().any(|e| ending.eq_ignore_ascii_case(e));
    let by_name = || FOREIGN.iter().find(is_of).map(|f| f.error(path));
    unsupported_bytes(bytes, path).or_else(by_name)
}

impl Foreign {
    fn has(&self, bytes: &[u8]) -> bool {
        self.magic.iter().any(|m| bytes.starts_with(m))
    }

    fn error(&self, path: &Path) -> ImportError {
        let input = path.display().to_string();
        let output = path.with_extension("").display().to_string();
        ImportError::Unsupported {
            path: path.to_path_buf(),
            feature: self.name.into(),
            advice: self
                .advice
                .replace("{out}", &output)
                .replace("{in}", &input),
        }
    }
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
            (b"PWAD\x01", "a.txt", "Doom", "Wavefront .obj"),
            (b"WAD3", "a.wad", "Half-Life", ".map"),
            (b"PK\x03\x04", "a.pk3", "archive", "unzip a.pk3"),
            (b"\xC1\x83\x2A\x9E", "a.umap", "Unreal", "glTF Exporter"),
            (b"[gd_scene load_steps=2", "a.txt", "Godot", "Export As"),
            (b"%YAML 1.1\n%TAG !u! tag", "a.txt", "Unity", "glTFast"),
            (b"\x1f\x8b", "a.schem", "Minecraft", "Mineways"),
            (b"[", "a.hbjson", "energy model", "IFC or OBJ"),
        ] {
            let error = unsupported(bytes, Path::new(path)).unwrap().to_string();
            assert!(error.contains(name) && error.contains(command), "{error}");
        }
        assert!(unsupported(b"o cube", Path::new("a.txt")).is_none());
    }
}
