//! A decimation reviewed in the window: steps and decisions with keys as a user would press them.
#![cfg(all(target_os = "linux", feature = "view"))]

mod windowed;

use std::fs;
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use enfilade::import::export_glb;
use enfilade_cpg::wire::decode_glb;
use enfilade_testkit::{Variant, gjorup_rooms};
use windowed::{Display, PATIENCE, Viewer, WINDOW, can_open_windows, folder};

/// The number before some words in a line.
fn number_before(line: &str, words: &str) -> usize {
    let before = line.split(words).next().unwrap_or_default();
    let number = before.split_whitespace().last().unwrap_or_default();
    number.parse().unwrap_or_else(|_| panic!("{line}"))
}

// Covers T5.
#[test]
fn without_a_display_the_window_says_how_to_review_in_text() {
    let dir = folder("window-decimate-none");
    let scene = gjorup_rooms(Variant::Optimised, [0.0; 3]).scene;
    fs::write(dir.join("scene.glb"), export_glb(&scene)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    let nowhere = command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let args = ["decimate", "scene.glb", "--window"];
    let output = nowhere.args(args).current_dir(&dir).output().unwrap();
    let says = String::from_utf8_lossy(&output.stderr);
    assert!(says.contains("`enfilade decimate --steps`"), "{says}");
    assert_eq!(output.status.code(), Some(1));
}

// Covers T5.
#[test]
fn steps_are_taken_a_portal_kept_one_joined_undone_saved_and_baked_as_seen() {
    if !can_open_windows() {
        return;
    }
    let dir = folder("window-decimate");
    let scene = gjorup_rooms(Variant::Optimised, [0.0; 3]).scene;
    fs::write(dir.join("scene.glb"), export_glb(&scene)).unwrap();
    let display = Display::without_repeats();
    let fixed = ["--window", "--free-mouse", "--size", "640x480"];
    let files = ["-o", "seen.glb", "--screenshot", "shot.png"];
    let args = [&fixed[..], &files].concat();
    let mut viewer = Viewer::of(&display, &dir, &["decimate", "scene.glb"], &args);
    viewer.wait_for_window(&display);
    let greeting = viewer.wait_to_hear("cells left indoors");
    let rooms = |line: &str| number_before(line, " cells left indoors");
    let step = |line: &str| number_before(line, " of ");
    assert_eq!(rooms(&greeting), 4, "{greeting}");
    let stop = step(&greeting);
    // A window that was just opened may not have the keys yet.
    let end = Instant::now() + PATIENCE;
    let focus = [&WINDOW[..], &["windowfocus"]].concat();
    loop {
        assert!(Instant::now() < end && display.tool(&focus));
        assert!(display.tool(&["key", "y"]));
        sleep(Duration::from_secs(1));
        let heard = viewer.heard();
        if heard.iter().any(|line| line.contains("nothing to redo")) {
            break;
        }
    }
    let press = |key: &str, words: &str| {
        assert!(display.tool(&["key", key]));
        viewer.wait_to_hear(words)
    };
    // Forwards and back, by one step and by many.
    let line = press("n", "cells left indoors");
    assert_eq!((step(&line), rooms(&line)), (stop + 1, 3), "{line}");
    let line = press("b", "cells left indoors");
    assert_eq!((step(&line), rooms(&line)), (stop, 4), "{line}");
    assert_eq!(step(&press("Home", "cells left indoors")), 0);
    assert_eq!(step(&press("Next", "cells left indoors")), 10);
    assert_eq!(step(&press("Prior", "cells left indoors")), 0);
    let line = press("End", "cells left indoors");
    assert!(step(&line) > stop && rooms(&line) < 4, "{line}");
    assert_eq!(step(&press("g", "cells left indoors")), stop);

    // The window begins before the portal of the next step, which the crosshair is at.
    assert!(display.tool(&["mousemove", "320", "240"]));
    sleep(Duration::from_secs(1));
    let there = press("shift+k", "keeps the portal at ");
    let kept = press("z", "undone: keeps the portal at ");
    let place = |line: &str| {
        let after = line.split("the portal at ").nth(1).unwrap_or_default();
        after.split(';').next().unwrap_or_default().to_owned()
    };
    assert_eq!(place(&there), place(&kept));
    let next = press("k", "keeps the portal at ");
    assert_eq!(place(&next), place(&there), "the crosshair is at the next");
    assert_eq!(rooms(&next), 4);
    // The one after it is joined; undone; and made again.
    let joined = press("j", "joins the portal at ");
    assert_ne!(place(&joined), place(&next));
    assert_eq!(rooms(&joined), 3, "{joined}");
    assert_eq!(rooms(&press("z", "undone: joins")), 4);
    assert_eq!(rooms(&press("y", "made again: joins")), 3);
    press("F12", "wrote shot-1.png");
    press("F2", "wrote choices.toml");
    let seen = press("F3", "wrote seen.glb");
    assert_eq!(number_before(&seen, " cells indoors"), 3, "{seen}");
    press("x", "the scene");
    press("x", "the rooms baked last");
    assert!(display.tool(&["key", "Escape"]));
    viewer.wait_to_hear("steps and decisions took ");
    assert_eq!(viewer.ends().code(), Some(0));

    let read = |name: &str| decode_glb(&fs::read(dir.join(name)).unwrap()).unwrap();
    let text = fs::read_to_string(dir.join("choices.toml")).unwrap();
    assert_eq!(text.matches("  [").count(), 2, "{text}");
    let mut bake = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    let args = "bake scene.glb --method delaunay --choices choices.toml -o baked.glb --quiet";
    let output = bake
        .args(args.split(' '))
        .current_dir(&dir)
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let [seen, baked] = ["seen.glb", "baked.glb"].map(read);
    assert_eq!(seen.graph.cells, baked.graph.cells);
    assert_eq!(seen.graph.portals, baked.graph.portals);
    assert_eq!(baked.graph.indoor_cells().count(), 3);
}
