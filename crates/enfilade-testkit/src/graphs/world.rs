//! A world from a grid and one choice per wall: portals, cells, batches, furniture.

use std::collections::BTreeMap;

use enfilade_cpg::{
    Batch, Cell, CellId, CellPortalGraph, DetailObject, Portal, PortalId, PortalKind, World,
};
use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{Aabb, DVec3};

use super::grid::{Face, Grid};

/// A hole in a face: `[low, high]` along its two other axes, and its kind.
pub(super) type FaceHole = ([f64; 2], [f64; 2], PortalKind);

/// Builds a world from the grid and one choice per face.
pub(super) fn world_of(
    grid: &Grid,
    furniture: &[(u32, Aabb)],
    hole: &mut dyn FnMut(&Face) -> Option<FaceHole>,
) -> World {
    let mut walls = Walls::default();
    for face in grid.faces() {
        let opening = match face.cells {
            [Some(_), Some(_)] => hole(&face),
            _ => None,
        };
        walls.add(grid, &face, opening);
    }
    let batches = walls.batches();
    let mut cells = cells_of(grid);
    for (i, p) in walls.portals.iter().enumerate() {
        for c in p.cells {
            cells[c.0 as usize].portals.push(PortalId(i as u32));
        }
    }
    for batch in &batches {
        for c in &batch.cells {
            cells[c.0 as usize].n_triangles += batch.primitive.indices.len() as u32 / 3;
        }
    }
    for (label, _) in furniture {
        cells[*label as usize].n_detail_triangles += 12;
    }
    let details = details_of(grid, furniture);
    World {
        graph: CellPortalGraph {
            cells,
            portals: walls.portals,
            locator: grid.locator().into(),
            ..CellPortalGraph::default()
        },
        batches,
        detail_meshes: if details.is_empty() {
            Vec::new()
        } else {
            vec![unit_cube()]
        },
        details,
        ..World::default()
    }
}

/// Walls by the cells that see them, and the openings in them.
#[derive(Default)]
struct Walls {
    by_cells: BTreeMap<Vec<CellId>, Primitive>,
    portals: Vec<Portal>,
}

impl Walls {
    fn add(&mut self, grid: &Grid, face: &Face, opening: Option<FaceHole>) {
        let mut parts = Vec::new();
        match opening {
            None => parts.push(([0.0; 2], [1.0; 2])),
            Some((low, high, _)) => {
                parts.push(([0.0; 2], [low[0], 1.0]));
                parts.push(([high[0], 0.0], [1.0; 2]));
                parts.push(([low[0], 0.0], [high[0], low[1]]));
                parts.push(([low[0], high[1]], [high[0], 1.0]));
            }
        }
        self.portals
            .extend(opening.map(|o| portal_of(grid, face, o)));
        let mut cells: Vec<CellId> = face.cells.iter().flatten().copied().map(CellId).collect();
        cells.sort_unstable();
        let primitive = self.by_cells.entry(cells).or_default();
        for (low, high) in parts {
            if low[0] < high[0] && low[1] < high[1] {
                let first = primitive.positions.len() as u32;
                let corners = grid.rectangle(face, low, high);
                primitive.positions.extend(corners.map(to_f32));
                let indices = [0, 1, 2, 0, 2, 3].map(|k| first + k);
                primitive.indices.extend(indices);
            }
        }
    }

    fn batches(&mut self) -> Vec<Batch> {
        std::mem::take(&mut self.by_cells)
            .into_iter()
            .map(|(cells, primitive)| Batch {
                cells,
                primitive,
                ..Batch::default()
            })
            .collect()
    }
}

fn portal_of(grid: &Grid, face: &Face, (low, high, kind): FaceHole) -> Portal {
    let corners = grid.rectangle(face, low, high);
    let outline: Vec<[f32; 3]> = corners.iter().map(|&p| to_f32(p)).collect();
    let area = (corners[1] - corners[0]).length() * (corners[3] - corners[0]).length();
    Portal {
        cells: [0, 1].map(|k| CellId(face.cells[k].unwrap_or_default())),
        kind,
        normal: to_f32(grid.turn.col(face.axis)),
        pieces: vec![outline.clone()],
        outline,
        area: area as f32,
        fittings: Vec::new(),
        why: Vec::new(),
    }
}

/// Makes cells with name, box and volume; the callers count the rest.
fn cells_of(grid: &Grid) -> Vec<Cell> {
    let labels = grid.label.iter().copied().chain(grid.outdoors);
    let n_cells = labels.max().map_or(0, |c| c as usize + 1);
    let mut cells: Vec<Cell> = (0..n_cells)
        .map(|i| Cell {
            name: if grid.outdoors == Some(i as u32) {
                "outdoors".into()
            } else {
                format!("cell-{i}")
            },
            outdoor: grid.outdoors == Some(i as u32),
            ..Cell::default()
        })
        .collect();
    let mut boxes = vec![Aabb::EMPTY; n_cells];
    for (i, &label) in grid.label.iter().enumerate() {
        let square = grid.square(i);
        let mut volume = 1.0;
        for (at, &i) in grid.at.iter().zip(&square) {
            volume *= at[i + 1] - at[i];
        }
        cells[label as usize].volume += volume as f32;
        for corner in 0..8 {
            let p = [0, 1, 2].map(|k| grid.at[k][square[k] + (corner >> k & 1)]);
            let b = &mut boxes[label as usize];
            *b = b.including(grid.turn * DVec3::from(p));
        }
    }
    if let Some(outdoors) = grid.outdoors {
        let all = boxes.iter().fold(Aabb::EMPTY, |b, &c| b.union(c));
        boxes[outdoors as usize] = all.expanded(5.0);
        // The locator's box without the rooms.
        let rooms: f32 = cells.iter().map(|c| c.volume).sum();
        cells[outdoors as usize].volume = (all.volume() as f32 - rooms).max(0.0);
    }
    for (cell, b) in cells.iter_mut().zip(&boxes) {
        cell.aabb = [
            to_f32(b.min).map(f32::next_down),
            to_f32(b.max).map(f32::next_up),
        ];
    }
    cells
}

/// Places a unit cube at each box, with the cell in which it stands.
fn details_of(grid: &Grid, furniture: &[(u32, Aabb)]) -> Vec<DetailObject> {
    let column = |v: DVec3, w: f32| {
        let [x, y, z] = to_f32(v);
        [x, y, z, w]
    };
    let placed = |(i, (label, b)): (usize, &(u32, Aabb))| {
        let axes = [0, 1, 2].map(|k| grid.turn.col(k) * b.size()[k]);
        let transform = [
            column(axes[0], 0.0),
            column(axes[1], 0.0),
            column(axes[2], 0.0),
            column(grid.turn * b.min, 1.0),
        ];
        DetailObject {
            name: format!("box-{i}"),
            mesh: 0,
            transform: std::array::from_fn(|k| transform[k / 4][k % 4]),
            cells: vec![CellId(*label)],
            source: None,
            part_of: None,
        }
    };
    furniture.iter().enumerate().map(placed).collect()
}

fn unit_cube() -> Mesh {
    let positions = (0..8)
        .map(|c| [0, 1, 2].map(|k| (c >> k & 1) as f32))
        .collect();
    Mesh {
        name: "cube".into(),
        primitives: vec![Primitive {
            positions,
            indices: box_indices(),
            ..Primitive::default()
        }],
    }
}

/// The triangles of a box whose vertices are numbered by one bit per axis.
pub(super) fn box_indices() -> Vec<u32> {
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = quads.map(|quad| [0, 1, 2, 0, 2, 3].map(|k: usize| quad[k]));
    triangles.concat()
}

fn to_f32(p: DVec3) -> [f32; 3] {
    p.as_vec3().to_array()
}
