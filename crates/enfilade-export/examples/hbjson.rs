//! Writes the rooms of a world as a Honeybee model, and prints how much of the area between two rooms it keeps.

use std::collections::BTreeMap;
use std::io::Write;

use enfilade_cpg::wire;
use enfilade_export::{Behind, SurfaceOptions, hbjson, room_surfaces};
use serde_json::Value;

/// Areas by the identifiers of two rooms.
type Areas = BTreeMap<[String; 2], f64>;

fn area(ring: &Value) -> [f64; 3] {
    let points: Vec<[f64; 3]> = serde_json::from_value(ring.clone()).expect("points");
    let mut sum = [0.0; 3];
    for (i, p) in points.iter().enumerate() {
        let q = points[(i + 1) % points.len()];
        for (k, s) in sum.iter_mut().enumerate() {
            let (a, b) = ((k + 1) % 3, (k + 2) % 3);
            *s += 0.5 * (p[a] * q[b] - p[b] * q[a]);
        }
    }
    sum
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let bytes = std::fs::read(&args[1]).expect("a world");
    let world = wire::decode_glb(&bytes).expect("a valid world");
    let text = hbjson(&world);
    std::fs::write(&args[2], &text).expect("a place to write");
    let mut out = std::io::stdout();
    let graph = &world.graph;
    let mut exact = Areas::new();
    for room in room_surfaces(&world, &SurfaceOptions::default()) {
        for surface in &room.surfaces {
            if let Behind::Cell(other) = surface.behind
                && other != room.cell
                && graph[room.cell].is_room()
                && graph[other].is_room()
            {
                let names = [room.cell, other].map(|c| graph[c].name.clone());
                *exact.entry(names).or_default() += surface.area;
            }
        }
    }
    let model: Value = serde_json::from_str(&text).expect("JSON");
    let rooms = model["rooms"].as_array().expect("rooms");
    let text_of = |v: &Value| v.as_str().unwrap_or_default().to_owned();
    let by_id: BTreeMap<String, String> = (rooms.iter())
        .map(|r| (text_of(&r["identifier"]), text_of(&r["display_name"])))
        .collect();
    let mut written = Areas::new();
    for room in rooms {
        for face in room["faces"].as_array().expect("faces") {
            let objects = face["boundary_condition"]["boundary_condition_objects"].as_array();
            let Some(other) = objects.and_then(|o| o.last()) else {
                continue;
            };
            let geometry = &face["geometry"];
            let holes = geometry["holes"].as_array();
            let mut sum = [0.0; 3];
            for ring in std::iter::once(&geometry["boundary"]).chain(holes.into_iter().flatten()) {
                let own = area(ring);
                (0..3).for_each(|k| sum[k] += own[k]);
            }
            let size = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
            let names = [
                text_of(&room["display_name"]),
                by_id[&text_of(other)].clone(),
            ];
            *written.entry(names).or_default() += size;
        }
        if !room["user_data"]["note"].is_null() {
            writeln!(
                out,
                "  {}: {}",
                room["display_name"], room["user_data"]["note"]
            )
            .unwrap();
        }
    }
    let whole: f64 = exact.values().sum();
    let kept: f64 = (exact.iter())
        .map(|(k, &a)| a.min(written.get(k).copied().unwrap_or(0.0)))
        .sum();
    let all: f64 = written.values().sum();
    writeln!(
        out,
        "  {} rooms, left out {}; between rooms {whole:.1} m2, written {all:.1}, kept {:.2} %",
        rooms.len(),
        model["user_data"]["rooms_left_out"],
        100.0 * kept / whole.max(1e-9)
    )
    .unwrap();
    let mut lost: Vec<_> = (exact.iter())
        .map(|(k, a)| (a - written.get(k).copied().unwrap_or(0.0), k, a))
        .collect();
    lost.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (d, names, a) in lost.iter().take(6).filter(|l| l.0 > 0.2) {
        writeln!(out, "    lost {d:.2} of {a:.2} {names:?}").unwrap();
    }
}
