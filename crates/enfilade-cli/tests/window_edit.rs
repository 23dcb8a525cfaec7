//! Editing in the window of `view`: a level is built with keys and clicks as a user would give them, killed, gone on with, saved and
//! walked through. Covers W14 and P4.
#![cfg(all(target_os = "linux", feature = "view"))]

mod windowed;

use std::fs;
use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use enfilade_cpg::PortalKind;
use enfilade_cpg::wire::decode_glb;
use windowed::{Display, PATIENCE, Viewer, WINDOW, can_open_windows, eyes_along_x, folder};

/// The window, and the hand that acts in it.
struct Hand<'a> {
    display: &'a Display,
    viewer: Viewer,
}

impl<'a> Hand<'a> {
    /// Opens the window, and waits until it greets and answers a key.
    fn open(display: &'a Display, dir: &Path, args: &[&str], greets: &str) -> Self {
        let fixed = ["--kit", "kit", "--save", "level.glb", "--size", "640x480"];
        let args = [&fixed[..], args].concat();
        let mut viewer = Viewer::open(display, dir, None, &args);
        viewer.wait_for_window(display);
        viewer.wait_to_hear(greets);
        let hand = Self { display, viewer };
        // A window that was just opened may not have the keys yet.
        let end = Instant::now() + PATIENCE;
        let focus = [&WINDOW[..], &["windowfocus"]].concat();
        loop {
            assert!(Instant::now() < end && display.tool(&focus));
            hand.keys(&["y"]);
            sleep(Duration::from_secs(1));
            let heard = hand.viewer.heard();
            if heard.iter().any(|line| line.contains("nothing to redo")) {
                return hand;
            }
        }
    }

    fn keys(&self, names: &[&str]) {
        for name in names {
            assert!(self.display.tool(&["key", name]));
        }
    }

    /// Clicks, and waits for what is said of it. Without a window manager, the window is at the upper left of the screen.
    fn click(&self, at: [u32; 2], says: &str) {
        let [x, y] = at.map(|p| p.to_string());
        assert!(self.display.tool(&["mousemove", &x, &y, "click", "1"]));
        self.viewer.wait_to_hear(says);
    }

    /// Drags the view.
    fn drag(&self, from: [u32; 2], to: [u32; 2]) {
        let [x, y] = from.map(|p| p.to_string());
        let [u, v] = to.map(|p| p.to_string());
        let moves = ["mousemove", &x, &y, "mousedown", "1"];
        assert!(self.display.tool(&moves));
        assert!(self.display.tool(&["mousemove", &u, &v, "mouseup", "1"]));
    }

    fn says(&self, key: &str, words: &str) {
        self.hears(key, words);
    }

    /// Presses a key; returns the line with words that answers it.
    fn hears(&self, key: &str, words: &str) -> String {
        self.keys(&[key]);
        self.viewer.wait_to_hear(words)
    }
}

#[test]
fn no_journal_is_left_where_no_window_can_be_opened() {
    let dir = folder("window-edit-none");
    let enfilade = |args: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
        let nowhere = command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
        let args = args.split(' ');
        nowhere.args(args).current_dir(&dir).output().unwrap()
    };
    let made = enfilade("generate dungeon --rooms 1 -o other.glb --pieces kit");
    assert!(made.status.success(), "{made:?}");
    let output = enfilade("view --kit kit --save level.glb");
    let says = String::from_utf8_lossy(&output.stderr);
    assert!(says.contains("no window can be opened here"), "{says}");
    assert_eq!(output.status.code(), Some(1));
    assert!(!dir.join("level.journal").exists());
}

const MIDDLE: [u32; 2] = [320, 240];

#[test]
fn three_rooms_are_built_by_hand_killed_gone_on_with_saved_and_walked_through() {
    if !can_open_windows() {
        return;
    }
    let dir = folder("window-edit");
    let enfilade = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
        let output = command.args(args).current_dir(&dir).output().unwrap();
        assert!(output.status.success(), "{args:?}: {output:?}");
    };
    let generate = "generate dungeon --rooms 1 -o other.glb --pieces kit";
    enfilade(&generate.split(' ').collect::<Vec<_>>());
    let display = Display::without_repeats();
    let greets = "is kept in level.journal";
    let mut hand = Hand::open(&display, &dir, &["--free-mouse"], greets);

    // A chamber, and through its east doorway a corridor, and through that a hall.
    hand.keys(&["2"]);
    hand.click(MIDDLE, "placed chamber-1");
    while !hand.hears("n", "before ").ends_with(".east") {}
    hand.keys(&["3"]);
    hand.click(MIDDLE, "placed corridor-2");
    hand.keys(&["5"]);
    hand.click(MIDDLE, "placed hall-3");
    hand.says("z", "undone; 2 more to undo");
    hand.says("y", "made again; 0 more to redo");
    // The hall, seen through two doorways, is turned, taken away, and back.
    hand.says("v", "turned hall-3");
    hand.says("x", "took hall-3 away");
    hand.says("z", "undone");
    // A door in the nearer doorway.
    hand.keys(&["F7"]);
    hand.click(MIDDLE, "made: door");
    hand.click(MIDDLE, "it is what it was before");
    hand.says("z", "undone; 5 more to undo");
    // A mirror, a lamp and a crate, to the right of the doorway.
    hand.drag([100, 240], [492, 240]);
    hand.keys(&["F8"]);
    hand.click([220, 200], "vertex 1");
    hand.click([400, 330], "made: mirror");
    hand.keys(&["F9"]);
    hand.click([320, 40], "made: lamp");
    hand.keys(&["F10"]);
    hand.click(MIDDLE, "a crate stands on a floor");
    hand.drag([320, 100], [320, 300]);
    hand.click([320, 300], "made: crate");

    // Killed before it is saved: nothing is lost.
    hand.viewer.process.kill().unwrap();
    hand.viewer.process.wait().unwrap();
    assert!(!dir.join("level.glb").exists());
    let journal = fs::read_to_string(dir.join("level.journal")).unwrap();
    let n = journal.lines().count() - 1;
    let eye = ["--eye", "0,1.6,-1", "--record", "walk.txt"];
    let again = format!("{n} operations of level.journal are made again");
    let hand = Hand::open(&display, &dir, &eye, &again);
    hand.says("F2", "wrote level.glb, 3 rooms");
    let world = decode_glb(&fs::read(dir.join("level.glb")).unwrap()).unwrap();
    let doors = world.graph.portals.iter();
    assert_eq!(doors.filter(|p| p.kind == PortalKind::Door).count(), 1);
    assert_eq!(world.graph.specials.len(), 1);
    assert_eq!((world.fixtures.len(), world.details.len()), (1, 1));
    enfilade(&["verify", "level.glb", "--rays", "20000", "--quiet"]);

    // From the chamber through the corridor into the hall, on foot.
    hand.keys(&["b", "f"]);
    let walked = || {
        hand.keys(&["F4"]);
        let run = ["keydown", "Shift_L", "keydown", "w", "sleep", "3"];
        assert!(display.tool(&run));
        assert!(display.tool(&["keyup", "w", "keyup", "Shift_L"]));
        hand.says("F5", "wrote walk.txt");
        eyes_along_x(&dir.join("walk.txt")).last().copied()
    };
    let end = Instant::now() + PATIENCE;
    while walked().is_none_or(|x| x < 9.5) {
        assert!(Instant::now() < end, "it does not reach the hall");
    }
    hand.keys(&["Escape"]);
    assert_eq!(hand.viewer.ends().code(), Some(0));
}
