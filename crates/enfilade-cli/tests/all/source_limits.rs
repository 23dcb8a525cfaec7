//! Limits of time and memory while scenes are read, before a bake begins.

use std::fs;
use std::io::Read;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use enfilade_cpg::wire::encode_glb;
use enfilade_testkit::{GridParams, room_grid};
use flate2::Compression;
use flate2::write::GzEncoder;

/// Time after which a run is killed: far more than any limit here.
const WATCHDOG: Duration = Duration::from_secs(120);

/// A ball in so fine a lattice that its surface would take hours.
const FINE: &str = r#"{ "enfilade": "implicit", "step": 0.0002, "air": { "ball": { "at": [0, 2, 0], "radius": 3 } } }"#;

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("source-limits-{name}"));
        let _ = fs::remove_dir_all(&dir);
        fs::create_dir_all(&dir).unwrap();
        fs::write(dir.join("fine.json"), FINE).unwrap();
        let world = room_grid(&GridParams::offices(2, 1));
        fs::write(dir.join("w.glb"), encode_glb(&world).unwrap()).unwrap();
        Self(dir)
    }

    fn started(&self, args: &[&str]) -> Child {
        Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(args)
            .current_dir(&self.0)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    /// Runs a command, whose standard input stays open: must end by itself with exit code 1, print all of `words`, and write
    /// nothing. Returns what it said.
    fn refused(&self, args: &[&str], words: &[&str]) -> String {
        let n_files = || fs::read_dir(&self.0).unwrap().count();
        let before = n_files();
        let mut child = self.started(args);
        let input = child.stdin.take();
        let start = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            if start.elapsed() > WATCHDOG {
                child.kill().unwrap();
                panic!("{args:?} has no end");
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        drop(input);
        let mut said = String::new();
        child.stderr.unwrap().read_to_string(&mut said).unwrap();
        assert_eq!(status.code(), Some(1), "{args:?}: {said}");
        for word in words {
            assert!(said.contains(word), "{args:?}: {word}: {said}");
        }
        assert_eq!(said.matches("enfilade: ").count(), 1, "{args:?}: {said}");
        assert_eq!(n_files(), before, "{args:?} left something");
        said
    }
}

#[test]
fn the_time_of_reading_counts() {
    let folder = Folder::new("time");
    let words = ["fine.json: ", "before it was read", "--max-time"];
    for args in [
        &["bake", "fine.json", "-o", "out.glb"][..],
        &["decimate", "fine.json", "-o", "out.glb"],
        &["rebake", "w.glb", "--source", "fine.json", "-o", "out.glb"],
        &["verify", "w.glb", "--source", "fine.json"],
    ] {
        folder.refused(&[args, &["--max-time", "1"]].concat(), &words);
    }
    let plan = ["job", "plan", "fine.json", "-o", "plan"];
    folder.refused(&[&plan[..], &["--", "--max-time", "1"]].concat(), &words);
}

#[test]
fn where_nothing_looks_at_the_clock_a_command_is_ended_all_the_same() {
    let folder = Folder::new("watch");
    // Standard input that never ends.
    for args in [
        &["bake", "-", "-o", "out.glb"][..],
        &["decimate", "-", "-o", "out.glb"],
        &["rebake", "w.glb", "--source", "-", "-o", "out.glb"],
    ] {
        let args = [args, &["--max-time", "1"]].concat();
        folder.refused(
            &args,
            &["standard input: ", "not done within 1 s", "--max-time"],
        );
    }
}

#[test]
fn without_a_limit_work_out_of_proportion_is_refused_beforehand() {
    let folder = Folder::new("proportion");
    let args = ["bake", "fine.json", "-o", "out.glb"];
    folder.refused(
        &args,
        &[
            "fine.json: surface: ",
            "a step of 0.0002",
            "points",
            "triangles",
            "give a step of",
        ],
    );
}

#[test]
fn the_memory_of_reading_counts() {
    let folder = Folder::new("memory");
    // A thousand million samples of nothing in a megabyte.
    let mut head = vec![0_u8; 352];
    head[..4].copy_from_slice(&348_i32.to_le_bytes());
    for (k, d) in [3_i16, 1000, 1000, 1000].into_iter().enumerate() {
        head[40 + 2 * k..][..2].copy_from_slice(&d.to_le_bytes());
    }
    head[70] = 2;
    head[72] = 8;
    head[108..112].copy_from_slice(&352_f32.to_le_bytes());
    head[344..348].copy_from_slice(b"n+1\0");
    let file = fs::File::create(folder.0.join("zeros.nii.gz")).unwrap();
    let mut zip = GzEncoder::new(file, Compression::fast());
    let zeros = std::io::repeat(0).take(1_000_000_000);
    std::io::copy(&mut head.as_slice().chain(zeros), &mut zip).unwrap();
    zip.finish().unwrap();
    let args = ["bake", "zeros.nii.gz", "--level", "1", "-o", "out.glb"];
    let limited = [&args[..], &["--max-memory", "300M"]].concat();
    let said = folder.refused(&limited, &["zeros.nii.gz: ", "--max-memory"]);
    assert!(!said.contains("unpack from"), "{said}");
    // Without a limit, it is out of proportion.
    let start = Instant::now();
    let words = [
        "zeros.nii.gz: samples: 1000000000 unpack from",
        "--max-memory 0",
    ];
    folder.refused(&args, &words);
    assert!(start.elapsed() < Duration::from_secs(10));
}

/// A LAZ whose packed points have another size than its head tells: its reader, of another project, panics.
#[test]
fn a_reader_that_panics_on_a_damaged_file_is_quiet_about_it() {
    let folder = Folder::new("panic");
    let mut file = include_bytes!("../../../../fuzz/seeds/las/room.laz").to_vec();
    file[471] = 7;
    fs::write(folder.0.join("case.laz"), file).unwrap();
    let args = ["bake", "case.laz", "--station", "0,0,0", "-o", "out.glb"];
    let said = folder.refused(&args, &["case.laz: file: ", "is damaged"]);
    assert!(
        !said.contains("panicked") && !said.contains("backtrace"),
        "{said}"
    );
}
