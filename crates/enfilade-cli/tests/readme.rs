//! Runs the README's program on the demo's world, and compares its features with those of the library.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

thread_local! {
    /// Lines that the program prints.
    static PRINTED: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// Takes the place of the usual one in the program.
macro_rules! println {
    ($($text:tt)*) => {
        crate::PRINTED.with_borrow_mut(|lines| lines.push(format!($($text)*)))
    };
}

#[path = "../../enfilade/examples/first_walk.rs"]
mod first_walk;

const README: &str = include_str!("../../../README.md");
const PROGRAM: &str = include_str!("../../enfilade/examples/first_walk.rs");
const MANIFEST: &str = include_str!("../../enfilade/Cargo.toml");

#[test]
fn the_program_of_the_readme_meets_an_object_and_a_door_of_the_demo() {
    let (_, shown) = README.split_once("```rust,no_run\n").unwrap();
    let (shown, _) = shown.split_once("```").unwrap();
    let (_, run) = PROGRAM
        .split_once("#![allow(clippy::print_stdout)]\n\n")
        .unwrap();
    assert_eq!(run.replace("pub(crate) fn main", "fn main"), shown);

    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("readme");
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    let mut demo = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    let made = demo.args(["demo", "--quiet"]).current_dir(&dir).output();
    assert!(made.unwrap().status.success());
    // The program opens `world.glb`; no other test of this file needs a folder.
    std::env::set_current_dir(&dir).unwrap();
    first_walk::main().unwrap();
    let lines = PRINTED.take();
    let frame_of = |what: &str| lines.iter().position(|line| line.ends_with(what));
    assert!(frame_of(": kitchen cabinet").is_some(), "{lines:?}");
    assert!(frame_of(", which opens").is_some(), "{lines:?}");
    assert!(lines.len() <= 120);
}

#[test]
fn the_readme_lists_the_features_of_the_library() {
    let (_, listed) = README.split_once("# features: ").unwrap();
    let listed: BTreeSet<&str> = listed.lines().next().unwrap().split(", ").collect();
    let (_, features) = MANIFEST.split_once("\n[features]\n").unwrap();
    let (features, _) = features.split_once("\n[").unwrap_or((features, ""));
    let names = features.lines().filter_map(|line| line.split_once(" = "));
    let known: BTreeSet<&str> = names
        .map(|n| n.0)
        .filter(|n| !n.starts_with(['#', ' ']))
        .collect();
    assert_eq!(
        listed,
        known.into_iter().filter(|n| *n != "default").collect()
    );
}
