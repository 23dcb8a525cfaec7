//! Cells take the names that the scene has for rooms. Covers S1.

use enfilade_bake::names::rename_cells;
use enfilade_bake::{BakeConfig, BakeContext, BakeOutput, Silent, bake};
use enfilade_cpg::{CellId, CellPortalGraph};
use enfilade_geom::DVec3;
use enfilade_geom::scene::RoomName;
use enfilade_testkit::mixed::two_rooms;

/// A point in the western room, which has 54 m³, and in the eastern one, which has 43 m³.
const WEST: DVec3 = DVec3::new(2.0, 1.2, 2.0);
const EAST: DVec3 = DVec3::new(7.0, 1.2, 2.0);

/// A room with this volume at each point.
fn room(name: &str, points: &[DVec3], volume: f64) -> RoomName {
    RoomName {
        name: name.into(),
        points: points.to_vec(),
        volume,
    }
}

fn baked(rooms: Vec<RoomName>) -> BakeOutput {
    let mut scene = two_rooms().scene;
    scene.rooms = rooms;
    let context = BakeContext::new(&Silent, None);
    bake(&scene, &BakeConfig::default(), &context).unwrap()
}

/// Names of the western and the eastern room, and of the outdoors.
fn named(rooms: Vec<RoomName>) -> [String; 3] {
    let graph = baked(rooms).world.graph;
    assert_eq!(graph.validate(), Ok(()));
    let name = |graph: &CellPortalGraph, p| graph[graph.locator.locate(p).unwrap()].name.clone();
    [WEST, EAST, DVec3::splat(-50.0)].map(|p| name(&graph, p))
}

#[test]
fn the_cell_around_a_point_takes_the_name() {
    let [west, east, outdoors] = named(vec![RoomName::at("Kitchen", WEST)]);
    assert_eq!(west, "Kitchen");
    assert!(east.starts_with("cell-") && outdoors == "outdoors");
    assert_eq!(named(vec![RoomName::at(" ", WEST)])[0], "cell-1");
}

#[test]
fn rooms_that_share_a_cell_share_its_name_by_size() {
    let rooms = |small: f64| {
        vec![
            room("Kitchen", &[WEST], 20.0),
            room("Living", &[WEST], 30.0),
            room("Closet", &[WEST], small),
        ]
    };
    assert_eq!(named(rooms(2.0))[0], "Living / Kitchen");
    assert_eq!(named(rooms(4.0))[0], "Living / Kitchen / Closet");
    // A name that someone set counts more than all volumes.
    let mut set = rooms(4.0);
    set.push(RoomName::at("Den", WEST));
    assert_eq!(named(set)[0], "Den");
}

#[test]
fn a_room_names_the_cells_of_which_it_is_the_larger_part_and_no_others() {
    // Two thirds of the room lie in the west.
    let [west, east, _] = named(vec![room("Hall", &[WEST, WEST + 0.5, EAST], 10.0)]);
    assert_eq!(west, "Hall");
    assert!(east.starts_with("cell-"), "{east}");
    // Now more than half of the eastern room lies in it, too.
    let [west, east, _] = named(vec![room("Hall", &[WEST, WEST + 0.5, EAST], 30.0)]);
    assert_eq!([west.as_str(), east.as_str()], ["Hall", "Hall 2"]);
}

#[test]
fn names_stay_unique_and_the_larger_room_has_no_number() {
    let rooms = vec![room("Room", &[WEST], 40.0), room("Room", &[EAST], 41.0)];
    assert_eq!(named(rooms)[..2], ["Room 2", "Room"]);
    // Names of cells without one are taken.
    let [west, east, _] = named(vec![RoomName::at("outdoors", WEST)]);
    assert_eq!(west, "outdoors 2");
    let [first, second, _] = named(vec![RoomName::at(east.clone(), WEST)]);
    assert_eq!([first, second], [format!("{east} 2"), east]);
}

#[test]
fn outdoors_takes_only_a_name_that_someone_set() {
    let garden = DVec3::splat(-50.0);
    assert_eq!(named(vec![room("Balcony", &[garden], 8.0)])[2], "outdoors");
    assert_eq!(named(vec![RoomName::at("Garden", garden)])[2], "Garden");
}

#[test]
fn no_cell_has_the_number_of_another() {
    let [west, _, _] = named(vec![RoomName::at("cell-17", WEST)]);
    assert_eq!(west, "cell-17 2");
    let [west, _, _] = named(vec![RoomName::at("cell-1", WEST)]);
    assert_eq!(west, "cell-1");
}

#[test]
fn names_for_points_that_name_no_room_of_their_own_are_told() {
    let notes = |rooms| baked(rooms).notes.join("\n");
    let set = |name: &str, at| RoomName::at(name, at);
    let said = notes(vec![set("Hall", WEST), set("Den", EAST)]);
    assert!(!said.contains("Hall") && !said.contains("Den"), "{said}");
    let said = notes(vec![set("Ha\nll", DVec3::new(2.0, -0.1, 2.0))]);
    assert!(
        said.contains(r"'Ha\nll' is for the point 2.00 -0.10 2.00, which is in a wall"),
        "{said}"
    );
    let said = notes(vec![set("Garden", DVec3::splat(-50.0))]);
    assert!(said.contains("'Garden'") && said.contains("the outdoors"));
    let said = notes(vec![
        set("Hall", WEST),
        set("Den", WEST + 0.1),
        set("Hall", WEST),
    ]);
    assert!(
        said.contains("'Den' and 'Hall' are names for points in one room, cell-1"),
        "{said}"
    );
}

#[test]
fn cells_of_a_world_may_exchange_their_names() {
    let mut graph = baked(Vec::new()).world.graph;
    let names = |graph: &CellPortalGraph| -> Vec<String> {
        graph.cells.iter().map(|c| c.name.clone()).collect()
    };
    let n = names(&graph).len();
    let all: Vec<CellId> = graph.cell_ids().collect();
    let rename = |graph: &mut CellPortalGraph, new: &[&str]| {
        let pairs = all.iter().copied().zip(new.iter().map(|n| (*n).to_owned()));
        rename_cells(graph, &pairs.collect::<Vec<_>>())
    };
    assert_eq!(rename(&mut graph, &["A", "B"]), ["A", "B"]);
    assert_eq!(rename(&mut graph, &["B", "A"]), ["B", "A"]);
    // The third cell keeps its name, so it is taken.
    let third = graph[all[2]].name.clone();
    assert_eq!(rename(&mut graph, &["A", "A"]), ["A", "A 2"]);
    assert_eq!(rename(&mut graph, &[&third])[0], format!("{third} 2"));
    assert_eq!(names(&graph)[2..], [third]);
    assert_eq!((n, graph.validate()), (3, Ok(())));
}
