//! Triangles that are missing in walls, floors and ceilings. Covers V1.

use enfilade_bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade_cpg::CellPortalGraph;
use enfilade_geom::scene::{Material, Object, Role, Scene};
use enfilade_geom::{DMat4, DVec3, triangle_area_normal};
use enfilade_testkit::solid::{MeshBuilder, aabb};

/// Three rooms of 4 × 4 m in a row, with doors between them, on a slab that is hollow as all solids are.
fn three_rooms() -> Scene {
    let (mut slab, mut walls) = (MeshBuilder::new(0), MeshBuilder::new(0));
    slab.cuboid(aabb([-0.3, -0.3, -0.3], [12.3, 0.0, 4.3]));
    let room = |i: f64| aabb([4.0 * i, 0.0, 0.0], [4.0 * i + 3.8, 2.5, 4.0]);
    let door = |x: f64| aabb([x, 0.0, 1.5], [x + 0.2, 2.0, 2.4]);
    let air = [room(0.0), room(1.0), room(2.0), door(3.8), door(7.8)];
    walls.carved(&[aabb([-0.3, 0.0, -0.3], [12.3, 2.8, 4.3])], &air);
    let object = |mesh: u32| Object {
        name: String::new(),
        mesh,
        transform: DMat4::IDENTITY,
        role: Role::Structural,
        reason: String::new(),
        filling: None,
        node: None,
    };
    Scene {
        meshes: vec![slab.build("slab", &[]), walls.build("walls", &[])],
        materials: vec![Material::default()],
        objects: vec![object(0), object(1)],
        ..Scene::default()
    }
}

/// Removes one of the two triangles of the slab's upper face.
fn without_floor(mut scene: Scene) -> Scene {
    let part = &mut scene.meshes[0].primitives[0];
    let first = (part.triangles()).position(|t| triangle_area_normal(&t).y > 20.0);
    let at = 3 * first.expect("a slab has an upper face");
    part.indices.drain(at..at + 3);
    scene
}

fn graph_by(method: Method, scene: &Scene) -> CellPortalGraph {
    let context = BakeContext::new(&Silent, None);
    bake(scene, &BakeConfig::of(method), &context)
        .unwrap()
        .world
        .graph
}

fn are_apart(graph: &CellPortalGraph) -> bool {
    let rooms = [2.0, 6.0, 10.0].map(|x| graph.locator.locate(DVec3::new(x, 1.2, 2.0)));
    rooms.iter().all(|r| r.is_some_and(|c| !graph[c].outdoor))
        && rooms[0] != rooms[1]
        && rooms[1] != rooms[2]
        && rooms[0] != rooms[2]
}

/// Returns the number of portals of the size of the doors.
fn n_doors(graph: &CellPortalGraph) -> usize {
    let is_door = |area: f32| (area - 1.8).abs() < 0.2;
    graph.portals.iter().filter(|p| is_door(p.area)).count()
}

#[test]
fn rooms_on_a_slab_whose_floor_is_missing_stay_apart() {
    for scene in [three_rooms(), without_floor(three_rooms())] {
        let graph = graph_by(Method::Watershed, &scene);
        assert!(are_apart(&graph));
        assert_eq!(n_doors(&graph), 2);
        assert!(are_apart(&graph_by(Method::Delaunay, &scene)));
    }
}
