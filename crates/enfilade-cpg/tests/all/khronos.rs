//! The Khronos validator finds no error in our files.
//!
//! Needs node and the npm package `gltf-validator`, found from the project's root or `NODE_PATH`; without them,
//! prints that and passes.

use crate::common;

use std::path::{Path, PathBuf};
use std::process::Command;

use common::{nasty_rooms, two_rooms, two_rooms_with_specials};
use enfilade_cpg::World;
use enfilade_cpg::wire::encode_glb;

fn validate(name: &str, world: &World, strict: bool) {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, encode_glb(world).unwrap()).unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut node = Command::new("node");
    node.current_dir(root)
        .arg("scripts/validate_gltf.mjs")
        .arg(&path);
    if strict {
        node.arg("--strict");
    }
    match node.output() {
        Ok(done) if done.status.code() == Some(0) => {}
        Ok(done) if done.status.code() == Some(2) => {
            eprintln!("SKIPPED: {}", String::from_utf8_lossy(&done.stderr));
        }
        Ok(done) => panic!("{}", String::from_utf8_lossy(&done.stdout)),
        Err(why) => eprintln!("SKIPPED: cannot run node: {why}"),
    }
}

#[test]
fn the_validator_finds_nothing_in_two_rooms() {
    validate("two_rooms.glb", &two_rooms(), true);
}

#[test]
fn the_validator_finds_nothing_in_a_leak_path() {
    let world = World {
        leak_path: vec![[0.0, 1.0, 2.0], [1.0, 1.0, 2.0], [9.0, 1.0, 2.5]],
        ..two_rooms()
    };
    validate("leak.glb", &world, true);
}

#[test]
fn the_validator_finds_nothing_in_special_portals() {
    validate("specials.glb", &two_rooms_with_specials(), true);
}

#[test]
fn the_validator_finds_nothing_in_an_empty_world() {
    validate("empty.glb", &World::default(), true);
}

#[test]
fn the_validator_finds_no_error_in_what_was_mended() {
    validate("nasty.glb", &nasty_rooms(), false);
}
