//! Windows on a display of their own, for tests of `view`.
#![allow(dead_code, reason = "each test uses a part")]

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Software draws slowly on a busy machine; a missing answer still fails.
pub(crate) const PATIENCE: Duration = Duration::from_secs(120);

/// A display that ends with the test.
pub(crate) struct Display {
    server: Child,
    name: String,
}

impl Display {
    /// Opens a display.
    pub(crate) fn open() -> Self {
        Self::with(&[])
    }

    /// Opens a display on which a key that is held is not repeated: what a busy machine does late counts once.
    pub(crate) fn without_repeats() -> Self {
        Self::with(&["-r"])
    }

    fn with(options: &[&str]) -> Self {
        let mut server = Command::new("Xvfb")
            .args(options)
            .args([
                // Otherwise the server restarts when its first client disconnects, and closes the window.
                "-noreset",
                "-displayfd",
                "1",
                "-screen",
                "0",
                "1280x720x24",
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

    /// Runs xdotool; returns `true` if it succeeds.
    pub(crate) fn tool(&self, args: &[&str]) -> bool {
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
        // Ignore the error if it has ended already.
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// The window's process, and its standard error.
pub(crate) struct Viewer {
    /// Its process.
    pub(crate) process: Child,
    said: Receiver<String>,
}

impl Viewer {
    /// Opens `view` in a folder.
    pub(crate) fn open(display: &Display, dir: &Path, world: Option<&str>, args: &[&str]) -> Self {
        let command: Vec<&str> = ["view"].into_iter().chain(world).collect();
        Self::of(display, dir, &command, args)
    }

    /// Opens the window of a command in a folder.
    pub(crate) fn of(display: &Display, dir: &Path, command: &[&str], args: &[&str]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(command)
            .args(["--adapter", "software"])
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

    /// Waits until its window is there.
    pub(crate) fn wait_for_window(&mut self, display: &Display) {
        let end = Instant::now() + PATIENCE;
        while !display.tool(&WINDOW) {
            if let Some(status) = self.process.try_wait().expect("it is ours") {
                panic!("it ended at once, {status}: {:?}", self.heard());
            }
            assert!(Instant::now() < end, "no window: {:?}", self.heard());
            sleep(Duration::from_millis(100));
        }
    }

    /// Returns the lines said since the last time.
    pub(crate) fn heard(&self) -> Vec<String> {
        self.said.try_iter().collect()
    }

    /// Waits for a line with `words` in it.
    pub(crate) fn wait_to_hear(&self, words: &str) -> String {
        let heard = self.hear_until(words);
        heard.lines().last().unwrap_or_default().to_owned()
    }

    /// All lines up to the first with `words` in it.
    pub(crate) fn hear_until(&self, words: &str) -> String {
        let end = Instant::now() + PATIENCE;
        let mut all = String::new();
        while Instant::now() < end {
            if let Ok(line) = self.said.recv_timeout(Duration::from_millis(200)) {
                all += &line;
                all += "\n";
                if line.contains(words) {
                    return all;
                }
            }
        }
        panic!("it did not say `{words}` but: {all}");
    }

    /// Waits for its end.
    pub(crate) fn ends(mut self) -> ExitStatus {
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

/// Finds the window.
pub(crate) const WINDOW: [&str; 4] = ["search", "--onlyvisible", "--name", "enfilade"];

/// Returns `false` if windows cannot be tried here.
pub(crate) fn can_open_windows() -> bool {
    if !(has("Xvfb") && has("xdotool")) {
        // `cargo xtask test` installs them, and does not let the test pass without.
        assert!(
            std::env::var_os("ENFILADE_NEEDS_WINDOW").is_none(),
            "Xvfb or xdotool is missing"
        );
        eprintln!("skipped: no Xvfb and xdotool, which the window is tried with");
        return false;
    }
    true
}

/// Makes an empty folder.
pub(crate) fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    if dir.exists() {
        fs::remove_dir_all(&dir).unwrap();
    }
    fs::create_dir_all(&dir).unwrap();
    dir
}

/// The x of each recorded eye.
pub(crate) fn eyes_along_x(path: &Path) -> Vec<f64> {
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().filter(|l| !l.starts_with('#'));
    lines
        .map(|l| l.split(' ').next().unwrap().parse().unwrap())
        .collect()
}
