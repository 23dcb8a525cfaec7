//! Scenes from strangers, without a truth: counts of features identified by eye.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use serde_json::Value;

use super::disturbed::MessyRows;
use super::figures::n_indoors;
use super::score::{V3, inspect};
use crate::process::{bake_file, output_of, scenes_dir};

/// A point inside a storey that is glazed all around. [Units: wu]
const IN_HALL: V3 = [10.0, 3.0, -6.0];
/// Most portals of a hotel room.
const MOST_PORTALS: f64 = 30.0;

/// Prints rows of the available scenes.
pub(super) fn run(rows: &mut MessyRows<'_>) -> anyhow::Result<()> {
    rows.state.label = "foreign".into();
    let Some(folder) = scenes_dir().map(|d| d.join("foreign")) else {
        return Ok(());
    };
    let scenes: [(&str, &[&str], Judge); 3] = [
        ("hotel-room.glb", &["--unit", "mm"], hotel_room),
        ("nav_test.obj", &["--allow-empty"], boxes),
        ("sports-hall.glb", &[], hall),
    ];
    for (file, settings, judge) in scenes {
        let path = folder.join(file);
        if !path.is_file() || !rows.chosen.has_scene(file) {
            continue;
        }
        rows.state.scene = file.into();
        let world = rows.state.folder.join("foreign.glb");
        let judged = output_of(&mut bake_file(&path, settings, &world), None)
            .and_then(|_| inspect(&world))
            .and_then(|graph| judge(rows, &path, &world, &graph));
        if let Err(error) = judged {
            rows.failed(&error);
        }
    }
    Ok(())
}

type Judge = fn(&mut MessyRows<'_>, &Path, &Path, &Value) -> anyhow::Result<()>;

fn hotel_room(rows: &mut MessyRows<'_>, _: &Path, _: &Path, graph: &Value) -> anyhow::Result<()> {
    let n = graph["portals"].as_array().map_or(0, Vec::len);
    rows.within("portals", n as f64, MOST_PORTALS);
    Ok(())
}

fn hall(rows: &mut MessyRows<'_>, _: &Path, world: &Path, graph: &Value) -> anyhow::Result<()> {
    let n = n_indoors(graph, world, &[IN_HALL])?;
    let row = "hall is indoors";
    rows.shares(row, Some(n as f64), Some(1.0), 0.0);
    Ok(())
}

fn boxes(rows: &mut MessyRows<'_>, path: &Path, world: &Path, graph: &Value) -> anyhow::Result<()> {
    let text = std::fs::read_to_string(path).context("an OBJ file is text")?;
    let middles = box_middles(&text);
    let n = n_indoors(graph, world, &middles)?;
    let row = format!("rooms inside {} boxes", middles.len());
    rows.within(&row, n as f64, 0.0);
    Ok(())
}

/// Returns the centers of the boxes of an OBJ file: connected sets of faces with eight vertices.
fn box_middles(text: &str) -> Vec<V3> {
    let (mut at, mut parent): (Vec<V3>, Vec<usize>) = (Vec::new(), Vec::new());
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let p: Vec<f64> = words.filter_map(|w| w.parse().ok()).collect();
                if let [x, y, z, ..] = p[..] {
                    parent.push(at.len());
                    at.push([x, y, z]);
                }
            }
            Some("f") => {
                let first = |w: &str| w.split('/').next()?.parse::<usize>().ok()?.checked_sub(1);
                let corners: Vec<usize> =
                    words.filter_map(first).filter(|&i| i < at.len()).collect();
                for pair in corners.windows(2) {
                    let (a, b) = (root(&mut parent, pair[0]), root(&mut parent, pair[1]));
                    parent[a] = b;
                }
            }
            _ => {}
        }
    }
    let mut parts: BTreeMap<usize, Vec<V3>> = BTreeMap::new();
    for (i, p) in at.iter().enumerate() {
        parts.entry(root(&mut parent, i)).or_default().push(*p);
    }
    let middle = |p: &Vec<V3>| [0, 1, 2].map(|k| p.iter().map(|q| q[k]).sum::<f64>() / 8.0);
    parts
        .values()
        .filter(|p| p.len() == 8)
        .map(middle)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_told_from_other_shapes() {
        let mut text = String::from("v 9 9 9\nv 8 9 9\nv 9 8 9\nf 1 2 3\n");
        for i in 0..8 {
            text += &format!("v {} {} {}\n", i & 1, i >> 1 & 1, i >> 2);
        }
        text += "f 4/1 5/2 7/3 6/4\nf 8 9 11 10\nf 4 5 9 8\n";
        assert_eq!(box_middles(&text), [[0.5; 3]]);
    }
}
