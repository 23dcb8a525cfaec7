//! Reads the input's information about itself from a file: names, lights, cameras, terms of use.

use enfilade_geom::DMat4;
use enfilade_geom::scene::{About, Fixture, FixtureKind, SourceNode};
use serde_json::value::RawValue;

use super::transform::of_node;
use super::{WireError, broken, json};

pub(super) fn source(source: &json::SourceJson) -> SourceNode {
    SourceNode {
        name: source.name.clone(),
        parent: source.parent,
        extras: text_of(source.extras.as_deref()),
    }
}

/// Reads the light, camera or marked place of a node.
pub(super) fn fixture(root: &json::Root, node: u32) -> Result<Fixture, WireError> {
    let at = || format!("fixtures, node {node}");
    let missing = || broken(at(), "is not a light, camera or marked place in the file");
    let node = root.nodes.get(node as usize).ok_or_else(missing)?;
    let light = node.extensions.light.as_ref().map(|l| l.light as usize);
    let text =
        |found: Option<&Box<RawValue>>| found.map(|t| t.get().to_owned()).ok_or_else(missing);
    let (kind, gltf) = match (light, node.camera) {
        (Some(light), None) => {
            let lights = root.extensions.lights.as_ref();
            let def = lights.and_then(|l| l.lights.get(light));
            (FixtureKind::Light, text(def)?)
        }
        (None, Some(camera)) => (
            FixtureKind::Camera,
            text(root.cameras.get(camera as usize))?,
        ),
        (None, None) => (FixtureKind::Marker, String::new()),
        _ => return Err(missing()),
    };
    let transform = of_node(node).map_err(|why| broken(at(), why))?;
    Ok(Fixture {
        kind,
        name: node.name.clone(),
        transform: DMat4::from_cols_array(&transform.map(f64::from)),
        gltf,
        extras: text_of(node.extras.as_deref()),
    })
}

pub(super) fn about(root: &json::Root) -> About {
    let scene = root.scenes.get(root.scene as usize);
    About {
        copyright: root.asset.copyright.clone(),
        extras: text_of(scene.and_then(|s| s.extras.as_deref())),
    }
}

fn text_of(value: Option<&RawValue>) -> String {
    value.map_or_else(String::new, |v| v.get().to_owned())
}
