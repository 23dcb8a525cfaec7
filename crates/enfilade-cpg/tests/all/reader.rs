//! The reader printed in `docs/format.md` reads our files as we do.
//!
//! Needs node; without it, prints that and passes.

use crate::common;

use std::path::PathBuf;
use std::process::Command;

use common::{two_rooms, two_rooms_with_specials};
use enfilade_cpg::wire::encode_glb;
use enfilade_cpg::{SpecialPortal, SpecialShape, World};
use enfilade_geom::DVec3;
use serde_json::{Value, json};

const FORMAT: &str = include_str!("../../../../docs/format.md");

#[test]
fn the_reader_in_the_documentation_reads_a_world() {
    let (_, rest) = FORMAT.split_once("```js\n").unwrap();
    let (code, _) = rest.split_once("```").unwrap();
    for (name, world) in [("read", two_rooms()), ("read_2", two_rooms_with_specials())] {
        read(code, name, &world);
    }
}

fn read(code: &str, name: &str, world: &World) {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let (script, file) = (dir.join("reader.mjs"), dir.join(name).with_extension("glb"));
    std::fs::write(&script, code).unwrap();
    std::fs::write(&file, encode_glb(world).unwrap()).unwrap();
    for point in [
        [1.0, 1.0, 1.0],
        [5.0, 1.0, 1.0],
        [5.0, 0.05, 1.0],
        [-3.0, 9.0, 0.0],
    ] {
        let mut node = Command::new("node");
        node.arg(&script)
            .arg(&file)
            .args(point.map(|v: f64| v.to_string()));
        let done = match node.output() {
            Ok(done) => done,
            Err(why) => return eprintln!("SKIPPED: cannot run node: {why}"),
        };
        assert!(
            done.status.success(),
            "{}",
            String::from_utf8_lossy(&done.stderr)
        );
        let said: Value = serde_json::from_slice(&done.stdout).unwrap();
        let cell = world.graph.locator.locate(DVec3::from(point));
        assert_eq!(
            said.get("cell"),
            cell.map(|c| json!(c.0)).as_ref(),
            "{point:?}"
        );
        let cell_batches = world
            .batches
            .iter()
            .filter(|b| cell.is_some_and(|c| b.cells.contains(&c)));
        assert_eq!(
            said["batches"].as_array().unwrap().len(),
            cell_batches.count()
        );
        let mut exits = Vec::new();
        for p in world
            .graph
            .portals
            .iter()
            .filter(|p| cell.is_some_and(|c| p.cells.contains(&c)))
        {
            let to = p.cells.iter().find(|c| Some(**c) != cell).unwrap();
            // As doubles, like the numbers that JavaScript prints.
            let outline: Vec<_> = p.outline.iter().map(|c| c.map(f64::from)).collect();
            exits.push(json!([to.0, outline]));
        }
        let specials = world.graph.specials.iter();
        let specials = specials.filter(|s| cell == Some(s.cell));
        let pieces = |s: &SpecialPortal| match &s.shape {
            SpecialShape::Portal(portal) => world.graph[*portal].pieces.clone(),
            SpecialShape::Surface { pieces, .. } => pieces.clone(),
        };
        let pieces: Vec<f64> = (specials.flat_map(pieces).flatten().flatten())
            .map(f64::from)
            .collect();
        assert_eq!(numbers(&said["specials"]), pieces, "{point:?}");
        assert_eq!(numbers(&said["exits"]), numbers(&json!(exits)), "{point:?}");
    }
}

/// Every number in `value`, in order: JavaScript writes 4 where we write 4.0.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => other.as_f64().into_iter().collect(),
    }
}
