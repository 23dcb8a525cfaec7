//! A world without a bake: `cargo run -p enfilade --example own_builder`.
//!
//! A level editor that knows its rooms builds the graph itself. Here: rooms of 4 × 3 × 5 m in a row, a doorway from each to the
//! next. Decoding the file checks every invariant, whatever built the graph.

#![allow(clippy::print_stdout)]

use std::error::Error;

use enfilade::cpg::wire::{decode_glb, encode_glb};
use enfilade::cpg::{Locator, LocatorNode};
use enfilade::geom::scene::Primitive;
use enfilade::geom::{Aabb, DVec3};
use enfilade::{Batch, Cell, CellId, CellPortalGraph, Portal, PortalId, PortalKind, World};

const SIZE: [f32; 3] = [4.0, 3.0, 5.0];

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let bytes = encode_glb(&rooms(6))?;
    let world = decode_glb(&bytes)?;
    let cell = world.graph.locate([9.0, 1.0, 2.0]);
    let cell = cell.ok_or("in no room")?;
    assert_eq!(world.graph[cell].name, "cell-2");
    let next: Vec<_> = world.graph.exits(cell).map(|e| e.to.to_string()).collect();
    assert_eq!(next, ["cell-1", "cell-3"]);
    println!(
        "{} bytes; {} opens to {}",
        bytes.len(),
        world.graph[cell].name,
        next.join(", ")
    );
    Ok(())
}

fn rooms(n: u32) -> World {
    let cells = (0..n).map(|i| Cell {
        name: CellId(i).to_string(),
        aabb: [[x(i), 0.0, 0.0], [x(i + 1), SIZE[1], SIZE[2]]],
        volume: SIZE.iter().product(),
        n_triangles: 2,
        // To the room before, and to the room after.
        portals: (i.saturating_sub(1)..(i + 1).min(n - 1))
            .map(PortalId)
            .collect(),
        ..Cell::default()
    });
    let graph = CellPortalGraph {
        cells: cells.collect(),
        portals: (1..n).map(doorway).collect(),
        locator: locator(n).into(),
        ..CellPortalGraph::default()
    };
    World {
        graph,
        // The triangles seen from each room: its floor.
        batches: (0..n).map(floor).collect(),
        ..World::default()
    }
}

/// Start of room `i` along x.
fn x(i: u32) -> f32 {
    i as f32 * SIZE[0]
}

/// The doorway from the room before into room `i`.
fn doorway(i: u32) -> Portal {
    // Counter-clockwise seen from the second cell, which the normal points to.
    let outline: Vec<[f32; 3]> = [[0.0, 2.0], [2.1, 2.0], [2.1, 3.0], [0.0, 3.0]]
        .map(|[y, z]| [x(i), y, z])
        .into();
    Portal {
        cells: [CellId(i - 1), CellId(i)],
        kind: PortalKind::Open,
        normal: [1.0, 0.0, 0.0],
        pieces: vec![outline.clone()],
        outline,
        area: 2.1,
        fittings: Vec::new(),
        why: Vec::new(),
    }
}

fn floor(i: u32) -> Batch {
    let (left, right, far) = (x(i), x(i + 1), SIZE[2]);
    Batch {
        cells: vec![CellId(i)],
        primitive: Primitive {
            positions: vec![
                [left, 0.0, 0.0],
                [left, 0.0, far],
                [right, 0.0, far],
                [right, 0.0, 0.0],
            ],
            indices: vec![0, 1, 2, 0, 2, 3],
            ..Primitive::default()
        },
        ..Batch::default()
    }
}

/// Planes between neighboring rooms: the first child is beyond the plane, the second in front of it.
fn locator(n: u32) -> Locator {
    let leaf = |i| Locator::leaf(Some(CellId(i)));
    let nodes = (1..n).map(|i| LocatorNode {
        plane: i - 1,
        children: [if i + 1 < n { i as i32 } else { leaf(i) }, leaf(i - 1)],
    });
    let far = DVec3::new(x(n).into(), SIZE[1].into(), SIZE[2].into());
    Locator {
        bounds: Aabb::new(DVec3::ZERO, far),
        planes: (1..n).map(|i| [1.0, 0.0, 0.0, -f64::from(x(i))]).collect(),
        nodes: nodes.collect(),
        root: if n > 1 { 0 } else { leaf(0) },
        ..Locator::default()
    }
}
