//! Volumes that engines use and never draw: triggers, probes, zones, collision shapes, by name and by shape.

use std::collections::BTreeMap;

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Rectangle, Triangle, facing, triangle_area_normal};

use crate::auto_roles::DEFAULT;
use crate::words::words;

/// A mark of an opening.
pub(crate) const OPENING: &str = "a mark of an opening";

/// A phrase, in words, and the thing that it names.
type Phrase = (&'static [&'static str], &'static str);

/// Phrases that name a helper wherever they stand in a name, whatever its shape.
const ALWAYS: [Phrase; 50] = [
    (&["trigger", "volume"], "a trigger volume"),
    (&["trigger", "box"], "a trigger volume"),
    (&["trigger", "zone"], "a trigger volume"),
    (&["trigger", "area"], "a trigger volume"),
    (&["kill", "volume"], "a trigger volume"),
    (&["kill", "zone"], "a trigger volume"),
    (&["kill", "z"], "a trigger volume"),
    (&["spawn", "volume"], "a trigger volume"),
    (&["spawn", "area"], "a trigger volume"),
    (&["sensor", "area"], "a trigger volume"),
    (&["reflection", "probe"], "a probe of light"),
    (&["reflection", "capture"], "a probe of light"),
    (&["light", "probe"], "a probe of light"),
    (&["lightmass", "importance"], "a volume of light"),
    (&["voxel", "gi"], "a volume of light"),
    (&["lightmap"], "a volume of light"),
    (&["room", "bounds"], "bounds of a room"),
    (&["ak", "room"], "a zone of sound"),
    (&["nav", "mesh"], "a navigation mesh"),
    (&["nav", "blocker"], "a navigation mesh"),
    (&["nav", "link"], "a navigation mesh"),
    (&["nav", "modifier"], "a navigation mesh"),
    (&["navmesh"], "a navigation mesh"),
    (&["navigation", "mesh"], "a navigation mesh"),
    (&["navigation", "region"], "a navigation mesh"),
    (&["navigation", "link"], "a navigation mesh"),
    (&["collider"], "a collision shape"),
    (&["colliders"], "a collision shape"),
    (&["invisible", "wall"], "a collision shape"),
    (&["player", "clip"], "a collision shape"),
    (&["hurtbox"], "a collision shape"),
    (&["audio", "zone"], "a zone of sound"),
    (&["audio", "volume"], "a zone of sound"),
    (&["audio", "probe"], "a zone of sound"),
    (&["sound", "zone"], "a zone of sound"),
    (&["reverb", "zone"], "a zone of sound"),
    (&["reverb", "volume"], "a zone of sound"),
    (&["occlusion", "volume"], "a volume of occlusion"),
    (&["occlusion", "area"], "a volume of occlusion"),
    (&["occlusion", "portal"], OPENING),
    (&["occluder"], "a volume of occlusion"),
    (&["notifier"], "a volume of visibility"),
    (&["cull", "volume"], "a volume of occlusion"),
    (&["culling", "volume"], "a volume of occlusion"),
    (&["visibility", "volume"], "a volume of occlusion"),
    (&["post", "process"], "a volume of effects"),
    (&["postprocess"], "a volume of effects"),
    (&["blocking", "volume"], "a collision shape"),
    (&["physics", "volume"], "a volume of physics"),
    (&["area", "d"], "a trigger volume"),
];

/// Phrases that name a helper at the end of the name of a plain box or sheet: anything else may be a thing called so, such as
/// an arch.
const PLAIN: [Phrase; 8] = [
    (&["trigger"], "a trigger volume"),
    (&["bounds"], "bounds"),
    (&["bound"], "bounds"),
    (&["collision"], "a collision shape"),
    (&["hitbox"], "a collision shape"),
    (&["portal"], OPENING),
    (&["visportal"], OPENING),
    (&["areaportal"], OPENING),
];

/// Last words, behind another, of the names of plain boxes that engines call so and that things go into, but for parts of buildings: a
/// main volume.
const KINDS: [(&str, &str); 3] = [
    ("volume", "a volume of an engine"),
    ("zone", "a zone of an engine"),
    ("probe", "a probe of an engine"),
];

/// Words for things that fill an opening. Any structural word beside them wins: kits name a wall with a hole in it
/// `wall_door`.
pub(crate) const OPENING_WORDS: [&str; 8] = [
    "door", "window", "gate", "shutter", "glass", "glazing", "pane", "leaf",
];

/// Words for the volumes that a building consists of.
const MASSING: [&str; 10] = [
    "building", "floor", "house", "lower", "main", "mass", "massing", "roof", "stair", "upper",
];

/// Least thickness of a box that things go into, metres: more than a wall has, less than a person takes.
const ROOMY: f64 = 0.5;

/// The beginning of the name of a portal of Godot, before that of the room to which it leads.
const PORTAL_TO: &str = "Portal_";
/// Words for what stands around an opening, beside which that is not the name of a room.
const AROUND: [&str; 5] = ["arch", "frame", "jamb", "lintel", "wall"];

/// The word for a collision shape made beside the mesh that is drawn: `Wall_collision`, `collision_hull`.
const BESIDE: &str = "collision";

/// Returns the thing that a name is of, if that is a helper. The thickness is that of a box or less, metres.
pub(crate) fn of_name(name: &str, thickness_if_plain: Option<f64>) -> Option<&'static str> {
    let words = words(name);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let is_plain = thickness_if_plain.is_some();
    let is_roomy = thickness_if_plain.is_some_and(|t| t >= ROOMY);
    let has = |list: &[&str]| words.iter().any(|w| list.contains(w));
    let always = ALWAYS
        .iter()
        .find(|(phrase, _)| words.windows(phrase.len()).any(|w| w == *phrase));
    let at_end = || PLAIN.iter().find(|(phrase, _)| words.ends_with(phrase));
    let plain = || at_end().filter(|_| is_plain);
    let kind = || KINDS.iter().find(|(last, _)| words.last() == Some(last));
    // Walls are not named after openings.
    let is_no_wall = || is_roomy || (is_plain && has(&OPENING_WORDS));
    let is_of_engine = || is_no_wall() && words.len() > 1 && !has(&MASSING);
    let of_kind = || kind().filter(|_| is_of_engine()).map(|(_, thing)| *thing);
    let leads = || (is_plain && name.starts_with(PORTAL_TO) && !has(&AROUND)).then_some(OPENING);
    let found = (always.or_else(plain).map(|(_, thing)| *thing))
        .or_else(leads)
        .or_else(of_kind);
    let is_beside = words.len() > 1 && words.contains(&BESIDE);
    found.or(is_beside.then_some("a collision shape"))
}

/// Triangles of a box.
const BOX_TRIANGLES: usize = 12;
/// Greatest difference of an object's surface from that of the box around it, relative to it.
const BOX_SURFACE: f64 = 0.01;

/// Returns the objects that may be helpers by their shape, ascending: boxes that are structure for want of a rule, with materials that
/// nothing but such boxes has. A pillar may be one, too: whether rooms are better without them, only a bake tells.
///
/// Linear in triangles.
#[must_use]
pub fn unnamed_helpers(scene: &Scene) -> Vec<usize> {
    let mut has_others: BTreeMap<Option<u32>, bool> = BTreeMap::new();
    let mut boxes = Vec::new();
    let structural = scene.objects.iter().enumerate();
    for (i, object) in structural.filter(|(_, o)| o.role == Role::Structural) {
        let primitives = &scene.meshes[object.mesh as usize].primitives;
        let placed = primitives
            .iter()
            .flat_map(|p| p.placed_triangles(object.transform));
        let is_lone = object.reason == DEFAULT && is_box(&placed.collect::<Vec<_>>());
        for primitive in primitives {
            *has_others.entry(primitive.material).or_default() |= !is_lone;
        }
        if is_lone {
            boxes.push(i);
        }
    }
    boxes.retain(|&i| {
        let primitives = &scene.meshes[scene.objects[i].mesh as usize].primitives;
        primitives.iter().all(|p| !has_others[&p.material])
    });
    boxes
}

/// Returns `true` if triangles are those of a box.
fn is_box(triangles: &[Triangle]) -> bool {
    if triangles.len() != BOX_TRIANGLES {
        return false;
    }
    let size = Rectangle::around(facing(triangles), triangles.as_flattened()).size();
    let around = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    let own: f64 = triangles
        .iter()
        .map(|t| triangle_area_normal(t).length() / 2.0)
        .sum();
    size.min_element() > 0.0 && (own - around).abs() <= BOX_SURFACE * around
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn helpers_of_engines_are_known_by_name() {
        for name in [
            "TriggerVolume_01",
            "ReflectionProbe.001",
            "RoomBounds_Kitchen",
            "NavMesh",
            "navmesh_02",
            "BoxCollider",
            "AudioZone_Hall",
            "OcclusionVolume",
            "PostProcessVolume",
            "Wall_collision",
            "OcclusionPortal",
            "NavigationRegion3D",
            "KillZVolume",
            "Collision_Wall",
            "InvisibleWall",
        ] {
            assert!(of_name(name, None).is_some(), "{name}");
        }
        for name in [
            "Portal",
            "Portal_03",
            "Portal_kitchen",
            "hall-portal",
            "hall-bound",
            "Door trigger",
            "Bounds",
        ] {
            assert!(of_name(name, Some(3.0)).is_some(), "{name}");
            assert!(of_name(name, None).is_none(), "{name}");
        }
    }

    #[test]
    fn things_of_a_building_are_none() {
        for name in [
            "Zone 1",
            "Volume",
            "portal:a",
            "Portal frame",
            "Portal_frame",
            "light box",
            "Sound wall",
            "probe",
            "boundary wall",
            "Main volume",
            "nav_test",
            "Roof volume",
            "",
        ] {
            assert!(of_name(name, Some(3.0)).is_none(), "{name}");
        }
        // A wall is thinner than what things go into.
        for name in ["Storage zone", "Stack volume", "Hall probe"] {
            assert!(of_name(name, Some(0.3)).is_none(), "{name}");
            assert!(of_name(name, Some(0.5)).is_some(), "{name}");
        }
        // A thin zone in a doorway: neither a leaf nor a wall.
        for name in ["Door_zone", "WindowVolume", "gate probe"] {
            assert!(of_name(name, Some(0.2)).is_some(), "{name}");
            assert!(of_name(name, None).is_none(), "{name}");
        }
    }
}
