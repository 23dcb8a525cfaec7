//! Files for other programs, as far as they can be judged without them.

use std::collections::BTreeMap;

use enfilade_cpg::World;
use enfilade_export::{gbxml, room_solids};
use serde_json::Value;

use crate::common::house;

fn list<'v>(value: &'v Value, name: &str) -> &'v [Value] {
    value[name].as_array().map_or(&[], Vec::as_slice)
}

#[test]
fn a_world_without_rooms_has_no_spaces() {
    assert!(!gbxml(&World::default()).contains("<Space "));
    assert!(room_solids(&World::default(), &|_| [0.1; 6]).is_empty());
}

#[test]
fn solids_of_rooms_are_watertight() {
    let world = house();
    let solids = room_solids(&world, &|_| [0.1; 6]);
    assert_eq!(solids.len(), world.graph.rooms().count());
    for solid in &solids {
        let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
        for t in solid.triangles() {
            for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|&n| n == 0), "{}", solid.name);
        let walls: Value = serde_json::from_str(&solid.acoustics_json()).unwrap();
        assert!(list(&walls, "walls").len() >= 6);
        assert_eq!(solid.stl().len(), 84 + 50 * solid.triangles().count());
        assert!(solid.obj().lines().any(|l| l.starts_with("usemtl ")));
    }
}
