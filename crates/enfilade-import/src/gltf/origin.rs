//! Names and extras of glTF documents: nodes, lights, cameras, markers.

use enfilade_geom::DMat4;
use enfilade_geom::scene::{Fixture, FixtureKind};
use serde_json::Value;
use serde_json::value::RawValue;

use super::json::Root;
use crate::ImportError;
use crate::builder::Builder;
use crate::origins::rigid;

/// Adds a node to the tree of names and returns its number there.
pub(super) fn add_node(
    root: &Root,
    i: usize,
    parent: Option<u32>,
    builder: &mut Builder<'_>,
) -> Result<Option<u32>, ImportError> {
    let node = &root.nodes[i];
    let mesh = node.mesh.and_then(|m| root.meshes.get(m as usize));
    let own = node.name.as_deref().filter(|n| !n.is_empty());
    let name = own.or(mesh.and_then(|m| m.name.as_deref())).unwrap_or("");
    let place = format!("node {i} '{name}'");
    builder.add_source(&place, parent, name, text(node.extras.as_deref()))
}

/// Adds the light, the camera and the marker of a node. A marker is a node with a name or extras and nothing on or
/// below it.
pub(super) fn add_fixtures(
    root: &Root,
    i: usize,
    world: &DMat4,
    is_joint: bool,
    builder: &mut Builder<'_>,
) -> Result<(), ImportError> {
    let node = &root.nodes[i];
    let light = node.extensions.as_ref().and_then(|e| e.light.as_ref());
    let is_marker = light.is_none()
        && node.camera.is_none()
        && node.mesh.is_none()
        && node.children.is_empty()
        && (node.name.as_deref().is_some_and(|n| !n.is_empty()) || node.extras.is_some())
        && !is_joint;
    let lights = root.extensions.as_ref().and_then(|e| e.lights.as_ref());
    let light = light.map(|l| lights.and_then(|all| all.lights.get(l.light as usize)));
    let camera = node.camera.map(|c| root.cameras.get(c as usize));
    let placed = [
        (FixtureKind::Light, light),
        (FixtureKind::Camera, camera),
        (FixtureKind::Marker, is_marker.then_some(Some(&Value::Null))),
    ];
    for (kind, def) in placed {
        let Some(def) = def else { continue };
        let name = node.name.as_deref().unwrap_or("");
        let place = format!("node {i} '{name}'");
        let Some(gltf) = def.and_then(|d| in_meters(d, builder.unit())) else {
            builder.note(place, "a light or camera that is not in the file; left out");
            continue;
        };
        let fixture = Fixture {
            kind,
            name: name.to_owned(),
            transform: rigid(world),
            gltf,
            extras: text(node.extras.as_deref()).to_owned(),
        };
        builder.add_fixture(&place, fixture)?;
    }
    Ok(())
}

/// Lengths in lights and cameras; all else is angles, intensities, colors and names.
const LENGTHS: [&str; 5] = ["range", "znear", "zfar", "xmag", "ymag"];

/// Returns a light or camera with its lengths in meters, empty for null; `None` for another value.
fn in_meters(def: &Value, unit: f64) -> Option<String> {
    let mut def = match def {
        Value::Null => return Some(String::new()),
        Value::Object(def) => def.clone(),
        _ => return None,
    };
    def.get("type")?.as_str()?;
    let scale = |map: &mut serde_json::Map<String, Value>| {
        for length in LENGTHS {
            if let Some(value) = map.get_mut(length)
                && let Some(number) = value.as_f64()
                && unit != 1.0
            {
                *value = (number * unit).into();
            }
        }
    };
    scale(&mut def);
    for part in ["perspective", "orthographic"] {
        if let Some(Value::Object(part)) = def.get_mut(part) {
            scale(part);
        }
    }
    Some(Value::Object(def).to_string())
}

/// Returns `true` for each node that is a bone.
pub(super) fn joints(root: &Root) -> Vec<bool> {
    let mut is_joint = vec![false; root.nodes.len()];
    for &joint in root.skins.iter().flat_map(|s| s.joints.iter()) {
        if let Some(slot) = is_joint.get_mut(joint as usize) {
            *slot = true;
        }
    }
    is_joint
}

pub(super) fn text(extras: Option<&RawValue>) -> &str {
    extras.map_or("", RawValue::get)
}

/// Adds the copyright and the extras of the document as a whole.
pub(super) fn add_about(root: &Root, builder: &mut Builder<'_>) {
    let copyright = root.asset.copyright.as_deref().unwrap_or("");
    let scene = root.scenes.get(root.scene.unwrap_or(0));
    builder.add_about(copyright, text(scene.and_then(|s| s.extras.as_deref())));
}
