//! Names and metadata of the input: tree of names, lights, cameras, markers, copyright.

use enfilade_geom::scene::{About, Entity, Fixture, FixtureKind, Object, Scene, SourceNode};
use enfilade_geom::{DMat3, DMat4, DVec3};
use serde_json::{Map, Value};
use std::collections::{BTreeSet, HashMap};

/// Deepest nesting of brackets in data kept for applications: worlds nest it a few levels deeper, and JSON readers
/// stop at 128.
const MAX_NESTING: usize = 100;

/// Names and metadata under construction.
#[derive(Default)]
pub(crate) struct Origins {
    nodes: Vec<SourceNode>,
    fixtures: Vec<Fixture>,
    /// Copyrights of the files, each once.
    copyrights: BTreeSet<String>,
    /// Extras of the scene as a whole.
    extras: String,
}

impl Origins {
    /// Adds a node below `parent` and returns its number. A node without name and extras is left out: it returns `parent`.
    pub(crate) fn add(&mut self, parent: Option<u32>, name: &str, extras: &str) -> Option<u32> {
        if name.is_empty() && extras.is_empty() {
            return parent;
        }
        self.nodes.push(SourceNode {
            name: name.to_owned(),
            parent,
            extras: extras.to_owned(),
        });
        Some(self.nodes.len() as u32 - 1)
    }

    /// Returns a node by its number.
    pub(crate) fn node(&self, number: Option<u32>) -> Option<&SourceNode> {
        self.nodes.get(number? as usize)
    }

    pub(crate) fn add_fixture(&mut self, fixture: Fixture) {
        self.fixtures.push(fixture);
    }

    /// Adds the copyright of one more file and the extras of its scene. Only the least extras, as text, are kept,
    /// whatever the order of files; returns `true` if others were left out.
    pub(crate) fn add_about(&mut self, copyright: &str, extras: &str) -> bool {
        if !copyright.is_empty() {
            self.copyrights.insert(copyright.to_owned());
        }
        if extras.is_empty() {
            return false;
        }
        let is_first = self.extras.is_empty();
        if is_first || *extras < *self.extras {
            extras.clone_into(&mut self.extras);
        }
        !is_first
    }

    /// Moves everything into the scene. Objects without a node get one with their own name; nodes without an object
    /// at or below them are removed.
    pub(crate) fn move_into(mut self, scene: &mut Scene) {
        let entities = scene.entities.iter();
        let entity_of: HashMap<u32, &Entity> =
            entities.filter_map(|e| Some((e.object?, e))).collect();
        let unnamed = (0..scene.objects.len()).filter(|&i| scene.objects[i].node.is_none());
        let made: Vec<(usize, Option<u32>)> = unnamed
            .map(|i| {
                let entity = entity_of.get(&(i as u32));
                let extras = entity.map(|e| extras_of(e)).unwrap_or_default();
                (i, self.add(None, &scene.objects[i].name, &extras))
            })
            .collect();
        for (i, node) in made {
            scene.objects[i].node = node;
        }
        for entity in scene.entities.iter().filter(|e| e.object.is_none()) {
            if let Some(position) = entity.position {
                self.fixtures.push(Fixture {
                    kind: FixtureKind::Marker,
                    name: entity.class.clone(),
                    transform: rigid(&DMat4::from_translation(position)),
                    gltf: String::new(),
                    extras: extras_of(entity),
                });
            }
        }
        let mut is_used = vec![false; self.nodes.len()];
        for node in scene.objects.iter().filter_map(|o| o.node) {
            is_used[node as usize] = true;
        }
        for i in (0..self.nodes.len()).rev() {
            if let Some(parent) = self.nodes[i].parent.filter(|_| is_used[i]) {
                is_used[parent as usize] = true;
            }
        }
        let mut number = vec![0; self.nodes.len()];
        for (i, mut node) in self.nodes.into_iter().enumerate() {
            if is_used[i] {
                number[i] = scene.nodes.len() as u32;
                node.parent = node.parent.map(|p| number[p as usize]);
                scene.nodes.push(node);
            }
        }
        for object in &mut scene.objects {
            object.node = object.node.map(|n| number[n as usize]);
        }
        name_after_groups(scene);
        scene.fixtures = self.fixtures;
        scene.about = About {
            copyright: Vec::from_iter(self.copyrights).join("\n"),
            extras: self.extras,
        };
    }
}

/// Names objects without a node of their own after the node around them where the name of their mesh, or none, would make them
/// another's: if an object has the node's name, or another node has theirs.
fn name_after_groups(scene: &mut Scene) {
    let named: BTreeSet<&str> = scene.nodes.iter().map(|node| &*node.name).collect();
    let group = |object: &Object| object.node.map(|n| (n, &*scene.nodes[n as usize].name));
    let is_own = |object: &&Object| group(object).is_some_and(|g| g.1 == object.name);
    let owned: BTreeSet<u32> = scene
        .objects
        .iter()
        .filter(is_own)
        .filter_map(|o| o.node)
        .collect();
    let renamed: Vec<(usize, String)> = (0..)
        .zip(&scene.objects)
        .filter_map(|(i, object)| {
            let (node, name) = group(object)?;
            let is_elsewhere = !object.name.is_empty() && named.contains(&*object.name);
            (object.name != name && (is_elsewhere || owned.contains(&node)))
                .then(|| (i, name.to_owned()))
        })
        .collect();
    for (i, name) in renamed {
        scene.objects[i].name = name;
    }
}

/// Returns an entity's properties as a JSON object.
pub(crate) fn extras_of(entity: &Entity) -> String {
    let properties = entity.properties.iter();
    let all: Map<String, Value> = properties
        .map(|(key, value)| (key.clone(), value.as_str().into()))
        .collect();
    Value::Object(all).to_string()
}

/// Returns `true` if JSON text nests no deeper than a world allows.
pub(crate) fn is_shallow(json: &str) -> bool {
    let (mut depth, mut in_text, mut is_escaped) = (0_usize, false, false);
    for byte in json.bytes() {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' if in_text => is_escaped = true,
            b'"' => in_text = !in_text,
            b'[' | b'{' if !in_text => depth += 1,
            b']' | b'}' if !in_text => depth -= 1,
            _ => {}
        }
        if depth > MAX_NESTING {
            return false;
        }
    }
    true
}

/// Returns the rotation and translation nearest to a transform, as files store them: the direction -z and y-up are
/// kept.
pub(crate) fn rigid(transform: &DMat4) -> DMat4 {
    let [up, back] = [transform.y_axis, transform.z_axis].map(|a| a.truncate().try_normalize());
    let (up, back) = (up.unwrap_or(DVec3::Y), back.unwrap_or(DVec3::Z));
    let right = up.cross(back).try_normalize();
    let right = right.unwrap_or_else(|| back.any_orthonormal_vector());
    let rotation = DMat3::from_cols(right, back.cross(right), back);
    let mut out = DMat4::from_mat3(rotation);
    out.w_axis = transform.w_axis.truncate().extend(1.0);
    out.as_mat4().as_dmat4()
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::scene::{Object, Role};

    fn object(name: &str, node: Option<u32>) -> Object {
        Object {
            name: name.into(),
            mesh: 0,
            transform: DMat4::IDENTITY,
            role: Role::Structural,
            reason: String::new(),
            filling: None,
            node,
        }
    }

    #[test]
    fn names_of_nothing_go_and_all_others_keep_what_is_above_them() {
        let mut origins = Origins::default();
        let house = origins.add(None, "house", "");
        let empty = origins.add(house, "", "");
        assert_eq!(empty, house);
        origins.add(empty, "left out", "");
        let wall = origins.add(house, "wall", r#"{"fire":60}"#);
        let mut scene = Scene {
            objects: vec![object("wall", wall), object("soup", None)],
            ..Scene::default()
        };
        origins.move_into(&mut scene);
        let names: Vec<_> = scene.nodes.iter().map(|n| n.name.as_str()).collect();
        assert_eq!(names, ["house", "wall", "soup"]);
        assert_eq!(scene.nodes[1].parent, Some(0));
        let of_objects: Vec<_> = scene.objects.iter().map(|o| o.node).collect();
        assert_eq!(of_objects, [Some(1), Some(2)]);
    }

    #[test]
    fn nesting_is_counted_outside_of_text() {
        let deep = |n: usize| "[".repeat(n) + &"]".repeat(n);
        assert!(is_shallow(&deep(MAX_NESTING)) && !is_shallow(&deep(MAX_NESTING + 1)));
        assert!(is_shallow(&format!("\"\\\"{}\"", deep(300))));
    }

    #[test]
    fn what_was_scaled_and_sheared_still_looks_where_it_looked() {
        let sheared = DMat4::from_scale(DVec3::new(2.0, 3.0, 1e-3))
            * DMat4::from_rotation_y(0.7)
            * DMat4::from_translation(DVec3::ONE);
        let m = rigid(&sheared);
        assert!((m.determinant() - 1.0).abs() < 1e-6);
        let looks = |m: &DMat4| m.z_axis.truncate().normalize();
        assert!(looks(&m).distance(looks(&sheared)) < 1e-6);
        assert_eq!(m.w_axis, sheared.w_axis.as_vec4().as_dvec4());
        assert!(rigid(&DMat4::ZERO).is_finite());
    }
}
