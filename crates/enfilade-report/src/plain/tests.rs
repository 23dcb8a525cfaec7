//! Plain data, read back by other readers.

use std::sync::Arc;

use super::*;
use enfilade_cpg::{Batch, DetailObject, Fitting, Locator, LocatorNode, Portal, Pvs, World};
use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{Aabb, DVec3};

fn portal(x: f32, cells: [u32; 2], kind: PortalKind) -> Portal {
    let outline = vec![[x, 0.0, 1.0], [x, 2.0, 1.0], [x, 2.0, 2.0], [x, 0.0, 2.0]];
    Portal {
        cells: cells.map(CellId),
        kind,
        normal: [1.0, 0.0, 0.0],
        pieces: vec![outline.clone()],
        outline,
        area: 2.0,
        fittings: Vec::new(),
        why: Vec::new(),
    }
}

fn cell(name: &str, [x0, x1]: [f32; 2], portals: &[u32]) -> Cell {
    Cell {
        name: name.to_owned(),
        aabb: [[x0, 0.0, 0.0], [x1, 3.0, 5.0]],
        volume: (x1 - x0) * 15.0,
        portals: portals.iter().map(|&p| enfilade_cpg::PortalId(p)).collect(),
        outdoor: name == "outdoors",
        ..Cell::default()
    }
}

/// Two rooms along x with a door between them and a window to the outdoors; names that need care.
fn world() -> World {
    let mut door = portal(4.0, [0, 1], PortalKind::Door);
    door.fittings = vec![Fitting {
        detail: 0,
        part: enfilade_cpg::FittingPart::Leaf,
        motion: None,
    }];
    let graph = CellPortalGraph {
        cells: vec![
            cell("Tom & \"Ann\" <1>, east", [0.0, 4.0], &[0]),
            cell("=hall\u{7}", [4.0, 8.0], &[0, 1]),
            cell("outdoors", [-1.0, 9.0], &[1]),
        ],
        portals: vec![door, portal(8.0, [1, 2], PortalKind::Window)],
        locator: Arc::new(Locator {
            bounds: Aabb::new(DVec3::ZERO, DVec3::new(8.0, 3.0, 5.0)),
            outside: Some(CellId(2)),
            planes: vec![[1.0, 0.0, 0.0, -4.0]],
            nodes: vec![LocatorNode {
                plane: 0,
                children: [1, 0].map(|c| Locator::leaf(Some(CellId(c)))),
            }],
            root: 0,
        }),
        ..CellPortalGraph::default()
    };
    let triangle = |x: f32| Primitive {
        positions: vec![[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 0.0, 1.0]],
        indices: vec![0, 1, 2],
        ..Primitive::default()
    };
    let mut moved = [0.0; 16];
    [0, 5, 10, 15].into_iter().for_each(|i| moved[i] = 1.0);
    moved[12] = 2.5;
    let thing = |name: &str| DetailObject {
        name: name.to_owned(),
        mesh: 0,
        transform: moved,
        cells: vec![CellId(0)],
        source: None,
        part_of: None,
    };
    World {
        graph,
        batches: vec![Batch {
            cells: vec![CellId(0), CellId(1)],
            primitive: triangle(3.5),
            ..Batch::default()
        }],
        details: vec![thing("leaf"), thing("chair")],
        detail_meshes: vec![Mesh {
            name: String::new(),
            primitives: vec![triangle(0.0)],
        }],
        pvs: Some(Pvs::of_ascending([vec![0, 1], vec![0, 1, 2], vec![1, 2]])),
        ..World::default()
    }
}

#[test]
fn json_has_the_graph_and_a_locator_that_another_program_can_walk() {
    let world = world();
    let json: serde_json::Value = serde_json::from_str(&graph_json(&world, &[]).unwrap()).unwrap();
    assert_eq!(json["format"], "enfilade graph");
    let cells = json["cells"].as_array().unwrap();
    assert_eq!(cells[0]["name"], "Tom & \"Ann\" <1>, east");
    assert_eq!(cells[1]["neighbors"], serde_json::json!([0, 2]));
    assert_eq!(cells[2]["kind"], "outdoors");
    let portals = json["portals"].as_array().unwrap();
    assert_eq!(portals[0]["kind"], "door");
    assert_eq!(portals[1]["cells"], serde_json::json!([1, 2]));
    assert_eq!(
        portals[1]["pieces"][0][2],
        serde_json::json!([8.0, 2.0, 2.0])
    );
    assert_eq!(
        json["visible"],
        serde_json::json!([[0, 1], [0, 1, 2], [1, 2]])
    );
    let locator = &json["locator"];
    let number = |v: &serde_json::Value| v.as_f64().unwrap();
    // Written after the page, not after the code of the locator.
    let locate = |p: [f64; 3]| -> Option<i64> {
        let is_in = (0..3).all(|k| {
            p[k] >= number(&locator["bounds"][0][k]) && p[k] <= number(&locator["bounds"][1][k])
        });
        if !is_in {
            return locator["outside"].as_i64();
        }
        let mut at = locator["root"].as_i64().unwrap();
        while at >= 0 {
            let node = &locator["nodes"][at as usize];
            let plane = &locator["planes"][node[0].as_u64().unwrap() as usize];
            let side = (0..3).map(|k| number(&plane[k]) * p[k]).sum::<f64>() + number(&plane[3]);
            at = node[if side >= 0.0 { 1 } else { 2 }].as_i64().unwrap();
        }
        (at < -1).then_some(-2 - at)
    };
    for p in [[1.0, 1.0, 1.0], [6.0, 1.0, 1.0], [9.0, 1.0, 1.0]] {
        let cell = world.graph.locator.locate(DVec3::from(p));
        assert_eq!(locate(p), cell.map(|c| i64::from(c.0)), "{p:?}");
    }
}

#[test]
fn graphml_is_valid_xml_whatever_the_names() {
    let text = graph_graphml(&world());
    let xml = roxmltree::Document::parse(&text).unwrap();
    let of = |name: &str| xml.descendants().filter(|n| n.has_tag_name(name)).count();
    // Three cells, two portals.
    assert_eq!((of("node"), of("edge"), of("key")), (3, 2, 10));
    let names: Vec<&str> = xml
        .descendants()
        .filter(|n| n.attribute("key") == Some("node-name"))
        .filter_map(|n| n.text())
        .collect();
    assert_eq!(names, ["Tom & \"Ann\" <1>, east", "=hall ", "outdoors"]);
    let keys: Vec<&str> = xml
        .descendants()
        .filter_map(|n| n.attribute("id"))
        .collect();
    let used = xml.descendants().filter_map(|n| n.attribute("key"));
    assert!(used.into_iter().all(|k| keys.contains(&k)));
}

#[test]
fn dot_quotes_names() {
    let text = graph_dot(&world());
    assert!(
        text.contains(r#"c0 [label="Tom & \"Ann\" <1>, east"];"#),
        "{text}"
    );
    assert!(
        text.contains("c1 -- c2 [label=\"window 1.00 × 2.00 m\"];"),
        "{text}"
    );
}

#[test]
fn tables_quote_commas_and_disarm_formulas() {
    let cells = cells_csv(&world());
    let lines: Vec<&str> = cells.split("\r\n").collect();
    assert_eq!(lines.len(), 5, "{cells}");
    assert!(
        lines[1].starts_with(
            "0,\"Tom & \"\"Ann\"\" <1>, east\",room,1,20.000,20.000,20.000,3.000,1,0,60,"
        ),
        "{cells}"
    );
    assert!(lines[2].starts_with("1,'=hall"), "{cells}");
    let portals = portals_csv(&world());
    assert!(
        portals.contains("\r\n1,window,1,2,1,2,2,8,1,1.5,1,0,0,'=hall"),
        "{portals}"
    );
}

#[test]
fn obj_has_each_surface_once_in_the_groups_of_its_cells_without_leaves() {
    let text = surfaces_obj(&world());
    let lines = |c: &str| {
        text.lines()
            .filter(|l| l.starts_with(c))
            .collect::<Vec<_>>()
    };
    assert_eq!(
        lines("g "),
        [
            "g Tom_&_\"Ann\"_<1>,_east =hall_",
            "g Tom_&_\"Ann\"_<1>,_east"
        ]
    );
    assert_eq!(lines("f "), ["f 1 2 3", "f 4 5 6"]);
    assert_eq!(lines("v ")[3], "v 2.5 0 0");
}
