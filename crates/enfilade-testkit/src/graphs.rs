//! Worlds made without a bake: rooms on a grid, with graph, locator and geometry by construction.
//!
//! Walls have no thickness and are seen from both sides; each opening is a rectangle in one wall. The
//! graph is exact, so any loss at run-time is the run-time's own.

mod doors;
mod dwelling;
mod furnished;
mod grid;
mod scale;
mod specials;
mod turned;
mod world;

use std::collections::BTreeMap;

use enfilade_cpg::{PortalKind, World};
use enfilade_geom::{Aabb, DMat3, DVec3};

pub use doors::with_doors;
pub use dwelling::{Dwelling, DwellingParams, dwelling};
use enfilade_demo::Rng;
use grid::{Face, Grid};
pub use scale::scaled_world;
pub use specials::{endless_room, linked_copies, traced_step, with_specials};
use world::{FaceHole, world_of};

/// Parameters of [`room_grid`].
#[derive(Clone, Debug)]
pub struct GridParams {
    /// Squares along x, y (storeys) and z. [Limit: above 0]
    pub size: [usize; 3],
    /// Seed of the random choices.
    pub seed: u64,
    /// Probability of a doorway in a wall between two rooms.
    pub doors: f64,
    /// Probability of a window in a wall to the outdoors, or between rooms without a doorway.
    pub windows: f64,
    /// Probability of a hole in a floor between two rooms.
    pub holes: f64,
    /// Probability that a square joins its neighbor's room, which makes concave cells.
    pub merges: f64,
    /// True to add the outdoors.
    pub outdoors: bool,
    /// Number of boxes in each square.
    pub furniture: usize,
    /// Rotation about a slanted axis. [Units: rad]
    pub turn: f64,
}

impl GridParams {
    /// Two rooms in a row along x with a doorway between them; no windows, no furniture, no outdoors.
    #[must_use]
    pub fn two_rooms() -> Self {
        Self {
            size: [2, 1, 1],
            doors: 1.0,
            windows: 0.0,
            furniture: 0,
            outdoors: false,
            ..Self::offices(2, 1)
        }
    }

    /// About `rooms` office-like rooms on storeys of at most 100, not rotated.
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
/// Returns a room with a window in each wall, 3 to 6 m, times `size`.
#[must_use]
pub fn cabin(seed: u64, size: f32, furniture: usize) -> World {
    let world = room_grid(&GridParams {
        size: [1, 1, 1],
        windows: 1.0,
        furniture,
        ..GridParams::offices(1, seed)
    });
    scaled_world(world, size)
}

/// Rooms on a grid, with random doorways, windows, holes in floors, concave rooms and furniture.
///
/// # Panics
///
/// If a side of the grid has no squares.
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
    // A square joins the room of a neighbor on a lower side; consecutive numbers at the end.
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
    let mut hole = |face: &Face| -> Option<FaceHole> {
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

/// A courtyard with `per_side` windows on each of its four sides; behind each a room of its own, with
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

/// A tower of `storeys` with `per_side` windows on each side of each: rooms around a core as high as the
/// tower, with doorways to it except where two facades meet, or `one_room` all around.
///
/// Cell 0 is the core, the last one the outdoors. Both have a portal for most rooms.
///
/// # Panics
///
/// If `per_side` is below 3 or there are no storeys.
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

/// The middle of a wall across an axis, in fractions of the wall: a window above the sill, or an open doorway.
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
    use enfilade_cpg::{CellId, Portal};

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
        // Twelve rooms per storey; those where two facades meet have two windows and no doorway.
        assert_eq!(world.graph.cells.len(), 1 + 4 * 12 + 1);
        assert_eq!(world.graph.cells[0].portals.len(), 4 * 8);
        let ring = window_tower(4, 4, true);
        assert_eq!(ring.validate(), Ok(()));
        assert_eq!((ring.graph.cells.len(), ring.graph.portals.len()), (3, 96));
    }
}
