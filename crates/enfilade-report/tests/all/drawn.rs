//! Lines below the cut, swings of doors, and the places of names, on plans of a small house.

use crate::verify_common as common;

use common::{A, B, DOOR, DOOR_X, batch, house, wall};
use enfilade_cpg::{DetailObject, Fitting, FittingPart, Motion, MotionKind, World};
use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{DMat4, DVec3};
use enfilade_report::{PlanOptions, plan_svg};

/// Path data of all elements of a class: a list of points for each `M`, in meters from the plan's origin.
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
                    [x, z].map(|n| n.parse::<f64>().unwrap() / 100.0)
                });
                out.push(points.collect());
            }
        }
    }
    out
}

fn bounds(line: &[[f64; 2]]) -> [[f64; 2]; 2] {
    let fold = |start: f64, pick: fn(f64, f64) -> f64| {
        [0, 1].map(|k| line.iter().map(|p| p[k]).fold(start, pick))
    };
    [
        fold(f64::INFINITY, f64::min),
        fold(f64::NEG_INFINITY, f64::max),
    ]
}

/// Returns `true` if one of the lines runs around the box, within the grid's step.
fn runs_around(lines: &[Vec<[f64; 2]>], [low, high]: [[f64; 2]; 2]) -> bool {
    lines.iter().any(|line| {
        let [l, h] = bounds(line);
        (0..2).all(|k| (l[k] - low[k]).abs() < 0.05 && (h[k] - high[k]).abs() < 0.05)
    })
}

/// The mesh of a box.
fn block(low: [f64; 3], high: [f64; 3]) -> Mesh {
    let corner = |k: u32| [0, 1, 2].map(|axis| [low, high][(k >> axis & 1) as usize][axis] as f32);
    let faces: [[u32; 4]; 6] = [
        [0, 2, 6, 4],
        [1, 5, 7, 3],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 1, 3, 2],
        [4, 6, 7, 5],
    ];
    let primitive = Primitive {
        positions: (0..8).map(corner).collect(),
        indices: faces
            .iter()
            .flat_map(|&[a, b, c, d]| [a, b, c, a, c, d])
            .collect(),
        ..Primitive::default()
    };
    Mesh {
        name: String::new(),
        primitives: vec![primitive],
    }
}

fn furnish(world: &mut World, name: &str, mesh: Mesh, at: DVec3, cell: enfilade_cpg::CellId) {
    world.detail_meshes.push(mesh);
    world.details.push(DetailObject {
        name: name.into(),
        mesh: world.detail_meshes.len() as u32 - 1,
        transform: DMat4::from_translation(at).as_mat4().to_cols_array(),
        cells: vec![cell],
        source: None,
        part_of: None,
    });
}

fn plan(world: &World) -> String {
    plan_svg(world, &PlanOptions::default())
}

#[test]
fn steps_of_the_structure_below_the_cut_are_drawn_and_others_are_not() {
    let mut world = house();
    let top = |x: f64, y: f64| wall([x, y, 1.0], [x + 0.5, y, 2.0], None);
    // Two treads; a shelf above the cut; a floor finish thinner than a step.
    let surfaces = [top(1.0, 0.2), top(1.5, 0.4), top(2.5, 2.0)];
    world.batches.push(batch(&[A], surfaces.to_vec()));
    let finish = wall([5.0, 0.01, 1.0], [7.0, 0.01, 3.0], None);
    world.batches.push(batch(&[B], vec![finish]));
    let lines = paths(&plan(&world), "edge");
    for x in [1.0, 1.5] {
        assert!(runs_around(&lines, [[x, 1.0], [x + 0.5, 2.0]]), "{lines:?}");
    }
    assert!(!runs_around(&lines, [[2.5, 1.0], [3.0, 2.0]]), "{lines:?}");
    assert!(!runs_around(&lines, [[5.0, 1.0], [7.0, 3.0]]), "{lines:?}");
}

#[test]
fn objects_have_their_outline_also_where_the_cut_passes_through_them() {
    let mut world = house();
    let rug = block([0.0; 3], [2.0, 0.01, 1.0]);
    furnish(&mut world, "rug", rug, DVec3::new(1.0, 0.0, 0.5), A);
    let wardrobe = block([0.0; 3], [1.8, 2.0, 0.6]);
    furnish(
        &mut world,
        "wardrobe",
        wardrobe,
        DVec3::new(5.0, 0.0, 3.2),
        B,
    );
    let lines = paths(&plan(&world), "edge");
    assert!(runs_around(&lines, [[1.0, 0.5], [3.0, 1.5]]), "{lines:?}");
    assert!(runs_around(&lines, [[5.0, 3.2], [6.8, 3.8]]), "{lines:?}");
}

#[test]
fn a_name_stands_beside_the_table_of_its_room() {
    let mut world = house();
    // In the middle of the room, where the name was.
    let table = block([0.0; 3], [1.6, 0.75, 1.6]);
    furnish(&mut world, "table", table, DVec3::new(1.2, 0.0, 1.2), A);
    let svg = plan(&world);
    let document = roxmltree::Document::parse(&svg).unwrap();
    let name = world.graph[A].name.as_str();
    let text = document
        .descendants()
        .find(|n| n.has_tag_name("text") && n.text() == Some(name))
        .unwrap();
    let [x, z] = ["x", "y"].map(|k| text.attribute(k).unwrap().parse::<f64>().unwrap() / 100.0);
    let is_on = (1.2..2.8).contains(&x) && (1.2..2.8).contains(&z);
    assert!(!is_on, "{name} at {x} {z}");
}

#[test]
fn a_leaf_is_drawn_open_with_the_arc_of_its_edge() {
    let mut world = house();
    let outline = &world.graph.portals[DOOR].outline;
    let low = outline.iter().map(|p| p[2]).fold(f32::INFINITY, f32::min);
    let leaf = block([-0.02, 0.0, 0.0], [0.02, 2.0, 1.0]);
    let hinge = DVec3::new(DOOR_X, 0.0, low.into());
    furnish(&mut world, "leaf", leaf, hinge, A);
    world.graph.portals[DOOR].fittings.push(Fitting {
        detail: 0,
        part: FittingPart::Leaf,
        motion: Some(Motion {
            kind: MotionKind::Turn {
                through: hinge.as_vec3().to_array(),
                axis: [0.0, 1.0, 0.0],
            },
            shut: 0.0,
            open: std::f32::consts::FRAC_PI_2,
        }),
    });
    let svg = plan(&world);
    let swings = paths(&svg, "swing");
    assert_eq!(swings.len(), 2, "{swings:?}");
    let [open, arc] = [&swings[0], &swings[1]];
    // A quarter turn about +y leads from +z to +x.
    let (x, z) = (DOOR_X, f64::from(low));
    let [l, h] = bounds(open);
    assert!(
        (l[0] - x).abs() < 0.03 && (h[0] - x - 1.0).abs() < 0.03,
        "{open:?}"
    );
    assert!(h[1] - l[1] < 0.06, "{open:?}");
    for p in arc {
        let radius = (p[0] - x).hypot(p[1] - z);
        assert!((radius - 1.0).abs() < 0.03, "{arc:?}");
    }
    // The shut leaf is not drawn, too.
    assert!(paths(&svg, "detail").is_empty());
}

#[test]
fn the_legend_names_what_is_on_the_sheet() {
    let svg = plan(&house());
    let document = roxmltree::Document::parse(&svg).unwrap();
    let texts: Vec<_> = document.descendants().filter_map(|n| n.text()).collect();
    assert!(
        texts.contains(&"window") && texts.contains(&"opening"),
        "{texts:?}"
    );
    assert!(!texts.contains(&"crack"), "{texts:?}");
}
