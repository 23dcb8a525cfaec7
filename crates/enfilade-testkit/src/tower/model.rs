//! The tower under construction: its dimensions, and the walls of all its parts.

use enfilade_geom::{Aabb, DVec3};

use super::params::TowerParams;
use enfilade_demo::Rng;
use enfilade_demo::Site;
use enfilade_demo::furniture::{Furniture, Palette, glaze, hang_door};
use enfilade_demo::solid::{MeshBuilder, snapped};
use enfilade_demo::{OpeningKind, Side};

/// Height from floor to floor. [Units: wu]
pub(super) const STOREY: f64 = 3.2;
pub(super) const SLAB: f64 = 0.25;
pub(super) const FACADE: f64 = 0.3;
pub(super) const CORRIDOR_WALL: f64 = 0.15;
pub(super) const PARTITION: f64 = 0.12;
/// A double wall: its two leaves and the cavity between them. [Units: wu]
pub(super) const LEAF: f64 = 0.08;
pub(super) const CAVITY: f64 = 0.06;
pub(super) const CORRIDOR: f64 = 2.0;
/// Clear depth of the rows of rooms on the two sides of a corridor. [Units: wu]
pub(super) const ROWS: [f64; 2] = [6.2, 4.9];
pub(super) const STAIRWELL: f64 = 2.8;
/// Mean clear width of an office, with its share of partition. [Units: wu]
pub(super) const BAY: f64 = 3.7;
/// Maximum number of rooms along one corridor.
pub(super) const WING: usize = 40;

/// A wall across `axis`: the box it fills, holes through it, and the probability of cracks.
pub(super) struct Wall {
    pub(super) axis: usize,
    pub(super) body: Aabb,
    pub(super) holes: Vec<(OpeningKind, Aabb, [Side; 2])>,
    pub(super) double: bool,
}

/// Position of a wing to be built.
pub(super) struct Wing {
    pub(super) s: usize,
    pub(super) storey: usize,
    pub(super) w: usize,
    pub(super) up: [f64; 2],
    /// The cross corridor.
    pub(super) cross: Option<Side>,
    /// The box of its flight of stairs, and the volume of it that the flight fills.
    pub(super) flight: Option<(Aabb, f64)>,
}

/// Data of a wing for the walls around it.
pub(super) struct BuiltWing {
    pub(super) corridor: Side,
    pub(super) corridor_z: [f64; 2],
    pub(super) rows: [Vec<([f64; 2], Side)>; 2],
    pub(super) rows_z: [[f64; 2]; 2],
    pub(super) stairwell: Option<Side>,
}

pub(super) struct Tower<'a> {
    pub(super) params: &'a TowerParams,
    pub(super) site: Site,
    pub(super) palette: Palette,
    pub(super) furniture: Furniture,
    pub(super) rng: Rng,
    /// Walls of the storey under construction.
    pub(super) walls: MeshBuilder,
    /// Length of the rows, between the cross corridor and the east facade. [Units: wu]
    pub(super) row_length: f64,
    /// West end of the rows. [Units: wu]
    pub(super) row_start: f64,
    /// Offices in each row of each wing.
    pub(super) rows: Vec<[usize; 2]>,
    pub(super) has_stairs: bool,
    pub(super) concrete: u32,
}

/// Depth of a wing between its facades or the walls to other wings. [Units: wu]
const WING_DEPTH: f64 = ROWS[0] + ROWS[1] + CORRIDOR + 2.0 * CORRIDOR_WALL;

impl Tower<'_> {
    /// Returns the rows' ends along x. [Units: wu]
    pub(super) fn rows_x(&self) -> [f64; 2] {
        [self.row_start, snapped(self.row_start + self.row_length)]
    }

    /// Returns the start of a wing along z. [Units: wu]
    pub(super) fn wing_start(w: usize) -> f64 {
        FACADE + w as f64 * (WING_DEPTH + CORRIDOR_WALL)
    }

    /// Returns the depth of all wings together. [Units: wu]
    pub(super) fn inner_depth(&self) -> f64 {
        let n = self.rows.len();
        n as f64 * WING_DEPTH + (n - 1) as f64 * CORRIDOR_WALL
    }

    /// Returns the outer size in plan; y is 0. [Units: wu]
    pub(super) fn size(&self) -> DVec3 {
        DVec3::new(
            self.row_start + self.row_length + FACADE,
            0.0,
            self.inner_depth() + 2.0 * FACADE,
        )
    }

    /// Models a wall, cracked or doubled if requested, and records its openings.
    pub(super) fn add_wall(&mut self, wall: Wall) {
        let Wall {
            axis,
            mut body,
            holes,
            double,
        } = wall;
        if self.params.cracks {
            let along = 2 - axis;
            // Two in three walls are whole.
            match self.rng.below(6) {
                0 => body.max.y -= self.rng.range(0.002, 0.02),
                1 => body.max[along] -= self.rng.range(0.002, 0.02),
                _ => {}
            }
        }
        let voids: Vec<Aabb> = holes.iter().map(|(_, hole, _)| *hole).collect();
        if double {
            let middle = body.center()[axis];
            let leaf = |low: f64| {
                let mut b = body;
                (b.min[axis], b.max[axis]) = (low, low + LEAF);
                b
            };
            for low in [middle - CAVITY * 0.5 - LEAF, middle + CAVITY * 0.5] {
                let leaf = leaf(low);
                let cut: Vec<Aabb> = voids
                    .iter()
                    .map(|v| {
                        let mut v = *v;
                        (v.min[axis], v.max[axis]) = (leaf.min[axis], leaf.max[axis]);
                        v
                    })
                    .collect();
                self.walls.carved(&[leaf], &cut);
            }
        } else {
            self.walls.carved(&[body], &voids);
        }
        for (kind, mut hole, sides) in holes {
            if self.params.leaves {
                match kind {
                    OpeningKind::Window => glaze(&mut self.site, &self.palette, &hole, axis),
                    _ => hang_door(&mut self.site, &self.palette, &hole, axis, 75.0),
                }
            }
            if double {
                let middle = hole.center()[axis];
                let half = CAVITY * 0.5 + LEAF;
                (hole.min[axis], hole.max[axis]) = (middle - half, middle + half);
            }
            self.site.opening(kind, hole, axis, sides);
        }
    }
}
