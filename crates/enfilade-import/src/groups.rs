//! Names of rooms from groups of meshes, as Godot has them.

use std::collections::BTreeMap;

use enfilade_geom::scene::{RoomName, Scene};
use enfilade_geom::{Aabb, DVec3};

use crate::marks::without_number;

/// Points along either side of the box of a group.
const N_POINTS: usize = 8;

/// Names the rooms around the meshes of groups that are called as a room: at points all over their box, halfway up. `O(n d)` in objects
/// and the depth of the tree.
pub(crate) fn name_groups(scene: &mut Scene) {
    let nodes = &scene.nodes;
    let is_named: Vec<bool> = nodes.iter().map(|n| of_group(&n.name).is_some()).collect();
    let mut boxes: BTreeMap<usize, Aabb> = BTreeMap::new();
    for object in &scene.objects {
        let own = object.node.map(|n| n as usize);
        let parent = |n: &usize| nodes[*n].parent.map(|n| n as usize);
        // A mesh with such a name is not a group.
        let is_group = |n: &usize| is_named[*n] && nodes[*n].name != object.name;
        if let Some(group) = std::iter::successors(own, parent).find(is_group) {
            let primitives = &scene.meshes[object.mesh as usize].primitives;
            let triangles = primitives
                .iter()
                .flat_map(|p| p.placed_triangles(object.transform));
            let around = boxes.entry(group).or_insert(Aabb::EMPTY);
            *around = triangles.flatten().fold(*around, Aabb::including);
        }
    }
    for (group, around) in boxes {
        let size = around.size();
        let step = DVec3::new(size.x, 0.0, size.z) / N_POINTS as f64;
        let first = DVec3::new(around.min.x, around.center().y, around.min.z) + step / 2.0;
        let place = |i: usize| DVec3::new((i % N_POINTS) as f64, 0.0, (i / N_POINTS) as f64);
        let points = (0..N_POINTS * N_POINTS).map(|i| first + place(i) * step);
        if let Some(name) = of_group(&nodes[group].name).filter(|_| size.is_finite()) {
            scene.rooms.push(RoomName {
                name: name.to_owned(),
                points: points.collect(),
                volume: size.element_product() / (N_POINTS * N_POINTS) as f64,
            });
        }
    }
}

/// Returns NAME of `NAME-room` or `Room_NAME`, the name of a group of a room's meshes.
fn of_group(name: &str) -> Option<&str> {
    let name = without_number(name);
    let own = name.strip_suffix("-room");
    let own = own.or_else(|| name.strip_prefix("Room_"))?.trim();
    (!own.is_empty()).then_some(own)
}
