//! File names in a scene: no file outside its folder is read.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use enfilade_import::{ImportOptions, Limits, import};

/// Returns a folder of this process.
pub(crate) fn folder() -> PathBuf {
    let folder = std::env::temp_dir().join(format!("enfilade-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for files");
    folder
}

/// A coordinate that only the file outside contains.
const SECRET: f32 = 54.25;

/// The folder of the scene, beside which there is a file that it must not read.
static SCENE: LazyLock<PathBuf> = LazyLock::new(|| {
    let outside = folder();
    let scene = outside.join("scene");
    std::fs::create_dir_all(scene.join("sub")).expect("a folder");
    let bytes = |x: f32| x.to_le_bytes().repeat(9);
    for (path, x) in [
        (outside.join("a.bin"), SECRET),
        (scene.join("a.bin"), 1.0),
        (scene.join("sub/a.bin"), 2.0),
    ] {
        std::fs::write(path, bytes(x)).expect("a file");
    }
    std::fs::write(outside.join("a.mtl"), "newmtl secret\n").expect("a file");
    #[cfg(unix)]
    {
        let _ = std::os::unix::fs::symlink(outside.join("a.bin"), scene.join("link.bin"));
        let _ = std::os::unix::fs::symlink(&outside, scene.join("up"));
    }
    scene
});

/// A glTF scene with any names of its buffer and image, and an OBJ scene with any name of its library.
pub fn files(data: &[u8]) {
    let Ok(name) = std::str::from_utf8(data) else {
        return;
    };
    let quoted: String = name
        .chars()
        .map(|c| format!("\\u{:04x}", c as u32))
        .collect();
    // Characters beyond four digits have another form in JSON.
    if name.chars().all(|c| (c as u32) < 0xd800) {
        let gltf = format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"buffers":[{{"byteLength":36,"uri":"{quoted}"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],"images":[{{"uri":"{quoted}"}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}]}}"#
        );
        check("scene.gltf", &gltf);
    }
    check(
        "scene.obj",
        &format!("mtllib {name}\nusemtl secret\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    );
}

fn check(file: &str, text: &str) {
    let path = SCENE.join(file);
    std::fs::write(&path, text).expect("a file");
    let limits = Limits {
        min_extent: 0.0,
        ..Limits::tiny()
    };
    let options = ImportOptions {
        limits,
        ..ImportOptions::default()
    };
    let Ok(imported) = import(&[path], &[], &options) else {
        return;
    };
    let inside = SCENE.canonicalize().expect("a folder");
    for reference in &imported.report.references {
        let is_inside = reference
            .canonicalize()
            .is_ok_and(|path| path.starts_with(&inside));
        assert!(
            is_inside || is_made_up(reference),
            "{} was read",
            reference.display()
        );
    }
    let meshes = imported.scene.meshes.iter().flat_map(|m| &m.primitives);
    for position in meshes.flat_map(|p| &p.positions) {
        assert!(!position.contains(&SECRET), "a buffer outside was read");
    }
}

/// Returns `true` for a name that belongs to no file.
fn is_made_up(path: &Path) -> bool {
    !path.exists()
}
