//! The commands `inspect --objects` and `locate --object` find objects of the input in the world by name.

use std::path::PathBuf;
use std::process::{Command, Output};
use std::{fs, str};

use enfilade::import::export_glb;
use enfilade_geom::scene::SourceNode;
use enfilade_testkit::mixed::two_rooms;
use serde_json::Value;

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> &str {
    str::from_utf8(bytes).unwrap()
}

#[test]
fn objects_are_found_by_cell_and_cells_by_object() {
    let scene = two_rooms().scene;
    assert_eq!(scene.nodes, Vec::<SourceNode>::new());
    let name = &scene.objects[0].name;
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let [input, world] =
        ["objects-in.glb", "objects.glb"].map(|n| folder.join(n).to_str().unwrap().to_owned());
    fs::write(&input, export_glb(&scene)).unwrap();
    let baked = enfilade(&["bake", &input, "-o", &world]);
    assert!(baked.status.success(), "{}", text(&baked.stderr));

    let listed = enfilade(&["inspect", &world, "--objects", "cell-1", "--json"]);
    assert!(listed.status.success(), "{}", text(&listed.stderr));
    let listed: Value = serde_json::from_slice(&listed.stdout).unwrap();
    let objects = &listed["objects"];
    assert_eq!(objects[0]["name"], name.as_str());
    assert_eq!(objects[0]["detail"], false);
    assert!(objects[0]["triangles"].as_u64().unwrap() > 0);
    let table = enfilade(&["inspect", &world, "--objects", "1"]);
    assert!(text(&table.stdout).contains(name.as_str()));
    let wrong = enfilade(&["inspect", &world, "--objects", "attic"]);
    assert_eq!(wrong.status.code(), Some(1));
    assert!(text(&wrong.stderr).contains("no cell is called 'attic'"));

    let found = enfilade(&["locate", &world, "--object", name]);
    assert!(text(&found.stdout).lines().any(|l| l == "1"), "{found:?}");
    let found = enfilade(&["locate", &world, "--object", name, "--json"]);
    let found: Value = serde_json::from_slice(&found.stdout).unwrap();
    assert!(found["cells"].as_array().unwrap().contains(&1.into()));
    let wrong = enfilade(&["locate", &world, "--object", "no such thing"]);
    assert_eq!(wrong.status.code(), Some(1));
    assert!(text(&wrong.stderr).contains("no object is called"));
}
