//! `view`, in a window on a display of its own: keys and clicks as somebody would give them.
#![cfg(all(target_os = "linux", feature = "view"))]

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread::sleep;
use std::time::{Duration, Instant};

use enfilade_cpg::World;
use enfilade_cpg::wire::encode_glb;
use enfilade_testkit::{GridParams, room_grid};

/// Software draws slowly on a busy machine; what never comes fails all the same.
const PATIENCE: Duration = Duration::from_secs(120);

/// A display that ends with the test.
struct Display {
    server: Child,
    name: String,
}

impl Display {
    fn open() -> Self {
        let mut server = Command::new("Xvfb")
            .args([
                // Else it starts anew when the first tool to look has gone, and takes the window along.
                "-noreset",
                "-displayfd",
                "1",
                "-screen",
                "0",
                "640x480x24",
                "-nolisten",
                "tcp",
            ])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb starts");
        let mut number = String::new();
        let out = server.stdout.take().expect("its output is piped");
        BufReader::new(out)
            .read_line(&mut number)
            .expect("it says its number");
        let name = format!(":{}", number.trim());
        assert!(name.len() > 1, "Xvfb found no display");
        Self { server, name }
    }

    fn tool(&self, args: &[&str]) -> bool {
        Command::new("xdotool")
            .args(args)
            .env("DISPLAY", &self.name)
            .output()
            .expect("xdotool runs")
            .status
            .success()
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // Nothing to be done where it has ended already.
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// The window's process, and what it says on standard error.
struct Viewer {
    process: Child,
    said: Receiver<String>,
}

impl Viewer {
    fn open(display: &Display, dir: &Path, args: &[&str]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args([
                "view",
                "world.glb",
                "--size",
                "320x240",
                "--adapter",
                "software",
            ])
            .args(args)
            .current_dir(dir)
            .env("DISPLAY", &display.name)
            .env_remove("WAYLAND_DISPLAY")
            .stderr(Stdio::piped())
            .spawn()
            .expect("it starts");
        let stderr = process.stderr.take().expect("it is piped");
        let (sender, said) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Self { process, said }
    }

    fn heard(&self) -> Vec<String> {
        self.said.try_iter().collect()
    }

    /// Waits for a line with `words` in it.
    fn wait_to_hear(&self, words: &str) -> String {
        let end = Instant::now() + PATIENCE;
        let mut all = String::new();
        while Instant::now() < end {
            if let Ok(line) = self.said.recv_timeout(Duration::from_millis(200)) {
                if line.contains(words) {
                    return line;
                }
                all += &line;
                all += "\n";
            }
        }
        panic!("it did not say `{words}` but: {all}");
    }

    fn ends(mut self) -> ExitStatus {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            if let Some(status) = self.process.try_wait().expect("it is ours") {
                return status;
            }
            sleep(Duration::from_millis(50));
        }
        let _ = self.process.kill();
        panic!("it did not close");
    }
}

fn has(tool: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|dir| dir.join(tool).is_file())
}

/// A place before a doorway that is looked through along +x.
fn before_a_doorway(world: &World) -> [f32; 3] {
    let graph = &world.graph;
    let door = graph.portals.iter().find(|p| {
        let heights = || p.outline.iter().map(|c| c[1]);
        let floor = graph[p.cells[0]].aabb[0][1];
        p.normal[0].abs() > 0.99
            && p.cells.iter().all(|c| !graph[*c].outdoor)
            // Somebody of 1.6 m looks through it.
            && heights().fold(f32::INFINITY, f32::min) < floor + 0.2
            && heights().fold(0.0, f32::max) > floor + 1.7
    });
    let door = door.expect("a doorway along x");
    let n = door.outline.len() as f32;
    let [x, y, z] = [0, 1, 2].map(|k| door.outline.iter().map(|c| c[k]).sum::<f32>() / n);
    [x - 1.2, y + 0.5, z]
}

fn folder() -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("window");
    if dir.exists() {
        fs::remove_dir_all(&dir).unwrap();
    }
    fs::create_dir_all(&dir).unwrap();
    dir
}

#[test]
fn a_window_opens_closes_a_door_walks_records_and_walks_again() {
    if !(has("Xvfb") && has("xdotool")) {
        // `cargo xtask test` installs them, and lets nobody pass without.
        assert!(
            std::env::var_os("ENFILADE_NEEDS_WINDOW").is_none(),
            "Xvfb or xdotool is missing"
        );
        eprintln!("skipped: no Xvfb and xdotool, which the window is tried with");
        return;
    }
    let dir = folder();
    let world = room_grid(&GridParams::offices(24, 1));
    fs::write(dir.join("world.glb"), encode_glb(&world).unwrap()).unwrap();
    let eye = before_a_doorway(&world).map(|x| x.to_string()).join(",");
    fs::create_dir_all(dir.join("walk.txt")).unwrap();
    let display = Display::open();
    let args = ["--eye", &eye, "--record", "walk.txt", "--free-mouse"];
    let mut viewer = Viewer::open(&display, &dir, &args);
    let end = Instant::now() + PATIENCE;
    while !display.tool(&[
        "search",
        "--onlyvisible",
        "--name",
        "enfilade",
        "windowfocus",
    ]) {
        if let Some(status) = viewer.process.try_wait().expect("it is ours") {
            panic!("it ended at once, {status}: {:?}", viewer.heard());
        }
        assert!(Instant::now() < end, "no window: {:?}", viewer.heard());
        sleep(Duration::from_millis(100));
    }
    let key = |name: &str| assert!(display.tool(&["key", name]));
    // It stands where a window without a manager stands: in the upper left corner.
    let click = || assert!(display.tool(&["mousemove", "160", "120", "click", "1"]));
    // A picture of what is shown, and how many triangles the last frame drew.
    let shot = |n: usize| {
        key("F12");
        let line = viewer.wait_to_hear(&format!("wrote shot-{n}.png, "));
        let words: Vec<&str> = line.split(' ').collect();
        let n_triangles: u64 = words[words.len() - 2].parse().expect("a number");
        let png = fs::read(dir.join(format!("shot-{n}.png"))).unwrap();
        assert!(png.starts_with(b"\x89PNG"));
        (png, n_triangles)
    };
    // Keys may come before the first frame, which on a busy machine takes seconds: as many tries as
    // patience allows, not as many as a blank window answers at once.
    let end = Instant::now() + PATIENCE;
    let mut numbers = (1..).take_while(|_| {
        sleep(Duration::from_millis(100));
        Instant::now() < end
    });
    let first = numbers.by_ref().map(&shot).find(|s| s.1 > 0);
    let (open, n_open) = first.expect("something is drawn");
    click();
    viewer.wait_to_hear("is closed");
    // The next frame is soon, but not at once.
    let is_less = numbers.any(|n| {
        let (closed, n_closed) = shot(n);
        assert_ne!(open, closed, "what a door hides is gone");
        n_closed < n_open
    });
    assert!(is_less, "{n_open} triangles as before");
    click();
    viewer.wait_to_hear("is open");
    key("Tab");
    viewer.wait_to_hear("the mouse is captured");
    key("Tab");
    viewer.wait_to_hear("the mouse is free");
    // All that decides what is drawn, and small portals spared and not: none of it ends the walk.
    for name in ["m", "m", "m", "m", "l", "l"] {
        key(name);
    }
    key("F4");
    assert!(display.tool(&["keydown", "w", "sleep", "1.5", "keyup", "w"]));
    key("F5");
    // Its place is taken by a folder: that is said, and what was walked is kept.
    viewer.wait_to_hear("cannot write walk.txt");
    fs::remove_dir(dir.join("walk.txt")).unwrap();
    key("F5");
    viewer.wait_to_hear("wrote walk.txt");
    key("Escape");
    assert_eq!(viewer.ends().code(), Some(0));

    let path = fs::read_to_string(dir.join("walk.txt")).unwrap();
    let eyes: Vec<f64> = path
        .lines()
        .filter(|l| !l.starts_with('#'))
        .map(|l| l.split(' ').next().unwrap().parse().unwrap())
        .collect();
    assert!(
        eyes[eyes.len() - 1] > eyes[0] + 0.3,
        "walked along x: {eyes:?}"
    );
    // Walks it again, and closes at its end by itself.
    let again = Viewer::open(&display, &dir, &["--path", "walk.txt"]);
    assert_eq!(again.ends().code(), Some(0));
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
