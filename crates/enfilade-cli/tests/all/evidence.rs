//! Two checkers of evidence without common code, one of them in Python, agree: on valid and on tampered evidence.

use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use enfilade_cpg::wire::encode_glb;
use enfilade_testkit::{GridParams, room_grid};
use serde_json::Value;

const CHECKER: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../scripts/check_evidence.py"
);

fn enfilade(args: &[&Path]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    command.args(args).output().unwrap()
}

/// Evidence with a changed body, and with matching sums.
fn tampered(evidence: &[u8], change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut body = Vec::new();
    let mut decoder = flate2::read::ZlibDecoder::new(&evidence[24..]);
    decoder.read_to_end(&mut body).unwrap();
    change(&mut body);
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(&body).unwrap();
    let packed = encoder.finish().unwrap();
    let sum = packed
        .iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
    let size = (body.len() as u64).to_le_bytes();
    [&evidence[..8], &size, &sum.to_le_bytes(), &packed].concat()
}

#[test]
fn a_checker_in_python_agrees() {
    let has_python = Command::new("python3").arg("--version").output();
    if !has_python.is_ok_and(|o| o.status.success()) {
        eprintln!("skipped: no python3, which checks evidence a second time");
        return;
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("evidence");
    fs::create_dir_all(&folder).unwrap();
    let file = |name: &str| folder.join(name);
    let world = room_grid(&GridParams {
        turn: 0.4,
        ..GridParams::offices(40, 3)
    });
    let (glb, evidence, answer) = (file("w.glb"), file("w.evidence"), file("w.pvs"));
    fs::write(&glb, encode_glb(&world).unwrap()).unwrap();
    let [pvs, verify, o, e, json] = ["pvs", "verify", "-o", "--evidence", "--json"].map(Path::new);
    let done = enfilade(&[pvs, &glb, o, &answer, e, &evidence]);
    assert!(done.status.success(), "{done:?}");
    let both = |evidence: &Path| {
        let rust = enfilade(&[verify, &glb, e, evidence, json]);
        let mut python = Command::new("python3");
        let python = python
            .arg(CHECKER)
            .args([&glb, evidence, json])
            .output()
            .unwrap();
        [rust, python]
    };
    let reports = both(&evidence).map(|done| -> Value {
        assert!(done.status.success(), "{done:?}");
        serde_json::from_slice(&done.stdout).unwrap()
    });
    assert_eq!(reports[0], reports[1]);
    assert!(
        reports[0]["hidden_pairs"].as_u64() > Some(100),
        "{}",
        reports[0]
    );
    assert!(
        reports[0]["trace_bytes"].as_u64() > Some(100),
        "{}",
        reports[0]
    );

    let whole = fs::read(&evidence).unwrap();
    let changed = file("changed.evidence");
    let mut n_body = 0;
    tampered(&whole, |body| n_body = body.len());
    let mut n_refused = 0;
    for k in 0..24 {
        let bit = (8 * n_body / 24) * k + 7 * k;
        let bytes = tampered(&whole, |body| body[bit / 8] ^= 1 << (bit % 8));
        fs::write(&changed, bytes).unwrap();
        let [rust, python] = both(&changed).map(|done| done.status.code());
        assert_eq!(rust, python, "bit {bit} of {}", 8 * n_body);
        n_refused += usize::from(rust == Some(1));
    }
    assert!(n_refused >= 8, "{n_refused}");
    // Both refuse incomplete evidence.
    for bytes in [&whole[..whole.len() - 1], &whole[..20], b"ENFEVID4"] {
        fs::write(&changed, bytes).unwrap();
        assert_eq!(both(&changed).map(|done| done.status.code()), [Some(1); 2]);
    }
}
