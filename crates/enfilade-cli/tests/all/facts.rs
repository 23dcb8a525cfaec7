//! Facts of rooms in worlds: written by what bakes and changes them, and found wrong by `verify`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use enfilade::cpg::{RoomFacts, World};
use enfilade::import::export_glb;
use enfilade_testkit::mixed::two_rooms;
use serde_json::Value;

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("facts-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    fs::write(dir.join("scene.glb"), export_glb(&two_rooms().scene)).unwrap();
    done(&dir, "bake -q scene.glb -o w.glb");
    dir
}

fn run(dir: &Path, line: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    let args = line.split(' ');
    command.args(args).current_dir(dir).output().unwrap()
}

fn done(dir: &Path, line: &str) -> Vec<u8> {
    let out = run(dir, line);
    assert!(out.status.success(), "{line}: {out:?}");
    out.stdout
}

fn world(dir: &Path, file: &str) -> World {
    enfilade::open(dir.join(file)).unwrap()
}

fn facts(world: &World) -> &[RoomFacts] {
    world.room_facts.as_deref().unwrap()
}

#[test]
fn a_bake_keeps_the_facts_of_rooms_and_what_changes_rooms_measures_them_again() {
    let dir = folder("kept");
    let baked = world(&dir, "w.glb");
    assert_eq!(facts(&baked).len(), 2);
    assert!(facts(&baked).iter().all(|room| room.floor_area > 1.0));
    done(&dir, "pvs -q w.glb --into seen.glb");
    assert_eq!(world(&dir, "seen.glb").room_facts, baked.room_facts);
    done(&dir, "simplify -q w.glb -o one.glb --max-cells 2");
    let simple = world(&dir, "one.glb");
    assert_eq!(facts(&simple).len(), simple.graph.rooms().count());
    let [two, one] = [&baked, &simple].map(|w| facts(w).iter().map(|f| f.floor_area).sum::<f64>());
    // The doorway between the rooms counts now.
    assert!(one >= two - 0.01 && one < two + 1.0, "{one} for {two}");
    done(&dir, "verify --rays 1000 one.glb");
}

#[test]
fn worlds_without_facts_are_measured_when_asked_and_give_the_same_answers() {
    let dir = folder("without");
    let mut bare = world(&dir, "w.glb");
    bare.room_facts = None;
    enfilade::save(dir.join("bare.glb"), &bare).unwrap();
    let [own, measured] = ["w.glb", "bare.glb"].map(|file| {
        let said = done(&dir, &format!("inspect --json {file}"));
        serde_json::from_slice::<Value>(&said).unwrap()["cells"].take()
    });
    assert_eq!(own, measured);
    assert!(own.to_string().contains("area_above_2_3"), "{own}");
}

#[test]
fn verify_finds_facts_that_are_not_those_of_the_walls() {
    let dir = folder("false");
    let changes: [fn(&mut RoomFacts); 3] = [
        |room| room.floor_area += 0.5,
        |room| room.height -= 0.25,
        |room| room.storeys = vec!["7".into()],
    ];
    for change in changes {
        let mut told = world(&dir, "w.glb");
        change(&mut told.room_facts.as_mut().unwrap()[1]);
        enfilade::save(dir.join("false.glb"), &told).unwrap();
        let out = run(&dir, "verify --rays 1000 false.glb");
        assert_eq!(out.status.code(), Some(1), "{out:?}");
        let said = String::from_utf8_lossy(&out.stdout).into_owned();
        let name = &told.graph.cells[facts(&told)[1].cell.idx()].name;
        assert!(said.contains(&format!("the facts of {name} are")), "{said}");
    }
}
