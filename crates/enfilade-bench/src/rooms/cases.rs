//! Small inputs with known answers, as the pages beside them say: rooms and portals, or a refusal and its words.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::score::{inspect, list};
use crate::measure::file_name;
use crate::process::{bake_file, beside_scenes, target_dir};

/// A small input and its right answer.
pub(crate) struct SmallCase {
    /// Its path below `cases` beside the real scenes.
    pub(crate) file: &'static str,
    /// Unit and axes of a file that does not say them.
    pub(crate) given: &'static [&'static str],
    /// Its rooms; `None` if it must be refused, or if its page tells only of portals.
    rooms: Option<usize>,
    /// The kind of portals that are counted, or `portal` for all, and their number.
    portals: Option<(&'static str, usize)>,
    /// Words of the report: of the refusal, or of what was left out.
    words: &'static [&'static str],
}

/// Returns a case by its rooms.
const fn rooms(file: &'static str, n: usize) -> SmallCase {
    SmallCase {
        file,
        given: &[],
        rooms: Some(n),
        portals: None,
        words: &[],
    }
}

/// Returns a level of two rooms.
const fn two(file: &'static str) -> SmallCase {
    rooms(file, 2)
}

/// Returns a case that must be refused.
const fn refused(file: &'static str, words: &'static [&'static str]) -> SmallCase {
    SmallCase {
        rooms: None,
        ..two(file).told(words)
    }
}

impl SmallCase {
    const fn with(mut self, kind: &'static str, n: usize) -> Self {
        self.portals = Some((kind, n));
        self
    }

    const fn told(mut self, words: &'static [&'static str]) -> Self {
        self.words = words;
        self
    }

    const fn given(mut self, given: &'static [&'static str]) -> Self {
        self.given = given;
        self
    }

    /// Returns a level whose doorway is a wall; whether the room behind it counts is open.
    const fn shut(file: &'static str) -> Self {
        Self {
            rooms: None,
            ..two(file).with("portal", 0)
        }
    }

    /// Returns what is right, in words.
    pub(crate) fn wanted(&self) -> String {
        let rooms = self.rooms.map(|n| format!("{n} rooms"));
        let portals = self.portals.map(|(kind, n)| format!("{n} of kind {kind}"));
        let told = (!self.words.is_empty()).then(|| format!("says {}", self.words.join(", ")));
        let refused = (rooms.is_none() && portals.is_none()).then(|| "refused".to_owned());
        let all = [refused, rooms, portals, told].into_iter().flatten();
        all.collect::<Vec<_>>().join("; ")
    }
}

/// The cases of the verdict.
const JUDGED: [SmallCase; 20] = [
    rooms("buildings/inner_suite.obj", 3)
        .given(&["--unit", "m", "--up", "y"])
        .with("portal", 2),
    two("levels/carved-facing-air-with-box.glb").with("portal", 1),
    two("levels/carved-facing-matter-with-box.glb").with("portal", 1),
    two("levels/carved-facing-matter.glb").with("portal", 1),
    two("levels/doorway-2x2.25-in-4m-rooms-with-door.glb").with("door", 1),
    two("levels/helper-navmesh.glb").told(&["NavMesh"]),
    two("levels/helper-portal-in-doorway.glb").with("portal", 2),
    two("levels/helper-reflection.glb").told(&["ReflectionProbe"]),
    two("levels/helper-trigger.glb").told(&["TriggerVolume"]),
    two("levels/kit-hollow-panels.glb").with("door", 2),
    two("levels/kit-leaf-door-noceiling.glb"),
    two("levels/kit-leaf-door.glb").with("door", 2),
    two("levels/kit-leaf-wall_doorway_door.glb").with("door", 2),
    two("levels/lod-wall.glb").with("portal", 2),
    two("levels/msft-lod.glb").with("portal", 2),
    two("levels/q1-house-in-skybox.map").told(&["sky"]),
    two("levels/q1-plain.map").with("portal", 1),
    rooms("levels/room-in-room.glb", 3).with("portal", 3),
    two("levels/skybox.glb").told(&["Skybox"]),
    two("levels/two-rooms.glb").with("portal", 2),
];

/// The others.
const OTHERS: [SmallCase; 21] = [
    two("levels/d3-visportal.map").with("portal", 1),
    two("levels/ent-func_door.map").with("door", 1),
    SmallCase::shut("levels/fill-hl_null.map"),
    two("levels/fill-q1_skip.map").with("portal", 1),
    SmallCase::shut("levels/fill-q3_caulk.map"),
    two("levels/fill-src_trigger.map").with("portal", 1),
    two("levels/fill-tdm_aassolid.map").with("portal", 1),
    SmallCase::shut("levels/layer-hidden.map"),
    two("levels/layer-omitted.map").with("portal", 1),
    refused("levels/level-in-second-scene.glb", &["--scene"]),
    // 32 units a meter, as exported from a map.
    two("levels/obj-skip.obj")
        .given(&["--unit", "0.03125", "--up", "z"])
        .with("portal", 1),
    refused("levels/q1-leak.map", &["leak", "steps"]),
    two("levels/q2-areaportal-entity.map").with("portal", 1),
    two("levels/q3-areaportal-brush.map").with("portal", 1),
    refused("levels/shell-func_detail.map", &["--structural-name"]),
    refused("levels/shell-func_geo.map", &["--structural-name"]),
    two("levels/skydome40.glb"),
    // As their author's tests have it.
    refused("../levels/q1_detail_non_sealing.map", &["leak"]),
    rooms("../levels/q2_areaportals.map", 3).with("portal", 2),
    rooms("../levels/q2_seal_empty_rooms.map", 1),
    rooms("../levels/base1leak.map", 1).with("portal", 0),
];

/// The longest bake of a case. [Units: s]
const LONGEST: &str = "120";

/// Returns the cases of a list that are there, and their files.
fn there(all: &'static [SmallCase]) -> impl Iterator<Item = (&'static SmallCase, PathBuf)> {
    let dir = beside_scenes("cases");
    let file = move |case: &'static SmallCase| Some((case, dir.as_ref()?.join(case.file)));
    all.iter().filter_map(file).filter(|(_, f)| f.is_file())
}

/// Returns the cases of the verdict that are there, and their files.
pub(super) fn judged_cases() -> impl Iterator<Item = (&'static SmallCase, PathBuf)> {
    there(&JUDGED)
}

/// Returns all cases that are there, and their files.
pub(crate) fn cases() -> impl Iterator<Item = (&'static SmallCase, PathBuf)> {
    there(&JUDGED).chain(there(&OTHERS))
}

/// The answer to a case.
pub(crate) struct Found {
    /// The path of the world; `None` if it was refused.
    pub(crate) world: Option<PathBuf>,
    rooms: usize,
    portals: Vec<String>,
    /// The output of `bake --json`.
    pub(super) report: Value,
    /// All words of the bake.
    said: String,
}

impl Found {
    /// Bakes a case.
    pub(crate) fn of(case: &SmallCase, file: &Path) -> anyhow::Result<Self> {
        let name = file_name(file);
        let world = target_dir().join(format!("judge-case-{name}.glb"));
        let mut baking = bake_file(file, case.given, &world);
        let done = baking.args(["--json", "--max-time", LONGEST]).output()?;
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let said = text(&done.stderr) + &text(&done.stdout);
        if !done.status.success() {
            return Ok(Self {
                world: None,
                rooms: 0,
                portals: Vec::new(),
                report: Value::Null,
                said,
            });
        }
        let graph = inspect(&world)?;
        let is_room = |cell: &&Value| cell["outdoor"] != true && cell["kind"] != "void";
        let kind = |p: &Value| p["kind"].as_str().unwrap_or_default().to_owned();
        Ok(Self {
            rooms: list(&graph["cells"]).iter().filter(is_room).count(),
            portals: list(&graph["portals"]).iter().map(kind).collect(),
            report: serde_json::from_slice(&done.stdout)?,
            world: Some(world),
            said,
        })
    }

    /// Returns the smaller number of rooms, of the right one and this, as a share of the larger.
    pub(super) fn share_of_rooms(&self, case: &SmallCase) -> f64 {
        let n = case.rooms.unwrap_or(0);
        self.rooms.min(n) as f64 / self.rooms.max(n) as f64
    }

    /// Returns `true` if this is the right answer, and says what was found.
    pub(crate) fn judged(&self, case: &SmallCase) -> (bool, String) {
        let is_refusal = case.rooms.is_none() && case.portals.is_none();
        let of_kind = |kind: &str| {
            let counted = |p: &&String| kind == "portal" || *p == kind;
            self.portals.iter().filter(counted).count()
        };
        let ok = self.world.is_none() == is_refusal
            && case.rooms.is_none_or(|n| n == self.rooms)
            && case.portals.is_none_or(|(kind, n)| n == of_kind(kind))
            && case.words.iter().all(|word| self.said.contains(word));
        let found = match &self.world {
            Some(_) => format!("{} rooms; {}", self.rooms, self.portals.join(", ")),
            None => {
                let last = self.said.lines().rfind(|l| !l.is_empty());
                last.unwrap_or("refused").chars().take(200).collect()
            }
        };
        (ok, found)
    }
}
