//! Packed worlds over HTTP: `serve` gives what commands read by address, and nothing outside its folder.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use enfilade_testkit::{GridParams, room_grid};

/// A running server, killed at the end.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn folder() -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("serve");
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(dir.join("worlds")).unwrap();
    enfilade::save(dir.join("w.glb"), &room_grid(&GridParams::offices(12, 1))).unwrap();
    for line in [
        "pack w.glb -o worlds/w.enf",
        "pack w.glb -o worlds/a~one.enf --one-file",
    ] {
        run(&dir, line);
    }
    fs::write(dir.join("worlds/long.txt"), "many words ".repeat(1000)).unwrap();
    fs::write(dir.join("secret"), "mine").unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(dir.join("secret"), dir.join("worlds/link")).unwrap();
    dir
}

fn command(dir: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    command.args(line.split(' ')).current_dir(dir);
    // A proxy of this machine does not know the server of the test.
    command.env("NO_PROXY", "127.0.0.1");
    command
}

/// Runs a command that must succeed; returns its standard output.
fn run(dir: &Path, line: &str) -> String {
    let done = command(dir, line).output().unwrap();
    let err = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{line}: {err}");
    String::from_utf8(done.stdout).unwrap()
}

/// Starts `serve`; returns its lines up to the last world, too.
fn serve(dir: &Path, n_lines: usize) -> (Server, Vec<String>) {
    let line = "serve worlds --address 127.0.0.1:0";
    let mut child = command(dir, line).stdout(Stdio::piped()).spawn().unwrap();
    let out = BufReader::new(child.stdout.take().unwrap());
    let server = Server(child);
    (
        server,
        out.lines().take(n_lines).map(Result::unwrap).collect(),
    )
}

/// Sends a request as it is; returns the answer, its head in small letters.
fn ask(host: &str, path: &str, headers: &str) -> (String, Vec<u8>) {
    let mut stream = TcpStream::connect(host).unwrap();
    let request =
        format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{headers}\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|w| w == b"\r\n\r\n").unwrap();
    let head = String::from_utf8_lossy(&answer[..end]).to_lowercase();
    (head, answer[end + 4..].to_vec())
}

#[test]
fn commands_read_what_serve_gives_and_nothing_else_is_given() {
    let dir = folder();
    let (_server, lines) = serve(&dir, 3);
    let url = lines[0].split(' ').nth(3).unwrap();
    assert_eq!(lines[0], format!("serving worlds at {url} until Ctrl-C"));
    assert_eq!(
        lines[1..],
        [format!("{url}a~one.enf"), format!("{url}w.enf/")]
    );
    let expected = run(&dir, "inspect w.glb --json");
    for name in ["w.enf", "w.enf/", "a~one.enf"] {
        assert_eq!(run(&dir, &format!("inspect {url}{name} --json")), expected);
        run(&dir, &format!("unpack {url}{name} -o back.glb"));
        assert!(fs::read(dir.join("back.glb")).unwrap() == fs::read(dir.join("w.glb")).unwrap());
    }
    run(&dir, &format!("simplify {url}w.enf --max-cells 6 -o s.glb"));
    for (line, words) in [
        (
            format!("inspect {url}none.enf"),
            "no packed world at this address",
        ),
        (
            format!("inspect {url}long.txt"),
            "no packed world at this address",
        ),
        (format!("pvs {url}w.enf"), "name a file with -o"),
        (
            format!("serve worlds --address {}", &url[7..url.len() - 1]),
            "--address",
        ),
        ("serve w.glb".into(), "is not a folder"),
        ("serve none".into(), "cannot serve none"),
    ] {
        let done = command(&dir, &line).output().unwrap();
        let err = String::from_utf8_lossy(&done.stderr);
        assert!(
            !done.status.success() && err.contains(words),
            "{line}: {err}"
        );
    }
    let host = &url[7..url.len() - 1];
    let whole = fs::read(dir.join("worlds/w.enf/pieces.enfp")).unwrap();
    let (head, body) = ask(
        host,
        "/w.enf/pieces.enfp",
        "Range: bytes=3-40\r\nOrigin: http://x\r\n",
    );
    assert!(
        head.contains(" 206 ") && head.contains("content-range: bytes 3-40/"),
        "{head}"
    );
    assert!(head.contains("access-control-allow-origin: *"), "{head}");
    assert_eq!(body, whole[3..=40]);
    for encoding in ["gzip", "zstd"] {
        let (head, body) = ask(
            host,
            "/long.txt",
            &format!("Accept-Encoding: {encoding}\r\n"),
        );
        assert!(
            head.contains(&format!("content-encoding: {encoding}")),
            "{head}"
        );
        assert!(body.len() < 1000);
    }
    for path in [
        "/../secret",
        "/%2e%2e/secret",
        "/..%2fsecret",
        "/link",
        "//secret",
        "/none",
    ] {
        let (head, body) = ask(host, path, "");
        assert!(
            head.contains(" 404 ") || head.contains(" 400 "),
            "{path}: {head}"
        );
        assert!(!body.windows(4).any(|w| w == b"mine"), "{path}");
    }
}

#[cfg(unix)]
#[test]
fn a_server_ends_on_ctrl_c() {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("serve-end");
    fs::create_dir_all(dir.join("worlds")).unwrap();
    let (mut server, lines) = serve(&dir, 2);
    assert!(lines[1].contains("no packed world"), "{lines:?}");
    let id = server.0.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-INT", &id])
            .status()
            .unwrap()
            .success()
    );
    assert!(server.0.wait().unwrap().success());
}

/// Waits for the end of a server for some seconds.
#[cfg(unix)]
fn ends(server: &mut Server) -> bool {
    (0..200).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(20));
        server.0.try_wait().unwrap().is_some()
    })
}

#[cfg(unix)]
#[test]
fn pipes_loops_and_hidden_files_are_not_there_and_hold_up_nothing() {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("serve-odd");
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(dir.join("worlds/.git")).unwrap();
    let worlds = dir.join("worlds");
    for name in ["plain", ".env", ".git/config"] {
        fs::write(worlds.join(name), "words").unwrap();
    }
    let made = Command::new("mkfifo").arg(worlds.join("pipe")).status();
    assert!(made.unwrap().success());
    for (target, link) in [
        ("one", "two"),
        ("two", "one"),
        (".env", "shown"),
        (".git", "folder"),
    ] {
        std::os::unix::fs::symlink(target, worlds.join(link)).unwrap();
    }
    // A server whose reader is gone ends: both lines are read.
    let (mut server, lines) = serve(&dir, 2);
    let host = lines[0].split(' ').nth(3).unwrap();
    let host = &host["http://".len()..host.len() - 1];
    for path in ["/plain", "/./plain"] {
        assert_eq!(ask(host, path, "").1, b"words", "{path}");
    }
    for path in [
        "/pipe",
        "/one",
        "/.env",
        "/.git/config",
        "/shown",
        "/folder/config",
        "/.git/",
        "/%2eenv",
    ] {
        let (head, _) = ask(host, path, "");
        assert!(head.starts_with("http/1.1 404"), "{path}: {head}");
    }
    let ended = Command::new("kill")
        .args(["-INT", &server.0.id().to_string()])
        .status();
    assert!(ended.unwrap().success() && ends(&mut server));
}

#[cfg(target_os = "linux")]
#[test]
fn too_few_files_that_may_be_open_are_told() {
    let dir = env!("CARGO_TARGET_TMPDIR");
    for n in 5..16 {
        let script = format!("ulimit -n {n}; exec \"$0\" serve . --address 127.0.0.1:0");
        let done = Command::new("sh")
            .args(["-c", &script, env!("CARGO_BIN_EXE_enfilade")])
            .current_dir(dir)
            .output()
            .unwrap();
        let err = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{n}: {err}");
        assert!(err.contains("ulimit -n"), "{n}: {err}");
    }
}
