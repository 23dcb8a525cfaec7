//! Time of `pvs --parts`, compared with an earlier build of the command.

use std::path::Path;
use std::process::Command;

use anyhow::Context;

use super::figures::Figures;
use crate::process::binary;

/// Path of the earlier build.
const BEFORE: &str = "ENFILADE_BEFORE";

const SCENES: [&str; 3] = ["institute", "kit-edc", "clinic"];

/// Largest ratio of its processor time to that of the earlier build.
const MOST: f64 = 2.0;

pub(super) fn run(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    let folder = crate::process::scenes_dir();
    let before = std::env::var_os(BEFORE);
    for scene in SCENES {
        let beside = |dir: &Path| dir.with_file_name("scenes2").join(scene);
        let dirs = folder.iter().flat_map(|dir| [dir.join(scene), beside(dir)]);
        let dir = dirs.into_iter().find(|dir| dir.join("scene.glb").exists());
        let (Some(dir), Some(before)) = (dir, &before) else {
            rows.print("tight: time of pvs", scene, None, "<= 2", None, "");
            continue;
        };
        let dir = dir.canonicalize()?;
        let [model, detail] = ["scene.glb", "detail.glb"].map(|file| dir.join(file));
        let (model, detail) = (model.to_string_lossy(), detail.to_string_lossy());
        let world = format!("tight-{scene}.glb");
        let baked = rows.enfilade(&["bake", &model, "--detail", &detail, "-o", &world], 600)?;
        anyhow::ensure!(baked.code == Some(0), "{scene}: {}", baked.said);
        let after = user_seconds(rows, &binary("enfilade"), &world)?;
        let before = user_seconds(rows, Path::new(before), &world)?;
        rows.at_most("tight: time of pvs", scene, after / before, MOST, "");
    }
    Ok(())
}

/// Returns the time to find all visible parts of a world, on one thread. [Units: s]
fn user_seconds(rows: &Figures<'_>, binary: &Path, world: &str) -> anyhow::Result<f64> {
    let mut timed = Command::new("/usr/bin/time");
    timed.args(["-f", "%U"]).arg(binary);
    timed.args(["pvs", world, "--into", "tight-seen.glb"]);
    timed.args(["--parts", "--threads", "1"]);
    let done = timed.current_dir(&rows.state.folder).output();
    let done = done.context("needs GNU time as /usr/bin/time (`apt-get install time`)")?;
    let said = String::from_utf8_lossy(&done.stderr);
    anyhow::ensure!(done.status.success(), "{}: {said}", binary.display());
    let seconds = said.lines().rev().find_map(|line| line.trim().parse().ok());
    seconds.context("time printed no figures")
}
