//! Plans of hand-made houses: valid XML, every room named, portals at their true width.

use crate::verify_common as common;

use common::{batch, cell, house, locator_of_boxes, moved, portal, wall};
use enfilade_cpg::{
    CellId, CellPortalGraph, DecidedPlace, DetailObject, Fact, PortalKind, Reason, Why, World,
};
use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{Aabb, DMat4, DVec3};
use enfilade_report::{
    PAPERS, PlanOptions, Plans, ReportParts, find_storeys, plan_svg, report_html, to_pdf,
};

fn plan(world: &World) -> String {
    plan_svg(world, &PlanOptions::default())
}

/// Path data `Mx yLx y…` of all elements of a class: a list of points for each `M`.
fn paths(svg: &str, class: &str) -> Vec<Vec<[f64; 2]>> {
    let document = roxmltree::Document::parse(svg).unwrap();
    let storeys = document
        .descendants()
        .filter(|n| n.attribute("class") == Some("storey"));
    let mut out = Vec::new();
    for node in storeys.flat_map(|s| s.descendants()) {
        if node.attribute("class") == Some(class) {
            let data = node.attribute("d").unwrap();
            for part in data.split('M').filter(|p| !p.is_empty()) {
                let points = part.trim_end_matches('Z').split('L').map(|p| {
                    let (x, z) = p.split_once(' ').unwrap();
                    [x.parse().unwrap(), z.parse().unwrap()]
                });
                out.push(points.collect());
            }
        }
    }
    out
}

fn texts(svg: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(svg).unwrap();
    let nodes = document.descendants().filter(|n| n.has_tag_name("text"));
    nodes.map(|n| n.text().unwrap().to_owned()).collect()
}

fn length(line: &[[f64; 2]]) -> f64 {
    (line[0][0] - line[1][0]).hypot(line[0][1] - line[1][1])
}

/// Two rooms of 6 × 5 m, one above the other, and a stair hole of 1 × 2 m.
fn two_storeys() -> World {
    let (low, high, outdoors) = (CellId(0), CellId(1), CellId(2));
    let locator = locator_of_boxes(
        &[
            ([0.0, 0.0, 0.0], [6.0, 3.0, 5.0], Some(low)),
            ([2.0, 3.0, 1.0], [3.0, 3.125, 3.0], Some(low)),
            ([2.0, 3.125, 1.0], [3.0, 3.25, 3.0], Some(high)),
            ([0.0, 3.25, 0.0], [6.0, 6.0, 5.0], Some(high)),
            ([0.0, 0.0, 0.0], [6.0, 6.0, 5.0], None),
        ],
        Aabb::new(DVec3::splat(-1.0), DVec3::splat(7.0)),
        Some(outdoors),
    );
    let hole = |y: f64| Some(([2.0, y, 1.0], [3.0, y, 3.0]));
    let batches = vec![
        batch(
            &[low],
            vec![
                wall([0.0, 0.0, 0.0], [6.0, 0.0, 5.0], None),
                wall([0.0, 3.0, 0.0], [6.0, 3.0, 5.0], hole(3.0)),
            ],
        ),
        batch(
            &[high],
            vec![wall([0.0, 3.25, 0.0], [6.0, 3.25, 5.0], hole(3.25))],
        ),
        batch(
            &[low, high, outdoors],
            vec![
                wall([0.0, 0.0, 0.0], [0.0, 6.0, 5.0], None),
                wall([6.0, 0.0, 0.0], [6.0, 6.0, 5.0], None),
                wall([0.0, 0.0, 0.0], [6.0, 6.0, 0.0], None),
                wall([0.0, 0.0, 5.0], [6.0, 6.0, 5.0], None),
            ],
        ),
    ];
    let y = 3.125;
    let stair = portal(
        [low, high],
        PortalKind::Open,
        [[2.0, y, 1.0], [2.0, y, 3.0], [3.0, y, 3.0], [3.0, y, 1.0]],
    );
    let cells = vec![
        cell("cell-0", [0.0; 3], [6.0, 3.125, 5.0], &[0], false),
        cell("cell-1", [0.0, 3.125, 0.0], [6.0, 6.0, 5.0], &[0], false),
        cell("outdoors", [-1.0; 3], [7.0; 3], &[], true),
    ];
    let graph = CellPortalGraph {
        cells,
        portals: vec![stair],
        locator: locator.into(),
        ..CellPortalGraph::default()
    };
    World {
        graph,
        batches,
        ..World::default()
    }
}

#[test]
fn every_room_is_named_with_its_area() {
    let svg = plan(&house());
    let texts = texts(&svg);
    for expected in [
        "cell-0",
        "cell-1",
        "Storey 1 of 1 · floor +0.00 m, cut +1.20 m",
    ] {
        assert!(
            texts.iter().any(|t| t == expected),
            "{expected} in {texts:?}"
        );
    }
    assert!(svg.contains("<title>portal-0, cell-0 and cell-1</title>"));
    // 16 m² and half of the doorway in the wall, 0.125 m². The grid spacing is 2 cm, so that each border of 4 m may
    // be off by 0.04 m².
    let areas: Vec<f64> = texts
        .iter()
        .filter_map(|t| t.strip_suffix(" m²")?.parse().ok())
        .collect();
    assert_eq!(areas.len(), 2);
    assert!(areas.iter().all(|a| (a - 16.1).abs() < 0.25), "{areas:?}");
    // The outdoors is left as paper.
    assert_eq!(svg.matches("class=\"cell\"").count(), 2);
    assert_eq!(paths(&svg, "solid").len(), 2, "the wall beside the doorway");
}

#[test]
fn portals_are_drawn_as_wide_as_they_are() {
    for angle in [0.0, 0.4] {
        let world = moved(house(), &DMat4::from_rotation_y(angle));
        let svg = plan(&world);
        for (class, width) in [("open", 100.0), ("window", 100.0)] {
            let lines = paths(&svg, class);
            assert_eq!(lines.len(), 1, "{class}");
            // Coordinates are written in millimeters.
            assert!(
                (length(&lines[0]) - width).abs() < 0.15,
                "{class} {lines:?}"
            );
        }
    }
}

#[test]
fn pieces_of_a_portal_are_one_line_and_gaps_stay_gaps() {
    let mut world = house();
    let door = &mut world.graph.portals[0];
    let piece = |z0: f32, z1: f32| {
        vec![
            [4.125, 0.0, z0],
            [4.125, 2.0, z0],
            [4.125, 2.0, z1],
            [4.125, 0.0, z1],
        ]
    };
    door.pieces = vec![piece(1.25, 1.5), piece(1.0, 1.25), piece(1.75, 2.0)];
    let lines = paths(&plan(&world), "open");
    assert_eq!(lines.len(), 2);
    assert_eq!(lines.iter().map(|l| length(l)).sum::<f64>(), 75.0);
}

#[test]
fn a_window_above_the_cut_is_drawn_and_a_hatch_below_it_too() {
    let mut world = house();
    let svg = plan_svg(
        &world,
        &PlanOptions {
            cut_height: 0.5,
            ..PlanOptions::default()
        },
    );
    assert_eq!(
        paths(&svg, "window").iter().map(|l| length(l)).sum::<f64>(),
        100.0
    );
    world.graph.portals[1].kind = PortalKind::Open;
    let svg = plan_svg(
        &world,
        &PlanOptions {
            cut_height: 0.5,
            ..PlanOptions::default()
        },
    );
    assert_eq!(
        paths(&svg, "low").iter().map(|l| length(l)).sum::<f64>(),
        100.0
    );
}

#[test]
fn a_door_that_only_touches_a_storey_is_left_to_its_own() {
    let mut world = two_storeys();
    let (x, y) = (1.0, 3.2);
    // Its sill stands 5 cm below the upper floor.
    let quad = [[x, y, 1.0], [x, 5.2, 1.0], [x, 5.2, 2.0], [x, y, 2.0]];
    world
        .graph
        .portals
        .push(portal([CellId(0), CellId(1)], PortalKind::Open, quad));
    let svg = plan(&world);
    assert_eq!(
        (paths(&svg, "low").len(), paths(&svg, "open").len()),
        (0, 1)
    );
}

#[test]
fn storeys_are_found_by_their_floors_and_share_the_stair_hole() {
    let world = two_storeys();
    let storeys = find_storeys(&world);
    let floors: Vec<f64> = storeys.iter().map(|s| s.floor).collect();
    assert_eq!(floors.len(), 2, "{storeys:?}");
    assert!(floors[0].abs() < 1e-6 && (floors[1] - 3.25).abs() < 1e-6);
    assert!((storeys[0].area - 30.0).abs() < 0.01, "{storeys:?}");
    // Two square meters less; the triangles around the hole are sampled every half meter.
    assert!((storeys[1].area - 28.0).abs() < 0.01, "{storeys:?}");
    let svg = plan(&world);
    let holes = paths(&svg, "stair");
    assert_eq!(holes.len(), 2);
    let texts = texts(&svg);
    assert!(texts.contains(&"Storey 2 of 2 · floor +3.25 m, cut +4.45 m".to_owned()));
    assert!(texts.contains(&"cell-0".to_owned()) && texts.contains(&"cell-1".to_owned()));
}

#[test]
fn neighbors_share_their_borders_point_by_point() {
    let turned = moved(house(), &DMat4::from_rotation_y(0.37));
    let cells = paths(&plan(&turned), "cell");
    // The door's portal lies where the two cells touch: some points are in both borders.
    let shared = cells[0].iter().filter(|p| cells[1].contains(p)).count();
    assert!(shared >= 2, "{shared}");
    // Straight walls do not become stairs of a thousand steps.
    assert!(
        cells.iter().all(|c| c.len() < 20),
        "{:?}",
        cells.iter().map(Vec::len).collect::<Vec<_>>()
    );
}

#[test]
fn hostile_names_and_empty_worlds_are_valid_xml() {
    let mut world = house();
    world.graph.cells[0].name = "<a & \"b\">\u{1}\u{ffff}".into();
    let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]];
    let primitive = Primitive {
        positions,
        indices: vec![0, 1, 2],
        ..Primitive::default()
    };
    world.detail_meshes.push(Mesh {
        name: String::new(),
        primitives: vec![primitive],
    });
    world.details.push(DetailObject {
        name: "]]>&".into(),
        mesh: 0,
        transform: DMat4::from_translation(DVec3::new(1.0, 0.0, 1.0))
            .as_mat4()
            .to_cols_array(),
        cells: vec![CellId(0)],
        source: None,
        part_of: None,
    });
    let svg = plan(&world);
    assert_eq!(paths(&svg, "detail").len(), 1);
    assert!(svg.contains("&lt;a &amp; &quot;b&quot;&gt;"));
    roxmltree::Document::parse(&plan(&World::default())).unwrap();
}

#[test]
fn the_same_world_gives_the_same_bytes() {
    assert_eq!(plan(&two_storeys()), plan(&two_storeys()));
}

/// Also writes the plans to `PLAN_DIR`, if set, for people to look at.
#[test]
fn plans_of_houses_that_are_turned_or_high_are_valid_xml() {
    let turned = moved(house(), &DMat4::from_rotation_y(0.37));
    for (name, world) in [
        ("house", house()),
        ("turned", turned),
        ("storeys", two_storeys()),
    ] {
        let svg = plan(&world);
        roxmltree::Document::parse(&svg).unwrap();
        assert!(!paths(&svg, "cell").is_empty(), "{name}");
        if let Ok(dir) = std::env::var("PLAN_DIR") {
            std::fs::write(format!("{dir}/{name}.svg"), svg).unwrap();
        }
    }
}

#[test]
fn names_that_are_too_long_are_cut() {
    let mut world = two_storeys();
    let sizes = |world: &World| {
        let plans = Plans::new(world, &PlanOptions::default());
        let pdf = to_pdf(&[plans.sheet(&[0])], PAPERS[1], None).unwrap();
        let page = report_html(world, &ReportParts::default());
        [plan(world).len(), pdf.len(), page.len()]
    };
    let usual = sizes(&world);
    // Letters of several bytes, one more than the limit.
    world.graph.cells[0].name = "ä".repeat(65);
    assert!(plan(&world).contains(&format!("{}…", "ä".repeat(63))));
    assert!(!plan(&world).contains(&"ä".repeat(64)));
    world.graph.cells[0].name = "ä".repeat(64);
    assert!(plan(&world).contains(&"ä".repeat(64)));
    for cell in &mut world.graph.cells {
        cell.name = "long ".repeat(100_000);
    }
    for (long, usual) in sizes(&world).into_iter().zip(usual) {
        assert!(long < usual + 20_000, "{long} {usual}");
    }
}

#[test]
fn reasons_are_rings_with_numbers_and_a_list_only_if_asked_for() {
    let mut world = house();
    let place = |at: [f32; 3], inside: f64| DecidedPlace {
        at,
        why: Why::compared(
            Reason::Solid,
            1.0,
            &[(Fact::Inside, inside), (Fact::Volume, 30.0)],
        ),
    };
    // The second is closer to its limit, and so comes first.
    world.graph.places = vec![place([1.0, 1.0, 1.0], 3.0), place([5.0, 1.0, 2.0], 1.05)];
    let plain = plan(&world);
    assert!(paths(&plain, "doubt").is_empty());
    let options = PlanOptions {
        has_reasons: true,
        ..PlanOptions::default()
    };
    let svg = plan_svg(&world, &options);
    let rings = paths(&svg, "doubt");
    let middle = |ring: &[[f64; 2]]| ring.iter().map(|p| p[0]).sum::<f64>() / ring.len() as f64;
    let middles: Vec<f64> = rings.iter().map(|r| middle(r).round()).collect();
    assert_eq!(middles, [500.0, 100.0]);
    assert!(svg.contains("?1 no cell: the inside of a solid"), "{svg}");
    assert!(svg.contains("30 m³"), "{svg}");
}
