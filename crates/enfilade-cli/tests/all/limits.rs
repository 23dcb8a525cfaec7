//! Limits of commands: excessive arguments are refused beforehand, other work ends at the limit.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use enfilade_cpg::wire::encode_glb;
use enfilade_geom::scene::SourceNode;
use enfilade_testkit::{GridParams, room_grid};

struct Folder(PathBuf);

impl Folder {
    /// Makes a folder with a world of rooms and outdoors, `w.glb`.
    fn new(name: &str) -> Self {
        let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("limits-{name}"));
        let _ = fs::remove_dir_all(&dir);
        fs::create_dir_all(&dir).unwrap();
        let world = room_grid(&GridParams::offices(6, 3));
        fs::write(dir.join("w.glb"), encode_glb(&world).unwrap()).unwrap();
        Self(dir)
    }

    fn run(&self, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(args)
            .current_dir(&self.0)
            .output()
            .unwrap()
    }

    /// Runs a command: must end with `code`, print all of `words` and write nothing.
    fn refused(&self, args: &[&str], code: i32, words: &[&str]) {
        let n_files = || fs::read_dir(&self.0).unwrap().count();
        let before = n_files();
        let done = self.run(args);
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(code), "{args:?}: {said}");
        for word in words {
            assert!(said.contains(word), "{args:?}: {word}: {said}");
        }
        assert_eq!(n_files(), before, "{args:?} left something");
    }
}

#[test]
fn commands_that_can_take_long_have_bounds_and_keep_to_them() {
    let folder = Folder::new("bounds");
    for command in [
        "edit", "inspect", "locate", "path", "plan", "portals", "pvs", "render", "report", "see",
        "simplify", "sound", "verify",
    ] {
        let done = folder.run(&[command, "--help"]);
        let help = String::from_utf8_lossy(&done.stdout).into_owned();
        for option in ["--max-time <SECONDS>", "--max-memory <BYTES>"] {
            assert!(help.contains(option), "{command} {option}");
        }
    }
    // Without a limit they would need hours, or gigabytes.
    let rays = ["verify", "w.glb", "--rays", "100000000000"];
    let late = [&rays[..], &["--max-time", "0.2"]].concat();
    folder.refused(&late, 1, &["within 0.2 s", "--max-time"]);
    let large = [&rays[..], &["--max-memory", "1M"]].concat();
    folder.refused(&large, 1, &["1 MiB were allowed", "--max-memory"]);
    let walk = ["1,1,1", "1,1,2000", "1,1,1"].join(";");
    let heard = [
        "sound",
        "w.glb",
        "--source",
        "1,1,1",
        "--listener",
        &walk,
        "-o",
        "walk.wav",
    ];
    let late = [&heard[..], &["--max-time", "0"]].concat();
    folder.refused(&late, 1, &["--max-time"]);
    // A command that ends in time is not affected.
    let done = folder.run(&[
        "inspect",
        "w.glb",
        "--max-time",
        "1000",
        "--max-memory",
        "4G",
    ]);
    assert!(done.status.success() && done.stderr.is_empty());
}

#[test]
fn a_walk_longer_than_an_hour_is_refused_and_a_long_one_is_written_as_it_is_heard() {
    let folder = Folder::new("walk");
    let sound = |walk: &str| {
        [
            "sound",
            "w.glb",
            "--source",
            "1,1,1",
            "-o",
            "walk.wav",
            "--listener",
            walk,
        ]
        .map(ToOwned::to_owned)
    };
    for far in ["1e6", "1e30", "1e38", "5050"] {
        let args = sound(&format!("1,1,1;{far},1,1"));
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        folder.refused(&args, 1, &["--listener", "3600 s", "5.04 km"]);
    }
    // Ten minutes at 8 kHz.
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 8000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut wav = hound::WavWriter::create(folder.0.join("own.wav"), spec).unwrap();
    (0..800).for_each(|i| wav.write_sample(i * 10).unwrap());
    wav.finalize().unwrap();
    let args = sound("1,1,1;421,1,1;1,1,1");
    let mut args: Vec<&str> = args.iter().map(String::as_str).collect();
    args.extend(["--wav", "own.wav"]);
    let done = folder.run(&args);
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    let walk = hound::WavReader::open(folder.0.join("walk.wav")).unwrap();
    let told = walk.duration();
    assert!(told.abs_diff(600 * 8000) < 256, "{told}");
    assert_eq!(walk.spec().channels, 2);
    let n = walk.into_samples::<i16>().map(Result::unwrap).count();
    assert_eq!(n as u32, 2 * told);
}

#[test]
fn numbers_that_no_one_can_mean_are_refused() {
    let folder = Folder::new("numbers");
    let page = ["report", "w.glb", "-o", "page.html", "--no-pictures"];
    let page = [&page[..], &["--views", "99999999"]].concat();
    folder.refused(&page, 2, &["--views", "100000"]);
    let walk = ["render", "w.glb", "-o", "walk.png", "--walk", "99999999"];
    folder.refused(&walk, 2, &["--walk", "10000"]);
    let pattern = "a*".repeat(600);
    folder.refused(
        &["locate", "w.glb", "--object", &pattern],
        1,
        &["at most 1000"],
    );
}

#[test]
fn an_object_is_found_deep_below_others() {
    let folder = Folder::new("deep");
    let mut world = room_grid(&GridParams::two_rooms());
    let node = |i: u32, name: &str| SourceNode {
        name: name.into(),
        parent: i.checked_sub(1),
        extras: String::new(),
    };
    // All geometry comes from the last one.
    world.sources = (0..4000).map(|i| node(i, "ab")).collect();
    let last = world.sources.len() as u32;
    world.sources.push(node(last, "cd"));
    for batch in &mut world.batches {
        let n = batch.primitive.indices.len() / 3;
        batch.sources = enfilade_cpg::SourceRuns::from_runs(vec![[last, n as u32]]);
    }
    fs::write(folder.0.join("w.glb"), encode_glb(&world).unwrap()).unwrap();
    for (pattern, is_there) in [
        ("a*b*c*d", true),
        ("ab/*/ab/cd", true),
        ("a*b*c*e", false),
        ("CD", true),
    ] {
        let done = folder.run(&["locate", "w.glb", "--object", pattern]);
        assert_eq!(done.status.success(), is_there, "{pattern}");
    }
    world.sources = (0..5000).map(|i| node(i, "ab")).collect();
    assert!(
        encode_glb(&world)
            .unwrap_err()
            .to_string()
            .contains("deeper than")
    );
}
