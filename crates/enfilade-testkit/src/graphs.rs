//! Worlds made without a bake: rooms on a grid, with graph, locator and geometry by construction.
//!
//! Walls have no thickness and are seen from both sides; each opening is a rectangle in one wall. The
//! graph is exact, so whatever a run-time loses in such a world, it lost itself.

use std::collections::BTreeMap;

use enfilade_cpg::{
    Batch, Cell, CellId, CellPortalGraph, DetailObject, Locator, LocatorNode, Portal, PortalId,
    PortalKind, World,
};
use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{Aabb, DMat3, DVec3};

use crate::rng::Rng;

/// What grid of rooms to make.
#[derive(Clone, Debug)]
pub struct GridParams {
    /// Squares along x, y (storeys) and z. [Limit: above 0]
    pub size: [usize; 3],
    /// Start of the random choices.
    pub seed: u64,
    /// Chance of a doorway in a wall between two rooms.
    pub doors: f64,
    /// Chance of a window in a wall to the outdoors, or between rooms without a doorway.
    pub windows: f64,
    /// Chance of a hole in a floor between two rooms.
    pub holes: f64,
    /// Chance that a square joins its neighbor's room: makes concave cells.
    pub merges: f64,
    /// Whether there is an outdoors.
    pub outdoors: bool,
    /// Boxes standing in each square.
    pub furniture: usize,
    /// Turn about a slanting axis. [Units: rad]
    pub turn: f64,
}

impl GridParams {
    /// About `rooms` office-like rooms on storeys of at most 100, unturned.
    #[must_use]
    pub fn offices(rooms: usize, seed: u64) -> Self {
        let storeys = rooms.div_ceil(100).max(1);
        let per_storey = rooms.div_ceil(storeys);
        let along = (per_storey as f64).sqrt().ceil() as usize;
        Self {
            size: [along, storeys, per_storey.div_ceil(along)],
            seed,
            doors: 0.6,
            windows: 0.4,
            holes: 0.02,
            merges: 0.0,
            outdoors: true,
            furniture: 4,
            turn: 0.0,
        }
    }
}

/// A rectangle, and which way it was cut out of its wall.
type Quad = [DVec3; 4];

/// The grid while it is built.
struct Grid {
    size: [usize; 3],
    /// Where squares end, by axis: `size + 1` numbers each.
    at: [Vec<f64>; 3],
    /// Cell of each square, x fastest, then y.
    label: Vec<u32>,
    outdoors: Option<u32>,
    turn: DMat3,
}

/// A wall face between two squares, or a square and the outdoors.
#[derive(Clone, Copy)]
struct Face {
    axis: usize,
    /// The square on the upper side (its index along `axis` is the plane's).
    square: [usize; 3],
    /// Cells on the lower and upper side; `None` for solid ground.
    cells: [Option<u32>; 2],
}

impl Grid {
    fn label_at(&self, square: [usize; 3]) -> u32 {
        self.label[(square[2] * self.size[1] + square[1]) * self.size[0] + square[0]]
    }

    fn faces(&self) -> Vec<Face> {
        let mut out = Vec::new();
        for axis in 0..3 {
            let mut n = self.size;
            n[axis] += 1;
            for z in 0..n[2] {
                for y in 0..n[1] {
                    for x in 0..n[0] {
                        let square = [x, y, z];
                        let mut below = square;
                        let lower = if square[axis] == 0 {
                            self.outdoors
                        } else {
                            below[axis] -= 1;
                            Some(self.label_at(below))
                        };
                        let upper = if square[axis] == self.size[axis] {
                            self.outdoors
                        } else {
                            Some(self.label_at(square))
                        };
                        if lower != upper {
                            out.push(Face {
                                axis,
                                square,
                                cells: [lower, upper],
                            });
                        }
                    }
                }
            }
        }
        out
    }

    /// The part of a face from `low` to `high` (0 to 1 along the two other axes, in cyclic order),
    /// counter-clockwise about the axis.
    fn rectangle(&self, face: &Face, low: [f64; 2], high: [f64; 2]) -> Quad {
        let (a, b) = ((face.axis + 1) % 3, (face.axis + 2) % 3);
        let along = |k: usize, t: f64| {
            let (from, to) = (self.at[k][face.square[k]], self.at[k][face.square[k] + 1]);
            from + (to - from) * t
        };
        let point = |s: f64, t: f64| {
            let mut p = DVec3::ZERO;
            p[face.axis] = self.at[face.axis][face.square[face.axis]];
            p[a] = along(a, s);
            p[b] = along(b, t);
            self.turn * p
        };
        [
            point(low[0], low[1]),
            point(high[0], low[1]),
            point(high[0], high[1]),
            point(low[0], high[1]),
        ]
    }

    fn locator(&self) -> Locator {
        let mut planes = Vec::new();
        let mut first = [0; 3];
        for (axis, first) in first.iter_mut().enumerate() {
            *first = planes.len() as u32;
            let n = self.turn.col(axis);
            planes.extend(self.at[axis].iter().map(|x| [n.x, n.y, n.z, -x]));
        }
        let mut bounds = Aabb::EMPTY;
        for corner in 0..8 {
            let pick = |k: usize| {
                self.at[k][if corner >> k & 1 == 1 {
                    self.size[k]
                } else {
                    0
                }]
            };
            bounds = bounds.including(self.turn * DVec3::new(pick(0), pick(1), pick(2)));
        }
        let mut nodes = Vec::new();
        // Six planes cut the box off from the ground or the outdoors, for turned grids.
        let outside = Locator::leaf(self.outdoors.map(CellId));
        for (axis, &low) in first.iter().enumerate() {
            for (side, plane) in [(0, low), (1, low + self.size[axis] as u32)] {
                let next = nodes.len() as i32 + 1;
                let children = if side == 0 {
                    [next, outside]
                } else {
                    [outside, next]
                };
                nodes.push(LocatorNode { plane, children });
            }
        }
        let inner = self.split(&mut nodes, [0; 3], self.size, &first);
        // A grid that is one room has no node of its own.
        nodes[5].children[1] = inner;
        Locator {
            bounds,
            outside: self.outdoors.map(CellId),
            planes,
            nodes,
            root: 0,
        }
    }

    fn split(
        &self,
        nodes: &mut Vec<LocatorNode>,
        low: [usize; 3],
        high: [usize; 3],
        first: &[u32; 3],
    ) -> i32 {
        let axis = (0..3).max_by_key(|&k| high[k] - low[k]).unwrap_or(0);
        if high[axis] - low[axis] <= 1 {
            let leaf = Locator::leaf(Some(CellId(self.label_at(low))));
            // The root of a grid of one square must be a node.
            return leaf;
        }
        let middle = (low[axis] + high[axis]) / 2;
        let at = nodes.len();
        nodes.push(LocatorNode {
            plane: first[axis] + middle as u32,
            children: [0; 2],
        });
        let (mut below, mut above) = (high, low);
        below[axis] = middle;
        above[axis] = middle;
        let upper = self.split(nodes, above, high, first);
        let lower = self.split(nodes, low, below, first);
        nodes[at].children = [upper, lower];
        at as i32
    }
}

fn to_f32(p: DVec3) -> [f32; 3] {
    p.as_vec3().to_array()
}

/// A hole in a face: `[low, high]` along its two other axes, and what it is.
type Hole = ([f64; 2], [f64; 2], PortalKind);

/// Puts a world together from the grid and one choice a face.
fn world_of(
    grid: &Grid,
    furniture: &[(u32, Aabb)],
    hole: &mut dyn FnMut(&Face) -> Option<Hole>,
) -> World {
    let n_cells = grid
        .label
        .iter()
        .copied()
        .chain(grid.outdoors)
        .max()
        .map_or(0, |c| c as usize + 1);
    let mut walls: BTreeMap<Vec<CellId>, Primitive> = BTreeMap::new();
    let mut portals = Vec::new();
    for face in grid.faces() {
        let mut cells: Vec<CellId> = face.cells.iter().flatten().copied().map(CellId).collect();
        cells.sort_unstable();
        let opening = match face.cells {
            [Some(_), Some(_)] => hole(&face),
            _ => None,
        };
        let mut parts = Vec::new();
        match opening {
            None => parts.push(([0.0; 2], [1.0; 2])),
            Some((low, high, kind)) => {
                parts.push(([0.0; 2], [low[0], 1.0]));
                parts.push(([high[0], 0.0], [1.0; 2]));
                parts.push(([low[0], 0.0], [high[0], low[1]]));
                parts.push(([low[0], high[1]], [high[0], 1.0]));
                let corners = grid.rectangle(&face, low, high);
                let outline: Vec<[f32; 3]> = corners.iter().map(|&p| to_f32(p)).collect();
                let area = (corners[1] - corners[0]).length() * (corners[3] - corners[0]).length();
                portals.push(Portal {
                    cells: [0, 1].map(|k| CellId(face.cells[k].unwrap_or_default())),
                    kind,
                    normal: to_f32(grid.turn.col(face.axis)),
                    pieces: vec![outline.clone()],
                    outline,
                    area: area as f32,
                });
            }
        }
        let primitive = walls.entry(cells).or_default();
        for (low, high) in parts {
            if low[0] < high[0] && low[1] < high[1] {
                let first = primitive.positions.len() as u32;
                let corners = grid.rectangle(&face, low, high);
                primitive.positions.extend(corners.map(to_f32));
                let indices = [0, 1, 2, 0, 2, 3].map(|k| first + k);
                primitive.indices.extend(indices);
            }
        }
    }
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
        let square = [
            i % grid.size[0],
            i / grid.size[0] % grid.size[1],
            i / grid.size[0] / grid.size[1],
        ];
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
    }
    for (cell, b) in cells.iter_mut().zip(&boxes) {
        cell.aabb = [
            to_f32(b.min).map(f32::next_down),
            to_f32(b.max).map(f32::next_up),
        ];
    }
    for (i, p) in portals.iter().enumerate() {
        for c in p.cells {
            cells[c.0 as usize].portals.push(PortalId(i as u32));
        }
    }
    let batches: Vec<Batch> = walls
        .into_iter()
        .map(|(cells, primitive)| Batch {
            cells,
            primitive,
            ..Batch::default()
        })
        .collect();
    for batch in &batches {
        for c in &batch.cells {
            cells[c.0 as usize].n_triangles += batch.primitive.indices.len() as u32 / 3;
        }
    }
    let locator = grid.locator();
    let mut details = Vec::new();
    for (i, (label, b)) in furniture.iter().enumerate() {
        let axes = [0, 1, 2].map(|k| grid.turn.col(k) * b.size()[k]);
        let origin = grid.turn * b.min;
        let column = |v: DVec3, w: f32| {
            let [x, y, z] = to_f32(v);
            [x, y, z, w]
        };
        let transform = [
            column(axes[0], 0.0),
            column(axes[1], 0.0),
            column(axes[2], 0.0),
            column(origin, 1.0),
        ];
        cells[*label as usize].n_detail_triangles += 12;
        details.push(DetailObject {
            name: format!("box-{i}"),
            mesh: 0,
            transform: std::array::from_fn(|k| transform[k / 4][k % 4]),
            cells: vec![CellId(*label)],
        });
    }
    World {
        graph: CellPortalGraph {
            cells,
            portals,
            locator,
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

fn unit_cube() -> Mesh {
    let positions = (0..8)
        .map(|c| [0, 1, 2].map(|k| (c >> k & 1) as f32))
        .collect();
    let mut indices = Vec::new();
    for quad in [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ] {
        indices.extend([0, 1, 2, 0, 2, 3].map(|k: usize| quad[k]));
    }
    Mesh {
        name: "cube".into(),
        primitives: vec![Primitive {
            positions,
            indices,
            ..Primitive::default()
        }],
    }
}

/// Rooms on a grid, with doorways, windows, holes in floors, concave rooms and furniture by chance.
///
/// # Panics
///
/// When a side of the grid has no squares.
#[must_use]
pub fn room_grid(params: &GridParams) -> World {
    let mut rng = Rng::new(params.seed);
    let size = params.size;
    assert!(size.iter().all(|&n| n > 0), "a grid has squares");
    let at = [0, 1, 2].map(|k| {
        let mut x = 0.0;
        let mut at = vec![x];
        for _ in 0..size[k] {
            x += if k == 1 { 3.0 } else { rng.range(3.0, 6.0) };
            at.push(x);
        }
        at
    });
    let n = size[0] * size[1] * size[2];
    // Squares join the room of a neighbor on a lower side; numbers without gaps at the end.
    let mut label: Vec<u32> = (0..n as u32).collect();
    let stride = [1, size[0], size[0] * size[1]];
    for i in 0..n {
        let square = [i % size[0], i / size[0] % size[1], i / stride[2]];
        for axis in [0, 2, 1] {
            if square[axis] > 0 && rng.chance(params.merges) {
                label[i] = label[i - stride[axis]];
            }
        }
    }
    let mut number: BTreeMap<u32, u32> = BTreeMap::new();
    for l in &mut label {
        let next = number.len() as u32;
        *l = *number.entry(*l).or_insert(next);
    }
    let axis = DVec3::new(0.3, 0.9, -0.4).normalize();
    let grid = Grid {
        size,
        at,
        label,
        outdoors: params.outdoors.then_some(number.len() as u32),
        turn: DMat3::from_axis_angle(axis, params.turn),
    };
    let mut furniture = Vec::new();
    for (i, &label) in grid.label.iter().enumerate() {
        let square = [i % size[0], i / size[0] % size[1], i / stride[2]];
        for _ in 0..params.furniture {
            let low = DVec3::from([0, 1, 2].map(|k| grid.at[k][square[k]]));
            let high = DVec3::from([0, 1, 2].map(|k| grid.at[k][square[k] + 1]));
            let extent = DVec3::new(
                rng.range(0.3, 1.2),
                rng.range(0.4, 1.6),
                rng.range(0.3, 1.2),
            );
            let room = high - low - extent - 0.2;
            let min = low + 0.1 + room * DVec3::new(rng.unit(), 0.0, rng.unit());
            furniture.push((label, Aabb::new(min, min + extent)));
        }
    }
    let outdoors = grid.outdoors;
    let mut hole = |face: &Face| -> Option<Hole> {
        let is_outer = outdoors.is_some() && face.cells.contains(&outdoors);
        if face.axis == 1 {
            let (x, z) = (rng.range(0.1, 0.6), rng.range(0.1, 0.6));
            let is_hole = !is_outer && rng.chance(params.holes);
            return is_hole.then_some(([z, x], [z + 0.3, x + 0.3], PortalKind::Open));
        }
        let place = rng.range(0.1, 0.6);
        // The axes after x are y and z, after z they are x and y.
        let (up, along) = if face.axis == 0 { (0, 1) } else { (1, 0) };
        let mut low = [0.0; 2];
        let mut high = [0.0; 2];
        low[along] = place;
        high[along] = place + 0.25;
        if !is_outer && rng.chance(params.doors) {
            high[up] = 0.7;
            return Some((low, high, PortalKind::Open));
        }
        if rng.chance(params.windows) {
            (low[up], high[up]) = (0.3, 0.8);
            return Some((low, high, PortalKind::Window));
        }
        None
    };
    world_of(&grid, &furniture, &mut hole)
}

/// A courtyard with `per_side` windows on each of its four sides; behind each its own room, with
/// doorways from room to room, or `one_room` all around.
///
/// Cell 0 is the courtyard.
#[must_use]
pub fn courtyard(per_side: usize, one_room: bool) -> World {
    let n = per_side + 2;
    let mut label = vec![0; n * n];
    let mut next = 1;
    for (i, l) in label.iter_mut().enumerate() {
        let (x, z) = (i % n, i / n);
        if x == 0 || z == 0 || x + 1 == n || z + 1 == n {
            *l = next;
            next += u32::from(!one_room);
        }
    }
    let mut x = Vec::new();
    for i in 0..=n {
        x.push(i as f64 * 3.0);
    }
    let grid = Grid {
        size: [n, 1, n],
        at: [x.clone(), vec![0.0, 3.0], x],
        label,
        outdoors: None,
        turn: DMat3::IDENTITY,
    };
    let mut furniture = Vec::new();
    for (i, &label) in grid.label.iter().enumerate() {
        let low = DVec3::new(grid.at[0][i % n] + 1.0, 0.0, grid.at[2][i / n] + 1.0);
        furniture.push((label, Aabb::new(low, low + 0.8)));
    }
    world_of(&grid, &furniture, &mut |face| {
        Some(window_or_doorway(face.axis, face.cells.contains(&Some(0))))
    })
}

/// A tower of `storeys` with `per_side` windows on each side of each: rooms around a core as high as
/// the tower, with a doorway to it but at corners, or `one_room` all around.
///
/// Cell 0 is the core, the last one the outdoors. Both have a portal for most rooms.
///
/// # Panics
///
/// When `per_side` is below 3 or there is no storey.
#[must_use]
pub fn window_tower(per_side: usize, storeys: usize, one_room: bool) -> World {
    assert!(per_side > 2 && storeys > 0, "a tower has rooms and a core");
    let n = per_side;
    let mut label = vec![0; n * storeys * n];
    let mut next = 1;
    for (i, l) in label.iter_mut().enumerate() {
        let (x, z) = (i % n, i / (n * storeys));
        if x == 0 || z == 0 || x + 1 == n || z + 1 == n {
            *l = next;
            next += u32::from(!one_room);
        }
    }
    let outdoors = label.iter().max().map_or(0, |l| l + 1);
    let steps = |n: usize| (0..=n).map(|i| i as f64 * 3.0).collect::<Vec<_>>();
    let grid = Grid {
        size: [n, storeys, n],
        at: [n, storeys, n].map(steps),
        label,
        outdoors: Some(outdoors),
        turn: DMat3::IDENTITY,
    };
    world_of(&grid, &[], &mut |face| {
        let is_window = face.cells.contains(&Some(outdoors));
        let is_wall = face.axis != 1 && (is_window || face.cells.contains(&Some(0)));
        is_wall.then(|| window_or_doorway(face.axis, is_window))
    })
}

/// The middle of a wall across an axis: a window above the sill, or an open doorway; as shares of the wall.
fn window_or_doorway(axis: usize, is_window: bool) -> ([f64; 2], [f64; 2], PortalKind) {
    let up = usize::from(axis != 0);
    let (sill, lintel, kind) = if is_window {
        (0.3, 0.8, PortalKind::Window)
    } else {
        (0.0, 0.7, PortalKind::Open)
    };
    let (mut low, mut high) = ([0.3; 2], [0.7; 2]);
    (low[up], high[up]) = (sill, lintel);
    (low, high, kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_are_valid_worlds_whose_locator_knows_every_square() {
        for (merges, turn, outdoors) in [(0.0, 0.0, true), (0.3, 0.5, true), (0.2, 1.0, false)] {
            let params = GridParams {
                merges,
                outdoors,
                turn,
                ..GridParams::offices(60, 3)
            };
            let world = room_grid(&params);
            assert_eq!(world.validate(), Ok(()));
            let axis = DVec3::new(0.3, 0.9, -0.4).normalize();
            let turn = DMat3::from_axis_angle(axis, turn);
            for d in &world.details {
                let m: Vec<f64> = d.transform.iter().map(|&x| f64::from(x)).collect();
                let middle = DVec3::new(m[12], m[13], m[14])
                    + 0.5
                        * (DVec3::new(m[0], m[1], m[2])
                            + DVec3::new(m[4], m[5], m[6])
                            + DVec3::new(m[8], m[9], m[10]));
                assert_eq!(world.graph.locator.locate(middle), Some(d.cells[0]));
            }
            let away = turn * DVec3::new(-1.0, 1.0, 1.0);
            let outside = world.graph.cells.iter().position(|c| c.outdoor);
            let found = world.graph.locator.locate(away);
            assert_eq!(found, outside.map(|i| CellId(i as u32)));
        }
    }

    #[test]
    fn a_courtyard_has_its_windows() {
        let world = courtyard(16, false);
        assert_eq!(world.validate(), Ok(()));
        assert_eq!(world.graph.cells[0].portals.len(), 64);
        assert_eq!(world.graph.cells.len(), 1 + 68);
        let ring = courtyard(16, true);
        assert_eq!(ring.validate(), Ok(()));
        assert_eq!((ring.graph.cells.len(), ring.graph.portals.len()), (2, 64));
    }

    #[test]
    fn a_tower_has_a_window_for_each_stretch_of_its_facades() {
        let world = window_tower(4, 4, false);
        assert_eq!(world.validate(), Ok(()));
        let is_window = |p: &&Portal| p.kind == PortalKind::Window;
        assert_eq!(world.graph.portals.iter().filter(is_window).count(), 64);
        // Twelve rooms a storey; those at corners have two windows and no doorway.
        assert_eq!(world.graph.cells.len(), 1 + 4 * 12 + 1);
        assert_eq!(world.graph.cells[0].portals.len(), 4 * 8);
        let ring = window_tower(4, 4, true);
        assert_eq!(ring.validate(), Ok(()));
        assert_eq!((ring.graph.cells.len(), ring.graph.portals.len()), (3, 96));
    }
}
