//! Small inputs with known numbers of rooms, for the verdict: what was found is right, refused, or doubted.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::process::{binary, scenes_dir, target_dir};
use crate::score::{inspect, list};

use super::Verdict;

/// The cases, below `cases` beside the real scenes, and their rooms, as the pages beside them say.
const ROOMS: [(&str, usize); 20] = [
    ("buildings/inner_suite.obj", 3),
    ("levels/carved-facing-air-with-box.glb", 2),
    ("levels/carved-facing-matter-with-box.glb", 2),
    ("levels/carved-facing-matter.glb", 2),
    ("levels/doorway-2x2.25-in-4m-rooms-with-door.glb", 2),
    ("levels/helper-navmesh.glb", 2),
    ("levels/helper-portal-in-doorway.glb", 2),
    ("levels/helper-reflection.glb", 2),
    ("levels/helper-trigger.glb", 2),
    ("levels/kit-hollow-panels.glb", 2),
    ("levels/kit-leaf-door-noceiling.glb", 2),
    ("levels/kit-leaf-door.glb", 2),
    ("levels/kit-leaf-wall_doorway_door.glb", 2),
    ("levels/lod-wall.glb", 2),
    ("levels/msft-lod.glb", 2),
    ("levels/q1-house-in-skybox.map", 2),
    ("levels/q1-plain.map", 2),
    ("levels/room-in-room.glb", 3),
    ("levels/skybox.glb", 2),
    ("levels/two-rooms.glb", 2),
];

/// Unit and axes of the files that do not say them.
const GIVEN: [(&str, &[&str]); 1] = [("obj", &["--unit", "m", "--up", "y"])];

/// Bakes all cases that are there.
pub(super) fn verdicts() -> anyhow::Result<Vec<Verdict>> {
    let Some(dir) = scenes_dir().map(|dir| dir.with_file_name("cases")) else {
        return Ok(Vec::new());
    };
    let there = ROOMS.map(|(name, n)| (dir.join(name), n)).into_iter();
    let there = there.filter(|(file, _)| file.is_file());
    there.map(|(file, n)| verdict(&file, n)).collect()
}

/// Bakes a case. One that is refused has no room, and all doubt.
fn verdict(file: &Path, n_rooms: usize) -> anyhow::Result<Verdict> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let world: PathBuf = target_dir().join(format!("judge-case-{name}.glb"));
    let mut baking = Command::new(binary("enfilade"));
    baking.arg("bake").arg(file).arg("-o").arg(&world);
    let extension = file.extension().unwrap_or_default();
    for (_, given) in GIVEN.iter().filter(|g| extension == g.0) {
        baking.args(*given);
    }
    let done = baking.args(["--json", "--max-time", "60"]).output()?;
    let mut out = Verdict {
        name: format!("case {name}"),
        rooms: 0.0,
        trust: "refused".to_owned(),
        doubt: 1.0,
    };
    if done.status.success() {
        let said: Value = serde_json::from_slice(&done.stdout)?;
        let graph = inspect(&world)?;
        let is_room = |cell: &&Value| cell["outdoor"] != true && cell["void"] != true;
        let n_found = list(&graph["cells"]).iter().filter(is_room).count();
        out.rooms = n_found.min(n_rooms) as f64 / n_found.max(n_rooms) as f64;
        (out.trust, out.doubt) = Verdict::said(&said);
    }
    Ok(out)
}
