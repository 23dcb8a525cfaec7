//! Buildings merged into one mesh.

use enfilade_geom::scene::{Object, Role, Scene};

use super::filler_tests::two_rooms;
use super::tests::Build;

/// Two rooms with a leaf, a window of frame and pane, and a table.
fn house() -> Build {
    let mut b = two_rooms();
    b.block("leaf", [1.0, 0.0, 3.11], [2.0, 2.1, 3.15])
        .block("frame", [3.5, 0.9, 3.08], [3.56, 2.1, 3.16])
        .block("frame", [4.94, 0.9, 3.08], [5.0, 2.1, 3.16])
        .block("frame", [3.56, 0.9, 3.08], [4.94, 0.96, 3.16])
        .block("frame", [3.56, 2.04, 3.08], [4.94, 2.1, 3.16])
        .block("pane", [3.56, 0.96, 3.11], [4.94, 2.04, 3.13])
        .block("table top", [2.0, 0.7, 1.0], [3.0, 0.75, 1.6])
        .block("table leg", [2.0, 0.0, 1.0], [2.06, 0.7, 1.06])
        .block("table leg", [2.94, 0.0, 1.54], [3.0, 0.7, 1.6]);
    b
}

/// Number of triangles of objects with a role.
fn n_triangles(scene: &Scene, role: Role) -> usize {
    scene.triangle_sources(role).count()
}

// Covers S4.
#[test]
fn leaves_panes_and_furniture_are_found_in_one_mesh() {
    let scene = house().merged("").decided();
    let details: Vec<&Object> = scene
        .objects
        .iter()
        .filter(|o| o.role == Role::Detail)
        .collect();
    let reasons: Vec<&str> = details.iter().map(|o| o.reason.as_str()).collect();
    let starts = [
        "part of a merged mesh: fills an opening: 1.00 x 2.10 m",
        "part of a merged mesh: fills an opening: 1.50 x 1.20 m",
        "part of a merged mesh: small, hides little: 1.0 x 0.8 x 0.6 m",
    ];
    assert_eq!(reasons.len(), 3, "{reasons:?}");
    for start in starts {
        assert!(reasons.iter().any(|r| r.starts_with(start)), "{reasons:?}");
    }
    // Leaf; frame of four and pane; top and two legs.
    assert_eq!(n_triangles(&scene, Role::Detail), 12 * (1 + 5 + 3));
    // Six slabs, and the wall of six boxes.
    assert_eq!(n_triangles(&scene, Role::Structural), 12 * (6 + 6));
    assert_eq!(scene.meshes.len(), 4);
}

#[test]
fn the_name_of_the_first_part_does_not_hide_the_others_but_a_rule_does() {
    let by_name = house().merged("name: 'wall'").decided();
    assert_eq!(n_triangles(&by_name, Role::Detail), 12 * 9);
    let by_class = house().merged("IFC class IfcWall").decided();
    assert_eq!(n_triangles(&by_class, Role::Detail), 12 * 9);
    let by_rule = house().merged("rule: structural 'House'").decided();
    assert_eq!(n_triangles(&by_rule, Role::Detail), 0);
    assert_eq!(by_rule.objects.len(), 1);
}

#[test]
fn the_name_of_a_door_makes_no_detail_of_a_whole_house() {
    let named = |reason: &str| {
        let mut scene = house().merged(reason).decided();
        scene.objects.truncate(1);
        scene.objects[0].role = Role::Detail;
        super::decide(&mut scene);
        scene
    };
    let by_class = named("IFC class IfcDoor");
    assert_eq!(n_triangles(&by_class, Role::Structural), 12 * 12);
    assert_eq!(by_class.objects[0].reason, "default");
    let by_rule = named("rule: detail 'House'");
    assert_eq!(n_triangles(&by_rule, Role::Structural), 0);
    // A room of 4 × 3 × 5 m under a name of cartons.
    let mut room = Build::default();
    room.block("box", [0.0; 3], [4.0, 3.0, 5.0]);
    let mut room = room.decided();
    room.objects[0].reason = "name: 'box'".to_owned();
    room.objects[0].role = Role::Detail;
    super::decide(&mut room);
    assert_eq!(room.objects[0].role, Role::Structural);
    // Beside structure, it is what it says.
    let mut scene = house().merged("IFC class IfcDoor").decided();
    scene.objects.truncate(1);
    let walls = scene.objects[0].clone();
    scene.objects[0].role = Role::Detail;
    scene.objects.push(walls);
    super::decide(&mut scene);
    assert_eq!(scene.objects[0].role, Role::Detail);
}

#[test]
fn parts_of_two_merged_meshes_that_touch_stay_apart() {
    // The second one's chair stands at the table of the first, and is far down in its list.
    let mut chair = Build::default();
    chair
        .block("far", [60.0, 0.0, 0.0], [65.0, 3.0, 4.0])
        .block("seat", [2.0, 0.4, 1.61], [2.4, 0.45, 2.0])
        .block("leg", [2.0, 0.0, 1.61], [2.05, 0.4, 1.66]);
    let scene = house().merged("").and(chair.merged("")).decided();
    // Each with its own: the leaf, the window, the table; and the chair.
    assert_eq!(n_triangles(&scene, Role::Detail), 12 * (9 + 2));
    assert_eq!(n_triangles(&scene, Role::Structural), 12 * (12 + 1));
    let details = scene.objects.iter().filter(|o| o.role == Role::Detail);
    assert_eq!(details.count(), 4);
}
