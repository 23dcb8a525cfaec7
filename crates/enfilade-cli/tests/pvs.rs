//! `pvs` and `verify --evidence` as a user runs them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn enfilade(args: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn place(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// Three rooms in a row and one beside the last, which the first does not see.
const PRT: &str = "PRT1\n4\n3\n\
    4 0 1 (1 0 0 ) (1 1 0 ) (1 1 1 ) (1 0 1 )\n\
    4 1 2 (2 0 0 ) (2 1 0 ) (2 1 1 ) (2 0 1 )\n\
    4 2 3 (3 0 5 ) (3 1 5 ) (3 1 6 ) (3 0 6 )\n";

#[test]
fn a_portal_file_becomes_a_pvs_and_its_evidence_is_accepted() {
    let (prt, pvs, evidence) = (
        place("rooms.prt"),
        place("rooms.pvs"),
        place("rooms.evidence"),
    );
    fs::write(&prt, PRT).unwrap();
    let [o, e, v] = ["-o", "--evidence", "verify"].map(Path::new);
    let done = enfilade(&[Path::new("pvs"), &prt, o, &pvs, e, &evidence]);
    assert!(done.status.success(), "{done:?}");
    let text = fs::read_to_string(&pvs).unwrap();
    assert!(
        text.contains("\n0: 0-2\n1: 0-3\n2: 0-3\n3: 1-3\n"),
        "{text}"
    );
    let done = enfilade(&[v, &prt, e, &evidence]);
    assert!(done.status.success(), "{done:?}");
    let mut bytes = fs::read(&evidence).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&evidence, bytes).unwrap();
    let done = enfilade(&[v, &prt, e, &evidence]);
    assert_eq!(done.status.code(), Some(1));
    assert!(
        String::from_utf8_lossy(&done.stderr).contains("damaged"),
        "{done:?}"
    );
}

#[test]
fn a_broken_portal_file_is_named_with_line_and_word() {
    let prt = place("broken.prt");
    fs::write(&prt, "PRT1\n2\n1\n3 0 1 (0 0 0 ) (0 nan 0 ) (0 0 1 )\n").unwrap();
    let done = enfilade(&[Path::new("pvs"), &prt]);
    assert_eq!(done.status.code(), Some(1));
    let message = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(
        message.contains("line 4") && message.contains("nan"),
        "{message}"
    );
    fs::write(&prt, "PRT1\n2\n1\n3 1 1 (0 0 0 ) (0 1 0 ) (0 0 1 )\n").unwrap();
    let done = enfilade(&[Path::new("pvs"), &prt]);
    assert!(
        String::from_utf8_lossy(&done.stderr).contains("to itself"),
        "{done:?}"
    );
}
