//! Names of volumes that engines use and never draw: triggers, probes, zones, collision shapes.

use crate::words::words;

/// A phrase, in words, and the thing that it names.
type Phrase = (&'static [&'static str], &'static str);

/// Phrases that name a helper wherever they stand in a name, whatever its shape.
const ALWAYS: [Phrase; 32] = [
    (&["trigger", "volume"], "a trigger volume"),
    (&["trigger", "box"], "a trigger volume"),
    (&["trigger", "zone"], "a trigger volume"),
    (&["trigger", "area"], "a trigger volume"),
    (&["kill", "volume"], "a trigger volume"),
    (&["kill", "zone"], "a trigger volume"),
    (&["spawn", "volume"], "a trigger volume"),
    (&["reflection", "probe"], "a probe of light"),
    (&["light", "probe"], "a probe of light"),
    (&["lightmass", "importance"], "a volume of light"),
    (&["room", "bounds"], "bounds of a room"),
    (&["nav", "mesh"], "a navigation mesh"),
    (&["navmesh"], "a navigation mesh"),
    (&["navigation", "mesh"], "a navigation mesh"),
    (&["nav", "blocker"], "a navigation mesh"),
    (&["collider"], "a collision shape"),
    (&["colliders"], "a collision shape"),
    (&["audio", "zone"], "a zone of sound"),
    (&["audio", "volume"], "a zone of sound"),
    (&["sound", "zone"], "a zone of sound"),
    (&["reverb", "zone"], "a zone of sound"),
    (&["reverb", "volume"], "a zone of sound"),
    (&["occlusion", "volume"], "a volume of occlusion"),
    (&["occlusion", "area"], "a volume of occlusion"),
    (&["occlusion", "portal"], "a mark of an opening"),
    (&["cull", "volume"], "a volume of occlusion"),
    (&["culling", "volume"], "a volume of occlusion"),
    (&["visibility", "volume"], "a volume of occlusion"),
    (&["post", "process"], "a volume of effects"),
    (&["postprocess"], "a volume of effects"),
    (&["blocking", "volume"], "a collision shape"),
    (&["physics", "volume"], "a volume of physics"),
];

/// Phrases that name a helper at the end of the name of a plain box or sheet: anything else may be a thing called so, such as
/// an arch.
const PLAIN: [Phrase; 7] = [
    (&["trigger"], "a trigger volume"),
    (&["bounds"], "bounds"),
    (&["collision"], "a collision shape"),
    (&["hitbox"], "a collision shape"),
    (&["portal"], "a mark of an opening"),
    (&["visportal"], "a mark of an opening"),
    (&["areaportal"], "a mark of an opening"),
];

/// The last word of a collision shape made beside the mesh that is drawn: `Wall_collision`.
const BESIDE: &str = "collision";

/// Returns the thing that a name is of, if that is a helper. `is_plain` tells that it has no more triangles than a box.
pub(crate) fn of_name(name: &str, is_plain: bool) -> Option<&'static str> {
    let words = words(name);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let always = ALWAYS
        .iter()
        .find(|(phrase, _)| words.windows(phrase.len()).any(|w| w == *phrase));
    let at_end = || PLAIN.iter().find(|(phrase, _)| words.ends_with(phrase));
    let plain = || at_end().filter(|_| is_plain);
    let found = always.or_else(plain).map(|(_, thing)| *thing);
    let is_beside = words.len() > 1 && words.last() == Some(&BESIDE);
    found.or(is_beside.then_some("a collision shape"))
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
        ] {
            assert!(of_name(name, false).is_some(), "{name}");
        }
        for name in ["Portal", "Portal_03", "Door trigger", "Bounds"] {
            assert!(of_name(name, true).is_some(), "{name}");
            assert!(of_name(name, false).is_none(), "{name}");
        }
    }

    #[test]
    fn things_of_a_building_are_none() {
        for name in [
            "Zone 1",
            "Volume",
            "portal:a",
            "Portal frame",
            "light box",
            "Sound wall",
            "probe",
            "boundary wall",
            "",
        ] {
            assert!(of_name(name, true).is_none(), "{name}");
        }
    }
}
