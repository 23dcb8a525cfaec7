//! The header is that of the functions, and programs in C get the answers of the library.

use std::path::{Path, PathBuf};
use std::process::Command;

use enfilade_cpg::wire::encode_glb;
use enfilade_testkit::{GridParams, room_grid};

const N_VIEWS: &str = "2000";

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the header in C as cbindgen writes it, but for blanks at ends of lines.
fn header() -> String {
    let config = cbindgen::Config::from_file(here().join("cbindgen.toml")).unwrap();
    let bindings = cbindgen::Builder::new()
        .with_src(here().join("src/status.rs"))
        .with_src(here().join("src/answers.rs"))
        .with_src(here().join("src/handle.rs"))
        .with_src(here().join("src/ffi.rs"))
        .with_config(config)
        .generate()
        .unwrap();
    let mut text = Vec::new();
    bindings.write(&mut text);
    String::from_utf8(text).unwrap()
}

#[test]
fn the_header_has_all_functions_as_they_are() {
    let path = here().join("include/enfilade.h");
    let text = header();
    if std::env::var_os("ENFILADE_WRITE").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(
        committed, text,
        "include/enfilade.h is out of date: ENFILADE_WRITE=1 cargo test writes it"
    );
}

/// Compiles a program against the header and the library.
fn compiled(name: &str, dir: &Path) -> PathBuf {
    let exe = dir.join(name);
    let done = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "-o"])
        .arg(&exe)
        .arg(here().join("c").join(name).with_extension("c"))
        .arg("-I")
        .arg(here().join("include"))
        .arg(static_library())
        .args(["-lm", "-lpthread", "-ldl"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{said}");
    exe
}

/// The library that cargo built with these tests, beside them.
fn static_library() -> PathBuf {
    let mut dir = std::env::current_exe().unwrap();
    dir.pop();
    dir.join("libenfilade_abi.a")
}

fn folder() -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("c");
    std::fs::create_dir_all(&dir).unwrap();
    dir
}

fn run(program: impl AsRef<std::ffi::OsStr>, args: &[&Path]) -> String {
    let done = Command::new(program).args(args).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, err) = (text(&done.stdout), text(&done.stderr));
    assert!(done.status.success(), "{out}{err}");
    out
}

// Covers R1.
#[test]
fn programs_in_c_get_the_same_answers_in_the_same_order() {
    let dir = folder();
    let compare = compiled("compare", &dir);
    let given = std::env::var_os("ENFILADE_WORLDS").unwrap_or_default();
    let given = std::env::split_paths(&given).filter(|p| !p.as_os_str().is_empty());
    let mut worlds: Vec<PathBuf> = given.collect();
    let grid = dir.join("grid.glb");
    std::fs::write(
        &grid,
        encode_glb(&room_grid(&GridParams::offices(60, 1))).unwrap(),
    )
    .unwrap();
    worlds.push(grid);
    for world in worlds {
        let answers = dir.join("answers");
        let oracle = env!("CARGO_BIN_EXE_oracle");
        run(
            oracle,
            &[&world, &answers, Path::new(N_VIEWS), Path::new("1")],
        );
        let said = run(&compare, &[&world, &answers]);
        assert_eq!(
            said,
            format!("{N_VIEWS} views, 0 wrong\n"),
            "{}",
            world.display()
        );
    }
}

#[test]
fn the_tour_of_the_page_compiles_and_tells_what_doors_hide() {
    let dir = folder();
    let tour = compiled("tour", &dir);
    let world = dir.join("tour.glb");
    std::fs::write(
        &world,
        encode_glb(&room_grid(&GridParams::offices(12, 1))).unwrap(),
    )
    .unwrap();
    let said = run(&tour, &[&world]);
    assert!(said.lines().count() > 10, "{said}");
    for line in said.lines().skip(1) {
        assert!(
            line.ends_with("; 1 cells with all its doors shut"),
            "{line}"
        );
    }
}
