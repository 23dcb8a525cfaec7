//! Mirrors, monitors, panes and links through the command: made, listed, written, and taken away.

use crate::cpg_common as common;

use std::path::PathBuf;
use std::process::{Command, Output};

use common::{doorway, two_rooms, two_rooms_with_pvs};
use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_cpg::{PortalId, Way, World};
use serde_json::{Value, json};

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn file(name: &str, world: &World) -> String {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, encode_glb(world).unwrap()).unwrap();
    path.display().to_string()
}

/// Edits a world; returns what was printed, and the new one.
fn edited(name: &str, world: &World, args: &[&str]) -> (String, World) {
    let input = file(&format!("{name}-in.glb"), world);
    let output = input.replace("-in.glb", "-out.glb");
    let done = enfilade(&[&["edit", &input, "-o", &output], args].concat());
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(0), "{args:?}: {said}");
    let world = decode_glb(&std::fs::read(output).unwrap()).unwrap();
    (String::from_utf8(done.stdout).unwrap(), world)
}

/// The error of an edit that changes nothing, and its exit code.
fn refused(name: &str, world: &World, args: &[&str]) -> (String, Option<i32>) {
    let input = file(&format!("{name}-in.glb"), world);
    let output = input.replace("-in.glb", "-none.glb");
    let done = enfilade(&[&["edit", &input, "-o", &output], args].concat());
    assert!(!PathBuf::from(output).exists(), "{args:?}");
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    (said, done.status.code())
}

#[test]
fn all_kinds_are_made_listed_and_made_plain() {
    let mut before = two_rooms_with_pvs();
    // A second doorway of the same size.
    before
        .graph
        .portals
        .push(doorway(4.0, 0.5, 1.5, 2.1, [0, 1]));
    for cell in 0..2 {
        before.graph.cells[cell].portals.push(PortalId(2));
    }
    let (said, after) = edited(
        "all",
        &before,
        &[
            "--mirror",
            "0,1,2;0,1,1;0,2,1;0,2,2",
            "--link",
            "0:cell-0",
            "2:1",
            "--monitor",
            "2:0=1,2.5,1;1,-0.5,0;60",
            "--tint",
            "1=0.5,1,0.75",
            "--reflect",
            "1:cell-1=0.2",
        ],
    );
    for line in [
        "special-0: mirror of a wall in cell-0, at 0.00 1.50 1.50",
        "special-1: to cell-1, back by special-2 of portal-0 in cell-0",
        "special-2: to cell-0, back by special-1 of portal-2 in cell-1",
        "special-3: monitor of a camera at 1.00 2.50 1.00 of portal-2 in cell-0",
        "special-4: through in 0.50 1.00 0.75 + mirror 20 % of portal-1 in cell-1",
        "special-5: through in 0.50 1.00 0.75 of portal-1 in outdoors",
    ] {
        assert!(said.contains(line), "{line}: {said}");
    }
    assert!(after.pvs.is_none());
    let world = file("all-listed.glb", &after);
    let tables = enfilade(&["inspect", &world]);
    let tables = String::from_utf8(tables.stdout).unwrap();
    assert!(
        tables.contains("special-0  mirror of a wall in cell-0"),
        "{tables}"
    );
    assert!(tables.contains("special portals        6"), "{tables}");
    let report = enfilade(&["inspect", &world, "--json"]);
    let report: Value = serde_json::from_slice(&report.stdout).unwrap();
    let link = &report["specials"][1];
    assert_eq!((&link["portal"], &link["cell"]), (&json!(0), &json!(0)));
    assert_eq!(link["passes"][0]["way"], "lead");
    assert_eq!(
        (&link["passes"][0]["to"], &link["passes"][0]["back"]),
        (&json!(1), &json!(2))
    );
    assert_eq!(report["specials"][0]["normal"], json!([-1.0, 0.0, 0.0]));
    // The other end of a link stays, as a way of no return.
    let (said, fewer) = edited("fewer", &after, &["--plain", "special-1", "--plain", "0"]);
    assert!(said.contains("special-1 is plain"), "{said}");
    assert_eq!(fewer.graph.specials.len(), 4);
    assert!(matches!(
        fewer.graph.specials[0].passes[0].way,
        Way::Lead { back: None, .. }
    ));
    let all: Vec<&str> = (0..6)
        .flat_map(|i| ["--plain", ["0", "1", "2", "3", "4", "5"][i]])
        .collect();
    let (_, plain) = edited("plain", &after, &all);
    assert_eq!(plain.graph.portals, before.graph.portals);
    assert!(plain.graph.specials.is_empty());
    let report = enfilade(&["inspect", &file("plain-listed.glb", &plain), "--json"]);
    let report: Value = serde_json::from_slice(&report.stdout).unwrap();
    assert_eq!(report.get("specials"), None);
}

#[test]
fn what_cannot_be_is_refused_with_the_reason_and_leaves_no_file() {
    let world = two_rooms();
    for (args, code, words) in [
        (&["--mirror", "0"][..], 1, &["0:cell-0", "0:cell-1"][..]),
        (&["--mirror", "7"], 1, &["no portal 7"]),
        (
            &["--mirror", "0:outdoors"],
            1,
            &["its cells are cell-0 and cell-1"],
        ),
        (&["--mirror", "0:attic"], 1, &["no cell is called 'attic'"]),
        (&["--mirror", "door"], 2, &["3:cell-0"]),
        (
            &["--mirror", "0:0", "--mirror", "0:1"],
            1,
            &["--mirror number 2", "cover a wall instead"],
        ),
        (
            &["--link", "0:0", "1:1"],
            1,
            &[
                "1.000 × 2.100",
                "2.000 × 2.000",
                "link openings of one shape",
            ],
        ),
        (&["--link", "0:0"], 2, &["--link"]),
        (&["--one-way", "--mirror", "0:0"], 2, &["--link"]),
        (
            &[
                "--link",
                "0:0",
                "1:1",
                "--one-way",
                "--transform",
                "1,0,0,0,0,1,0,0,0,0,1,0,90,0,0,1",
            ],
            1,
            &["not in cell-1"],
        ),
        (
            &["--link", "0:0", "1:1", "--transform", "1,2,3"],
            2,
            &["16 numbers"],
        ),
        (&["--tint", "0=2,1,1"], 2, &["from 0 to 1"]),
        (&["--reflect", "0:0=0.5", "--mirror", "0:0"], 1, &["only"]),
        (&["--plain", "0"], 1, &["no such special portal"]),
    ] {
        let (said, found) = refused("refused", &world, args);
        if args[0] == "--reflect" {
            // The mirror is made first; behind it nothing shines through.
            assert!(
                said.contains("is a mirror, with nothing behind it"),
                "{said}"
            );
            continue;
        }
        assert_eq!(found, Some(code), "{args:?}: {said}");
        for word in words {
            assert!(said.contains(word), "{args:?}: {word}: {said}");
        }
    }
}
