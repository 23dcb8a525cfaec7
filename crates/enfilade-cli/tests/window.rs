//! `view`, in a window on its own display: keys and clicks as a user would give them.
#![cfg(all(target_os = "linux", feature = "view"))]

mod windowed;

use std::fs;
use std::io::Read;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Instant;

use enfilade::stream::PackedWorld;
use enfilade_cpg::World;
use enfilade_cpg::wire::encode_glb;
use enfilade_testkit::{GridParams, room_grid};
use windowed::{Display, PATIENCE, Viewer, WINDOW, can_open_windows, eyes_along_x, folder};

/// A place in front of a doorway that faces along +x.
fn before_a_doorway(world: &World) -> [f32; 3] {
    let graph = &world.graph;
    let door = graph.portals.iter().find(|p| {
        let heights = || p.outline.iter().map(|c| c[1]);
        let floor = graph[p.cells[0]].aabb[0][1];
        p.normal[0].abs() > 0.99
            && p.cells.iter().all(|c| !graph[*c].outdoor)
            // A person of 1.6 m looks through it.
            && heights().fold(f32::INFINITY, f32::min) < floor + 0.2
            && heights().fold(0.0, f32::max) > floor + 1.7
    });
    let door = door.expect("a doorway along x");
    let n = door.outline.len() as f32;
    let [x, y, z] = [0, 1, 2].map(|k| door.outline.iter().map(|c| c[k]).sum::<f32>() / n);
    [x - 1.2, y + 0.5, z]
}

#[test]
fn a_window_opens_closes_a_door_walks_records_and_walks_again() {
    if !can_open_windows() {
        return;
    }
    let dir = folder("window");
    let world = room_grid(&GridParams::offices(24, 1));
    fs::write(dir.join("world.glb"), encode_glb(&world).unwrap()).unwrap();
    let eye = before_a_doorway(&world).map(|x| x.to_string()).join(",");
    fs::create_dir_all(dir.join("walk.txt")).unwrap();
    let display = Display::open();
    let args = [
        "--eye",
        &eye,
        "--record",
        "walk.txt",
        "--free-mouse",
        "--size",
        "320x240",
    ];
    let mut viewer = Viewer::open(&display, &dir, Some("world.glb"), &args);
    viewer.wait_for_window(&display);
    // F12 goes down while the pointer is at no window, and stays down until the server repeats it: it is not pressed
    // in the window that gets the focus meanwhile.
    assert!(display.tool(&["mousemove", "639", "479", "keydown", "F12"]));
    assert!(display.tool(&[&WINDOW[..], &["windowfocus"]].concat()));
    assert!(display.tool(&["sleep", "1.5", "keyup", "F12"]));
    let key = |name: &str| assert!(display.tool(&["key", name]));
    key("Tab");
    let heard = viewer.hear_until("the mouse is captured");
    assert!(!heard.contains("shot"), "{heard}");
    key("Tab");
    viewer.wait_to_hear("the mouse is free");
    // Without a window manager, the window is at the upper left of the screen.
    let click = || assert!(display.tool(&["mousemove", "160", "120", "click", "1"]));
    // Presses F12; returns the picture and the number of triangles in the last frame. Only the viewer numbers
    // pictures: a busy server may repeat a key, so that there are more than requested.
    let shot = || {
        viewer.heard();
        key("F12");
        let line = viewer.wait_to_hear("wrote shot-");
        let words: Vec<&str> = line.split(' ').collect();
        let file = words.iter().find_map(|w| w.strip_suffix(".png,"));
        let file = file.unwrap_or_else(|| panic!("names no picture: {line}"));
        let n_triangles: u64 = words[words.len() - 2].parse().expect("a number");
        let png = fs::read(dir.join(format!("{file}.png"))).unwrap();
        assert!(png.starts_with(b"\x89PNG"));
        (png, n_triangles)
    };
    // Takes pictures until one draws something and fewer than `most` triangles: a change may appear only after a few
    // frames, and keys may arrive before the first frame, which takes seconds on a busy machine.
    let shot_below = |most: u64| {
        let end = Instant::now() + PATIENCE;
        std::iter::repeat_with(shot)
            .take_while(|_| Instant::now() < end)
            .find(|s| s.1 > 0 && s.1 < most)
    };
    let (open, n_open) = shot_below(u64::MAX).expect("something is drawn");
    click();
    viewer.wait_to_hear("is closed");
    let closed = shot_below(n_open);
    let (closed, _) = closed.unwrap_or_else(|| panic!("{n_open} triangles as before"));
    assert_ne!(open, closed, "a door hides what is behind it");
    click();
    viewer.wait_to_hear("is open");
    // All modes, and small portals spared and not: none of it ends the walk.
    for name in ["m", "m", "m", "m", "l", "l"] {
        key(name);
    }
    // Records a walk. A busy machine may draw no frame while the key is down, so repeat until the recording has
    // moved.
    let walk = dir.join("walk.txt");
    let walked_along_x = || {
        key("F4");
        assert!(display.tool(&["keydown", "w", "sleep", "1.5", "keyup", "w"]));
        key("F5");
        // A folder is in the way: the viewer reports it and keeps the recording.
        viewer.wait_to_hear("cannot write walk.txt");
        fs::remove_dir(&walk).unwrap();
        key("F5");
        viewer.wait_to_hear("wrote walk.txt");
        let eyes = eyes_along_x(&walk);
        eyes.last().zip(eyes.first()).map_or(0.0, |(b, a)| b - a)
    };
    let end = Instant::now() + PATIENCE;
    while walked_along_x() < 0.3 {
        assert!(Instant::now() < end, "it does not walk");
        fs::remove_file(&walk).unwrap();
        fs::create_dir(&walk).unwrap();
    }
    key("Escape");
    assert_eq!(viewer.ends().code(), Some(0));

    // Repeats the walk, and closes at its end by itself.
    let again = Viewer::open(
        &display,
        &dir,
        Some("world.glb"),
        &["--path", "walk.txt", "--size", "320x240"],
    );
    assert_eq!(again.ends().code(), Some(0));

    // The same from pieces, and by foot.
    let packed = PackedWorld::pack(&encode_glb(&world).unwrap()).unwrap();
    fs::write(dir.join("world.enf"), packed.one_file().unwrap()).unwrap();
    let args = ["--path", "walk.txt", "--memory", "64", "--size", "320x240"];
    let again = Viewer::open(&display, &dir, Some("world.enf"), &args);
    assert_eq!(again.ends().code(), Some(0));
    let viewer = Viewer::open(
        &display,
        &dir,
        Some("world.enf"),
        &["--eye", &eye, "--size", "320x240"],
    );
    viewer.wait_to_hear("the mouse is captured");
    assert!(display.tool(&[&WINDOW[..], &["windowfocus"]].concat()));
    key("F12");
    viewer.wait_to_hear("wrote shot-");
    assert!(
        fs::read(dir.join("shot-1.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    key("Escape");
    assert_eq!(viewer.ends().code(), Some(0));
}

#[test]
fn without_a_display_it_says_what_to_do() {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("no-display");
    fs::create_dir_all(&dir).unwrap();
    let world = room_grid(&GridParams::offices(4, 1));
    fs::write(dir.join("world.glb"), encode_glb(&world).unwrap()).unwrap();
    let mut process = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(["view", "world.glb"])
        .current_dir(&dir)
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = String::new();
    let mut stderr = process.stderr.take().unwrap();
    stderr.read_to_string(&mut said).unwrap();
    assert_eq!(process.wait().unwrap().code(), Some(1), "{said}");
    assert!(said.contains("enfilade render"), "{said}");
}
