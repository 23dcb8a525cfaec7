//! A small house: two rooms, a doorway in a thick wall between them, a window to the outdoors.
//!
//! `A` is the box (0 0 0)–(4 3 4), `B` (4.25 0 0)–(8.25 3 4). The doorway is 1 m wide and 2 m high, its
//! portal in the middle of the wall; the window is 1 m square in the wall x = 0.

#![allow(dead_code, reason = "each test program uses its part")]

use std::sync::Arc;

use enfilade_cpg::{
    Batch, Cell, CellId, CellPortalGraph, Locator, LocatorNode, Portal, PortalId, PortalKind, World,
};
use enfilade_geom::scene::Primitive;
use enfilade_geom::{Aabb, DMat4, DVec3, Plane};

pub(crate) const A: CellId = CellId(0);
pub(crate) const B: CellId = CellId(1);
pub(crate) const OUTDOORS: CellId = CellId(2);
pub(crate) const DOOR: usize = 0;
pub(crate) const WINDOW: usize = 1;
/// Position of the door's portal.
pub(crate) const DOOR_X: f64 = 4.125;

pub(crate) type Quad = [[f64; 3]; 4];

/// Builds a chain of box tests: the first box that contains a point gives its cell. Box `k` has planes `6 k` to
/// `6 k + 5`; a point may fail at each of them, and its next test is then in a tree of its own.
pub(crate) fn locator_of_boxes(
    boxes: &[([f64; 3], [f64; 3], Option<CellId>)],
    bounds: Aabb,
    outside: Option<CellId>,
) -> Locator {
    let mut planes = Vec::new();
    for (min, max, _) in boxes {
        for i in 0..6_usize {
            let axis = i / 2;
            let mut plane = [0.0; 4];
            (plane[axis], plane[3]) = if i % 2 == 0 {
                (1.0, -min[axis])
            } else {
                (-1.0, max[axis])
            };
            planes.push(plane);
        }
    }
    let cells: Vec<Option<CellId>> = boxes.iter().map(|b| b.2).collect();
    let mut nodes = Vec::new();
    let root = tree_of_boxes(&cells, 0, outside, &mut nodes);
    Locator {
        bounds,
        outside,
        planes,
        nodes,
        root,
    }
}

/// Adds the tests of box `k` and of those after it; returns the first node.
fn tree_of_boxes(
    cells: &[Option<CellId>],
    k: usize,
    outside: Option<CellId>,
    nodes: &mut Vec<LocatorNode>,
) -> i32 {
    if k == cells.len() {
        return Locator::leaf(outside);
    }
    let first = nodes.len();
    for i in 0..6 {
        let inside = if i == 5 {
            Locator::leaf(cells[k])
        } else {
            (first + i + 1) as i32
        };
        nodes.push(LocatorNode {
            plane: (6 * k + i) as u32,
            children: [inside, 0],
        });
    }
    for i in 0..6 {
        let next = tree_of_boxes(cells, k + 1, outside, nodes);
        nodes[first + i].children[1] = next;
    }
    first as i32
}

/// Returns the rectangle `a` to `b` in the plane where they share a coordinate, with a rectangular hole.
pub(crate) fn wall(a: [f64; 3], b: [f64; 3], hole: Option<([f64; 3], [f64; 3])>) -> Vec<Quad> {
    let flat = (0..3).find(|&k| a[k] == b[k]).expect("a flat rectangle");
    let (u, v) = ((flat + 1) % 3, (flat + 2) % 3);
    let rect = |u0: f64, u1: f64, v0: f64, v1: f64| -> Quad {
        [(u0, v0), (u1, v0), (u1, v1), (u0, v1)].map(|(pu, pv)| {
            let mut p = [0.0; 3];
            (p[flat], p[u], p[v]) = (a[flat], pu, pv);
            p
        })
    };
    let Some((h0, h1)) = hole else {
        return vec![rect(a[u], b[u], a[v], b[v])];
    };
    [
        rect(a[u], h0[u], a[v], b[v]),
        rect(h1[u], b[u], a[v], b[v]),
        rect(h0[u], h1[u], a[v], h0[v]),
        rect(h0[u], h1[u], h1[v], b[v]),
    ]
    .into_iter()
    .filter(|q| q[0][u] < q[2][u] && q[0][v] < q[2][v])
    .collect()
}

pub(crate) fn batch(cells: &[CellId], quads: Vec<Vec<Quad>>) -> Batch {
    let mut primitive = Primitive::default();
    for quad in quads.into_iter().flatten() {
        let first = primitive.positions.len() as u32;
        primitive
            .positions
            .extend(quad.map(|p| p.map(|x| x as f32)));
        primitive
            .indices
            .extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }
    Batch {
        cells: cells.to_vec(),
        primitive,
        is_seal: false,
        sources: enfilade_cpg::SourceRuns::default(),
    }
}

pub(crate) fn portal(cells: [CellId; 2], kind: PortalKind, quad: Quad) -> Portal {
    let outline = quad.map(|p| p.map(|x| x as f32)).to_vec();
    let corners = quad.map(DVec3::from_array);
    let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    Portal {
        cells,
        kind,
        normal: n.normalize().as_vec3().to_array(),
        pieces: vec![outline.clone()],
        outline,
        area: n.length() as f32,
        fittings: Vec::new(),
        why: Vec::new(),
    }
}

pub(crate) fn cell(
    name: &str,
    min: [f32; 3],
    max: [f32; 3],
    portals: &[u32],
    outdoor: bool,
) -> Cell {
    Cell {
        name: name.into(),
        aabb: [min, max],
        volume: (0..3).map(|k| max[k] - min[k]).product(),
        portals: portals.iter().copied().map(PortalId).collect(),
        outdoor,
        ..Cell::default()
    }
}

/// Returns the house with the locator's plane of the door at `door_x`.
pub(crate) fn house_with_locator_plane(door_x: f64) -> World {
    let bounds = Aabb::new(DVec3::splat(-2.0), DVec3::new(10.25, 5.0, 6.0));
    let locator = locator_of_boxes(
        &[
            ([0.0, 0.0, 0.0], [4.0, 3.0, 4.0], Some(A)),
            ([4.0, 0.0, 1.0], [door_x, 2.0, 2.0], Some(A)),
            ([door_x, 0.0, 1.0], [4.25, 2.0, 2.0], Some(B)),
            ([4.25, 0.0, 0.0], [8.25, 3.0, 4.0], Some(B)),
            ([4.0, 0.0, 0.0], [4.25, 3.0, 4.0], None),
        ],
        bounds,
        Some(OUTDOORS),
    );
    let doorway = |x: f64| Some(([x, 0.0, 1.0], [x, 2.0, 2.0]));
    let window = Some(([0.0, 1.0, 1.5], [0.0, 2.0, 2.5]));
    let batches = vec![
        batch(
            &[A, B, OUTDOORS],
            vec![
                wall([0.0, 0.0, 0.0], [8.25, 0.0, 4.0], None),
                wall([0.0, 3.0, 0.0], [8.25, 3.0, 4.0], None),
                wall([0.0, 0.0, 0.0], [8.25, 3.0, 0.0], None),
                wall([0.0, 0.0, 4.0], [8.25, 3.0, 4.0], None),
            ],
        ),
        batch(
            &[A, OUTDOORS],
            vec![wall([0.0, 0.0, 0.0], [0.0, 3.0, 4.0], window)],
        ),
        batch(
            &[B, OUTDOORS],
            vec![wall([8.25, 0.0, 0.0], [8.25, 3.0, 4.0], None)],
        ),
        batch(
            &[A],
            vec![wall([4.0, 0.0, 0.0], [4.0, 3.0, 4.0], doorway(4.0))],
        ),
        batch(
            &[B],
            vec![wall([4.25, 0.0, 0.0], [4.25, 3.0, 4.0], doorway(4.25))],
        ),
        batch(
            &[A, B],
            vec![
                wall([4.0, 0.0, 1.0], [4.25, 2.0, 1.0], None),
                wall([4.0, 0.0, 2.0], [4.25, 2.0, 2.0], None),
                wall([4.0, 2.0, 1.0], [4.25, 2.0, 2.0], None),
            ],
        ),
    ];
    let x = DOOR_X;
    let portals = vec![
        portal(
            [A, B],
            PortalKind::Open,
            [[x, 0.0, 1.0], [x, 2.0, 1.0], [x, 2.0, 2.0], [x, 0.0, 2.0]],
        ),
        portal(
            [OUTDOORS, A],
            PortalKind::Window,
            [
                [0.0, 1.0, 1.5],
                [0.0, 2.0, 1.5],
                [0.0, 2.0, 2.5],
                [0.0, 1.0, 2.5],
            ],
        ),
    ];
    let mut cells = vec![
        cell("cell-0", [0.0; 3], [4.125, 3.0, 4.0], &[0, 1], false),
        cell("cell-1", [4.125, 0.0, 0.0], [8.25, 3.0, 4.0], &[0], false),
        cell("outdoors", [-2.0; 3], [10.25, 5.0, 6.0], &[1], true),
    ];
    // The rooms with half of the doorway each; the rest of the box but the house is outdoors.
    let doorway = |width: f64| (48.0 + 2.0 * width) as f32;
    cells[0].volume = doorway(door_x - 4.0);
    cells[1].volume = doorway(4.25 - door_x);
    cells[2].volume = 12.25 * 7.0 * 8.0 - 8.25 * 3.0 * 4.0;
    cells[0].aabb[1][0] = door_x as f32;
    cells[1].aabb[0][0] = door_x as f32;
    for batch in &batches {
        for c in &batch.cells {
            cells[c.0 as usize].n_triangles += batch.primitive.indices.len() as u32 / 3;
        }
    }
    let graph = CellPortalGraph {
        cells,
        portals,
        locator: locator.into(),
        ..CellPortalGraph::default()
    };
    World {
        graph,
        batches,
        ..World::default()
    }
}

pub(crate) fn house() -> World {
    house_with_locator_plane(DOOR_X)
}

/// Returns the world moved as a whole; vertices are rounded to `f32` again, the locator's planes are not.
pub(crate) fn moved(mut world: World, by: &DMat4) -> World {
    let point = |p: &mut [f32; 3]| {
        let q = by.transform_point3(DVec3::from_array(p.map(f64::from)));
        *p = q.as_vec3().to_array();
    };
    for batch in &mut world.batches {
        batch.primitive.positions.iter_mut().for_each(point);
    }
    for p in &mut world.graph.portals {
        p.outline
            .iter_mut()
            .chain(p.pieces.iter_mut().flatten())
            .for_each(point);
        let n = by.transform_vector3(DVec3::from_array(p.normal.map(f64::from)));
        p.normal = n.normalize().as_vec3().to_array();
    }
    let box_of = |min: DVec3, max: DVec3| {
        let mut b = Aabb::EMPTY;
        for k in 0..8 {
            let pick = |axis: usize| {
                if k >> axis & 1 == 0 {
                    min[axis]
                } else {
                    max[axis]
                }
            };
            b = b.including(by.transform_point3(DVec3::new(pick(0), pick(1), pick(2))));
        }
        b
    };
    let rooms = [
        [
            ([0.0, 0.0, 0.0], [4.0, 3.0, 4.0]),
            ([4.0, 0.0, 1.0], [DOOR_X, 2.0, 2.0]),
        ],
        [
            ([4.25, 0.0, 0.0], [8.25, 3.0, 4.0]),
            ([DOOR_X, 0.0, 1.0], [4.25, 2.0, 2.0]),
        ],
    ];
    for (c, parts) in world.graph.cells.iter_mut().zip(rooms) {
        let b = parts.map(|(min, max)| box_of(min.into(), max.into()));
        let b = b[0].union(b[1]);
        c.aabb = [b.min.as_vec3().to_array(), b.max.as_vec3().to_array()];
    }
    let locator = Arc::make_mut(&mut world.graph.locator);
    let before = locator.bounds.volume();
    locator.bounds = box_of(locator.bounds.min, locator.bounds.max);
    let outdoors = &mut world.graph.cells[2];
    outdoors.volume += (locator.bounds.volume() - before) as f32;
    outdoors.aabb = [locator.bounds.min, locator.bounds.max].map(|p| p.as_vec3().to_array());
    for p in &mut locator.planes {
        let plane = Plane {
            normal: DVec3::new(p[0], p[1], p[2]),
            d: p[3],
        };
        let on = by.transform_point3(-plane.normal * plane.d);
        let turned = Plane::through(on, by.transform_vector3(plane.normal));
        *p = [turned.normal.x, turned.normal.y, turned.normal.z, turned.d];
    }
    world
}
