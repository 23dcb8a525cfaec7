//! Honeybee models, by rules of the client that need no client: shells close, and what answers is equal.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{PortalKind, World};
use enfilade_export::hbjson;
use enfilade_geom::DVec3;
use enfilade_testkit::{GridParams, furnished_house, room_grid, rotated};
use serde_json::Value;

use crate::common::{baked, house};

/// Tolerance of the model. [Units: wu]
const TOLERANCE: f64 = 0.01;

fn list<'v>(value: &'v Value, name: &str) -> &'v [Value] {
    value[name].as_array().map_or(&[], Vec::as_slice)
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

/// Returns the loops of a face, the outer one first.
fn loops(thing: &Value) -> Vec<Vec<DVec3>> {
    let geometry = &thing["geometry"];
    let outer = std::iter::once(&geometry["boundary"]);
    let all = outer.chain(list(geometry, "holes"));
    let points = |ring: &Value| -> Vec<[f64; 3]> { serde_json::from_value(ring.clone()).unwrap() };
    all.map(|ring| points(ring).into_iter().map(DVec3::from).collect())
        .collect()
}

fn area(loops: &[Vec<DVec3>]) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for ring in loops {
        for (i, p) in ring.iter().enumerate() {
            sum += 0.5 * (p - loops[0][0]).cross(ring[(i + 1) % ring.len()] - loops[0][0]);
        }
    }
    sum
}

/// Checks that each edge of a room's faces is one of exactly two, where vertices within the tolerance are the same.
fn closes(room: &Value) {
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut edges: BTreeMap<[usize; 2], u32> = BTreeMap::new();
    for face in list(room, "faces") {
        let loops = loops(face);
        let whole = area(&loops);
        assert!(whole.length() > TOLERANCE, "{}", face["identifier"]);
        for ring in &loops {
            let numbers: Vec<usize> = ring
                .iter()
                .map(|p| {
                    let off = (p - loops[0][0]).dot(whole.normalize());
                    assert!(off.abs() < 1e-4, "{}: {off}", face["identifier"]);
                    let known = vertices
                        .iter()
                        .position(|v| (v - p).abs().max_element() <= TOLERANCE);
                    known.unwrap_or_else(|| {
                        vertices.push(*p);
                        vertices.len() - 1
                    })
                })
                .collect();
            for (i, &a) in numbers.iter().enumerate() {
                let b = numbers[(i + 1) % numbers.len()];
                assert_ne!(a, b, "{}: an edge without length", face["identifier"]);
                *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
            }
        }
    }
    assert!(edges.values().all(|&n| n == 2), "{}", room["identifier"]);
}

/// Checks that openings are in the plane of their face, inside of its outline and outside of its holes.
fn holds_openings(face: &Value) -> usize {
    let outline = loops(face);
    let normal = area(&outline).normalize();
    let is_inside = |p: DVec3| {
        let mut turns = 0.0;
        for ring in &outline {
            for (i, &a) in ring.iter().enumerate() {
                let (a, b) = (a - p, ring[(i + 1) % ring.len()] - p);
                turns += f64::atan2(a.cross(b).dot(normal), a.dot(b));
            }
        }
        turns > 3.0
    };
    let openings = list(face, "apertures").iter().chain(list(face, "doors"));
    let mut n = 0;
    for opening in openings {
        let own = loops(opening);
        assert!(
            area(&own).dot(normal) > TOLERANCE,
            "{}",
            opening["identifier"]
        );
        for &p in &own[0] {
            let off = (p - outline[0][0]).dot(normal).abs();
            assert!(off < 1e-4 && is_inside(p), "{}", opening["identifier"]);
        }
        let kinds = [opening, face].map(|o| text(&o["boundary_condition"]["type"]));
        assert!(kinds[0] == kinds[1] && ["Surface", "Outdoors"].contains(&kinds[0]));
        n += 1;
    }
    n
}

/// Checks that each face or opening between two rooms has one that answers it, of the same size and on the other side.
fn answers(rooms: &[Value]) -> usize {
    let mut by_id: BTreeMap<&str, &Value> = BTreeMap::new();
    for face in rooms.iter().flat_map(|r| list(r, "faces")) {
        let openings = list(face, "apertures").iter().chain(list(face, "doors"));
        for thing in openings.chain([face]) {
            let id = text(&thing["identifier"]);
            assert!(id.len() <= 100 && by_id.insert(id, thing).is_none(), "{id}");
        }
    }
    let objects = |thing: &Value| {
        let objects = list(&thing["boundary_condition"], "boundary_condition_objects");
        objects.first().map(|o| text(o).to_owned())
    };
    let mut n = 0;
    for (id, thing) in &by_id {
        if let Some(other) = objects(thing) {
            let answer = by_id[other.as_str()];
            assert_eq!(objects(answer).as_deref(), Some(*id));
            assert!(
                (area(&loops(thing)) + area(&loops(answer))).length() < 1e-3,
                "{id}"
            );
            n += 1;
        } else {
            assert_ne!(thing["face_type"], "AirBoundary", "{id}");
        }
    }
    n
}

fn check(world: &World) {
    let whole = hbjson(world);
    let model: Value = serde_json::from_str(&whole.text).unwrap();
    let rooms = list(&model, "rooms");
    assert_eq!(rooms.len(), world.graph.rooms().count());
    rooms.iter().for_each(closes);
    let faces = rooms.iter().flat_map(|r| list(r, "faces"));
    assert!(faces.map(holds_openings).sum::<usize>() > 0);
    assert!(answers(rooms) > 0);
    assert!(rooms.iter().all(|r| r["user_data"]["note"].is_null()));
    // Each opening is a door, an aperture, air, or said to be left out.
    let ids = rooms
        .iter()
        .flat_map(|r| list(r, "faces"))
        .flat_map(|face| {
            let openings = list(face, "doors").iter().chain(list(face, "apertures"));
            openings.map(|o| text(&o["identifier"]).rsplit("_o").next().unwrap())
        });
    let n_written = ids.collect::<BTreeSet<_>>().len();
    let faces = rooms.iter().flat_map(|r| list(r, "faces"));
    let n_air = faces.filter(|f| f["face_type"] == "AirBoundary").count() / 2;
    let n_left_out = list(&model["user_data"], "openings_left_out").len();
    let graph = &world.graph;
    let openings = graph
        .portals
        .iter()
        .filter(|p| p.kind != PortalKind::Crack && p.cells.iter().any(|&c| graph[c].is_room()));
    assert_eq!(n_written + n_air + n_left_out, openings.count());
    assert_eq!(whole.notes.len(), usize::from(n_left_out > 0));
}

#[test]
fn rooms_of_a_house_close_and_answer_each_other() {
    check(&house());
}

#[test]
fn walls_in_any_direction_are_axes() {
    check(&baked(&rotated(furnished_house(), 17.0)));
}

#[test]
fn rooms_of_several_storeys_close_and_answer_each_other() {
    for seed in 0..4 {
        check(&room_grid(&GridParams {
            size: [3, 2, 2],
            seed,
            doors: 0.7,
            merges: 0.3,
            ..GridParams::two_rooms()
        }));
    }
}

#[test]
fn a_world_without_rooms_is_a_model_without_rooms() {
    let model: Value = serde_json::from_str(&hbjson(&World::default()).text).unwrap();
    assert!(list(&model, "rooms").is_empty());
}
