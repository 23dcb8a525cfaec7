//! Worlds as a folder of scenes, which other programs load cell by cell.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

fn run(dir: &Path, line: &str) -> (bool, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    let done = command
        .args(line.split(' '))
        .current_dir(dir)
        .output()
        .unwrap();
    let text = [done.stdout, done.stderr].concat();
    (
        done.status.success(),
        String::from_utf8_lossy(&text).into_owned(),
    )
}

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("export-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    dir
}

/// The JSON of a GLB.
fn gltf(path: &Path) -> Value {
    let glb = fs::read(path).unwrap();
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap());
    serde_json::from_slice(&glb[20..20 + length as usize]).unwrap()
}

/// Triangles that the nodes of a file place.
fn n_triangles(gltf: &Value) -> u64 {
    let list = |of: &Value, name: &str| of[name].as_array().cloned().unwrap_or_default();
    let placed = list(gltf, "nodes")
        .into_iter()
        .filter_map(|n| n["mesh"].as_u64());
    let primitives = placed.flat_map(|m| list(&gltf["meshes"][m as usize], "primitives"));
    primitives
        .map(|p| gltf["accessors"][p["indices"].as_u64().unwrap() as usize]["count"].clone())
        .map(|count| count.as_u64().unwrap() / 3)
        .sum()
}

// Covers W1.
#[test]
fn scenes_of_a_split_world_hold_each_surface_once_with_its_pictures() {
    let dir = folder("split");
    let (is_done, said) = run(&dir, "demo -o house");
    assert!(is_done, "{said}");
    for _ in 0..2 {
        // The second replaces the first.
        let (is_done, said) = run(&dir, "export house/world.glb --split -o cells");
        assert!(is_done && said.contains("wrote cells ("), "{said}");
    }
    let world = enfilade::open(dir.join("house/world.glb")).unwrap();
    let mut expected: BTreeMap<Vec<u32>, u64> = BTreeMap::new();
    let of_cells = |cells: &[enfilade_cpg::CellId]| cells.iter().map(|c| c.0).collect::<Vec<_>>();
    for batch in &world.batches {
        *expected.entry(of_cells(&batch.cells)).or_default() +=
            batch.primitive.indices.len() as u64 / 3;
    }
    for detail in &world.details {
        let primitives = &world.detail_meshes[detail.mesh as usize].primitives;
        let n: usize = primitives.iter().map(|p| p.indices.len() / 3).sum();
        *expected.entry(of_cells(&detail.cells)).or_default() += n as u64;
    }
    let graph = fs::read(dir.join("cells/graph.json")).unwrap();
    let graph: Value = serde_json::from_slice(&graph).unwrap();
    assert_eq!(
        graph["cells"].as_array().unwrap().len(),
        world.graph.cells.len()
    );
    let files = graph["files"].as_array().unwrap();
    assert_eq!(
        fs::read_dir(dir.join("cells")).unwrap().count(),
        files.len() + 1
    );
    let (mut found, mut n_pictures, mut names) = (BTreeMap::new(), 0, Vec::new());
    for file in files {
        let scene = gltf(&dir.join("cells").join(file["file"].as_str().unwrap()));
        let cells: Vec<u32> = serde_json::from_value(file["cells"].clone()).unwrap();
        found.insert(cells, n_triangles(&scene));
        n_pictures += scene["images"].as_array().map_or(0, Vec::len);
        let nodes = scene["nodes"].as_array().into_iter().flatten();
        names.extend(nodes.filter_map(|n| n["name"].as_str().map(str::to_owned)));
    }
    assert_eq!(found, expected);
    assert!(
        names.iter().any(|n| n == "outdoors" || n.contains("door")),
        "{names:?}"
    );
    // The house has textures, but not every file shows each.
    assert!(n_pictures >= world.images.len() && n_pictures < world.images.len() * files.len());
}

#[test]
fn a_folder_of_something_else_is_not_replaced() {
    let dir = folder("refused");
    let grid = enfilade_testkit::GridParams::offices(4, 1);
    enfilade::save(dir.join("w.glb"), &enfilade_testkit::room_grid(&grid)).unwrap();
    fs::create_dir(dir.join("mine")).unwrap();
    fs::write(dir.join("mine/letter.txt"), "Dear").unwrap();
    for (line, why) in [
        ("export w.glb --split -o mine", "other contents"),
        ("export w.glb --split -o w.glb", "is a file"),
        ("export w.glb --split --cells -o x", "cannot be used with"),
        ("export w.glb --split -o -", "-o"),
    ] {
        let (is_done, said) = run(&dir, line);
        assert!(!is_done && said.contains(why), "{line}: {said}");
    }
    assert_eq!(
        fs::read_to_string(dir.join("mine/letter.txt")).unwrap(),
        "Dear"
    );
}
