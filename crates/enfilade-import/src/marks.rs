//! Objects that become mirrors or linked portals, by their names.
//!
//! A name marks if its first word is `mirror`, unless another word is `frame`, or if it begins with `portal:`. The number that modelers
//! append to a name in use (`.001`) does not count. The object's name decides, then its mesh's; if neither marks, the names of
//! materials do, each for its own triangles. A value `enfilade` in the node's `extras` decides instead of all names: `mirror`,
//! `portal:NAME`, or any other for a plain object.

use enfilade_geom::scene::{Mark, MarkKind, Object, Scene};
use enfilade_prepare::{marked_portal, words};
use serde_json::Value;

/// Key of the mark in `extras`.
const KEY: &str = "enfilade";

/// Returns all marks of a scene, in the order of its objects. Linear time.
pub(crate) fn of_scene(scene: &Scene) -> Vec<Mark> {
    let by_node: Vec<Option<Option<MarkKind>>> =
        (scene.nodes.iter()).map(|n| of_extras(&n.extras)).collect();
    let by_mesh: Vec<Option<MarkKind>> = scene.meshes.iter().map(|m| of_name(&m.name)).collect();
    let by_material: Vec<Option<MarkKind>> =
        scene.materials.iter().map(|m| of_name(&m.name)).collect();
    let mut marks = Vec::new();
    for (number, object) in (0..).zip(&scene.objects) {
        let mark = |primitive, kind: &MarkKind| Mark {
            object: number,
            primitive,
            kind: kind.clone(),
        };
        let asked = object.node.and_then(|n| by_node.get(n as usize)?.as_ref());
        if let Some(asked) = asked {
            marks.extend(asked.iter().map(|kind| mark(None, kind)));
            continue;
        }
        let named = of_name(&object.name);
        if let Some(kind) = named.as_ref().or(by_mesh[object.mesh as usize].as_ref()) {
            marks.push(mark(None, kind));
            continue;
        }
        for (primitive, material) in materials(scene, object) {
            let kind = material.and_then(|m| by_material.get(m as usize)?.as_ref());
            marks.extend(kind.map(|kind| mark(Some(primitive), kind)));
        }
    }
    marks
}

/// Returns the materials of an object's primitives.
fn materials<'s>(
    scene: &'s Scene,
    object: &Object,
) -> impl Iterator<Item = (u32, Option<u32>)> + use<'s> {
    let primitives = &scene.meshes[object.mesh as usize].primitives;
    (0..).zip(primitives.iter().map(|p| p.material))
}

/// Returns the mark that extras ask for; `Some(None)` for a plain object.
fn of_extras(extras: &str) -> Option<Option<MarkKind>> {
    let asked = asked(extras)?;
    if asked.eq_ignore_ascii_case("mirror") {
        return Some(Some(MarkKind::Mirror));
    }
    Some(marked_portal(&asked).map(|name| MarkKind::Portal(name.to_owned())))
}

/// Returns the value by which extras decide, whatever the names.
pub(crate) fn asked(extras: &str) -> Option<String> {
    if !extras.contains(KEY) {
        return None;
    }
    let value: Value = serde_json::from_str(extras).ok()?;
    Some(value.get(KEY)?.as_str()?.trim().to_owned())
}

/// Returns the mark that a name makes.
fn of_name(name: &str) -> Option<MarkKind> {
    if let Some(name) = marked_portal(name) {
        return Some(MarkKind::Portal(without_number(name).to_owned()));
    }
    let words = words(name);
    let is_mirror =
        words.first().is_some_and(|w| w == "mirror") && words.iter().all(|w| w != "frame");
    is_mirror.then_some(MarkKind::Mirror)
}

/// Returns a name without the `.001` that modelers append.
pub(crate) fn without_number(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((rest, number)) if number.len() >= 3 && number.bytes().all(|b| b.is_ascii_digit()) => {
            rest.trim_end()
        }
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_word_marks_a_mirror_and_a_prefix_a_portal() {
        for name in [
            "mirror",
            "Mirror_bath",
            "MIRROR.001",
            "MirrorHall",
            "mirror 2",
        ] {
            assert_eq!(of_name(name), Some(MarkKind::Mirror), "{name}");
        }
        for name in [
            "",
            "hall mirror",
            "mirrored",
            "Mirror_frame",
            "mirrorFrame.002",
            "portal",
            "portals:a",
        ] {
            assert_eq!(of_name(name), None, "{name}");
        }
        for (name, portal) in [
            ("portal:a", "a"),
            ("Portal: a.001", "a"),
            ("PORTAL:v1.2", "v1.2"),
            ("portal:", ""),
        ] {
            assert_eq!(
                of_name(name),
                Some(MarkKind::Portal(portal.into())),
                "{name}"
            );
        }
    }

    #[test]
    fn extras_decide_before_names() {
        let of = |text: &str| of_extras(text);
        assert_eq!(of(r#"{"enfilade":"Mirror"}"#), Some(Some(MarkKind::Mirror)));
        let portal = MarkKind::Portal("a".into());
        assert_eq!(of(r#"{"enfilade":"portal:a","n":1}"#), Some(Some(portal)));
        assert_eq!(of(r#"{"enfilade":"plain"}"#), Some(None));
        for text in ["", "{}", "7", r#"{"enfilade":1}"#, r#"{"x":"enfilade"}"#] {
            assert_eq!(of(text), None, "{text}");
        }
    }
}
