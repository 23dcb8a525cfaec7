//! Bakes that are killed and go on, and bakes in shards. Covers V13.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;

use enfilade::import::export_glb;
use enfilade_geom::DMat4;
use enfilade_testkit::mixed::rooms_with_closet;
use enfilade_testkit::{TowerParams, office_tower};

/// A folder of its own, with two buildings far apart in `town.glb`.
fn folder(name: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    let mut scene = rooms_with_closet().scene;
    for mut object in scene.objects.clone() {
        object.transform = DMat4::from_translation([300.0, 0.0, 40.0].into()) * object.transform;
        scene.objects.push(object);
    }
    fs::write(dir.join("town.glb"), export_glb(&scene)).unwrap();
    dir
}

fn command(dir: &Path, words: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    command.current_dir(dir).args(words.split(' '));
    command
}

/// Runs a command in words; returns if it succeeded, and all that it said.
fn said(dir: &Path, words: &str) -> (bool, String) {
    let done = command(dir, words).output().unwrap();
    let text = [done.stdout, done.stderr].map(|t| String::from_utf8_lossy(&t).into_owned());
    (done.status.success(), text.concat())
}

/// Runs a command that must fail; returns what it said.
fn refused(dir: &Path, words: &str) -> String {
    let (is_done, text) = said(dir, words);
    assert!(!is_done, "{words}: {text}");
    text
}

/// Runs a command that must succeed; returns what it said.
fn done(dir: &Path, words: &str) -> String {
    let (is_done, text) = said(dir, words);
    assert!(is_done, "{words}: {text}");
    text
}

fn same(dir: &Path, a: &str, b: &str) -> bool {
    fs::read(dir.join(a)).unwrap() == fs::read(dir.join(b)).unwrap()
}

#[test]
fn shards_of_a_bake_from_anywhere_make_the_world_of_one_machine() {
    let dir = &folder("baked-shards");
    done(dir, "bake town.glb --min-opening 0.5 -o alone.glb");
    let keys = done(dir, "job plan town.glb -o a -- --min-opening 0.5");
    let keys: Vec<&str> = keys.lines().filter(|k| k.len() == 32).collect();
    assert_eq!(keys.len(), 2, "{keys:?}");
    done(dir, "job plan town.glb -o b -- --min-opening 0.5");
    let text = refused(dir, "job plan town.glb -o b");
    assert!(text.contains("something else"), "{text}");
    done(dir, &format!("job run a {} --threads 1", keys[1]));
    let text = refused(dir, "job finish a -o made.glb");
    assert!(
        text.contains("are missing") && !dir.join("made.glb").exists(),
        "{text}"
    );
    // Both are computed in the other folder, and one is cut off.
    done(dir, "job run b");
    let shard = |folder: &str, key: &str| dir.join(format!("{folder}/shards/{key}.block"));
    let [mine, other] = ["a", "b"].map(|folder| fs::read(shard(folder, keys[1])).unwrap());
    assert!(mine == other);
    fs::write(shard("a", keys[1]), &mine[..mine.len() - 7]).unwrap();
    let text = done(dir, "job merge a b");
    assert!(
        text.contains("2 shards copied, 0 there before; 0 are missing"),
        "{text}"
    );
    done(dir, "job finish a -o made.glb");
    assert!(same(dir, "made.glb", "alone.glb"));
    assert!(shard("a", keys[0]).exists());
    // A shard under the name of another counts as missing, and a manifest that was changed is refused.
    fs::copy(shard("b", keys[1]), shard("b", keys[0])).unwrap();
    let text = refused(dir, "job finish b -o made.glb");
    assert!(
        text.contains("1 of 2 shards are missing or damaged"),
        "{text}"
    );
    done(dir, "job run b");
    assert!(same(
        dir,
        &format!("a/shards/{}.block", keys[0]),
        &format!("b/shards/{}.block", keys[0])
    ));
    let manifest = fs::read_to_string(dir.join("b/manifest.json")).unwrap();
    fs::write(dir.join("b/manifest.json"), manifest.replace("0.5", "0.6")).unwrap();
    let text = refused(dir, "job run b");
    assert!(text.contains("plan it again"), "{text}");
    fs::write(dir.join("b/manifest.json"), manifest).unwrap();
    // A job whose input was changed is refused.
    let tower = office_tower(&TowerParams::with_rooms(2, 1)).scene;
    fs::write(dir.join("b/town.glb"), export_glb(&tower)).unwrap();
    let text = refused(dir, "job run b");
    assert!(text.contains("plan it again"), "{text}");
}

#[test]
fn a_job_planned_or_merged_again_removes_what_killed_runs_left() {
    let dir = &folder("left-of-jobs");
    for job in ["a", "b"] {
        done(dir, &format!("job plan town.glb -o {job}"));
    }
    done(dir, "job run b");
    let of_plan = dir.join(".a.17-1.tmp");
    fs::create_dir(&of_plan).unwrap();
    fs::write(of_plan.join("manifest.json"), "{").unwrap();
    done(dir, "job plan town.glb -o a");
    assert!(!of_plan.exists());
    // Also of pieces that are not shards, such as basins.
    let shards = |job: &str| {
        let entries = fs::read_dir(dir.join(job).join("shards")).unwrap();
        let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
        names.collect::<Vec<String>>()
    };
    let all = shards("b");
    assert_eq!(all.len(), 4);
    for (job, line) in [("a", "job merge a b"), ("b", "job run b")] {
        fs::create_dir_all(dir.join(job).join("shards")).unwrap();
        for name in &all {
            let left = format!("{job}/shards/.{name}.17-1.tmp");
            fs::write(dir.join(left), "half").unwrap();
        }
        done(dir, line);
        let left = shards(job);
        assert!(left.iter().all(|name| all.contains(name)), "{left:?}");
    }
}

#[test]
fn a_long_file_of_text_is_copied_whole() {
    let dir = &folder("long-text");
    // Two rooms seen from inside, 200 m apart, after a long comment.
    let mut text = "# a model\n".repeat(2000);
    for at in [0, 200] {
        for corner in 0..8 {
            let [x, y, z] = [corner / 4 * 5 + at, corner / 2 % 2 * 3, corner % 2 * 4 + at];
            text += &format!("v {x} {y} {z}\n");
        }
        for side in [
            "3 4 2 1", "6 8 7 5", "2 6 5 1", "7 8 4 3", "5 7 3 1", "4 8 6 2",
        ] {
            let corners = side.split(' ').map(|c| c.parse::<i32>().unwrap() - 9);
            let corners: Vec<_> = corners.map(|c| c.to_string()).collect();
            text += &format!("f {}\n", corners.join(" "));
        }
    }
    fs::write(dir.join("rooms.obj"), text).unwrap();
    done(dir, "bake rooms.obj -o alone.glb");
    done(dir, "job plan rooms.obj -o job");
    assert!(same(dir, "rooms.obj", "job/rooms.obj"));
    let text = done(dir, "job run job");
    assert!(text.contains("2 shards computed"), "{text}");
    done(dir, "job finish job -o made.glb");
    assert!(same(dir, "made.glb", "alone.glb"));
}

#[test]
fn a_job_that_cannot_be_is_refused_with_the_remedy() {
    let dir = &folder("refused-jobs");
    let gltf = r#"{"asset":{"version":"2.0"},"buffers":[{"uri":"far.bin","byteLength":36}],"bufferViews":[{"buffer":0,"byteLength":36}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}]}"#;
    fs::write(dir.join("two.gltf"), gltf).unwrap();
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    fs::write(
        dir.join("far.bin"),
        corners.map(f32::to_le_bytes).as_flattened(),
    )
    .unwrap();
    fs::copy(dir.join("town.glb"), dir.join("manifest.json")).unwrap();
    done(dir, "bake town.glb -o world.glb");
    for (words, part) in [
        (
            "job plan town.glb --mode fast -o j",
            "--mode is for visibility",
        ),
        (
            "job plan world.glb -o j -- --min-opening 0.5",
            "is baked already",
        ),
        ("job plan town.glb -o j -- --method bsp", "method is bsp"),
        ("job plan town.glb -o j -- --min-opnig 0.5", "--min-op"),
        ("job plan manifest.json -o j", "a name of its own"),
        (
            "job plan two.gltf -o j",
            "far.bin: a job takes scenes in one file",
        ),
    ] {
        let text = refused(dir, words);
        assert!(
            text.contains(part) && !dir.join("j").exists(),
            "{words}: {text}"
        );
    }
    done(dir, "job plan town.glb -o j");
    done(dir, "job run j");
    let text = refused(dir, "job finish j --into x.glb -o y.glb");
    assert!(text.contains("--into is for visibility"), "{text}");
    assert!(!dir.join("y.glb").exists());
}

#[test]
fn a_bake_that_is_killed_goes_on_from_its_pieces() {
    let dir = &folder("killed-bake");
    // Merging takes much longer than it takes to notice a piece.
    let tower = office_tower(&TowerParams::with_rooms(64, 1)).scene;
    fs::write(dir.join("tower.glb"), export_glb(&tower)).unwrap();
    done(dir, "bake tower.glb -o alone.glb");
    let words = "bake tower.glb -o made.glb --checkpoint pieces";
    let pieces = dir.join("pieces");
    // On a busy machine a bake may end first: then it is tried again.
    let is_killed = (0..20).any(|_| {
        let mut child = command(dir, words)
            .stderr(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        while child.try_wait().unwrap().is_none() {
            let n = fs::read_dir(&pieces).map_or(0, Iterator::count);
            if n > 0 {
                let _ = child.kill();
            }
            thread::yield_now();
        }
        !child.wait().unwrap().success() && pieces.exists()
    });
    assert!(is_killed && !dir.join("made.glb").exists());
    // Pieces of another scene under the names of these.
    done(dir, "job plan town.glb -o town");
    done(dir, "job run town");
    let foreign = fs::read_dir(dir.join("town/shards")).unwrap().next();
    let foreign = foreign.unwrap().unwrap().path();
    for piece in fs::read_dir(&pieces).unwrap() {
        fs::copy(&foreign, piece.unwrap().path()).unwrap();
    }
    fs::write(pieces.join("notes.txt"), "mine").unwrap();
    done(dir, words);
    assert!(same(dir, "made.glb", "alone.glb"));
    // Files of others stay.
    assert_eq!(fs::read_dir(&pieces).unwrap().count(), 1);
    // A place where nothing can be kept does not stop a bake.
    let text = done(dir, "bake tower.glb -o made.glb --checkpoint alone.glb");
    assert!(text.contains("cannot make the folder"), "{text}");
    assert!(same(dir, "made.glb", "alone.glb"));
}
