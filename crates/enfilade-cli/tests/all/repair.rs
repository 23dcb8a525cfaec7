//! `bake --repair` as users run it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn place(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// A room of 4 x 3 x 5 m, seen from within; one vertex of one triangle is off by half a millimeter.
const ROOM: &str = "o Room\nv 0 0 0\nv 4 0 0\nv 0 3 0\nv 4 3 0\nv 0 0 5\nv 4 0 5\nv 0 3 5\nv 4 3 5\n\
    v 4 3 5.0005\nf 1 3 7\nf 1 7 5\nf 2 6 8\nf 2 8 4\nf 1 5 6\nf 1 6 2\nf 3 4 8\nf 3 8 7\nf 1 2 4\n\
    f 1 4 3\nf 5 7 9\nf 5 8 6\n";

#[test]
fn a_bake_repairs_on_request_and_says_what_it_changed() {
    let (obj, plain, better) = (place("torn.obj"), place("torn.glb"), place("whole.glb"));
    fs::write(&obj, ROOM).unwrap();
    let text = |p: &Path| p.to_str().unwrap().to_owned();
    let (obj, plain, better) = (text(&obj), text(&plain), text(&better));
    let done = enfilade(&["bake", &obj, "-o", &plain]);
    assert!(done.status.success(), "{done:?}");
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(said.contains("nothing was changed"), "{said}");
    let done = enfilade(&["bake", "--repair", &obj, "-o", &better]);
    assert!(done.status.success(), "{done:?}");
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    let line = format!("{:<30} {:>9}", "vertices welded", 1);
    assert!(said.contains(&line), "{said}");
    // The world has the repaired triangles, and records the repair.
    let done = enfilade(&[
        "verify", &better, "--source", &obj, "--repair", "--rays", "20000",
    ]);
    assert!(done.status.success(), "{done:?}");
    let settings = fs::read(&better).unwrap();
    let has = |bytes: &[u8], key: &str| bytes.windows(key.len()).any(|w| w == key.as_bytes());
    assert!(has(&settings, "repair.weld"));
    assert!(!has(&fs::read(&plain).unwrap(), "repair.weld"));
    // A distance below the gap closes nothing; an invalid distance is refused.
    let done = enfilade(&["bake", "--repair=0.0001", &obj, "-o", &better]);
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(!said.contains("vertices welded"), "{said}");
    let done = enfilade(&["bake", "--repair=5", &obj, "-o", &better]);
    assert_eq!(done.status.code(), Some(2));
}

#[test]
fn a_missing_triangle_is_put_back_and_told_unless_refused() {
    let (obj, out) = (place("gap.obj"), place("gap.glb"));
    let whole = ROOM.replace("0.0005", "0").replace("5.0005", "5");
    fs::write(
        &obj,
        whole.replace("f 4 3 1\n", "").replace("f 1 4 3\n", ""),
    )
    .unwrap();
    let text = |p: &Path| p.to_str().unwrap().to_owned();
    let (obj, out) = (text(&obj), text(&out));
    for (switch, is_told) in [(None, true), (Some("off"), false)] {
        let switch = switch.map(|s| ["--put-back", s]);
        let put_back = switch.as_ref().map_or(&[][..], |s| &s[..]);
        let done = enfilade(&[&["bake", &obj, "-o", &out], put_back].concat());
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(
            said.contains("missing triangles put back: 1"),
            is_told,
            "{said}"
        );
        assert_eq!(
            said.contains("triangles are missing in 1"),
            !is_told,
            "{said}"
        );
        if is_told {
            let verified = enfilade(&["verify", &out, "--source", &obj, "--rays", "20000"]);
            assert!(verified.status.success(), "{verified:?}");
        }
    }
}
