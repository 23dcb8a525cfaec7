//! Reads the real scenes where they are at hand; passes, and says so, where they are not.

use enfilade_geom::scene::Role;
use enfilade_import::{ImportOptions, import};
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
