//! Objects that stand for others in the same place: coarser levels of detail (`Wall_LOD1` beside `Wall_LOD0`), of which an
//! engine draws one at a time, and collision shapes (`Wall-col` beside `Wall`), which it never draws.

use enfilade_geom::scene::Scene;
use std::collections::HashMap;

/// Most objects of one name that are compared by place; more are taken to lie in the same one.
const MOST: usize = 1000;

/// Returns the objects that are coarser levels of others in the same place, ascending. O(n) but for up to a thousand objects of
/// one name, which are compared in pairs.
#[must_use]
pub fn lower_levels(scene: &Scene) -> Vec<usize> {
    copies(scene, level_of)
}

/// Returns the objects that end in `-col` or `-convcol` where one without it is in the same place, ascending. As fast as
/// [`lower_levels`].
#[must_use]
pub fn collision_copies(scene: &Scene) -> Vec<usize> {
    copies(scene, |name| {
        let stem = without_copy(name).to_lowercase();
        let ends = ["-col", "_col", "$col", "-convcol", "_convcol", "$convcol"];
        let base = ends.into_iter().find_map(|end| stem.strip_suffix(end));
        let key = (base.unwrap_or(&stem).to_owned(), u32::from(base.is_some()));
        (!key.0.is_empty()).then_some(key)
    })
}

/// Returns the objects in the place of another one with the same key and the least rank of all with it.
fn copies(scene: &Scene, rank: impl Fn(&str) -> Option<(String, u32)>) -> Vec<usize> {
    let mut groups: HashMap<String, Vec<(u32, usize)>> = HashMap::new();
    for (i, object) in scene.objects.iter().enumerate() {
        if let Some((base, rank)) = rank(&object.name) {
            groups.entry(base).or_default().push((rank, i));
        }
    }
    let mut found = Vec::new();
    for group in groups.values() {
        let least = group.iter().map(|g| g.0).min().unwrap_or(0);
        let (kept, others): (Vec<&(u32, usize)>, Vec<_>) = group.iter().partition(|g| g.0 == least);
        let is_there = |i: usize| {
            let own = scene.object_aabb(i);
            kept.len() > MOST || kept.iter().any(|k| scene.object_aabb(k.1).overlaps(&own))
        };
        // Boxes are measured only where there is something to compare.
        found.extend(others.iter().map(|g| g.1).filter(|&i| is_there(i)));
    }
    found.sort_unstable();
    found
}

/// Returns the name without the `.001` that modelers append.
fn without_copy(name: &str) -> &str {
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    match name.rsplit_once('.') {
        Some((stem, copy)) if !copy.is_empty() && copy.chars().all(is_number) => stem,
        _ => name,
    }
}

/// Returns the other words of a name, in small letters, and its level of detail: `wall` and 1 of `Wall_LOD1.002` and `LOD 1 Wall`.
fn level_of(name: &str) -> Option<(String, u32)> {
    let stem = without_copy(name).to_lowercase();
    let mut words: Vec<&str> = stem.split(['_', '-', ' ', '.']).collect();
    let at = words.iter().position(|word| {
        let rest = word.strip_prefix("lod");
        rest.is_some_and(|rest| rest.bytes().all(|b| b.is_ascii_digit()))
    })?;
    let own = words.remove(at).trim_start_matches("lod");
    let level = match own {
        "" if at < words.len() => words.remove(at).parse().ok()?,
        own => own.parse().ok()?,
    };
    words.retain(|word| !word.is_empty());
    Some((words.join("_"), level))
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::DMat4;
    use enfilade_geom::DVec3;
    use enfilade_geom::scene::{Mesh, Object, Primitive, Role};

    /// Returns a scene of triangles 1 m wide, by name and place.
    fn scene(objects: &[(&str, f64)]) -> Scene {
        let primitive = Primitive {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            indices: vec![0, 1, 2],
            ..Primitive::default()
        };
        let object = |&(name, x): &(&str, f64)| Object {
            name: name.to_owned(),
            mesh: 0,
            transform: DMat4::from_translation(DVec3::new(x, 0.0, 0.0)),
            role: Role::Structural,
            reason: String::new(),
            filling: None,
            node: None,
        };
        Scene {
            meshes: vec![Mesh {
                name: String::new(),
                primitives: vec![primitive],
            }],
            objects: objects.iter().map(object).collect(),
            ..Scene::default()
        }
    }

    #[test]
    fn the_finest_level_in_a_place_stays() {
        let all = [
            ("Wall_LOD0", 0.0),
            ("Wall_LOD1.002", 0.0),
            ("wall-lod2", 0.5),
            ("LOD_3_Wall", 0.5),
            ("Wall_LOD1", 9.0),
            ("Roof LOD 1", 0.0),
            ("Roof LOD 2", 0.0),
        ];
        assert_eq!(lower_levels(&scene(&all)), [1, 2, 3, 6]);
    }

    #[test]
    fn a_collision_shape_goes_where_its_original_is() {
        let all = [
            ("Wall", 0.0),
            ("Wall-col", 0.0),
            ("wall_convcol.001", 0.2),
            ("Wall-col.002", 9.0),
            ("Floor-col", 0.0),
            ("protocol", 0.0),
        ];
        assert_eq!(collision_copies(&scene(&all)), [1, 2]);
    }

    #[test]
    fn other_names_are_no_levels() {
        let all = [("Explod0", 0.0), ("Explod1", 0.0), ("Melody_LOD", 0.0)];
        assert_eq!(lower_levels(&scene(&all)), [0_usize; 0]);
        assert_eq!(level_of("LOD1"), Some((String::new(), 1)));
        assert_eq!(level_of("a.lod3"), Some(("a".to_owned(), 3)));
    }
}
