//! Rooms for other trades: energy, robots, navigation, acoustics.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

fn run(dir: &Path, line: &str) -> (bool, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    let done = command.args(line.split(' ')).current_dir(dir).output();
    let done = done.unwrap();
    let text = [done.stdout, done.stderr].concat();
    (
        done.status.success(),
        String::from_utf8_lossy(&text).into_owned(),
    )
}

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("trades-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    dir
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn the_house_is_written_for_each_trade() {
    let dir = folder("house");
    let (is_done, said) = run(&dir, "demo -o house");
    assert!(is_done, "{said}");
    for line in [
        "export house/world.glb -o house.gbxml",
        "export house/world.glb -o house.hbjson",
        "export house/world.glb -o house.gml",
        "export house/world.glb -o house.pgm --resolution 0.1",
        "export house/world.glb --walkable -o floors.obj",
        "export house/world.glb --rooms-solid -o solids",
        // Again, over the first.
        "export house/world.glb --rooms-solid -o solids",
    ] {
        let (is_done, said) = run(&dir, line);
        assert!(is_done && said.contains("wrote "), "{line}: {said}");
    }
    let list = json(&dir.join("solids/_rooms.json"));
    let n_rooms = list["rooms"].as_array().unwrap().len();
    assert!(n_rooms > 5, "{n_rooms}");
    let gml = fs::read_to_string(dir.join("house.gml")).unwrap();
    assert_eq!(gml.matches("<core:CellSpace ").count(), n_rooms);
    assert_eq!(gml.matches("<gml:Solid ").count(), n_rooms);
    let gbxml = fs::read_to_string(dir.join("house.gbxml")).unwrap();
    assert_eq!(gbxml.matches("<Space ").count(), n_rooms);
    let honeybee = json(&dir.join("house.hbjson"));
    assert_eq!(honeybee["rooms"].as_array().unwrap().len(), n_rooms);
    for room in list["rooms"].as_array().unwrap() {
        let file = room["file"].as_str().unwrap();
        for ending in ["obj", "stl", "json"] {
            assert!(dir.join(format!("solids/{file}.{ending}")).is_file());
        }
    }
    // Where people stand: less than the floors, and in most rooms.
    let floors = fs::read_to_string(dir.join("floors.obj")).unwrap();
    assert!(floors.matches("\ng ").count() >= n_rooms / 2 && floors.contains("\nf -4 -3 -2 -1"));
    let yaml = fs::read_to_string(dir.join("house.yaml")).unwrap();
    assert!(yaml.contains("image: \"house.pgm\"") && yaml.contains("resolution: 0.1\n"));
    let table = json(&dir.join("house.rooms.json"));
    assert!(!table["rooms"].as_array().unwrap().is_empty());
    assert!(
        fs::read(dir.join("house.labels.pgm"))
            .unwrap()
            .starts_with(b"P5\n")
    );
}

#[test]
fn what_cannot_be_written_is_refused_with_a_remedy() {
    let dir = folder("refused");
    let (is_done, said) = run(&dir, "demo -o house");
    assert!(is_done, "{said}");
    fs::create_dir(dir.join("mine")).unwrap();
    fs::write(dir.join("mine/notes.txt"), "keep").unwrap();
    for (line, why) in [
        (
            "export house/world.glb -o x.gbxml --storey 1",
            "only to maps",
        ),
        (
            "export house/world.glb -o x.pgm --storey attic",
            "there is no such storey; the world has 1",
        ),
        (
            "export house/world.glb -o x.pgm --resolution 0",
            "resolution above 0",
        ),
        (
            "export house/world.glb -o x.pgm --resolution 1e-5",
            "give a resolution of",
        ),
        ("export house/world.glb -o x.pgm --cells", "--cells"),
        (
            "export house/world.glb --rooms-solid -o mine",
            "other contents",
        ),
        (
            "export house/world.glb --rooms-solid -o -",
            "standard output",
        ),
        (
            "export house/world.glb --rooms-solid --split -o y",
            "cannot be used with",
        ),
        ("export house/world.glb -o x.gbx", "end it in"),
        (
            "export house/world.glb --walkable -o x.json",
            "only to a .obj file",
        ),
        ("export house/scene.glb -o x.gbxml", ""),
    ] {
        let (is_done, said) = run(&dir, line);
        assert!(!is_done && said.contains(why), "{line}: {said}");
    }
    assert_eq!(fs::read(dir.join("mine/notes.txt")).unwrap(), b"keep");
    assert!(!dir.join("x.pgm").exists() && !dir.join("x.gbxml").exists());
}
