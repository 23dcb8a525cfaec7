//! Reads the real scenes where they are available; otherwise prints a message and passes.

use enfilade_geom::scene::{Role, Scene};
use enfilade_import::{ImportOptions, decode_gltf, decode_map, decode_obj, export_glb, import};
use enfilade_testkit::{shuffled_glb, shuffled_map, shuffled_obj};
use std::path::{Path, PathBuf};

fn scenes_folder() -> PathBuf {
    std::env::var_os("ENFILADE_SCENES").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes"),
        PathBuf::from,
    )
}

#[test]
fn every_real_scene_loads() {
    let Ok(entries) = std::fs::read_dir(scenes_folder()) else {
        eprintln!("no scenes at {}; nothing tested", scenes_folder().display());
        return;
    };
    for entry in entries.flatten() {
        let scene = entry.path().join("scene.glb");
        let detail = entry.path().join("detail.glb");
        if !scene.exists() {
            continue;
        }
        let details = if detail.exists() {
            vec![detail]
        } else {
            vec![]
        };
        let imported = import(
            std::slice::from_ref(&scene),
            &details,
            &ImportOptions::default(),
        );
        let imported = imported.unwrap_or_else(|e| panic!("{e}"));
        let n = |role| imported.scene.triangle_sources(role).count();
        let (n_structural, n_detail) = (n(Role::Structural), n(Role::Detail));
        eprintln!(
            "{}: {n_structural} + {n_detail}\n{}",
            scene.display(),
            imported.report
        );
        for object in imported
            .scene
            .objects
            .iter()
            .filter(|o| o.role == Role::Detail)
        {
            if object.reason != "from a detail file" {
                eprintln!("  {} {}", object.name, object.reason);
            }
        }
        assert!(n_structural > 0, "{}", scene.display());
        assert!(details.is_empty() || n_detail > 0, "{}", scene.display());
    }
}

/// Reads the scene of a file with this ending, unchanged and shuffled.
fn plain_and_shuffled(ending: &str, bytes: &[u8], seed: u64) -> Option<[Scene; 2]> {
    let options = ImportOptions::default();
    let text = String::from_utf8_lossy(bytes);
    let read = match ending {
        "glb" => [bytes.to_vec(), shuffled_glb(bytes, seed)].map(|b| decode_gltf(&b, &options)),
        "obj" => [text.clone().into_owned(), shuffled_obj(&text, seed)]
            .map(|t| decode_obj(t.as_bytes(), &options)),
        "map" => [text.clone().into_owned(), shuffled_map(&text, seed)]
            .map(|t| decode_map(t.as_bytes(), &options)),
        _ => return None,
    };
    Some(read.map(|r| r.unwrap_or_else(|e| panic!("{e}")).scene))
}

#[test]
fn every_real_scene_is_the_same_in_another_order() {
    /// Larger files take minutes in the gate's build; `cargo xtask bench trust --rows order` reads them. [Units:
    /// bytes]
    const LARGEST: u64 = 1 << 20;
    let folders = std::fs::read_dir(scenes_folder()).into_iter().flatten();
    let files = folders.flatten().filter_map(|f| f.path().read_dir().ok());
    for file in files.flatten().flatten().map(|f| f.path()) {
        let ending = file.extension().unwrap_or_default().to_string_lossy();
        if file.metadata().is_ok_and(|m| m.len() > LARGEST) {
            continue;
        }
        let bytes = std::fs::read(&file).unwrap();
        let Some([plain, shuffled]) = plain_and_shuffled(&ending, &bytes, 1) else {
            continue;
        };
        let told = |s: &Scene| {
            let named = format!("{:?} {:?} {:?}", s.objects, s.nodes, s.fixtures);
            (
                named,
                format!("{:?} {:?}", s.solids, s.entities),
                export_glb(s),
            )
        };
        assert!(told(&plain) == told(&shuffled), "{}", file.display());
    }
}
