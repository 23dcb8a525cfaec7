//! Bakes as a user runs them: files, arguments, exit code, words.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context;
use enfilade::geom::DVec3;
use enfilade::geom::scene::{Role, Scene};
use serde_json::Value;

use crate::measure::file_name;
use crate::process::{binary, scenes_and, scenes_dir, target_dir};

/// Result of `enfilade bake --json`.
pub(super) struct BakeDone {
    pub(super) code: Option<i32>,
    /// Standard error.
    pub(super) said: String,
    /// Standard output; null if it is not JSON.
    pub(super) report: Value,
}

impl BakeDone {
    /// Returns the number of rooms and doors.
    pub(super) fn found(&self) -> [i64; 2] {
        let n = |name: &str| self.report[name].as_i64().unwrap_or(0);
        [n("cells_indoors") - n("voids"), n("doors")]
    }

    /// Returns the trust of the verdict, or `refused` without a world.
    pub(super) fn trust(&self) -> &str {
        let trust = self.report["verdict"]["trust"].as_str();
        trust.unwrap_or("refused")
    }
}

/// Bakes files into the folder of this benchmark.
pub(super) fn bake(inputs: &[PathBuf], args: &[String]) -> anyhow::Result<BakeDone> {
    let mut command = Command::new(binary("enfilade"));
    command.arg("bake").arg(&inputs[0]);
    for detail in &inputs[1..] {
        command.arg("--detail").arg(detail);
    }
    let world = folder()?.join("world.glb");
    command.args(args).arg("--json").arg("-o").arg(world);
    let done = command.output().context("cannot start enfilade")?;
    Ok(BakeDone {
        code: done.status.code(),
        said: String::from_utf8_lossy(&done.stderr).into_owned(),
        report: serde_json::from_slice(&done.stdout).unwrap_or(Value::Null),
    })
}

/// Returns the folder of this benchmark's files.
pub(super) fn folder() -> anyhow::Result<PathBuf> {
    let folder = target_dir().join("stranger");
    std::fs::create_dir_all(&folder)?;
    Ok(folder)
}

/// Returns the shared scenes, by name: folders first, then the files of strangers that this program can read.
pub(super) fn shared() -> Vec<(String, PathBuf)> {
    let foreign = scenes_dir().map(|dir| dir.join("foreign"));
    let files = [
        "darkzone.map",
        "hotel-room.glb",
        "nav_test.obj",
        "sports-hall.glb",
    ];
    let files = files
        .iter()
        .filter_map(|file| Some(foreign.as_ref()?.join(file)));
    let all = scenes_and(&["scenes2"]).into_iter().chain(files);
    all.filter(|path| path.exists())
        .map(|path| (file_name(&path), path))
        .collect()
}

/// Writes a scene as OBJ files, its structure and, if it has any, its details, with each vertex mapped. Returns their
/// paths.
pub(super) fn write_obj(
    scene: &Scene,
    name: &str,
    map: impl Fn(DVec3) -> DVec3,
) -> anyhow::Result<Vec<PathBuf>> {
    let mut written = Vec::new();
    for (role, ending) in [(Role::Structural, ""), (Role::Detail, "-detail")] {
        let text = obj(scene, role, &map);
        if role == Role::Structural || !text.is_empty() {
            let path = folder()?.join(format!("{name}{ending}.obj"));
            std::fs::write(&path, text).with_context(|| path.display().to_string())?;
            written.push(path);
        }
    }
    Ok(written)
}

fn obj(scene: &Scene, role: Role, map: &impl Fn(DVec3) -> DVec3) -> String {
    let (mut text, mut first) = (String::new(), 1);
    for object in scene.objects.iter().filter(|o| o.role == role) {
        let _ = writeln!(text, "o {}", object.name.replace(char::is_whitespace, "_"));
        for primitive in &scene.meshes[object.mesh as usize].primitives {
            for p in &primitive.positions {
                let p = DVec3::from_array(p.map(f64::from));
                let DVec3 { x, y, z } = map(object.transform.transform_point3(p));
                let _ = writeln!(text, "v {x:.6} {y:.6} {z:.6}");
            }
            for t in primitive.triples() {
                let [a, b, c] = t.map(|i| i as usize + first);
                let _ = writeln!(text, "f {a} {b} {c}");
            }
            first += primitive.positions.len();
        }
    }
    text
}

/// Writes boxes as an OBJ file, an object each. Returns its path.
pub(super) fn write_boxes(
    name: &str,
    boxes: &[(&str, [f64; 3], [f64; 3])],
) -> anyhow::Result<PathBuf> {
    const SIDES: [[usize; 4]; 6] = [
        [1, 3, 4, 2],
        [5, 6, 8, 7],
        [1, 2, 6, 5],
        [3, 7, 8, 4],
        [1, 5, 7, 3],
        [2, 4, 8, 6],
    ];
    let mut text = String::new();
    for (i, (object, min, max)) in boxes.iter().enumerate() {
        let _ = writeln!(text, "o {object}");
        for corner in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|k| if corner >> k & 1 == 0 { min[k] } else { max[k] });
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        for side in SIDES {
            let [a, b, c, d] = side.map(|v| v + 8 * i);
            let _ = writeln!(text, "f {a} {b} {c} {d}");
        }
    }
    write_text(name, &text)
}

/// Writes a file into the folder of this benchmark.
pub(super) fn write_text(name: &str, text: &str) -> anyhow::Result<PathBuf> {
    let path: PathBuf = folder()?.join(Path::new(name));
    std::fs::write(&path, text).with_context(|| path.display().to_string())?;
    Ok(path)
}
