//! Words of tables are explained below them, and numbers are rounded for people.

use std::path::PathBuf;
use std::process::Command;

use enfilade_testkit::{GridParams, room_grid};

#[test]
fn words_that_need_it_are_explained_below_their_table() {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("tables");
    std::fs::create_dir_all(&dir).unwrap();
    enfilade::save(dir.join("w.glb"), &room_grid(&GridParams::offices(12, 1))).unwrap();
    for (line, words) in [
        ("pvs w.glb", &["pair", "proved", "undecided", "planes"][..]),
        ("see w.glb --eye 2,1,2 --look 3,1,2", &["depth", "portal"]),
        ("simplify w.glb --max-cells 6 -o s.glb", &["cost"]),
        ("edit w.glb --delete-portal 0 -o e.glb", &["cost"]),
        ("inspect w.glb", &["triangles", "detail"]),
    ] {
        let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(line.split(' '))
            .current_dir(&dir)
            .output()
            .unwrap();
        assert!(done.status.success(), "{line}: {done:?}");
        let printed = String::from_utf8(done.stdout).unwrap();
        for word in words {
            let explained = format!("{word}: ");
            let mut lines = printed.lines().skip_while(|l| !l.contains(word));
            let is_used = lines.next().is_some_and(|l| !l.contains(&explained));
            assert!(is_used, "{line}: nothing is called {word}: {printed}");
            let mut below = lines.filter(|l| l.contains(&explained));
            assert!(below.next().is_some(), "{line}: {word} in {printed}");
        }
        // Two digits behind the point are enough, but for small values.
        let long = printed.split_whitespace().find(|w| {
            w.split_once('.')
                .is_some_and(|(_, digits)| digits.len() > 3 && w.parse::<f64>().is_ok())
        });
        assert_eq!(long, None, "{line}: {printed}");
    }
}
