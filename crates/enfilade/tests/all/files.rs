//! Worlds opened and saved by path.

use std::error::Error;
use std::path::PathBuf;

use enfilade::{FileError, whole};
use enfilade_testkit::{GridParams, room_grid};

fn folder(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("enfilade-files-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&path).unwrap();
    path
}

#[test]
fn saved_worlds_open_again_and_leave_no_other_file() {
    let folder = folder("saved");
    let path = folder.join("world.glb");
    let mut world = room_grid(&GridParams::offices(12, 1));
    // A leftover of a run killed while saving.
    std::fs::write(folder.join(".world.glb.4000000-1.tmp"), "half").unwrap();
    enfilade::save(&path, &world).unwrap();
    assert_eq!(enfilade::open(&path).unwrap().graph, world.graph);
    // A broken world is refused, and the file stays unchanged.
    let before = std::fs::read(&path).unwrap();
    world.graph.portals[0].cells[0] = enfilade::CellId(99);
    assert!(matches!(
        enfilade::save(&path, &world),
        Err(FileError::World { .. })
    ));
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn errors_name_the_file() {
    let folder = folder("errors");
    let path = folder.join("scene.glb");
    let missing = enfilade::open(&path).unwrap_err();
    assert!(matches!(missing, FileError::Read { .. }));
    assert!(missing.to_string().contains("scene.glb"), "{missing}");
    assert!(missing.source().is_some());
    std::fs::write(&path, b"no world").unwrap();
    let broken = enfilade::open(&path).unwrap_err();
    assert!(matches!(broken, FileError::World { .. }));
    assert!(broken.to_string().contains("scene.glb"), "{broken}");
    let world = room_grid(&GridParams::offices(2, 1));
    let nowhere = enfilade::save(path.join("world.glb"), &world).unwrap_err();
    assert!(matches!(nowhere, FileError::Write { .. }), "{nowhere}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn threads_that_write_to_one_path_leave_one_whole_file() {
    let folder = folder("threads");
    let path = folder.join("w.glb");
    std::thread::scope(|scope| {
        for byte in 0..8_u8 {
            let path = &path;
            scope.spawn(move || {
                for _ in 0..20 {
                    whole::remove_left(&[path]);
                    whole::write(path, &[byte; 50_000]).unwrap();
                }
            });
        }
    });
    let bytes = std::fs::read(&path).unwrap();
    assert!(bytes.len() == 50_000 && bytes.iter().all(|b| *b == bytes[0]));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    std::fs::remove_dir_all(&folder).unwrap();
}
