//! `enfilade portals`: portal textures made ahead by the command. Covers X2.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use enfilade::cpg::World;
use enfilade::cpg::wire::decode_glb;
use enfilade::world::PartId;
use enfilade_render::{AdapterChoice, Gpu, PortalTextureOptions, Studio, lamp_lights};
use enfilade_testkit::{GridParams, room_grid};
use serde_json::Value;

/// A folder of one test, with a world of rooms.
fn folder(name: &str, rooms: &GridParams) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("portals-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    enfilade::save(dir.join("w.glb"), &room_grid(rooms)).unwrap();
    dir
}

/// Runs `enfilade portals`; returns the exit code, the output, and the messages.
fn portals(dir: &Path, args: &str) -> (Option<i32>, String, String) {
    let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(["portals", "w.glb", "--adapter", "software"])
        .args(args.split_whitespace())
        .current_dir(dir)
        .env("NODEVICE_SELECT", "1")
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (done.status.code(), text(&done.stdout), text(&done.stderr))
}

fn studio(world: &World) -> Studio {
    let gpu = Gpu::open(&AdapterChoice::Software).unwrap();
    let mut studio = Studio::new(gpu, world).unwrap();
    let options = PortalTextureOptions::default();
    studio.add_portal_textures(options).unwrap();
    studio
}

#[test]
fn a_file_keeps_to_its_budget_and_is_loaded_for_its_world_and_light() {
    let dir = folder("budget", &GridParams::offices(5, 3));
    let (code, printed, said) = portals(&dir, "--max-bytes 200K -o w.ptx --json");
    assert_eq!(code, Some(0), "{said}");
    let report: Value = serde_json::from_str(&printed).unwrap();
    let file = fs::read(dir.join("w.ptx")).unwrap();
    assert!(file.len() <= 200 << 10);
    assert_eq!(report["bytes"].as_u64(), Some(file.len() as u64));
    let n = report["textures"].as_u64().unwrap();
    assert!(
        n > 5 && report["left_out"].as_u64().unwrap() > 0,
        "{report}"
    );
    let world = decode_glb(&fs::read(dir.join("w.glb")).unwrap()).unwrap();
    let mut own = studio(&world);
    let refused = own.load_portal_textures(&file).unwrap_err();
    assert!(refused.to_string().contains("daylight"), "{refused}");
    own.add_light(&world).unwrap();
    own.set_lamps(lamp_lights(&world, PartId::ROOT)).unwrap();
    assert_eq!(own.load_portal_textures(&file).unwrap() as u64, n);
    // Without light for views without light, and with the report for people.
    let (code, printed, said) = portals(&dir, "--max-bytes 200K --plain -o w.ptx");
    assert_eq!(code, Some(0), "{said}");
    for words in ["textures of", "left out", "wrote w.ptx"] {
        assert!(printed.contains(words), "{words}: {printed}");
    }
    let file = fs::read(dir.join("w.ptx")).unwrap();
    assert!(studio(&world).load_portal_textures(&file).unwrap() > 5);
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn budgets_without_room_and_bad_places_are_refused() {
    let dir = folder("refused", &GridParams::offices(5, 3));
    for (args, code, says) in [
        ("--max-bytes 0 -o w.ptx", 2, "an amount of memory"),
        ("--max-bytes 1B -o w.ptx", 1, "raise the budget"),
        ("--side 8 -o w.ptx", 2, "16..=1024"),
        ("-o w.glb", 1, "is the input"),
        ("-o w.png", 1, ".ptx fits"),
        ("-o none/w.ptx", 1, "there is no folder none"),
    ] {
        let (found, _, said) = portals(&dir, args);
        assert_eq!(found, Some(code), "{args}: {said}");
        assert!(said.contains(says), "{args}: {said}");
        assert!(!dir.join("w.ptx").exists());
    }
    // A full disk.
    #[cfg(target_os = "linux")]
    {
        let (found, _, said) = portals(&dir, "--max-bytes 20K --plain -o /dev/full");
        assert_eq!(found, Some(1), "{said}");
        assert!(said.contains("free space there"), "{said}");
    }
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn a_world_without_portals_gets_a_file_without_textures_and_a_warning() {
    let closed = GridParams {
        doors: 0.0,
        windows: 0.0,
        holes: 0.0,
        outdoors: false,
        ..GridParams::offices(1, 3)
    };
    let dir = folder("none", &closed);
    let path = dir.join("w.glb");
    let world = decode_glb(&fs::read(&path).unwrap()).unwrap();
    assert!(world.graph.portals.is_empty(), "one room");
    let (code, printed, said) = portals(&dir, "-o w.ptx");
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("without textures: the world has no portals"),
        "{said}"
    );
    assert!(printed.contains("0 textures"), "{printed}");
    let file = fs::read(dir.join("w.ptx")).unwrap();
    let mut own = studio(&world);
    own.add_light(&world).unwrap();
    assert_eq!(own.load_portal_textures(&file).unwrap(), 0);
    fs::remove_dir_all(&dir).unwrap();
}
