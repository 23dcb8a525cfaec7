//! Storeys of worlds made of boxes: which floors share a plan, and that every room is on one.

use crate::verify_common as common;

use common::{batch, cell, locator_of_boxes, portal, wall};
use enfilade_cpg::{CellId, CellPortalGraph, PortalKind, World};
use enfilade_geom::{Aabb, DVec3};
use enfilade_report::{PlanOptions, Plans, RasterError, find_storeys, plan_svg};

type Corner = [f64; 3];

/// A room, with or without a floor.
struct Hall {
    low: Corner,
    high: Corner,
    has_floor: bool,
}

fn room(low: Corner, high: Corner) -> Hall {
    Hall {
        low,
        high,
        has_floor: true,
    }
}

fn shaft(low: Corner, high: Corner) -> Hall {
    Hall {
        has_floor: false,
        ..room(low, high)
    }
}

/// A door 2 m wide in a wall across x, from `y` up, between two halls.
type Door = (u32, u32, [f64; 3]);

fn world(halls: &[Hall], doors: &[Door]) -> World {
    let boxes: Vec<_> = (0..)
        .zip(halls)
        .map(|(i, h)| (h.low, h.high, Some(CellId(i))))
        .collect();
    let mut bounds = Aabb::EMPTY;
    for h in halls {
        bounds = bounds.including(DVec3::from_array(h.low));
        bounds = bounds.including(DVec3::from_array(h.high));
    }
    let bounds = Aabb::new(bounds.min - 1.0, bounds.max + 1.0);
    let portals: Vec<_> = doors
        .iter()
        .map(|&(a, b, [x, y, z])| {
            let quad = [
                [x, y, z],
                [x, y + 2.0, z],
                [x, y + 2.0, z + 1.0],
                [x, y, z + 1.0],
            ];
            portal([CellId(a), CellId(b)], PortalKind::Door, quad)
        })
        .collect();
    let cells = (0..)
        .zip(halls)
        .map(|(i, h)| {
            let of: Vec<u32> = (0..)
                .zip(doors)
                .filter(|(_, d)| d.0 == i || d.1 == i)
                .map(|(k, _)| k)
                .collect();
            let [low, high] = [h.low, h.high].map(|p| p.map(|x| x as f32));
            cell(&format!("cell-{i}"), low, high, &of, false)
        })
        .collect();
    let floors = (0..).zip(halls).filter(|(_, h)| h.has_floor);
    let batches = floors.map(|(i, h)| {
        let end = [h.high[0], h.low[1], h.high[2]];
        batch(&[CellId(i)], vec![wall(h.low, end, None)])
    });
    World {
        batches: batches.collect(),
        graph: CellPortalGraph {
            cells,
            portals,
            locator: locator_of_boxes(&boxes, bounds, None).into(),
            ..CellPortalGraph::default()
        },
        ..World::default()
    }
}

/// Storeys by name, with their cells.
fn storeys(world: &World) -> Vec<(String, Vec<u32>)> {
    let found = find_storeys(world).into_iter();
    found
        .map(|s| (s.name, s.cells.iter().map(|c| c.0).collect()))
        .collect()
}

fn named(name: &str, cells: &[u32]) -> (String, Vec<u32>) {
    (name.into(), cells.to_vec())
}

/// Six rooms in a row, each 2 m lower than the last, with doors between them.
fn cascade() -> Vec<Hall> {
    let at = |i: i32| (f64::from(6 * i), f64::from(-2 * i));
    (0..6)
        .map(|i| {
            let (x, y) = at(i);
            room([x, y, 0.0], [x + 6.0, y + 5.0, 5.0])
        })
        .collect()
}

fn cascade_doors() -> Vec<Door> {
    (0..5)
        .map(|i| (i, i + 1, [f64::from(6 * (i + 1)), f64::from(i) * -2.0, 2.0]))
        .collect()
}

#[test]
fn rooms_that_step_down_beside_each_other_are_one_storey() {
    let world = world(&cascade(), &cascade_doors());
    assert_eq!(storeys(&world), [named("1", &[0, 1, 2, 3, 4, 5])]);
    let storey = &find_storeys(&world)[0];
    assert_eq!(storey.range, [-10.0, 0.0]);
    let svg = plan_svg(&world, &PlanOptions::default());
    assert!(
        svg.contains("floors -10.00 to +0.00 m, cut 1.20 m above each"),
        "{svg}"
    );
    assert_eq!(svg.matches("class=\"cell\"").count(), 6);
}

#[test]
fn what_lies_above_is_another_storey_whatever_stairs_lead_there() {
    let mut halls = cascade();
    // Back over the first room, reached from the last one by a door with a drop.
    halls.push(room([0.0, -12.0, 0.0], [30.0, -9.0, 5.0]));
    let mut doors = cascade_doors();
    doors.push((5, 6, [30.0, -11.0, 2.0]));
    let world = world(&halls, &doors);
    assert_eq!(
        storeys(&world),
        [named("1", &[6]), named("2", &[0, 1, 2, 3, 4, 5])]
    );
}

#[test]
fn wings_of_one_height_are_one_storey_without_a_doorway() {
    let halls = [
        room([0.0, 0.0, 0.0], [5.0, 3.0, 5.0]),
        room([20.0, 0.3, 0.0], [25.0, 3.0, 5.0]),
        // Far below, and unconnected; but too small for a storey of its own beside these two.
        room([0.0, -30.0, 20.0], [1.2, -27.0, 21.2]),
        room([0.0, 9.0, 20.0], [5.0, 12.0, 25.0]),
    ];
    assert_eq!(
        storeys(&world(&halls, &[])),
        [named("1", &[0, 1, 2]), named("2", &[3])]
    );
}

#[test]
fn a_hall_with_a_gallery_is_on_both_storeys() {
    let halls = [
        room([0.0, 0.0, 0.0], [5.0, 3.0, 5.0]),
        room([0.0, 3.0, 0.0], [5.0, 6.0, 5.0]),
        room([5.0, 0.0, 0.0], [15.0, 6.0, 5.0]),
    ];
    let mut world = world(&halls, &[(0, 2, [5.0, 0.0, 2.0]), (1, 2, [5.0, 3.0, 2.0])]);
    let gallery = wall([5.0, 3.0, 0.0], [7.0, 3.0, 5.0], None);
    world.batches.push(batch(&[CellId(2)], vec![gallery]));
    // The gallery lies above the floor of its own hall.
    assert_eq!(storeys(&world), [named("1", &[0, 2]), named("2", &[1, 2])]);
}

#[test]
fn spaces_without_a_floor_stand_beside_rooms_or_on_plans_of_their_own() {
    let halls = [
        room([0.0, 0.0, 0.0], [8.0, 2.5, 5.0]),
        // Above the ceiling of that room, and another space above this one.
        shaft([0.0, 2.5, 0.0], [8.0, 3.0, 5.0]),
        shaft([0.0, 3.0, 0.0], [8.0, 3.4, 5.0]),
        // A shaft beside it, and one under a stair.
        shaft([8.5, 0.0, 0.0], [9.5, 3.0, 1.0]),
        shaft([3.0, 2.0, 1.0], [4.0, 2.4, 2.0]),
    ];
    // The first box wins: the cavity is cut out of its room.
    let halls = [4, 0, 1, 2, 3].map(|i: usize| Hall {
        low: halls[i].low,
        high: halls[i].high,
        has_floor: halls[i].has_floor,
    });
    let world = world(&halls, &[]);
    assert_eq!(
        storeys(&world),
        [named("1", &[0, 1, 4]), named("1a", &[2]), named("1b", &[3])]
    );
    let plans = Plans::new(&world, &PlanOptions::default());
    assert_eq!(plans.voids().map(|c| c.0).collect::<Vec<_>>(), [0, 2, 3, 4]);
    assert_eq!(plans.find("cell-3"), [2]);
    assert_eq!(plans.find("1a"), [1]);
    assert!(plans.find("cell-9").is_empty() && plans.find("7").is_empty());
    // The cavity is cut at its own height.
    let svg = plan_svg(&world, &PlanOptions::default());
    for id in 0..5 {
        assert!(
            svg.contains(&format!("<path class=\"cell\" data-cell=\"{id}\"")),
            "{id}"
        );
    }
}

/// A plenum above two rooms, of the headroom of a room, and a duct between them at the height of the cut.
#[test]
fn voids_make_no_storey_and_are_hatched_where_a_plan_cuts_them() {
    let halls = [
        room([0.0, 0.0, 0.0], [5.0, 2.5, 5.0]),
        room([6.0, 0.0, 0.0], [11.0, 2.5, 5.0]),
        room([5.0, 1.0, 2.0], [6.0, 1.6, 3.0]),
        room([0.0, 2.5, 0.0], [11.0, 4.3, 5.0]),
    ];
    let mut world = world(&halls, &[]);
    assert_eq!(storeys(&world).len(), 2);
    for cell in [2, 3] {
        world.graph.cells[cell].is_void = true;
    }
    assert_eq!(storeys(&world), [named("1", &[0, 1])]);
    let plans = Plans::new(&world, &PlanOptions::default());
    assert_eq!(plans.voids().map(|c| c.0).collect::<Vec<_>>(), [2, 3]);
    assert!(plans.find("cell-3").is_empty());
    let svg = plan_svg(&world, &PlanOptions::default());
    let shown = |id: u32| svg.contains(&format!("data-cell=\"{id}\""));
    assert_eq!([0, 1, 2, 3].map(shown), [true, true, false, false]);
    let document = roxmltree::Document::parse(&svg).unwrap();
    let is_hatching = |n: &roxmltree::Node| n.attribute("class") == Some("hatching");
    let hatching = document
        .descendants()
        .filter(|n| is_hatching(n) && n.has_tag_name("path"));
    let lines = hatching.filter_map(|n| n.attribute("d")).next().unwrap();
    // A square meter, each line 0.42 m from the next along its side: about as many as fit on two sides.
    assert!((3..=6).contains(&lines.matches('M').count()), "{lines}");
}

#[test]
fn a_low_room_is_cut_below_its_ceiling() {
    // The lower one of two rooms cut together ends below that cut.
    let halls = [
        room([0.0, 0.4, 0.0], [20.0, 4.0, 20.0]),
        room([20.0, 0.0, 0.0], [22.0, 1.3, 20.0]),
    ];
    let world = world(&halls, &[]);
    assert_eq!(storeys(&world), [named("1", &[0, 1])]);
    let svg = plan_svg(&world, &PlanOptions::default());
    for id in 0..2 {
        assert!(svg.contains(&format!("<path class=\"cell\" data-cell=\"{id}\"")));
    }
}

#[test]
fn rooms_a_thousand_kilometers_apart_are_drawn_in_no_more_memory() {
    let halls = [
        room([0.0, 0.0, 0.0], [5.0, 3.0, 5.0]),
        room([1e6, 0.0, 1e6], [1e6 + 5.0, 3.0, 1e6 + 5.0]),
    ];
    let svg = plan_svg(&world(&halls, &[]), &PlanOptions::default());
    assert_eq!(svg.matches("<path class=\"thin\" data-cell=").count(), 2);
}

#[test]
fn a_cell_that_is_too_thin_to_draw_is_a_box_with_its_number() {
    let halls = [
        room([0.0, 0.0, 0.0], [40.0, 3.0, 40.0]),
        shaft([40.0, 0.0, 3.0], [40.000_001, 3.0, 4.0]),
    ];
    let world = world(&halls, &[]);
    let svg = plan_svg(&world, &PlanOptions::default());
    assert_eq!(
        svg.matches("<path class=\"thin\" data-cell=\"1\"").count(),
        1
    );
    assert!(svg.contains("data-cell=\"1\">1</text>"));
    assert!(svg.contains("A number alone stands for a cell: 1 is cell-1."));
}

/// Text of a cell on the sheet: place, height, `true` if turned, and content.
fn words_of(svg: &str, cell: u32) -> Vec<([f64; 2], f64, bool, String)> {
    let document = roxmltree::Document::parse(svg).unwrap();
    let id = cell.to_string();
    let texts = document
        .descendants()
        .filter(|n| n.has_tag_name("text") && n.attribute("data-cell") == Some(id.as_str()));
    let number = |t: Option<&str>| t.unwrap().parse::<f64>().unwrap();
    texts
        .map(|t| {
            let size = number(t.attribute("font-size"));
            let text = t.text().unwrap().to_owned();
            if let Some(place) = t.attribute("transform") {
                let inner = place.strip_prefix("translate(").unwrap();
                let (x, rest) = inner.split_once(' ').unwrap();
                let (y, _) = rest.split_once(')').unwrap();
                return ([number(Some(x)), number(Some(y))], size, true, text);
            }
            let at = ["x", "y"].map(|k| number(t.attribute(k)));
            (at, size, false, text)
        })
        .collect()
}

#[test]
fn names_stay_in_their_rooms_shrunk_turned_wrapped_or_numbered() {
    let halls = [
        room([0.0, 0.0, 0.0], [30.0, 3.0, 20.0]),
        room([30.0, 0.0, 0.0], [31.0, 3.0, 20.0]),
        room([31.0, 0.0, 0.0], [32.6, 3.0, 1.6]),
        room([31.0, 0.0, 3.0], [31.9, 3.0, 3.9]),
    ];
    let mut world = world(&halls, &[]);
    let names = [
        "assembly hall",
        "corridor of the west wing",
        "boiler-and-water-room",
        "a very small room with a very long name",
    ];
    for (cell, name) in world.graph.cells.iter_mut().zip(names) {
        cell.name = name.into();
    }
    let svg = plan_svg(&world, &PlanOptions::default());
    for (id, hall) in (0..).zip(&halls) {
        let words = words_of(&svg, id);
        assert!(!words.is_empty(), "{id}");
        for (at, size, is_turned, text) in &words {
            let half = 0.5 * 0.62 * size * text.chars().count() as f64;
            let reach = if *is_turned {
                [*size, half]
            } else {
                [half, *size]
            };
            // Letters stand on their base line, and reach a quarter of their height below it.
            for (k, axis) in [0, 2].into_iter().enumerate() {
                let (low, high) = (hall.low[axis] * 100.0, hall.high[axis] * 100.0);
                let is_down = (k == 1) != *is_turned;
                let (before, after) = if is_down {
                    (0.8 * reach[k], 0.3 * reach[k])
                } else {
                    (reach[k], reach[k])
                };
                // Twice the grid of the section, 2 cm.
                assert!(
                    at[k] - before > low - 4.0 && at[k] + after < high + 4.0,
                    "{text} at {at:?} in {low}..{high} of {axis}"
                );
            }
        }
    }
    let all = |id: u32| -> Vec<String> { words_of(&svg, id).into_iter().map(|w| w.3).collect() };
    assert_eq!(all(0)[0], names[0]);
    let turned = words_of(&svg, 1);
    assert!(turned.len() == 1 && turned[0].2 && turned[0].3 == names[1]);
    assert_eq!(all(2), ["boiler-", "and-", "water-", "room"]);
    assert_eq!(all(3), ["3"]);
    assert!(svg.contains(&format!(">3  {}<", names[3])), "the legend");
}

#[test]
fn a_name_stays_in_the_arms_of_a_room_with_a_corner_in_it() {
    // The first box wins: the second room is an L around the first, 2 m wide on one side and 1 m on the other.
    let halls = [
        room([2.0, 0.0, 1.0], [12.0, 3.0, 12.0]),
        room([0.0, 0.0, 0.0], [12.0, 3.0, 12.0]),
    ];
    let mut world = world(&halls, &[]);
    world.graph.cells[1].name = "gallery around the hall".into();
    let svg = plan_svg(&world, &PlanOptions::default());
    let words = words_of(&svg, 1);
    assert_eq!(words.len(), 2, "the name and the area");
    for (at, size, is_turned, text) in words {
        let half = 0.5 * 0.62 * size * text.chars().count() as f64;
        let right = at[0] + if is_turned { 0.3 * size } else { half };
        let below = at[1] + if is_turned { half } else { 0.3 * size };
        assert!(
            right < 202.0 || below < 102.0,
            "{text} at {at:?}, {size} high, is in the other room"
        );
    }
}

#[test]
fn a_picture_is_as_wide_as_asked_and_the_same_every_time() {
    let world = world(&cascade(), &cascade_doors());
    let plans = Plans::new(&world, &PlanOptions::default());
    let sheet = plans.sheet(&[0]);
    let png = sheet.to_png(300).unwrap();
    assert_eq!(png, sheet.to_png(300).unwrap());
    let reader = png::Decoder::new(std::io::Cursor::new(&png));
    let mut reader = reader.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(info.width, 300);
    let [w, h] = sheet.size();
    assert_eq!(f64::from(info.height), (300.0 * h / w).ceil());
    // White paper, six colors of rooms, black walls and letters.
    let colors: std::collections::BTreeSet<&[u8]> = pixels.chunks(3).collect();
    assert!(colors.contains(&[0xff, 0xff, 0xff][..]) && colors.len() > 20);
    assert_eq!(sheet.to_png(0), Err(RasterError::Size { size: [0, 0] }));
    assert!(sheet.to_png(enfilade_report::MAX_PIXELS + 1).is_err());
}

#[test]
fn a_pdf_has_a_page_for_each_drawing_at_a_scale_that_fits() {
    let mut halls = cascade();
    halls.push(room([0.0, -20.0, 0.0], [36.0, -17.0, 5.0]));
    let world = world(&halls, &cascade_doors());
    let plans = Plans::new(&world, &PlanOptions::default());
    let pages: Vec<_> = (0..plans.storeys().len())
        .map(|k| plans.sheet(&[k]))
        .collect();
    assert_eq!(pages.len(), 2);
    let [a4, a0] = ["A4", "A0"].map(|name| {
        let papers = enfilade_report::PAPERS.into_iter();
        papers.into_iter().find(|p| p.name == name).unwrap()
    });
    let pdf = enfilade_report::to_pdf(&pages, a4, None).unwrap();
    assert_eq!(pdf, enfilade_report::to_pdf(&pages, a4, None).unwrap());
    let text = String::from_utf8_lossy(&pdf);
    assert!(text.starts_with("%PDF-") && text.contains("/Count 2"));
    // A4 landscape, in points.
    assert_eq!(text.matches("/MediaBox [0 0 841.88").count(), 2, "{text}");
    let error = enfilade_report::to_pdf(&pages, a4, Some(50.0)).unwrap_err();
    assert_eq!((error.scale, error.paper, error.fits), (50.0, "A4", 200.0));
    assert!(enfilade_report::to_pdf(&pages, a0, Some(50.0)).is_ok());
    assert!(enfilade_report::to_pdf(&pages, a4, Some(200.0)).is_ok());
}
