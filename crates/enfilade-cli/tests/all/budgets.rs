//! Budgets of a bake: reported before the work, and kept. On Linux each bake here has an address space of 4 GiB: one
//! that requests more than its budget is aborted, and fails.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use enfilade_testkit::furnished_house;

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("budgets-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    let scene = furnished_house().scene;
    fs::write(dir.join("house.glb"), enfilade::import::export_glb(&scene)).unwrap();
    fs::write(dir.join("w.glb"), "old").unwrap();
    dir
}

fn bake(dir: &Path, more: &[&str]) -> (Output, String) {
    let binary = env!("CARGO_BIN_EXE_enfilade");
    let mut command = if cfg!(target_os = "linux") {
        let mut limited = Command::new("sh");
        limited
            .args(["-c", "ulimit -v 4194304 && exec \"$0\" \"$@\""])
            .arg(binary);
        limited
    } else {
        Command::new(binary)
    };
    let done = command
        .args(["bake", "house.glb", "-o", "w.glb"])
        .args(more)
        .current_dir(dir)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    (done, said)
}

#[test]
fn what_cannot_be_done_within_a_budget_is_refused_with_a_way_out() {
    let dir = folder("refused");
    for (args, words) in [
        // It is up while the scene is read.
        (["--max-time", "0"], ["the time was up", "--max-time"]),
        (
            ["--max-memory", "10K"],
            ["voxels that are allowed", "--max-memory"],
        ),
    ] {
        let (done, said) = bake(&dir, &args);
        assert_eq!(done.status.code(), Some(1), "{said}");
        for word in words {
            assert!(said.contains(word), "{word}: {said}");
        }
        assert_eq!(fs::read(dir.join("w.glb")).unwrap(), b"old");
    }
    for wrong in [
        ["--max-time", "-1"],
        ["--max-memory", "4"],
        ["--max-memory", "much"],
    ] {
        let (done, said) = bake(&dir, &wrong);
        assert_eq!(done.status.code(), Some(2), "{said}");
    }
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn voxels_that_cannot_be_are_refused_with_those_that_can() {
    let dir = folder("voxels");
    for args in [
        &["--voxel", "0.00001"][..],
        &["--voxel", "1e-9", "--max-memory", "900T"],
        &["--voxel", "1e-300"],
        &["--voxel", "0.05", "--max-memory", "1M"],
        &["--voxel", "0.00001", "--leak-path"],
    ] {
        let (done, said) = bake(&dir, args);
        assert_eq!(done.status.code(), Some(1), "{args:?}: {said}");
        // No number with hundreds of digits.
        assert!(said.lines().all(|l| l.len() < 400), "{args:?}: {said}");
        let (_, way) = said.split_once("give --voxel ").expect(&said);
        let finest: f64 = way.split(' ').next().unwrap().parse().unwrap();
        assert!(finest > 0.0, "{said}");
        assert!(way.contains("--max-memory"), "{said}");
        assert_eq!(fs::read(dir.join("w.glb")).unwrap(), b"old");
    }
    // The advice works.
    let (_, said) = bake(&dir, &["--voxel", "0.05", "--max-memory", "15M"]);
    let (_, way) = said.split_once("give --voxel ").expect(&said);
    let finest = way.split(' ').next().unwrap();
    let (done, said) = bake(&dir, &["--voxel", finest, "--max-memory", "15M"]);
    assert!(done.status.success(), "{said}");
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn a_coarser_answer_says_so_and_voxels_are_told_before() {
    let dir = folder("coarse");
    let (done, said) = bake(&dir, &["--max-memory", "15M", "--max-time", "600"]);
    assert!(done.status.success(), "{said}");
    assert!(said.contains("voxels of 0.1"), "{said}");
    assert!(said.contains("coarser than the 0.1 m requested"), "{said}");
    let (done, said) = bake(&dir, &[]);
    assert!(done.status.success(), "{said}");
    assert!(said.contains("voxels of 0.100 m"), "{said}");
    assert!(
        said.contains("about") && said.contains(" MB and "),
        "{said}"
    );
    assert!(!said.contains("coarser"), "{said}");
    fs::remove_dir_all(&dir).unwrap();
}
