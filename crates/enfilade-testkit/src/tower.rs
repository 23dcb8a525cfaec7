//! A parametric office tower, from a handful of rooms to thousands.

mod facade;
mod model;
mod params;
mod wing;

use enfilade_geom::{Aabb, DVec3};

use enfilade_demo::Rng;
use enfilade_demo::furniture::{Furniture, Palette};
use enfilade_demo::solid::{MeshBuilder, Steps, aabb, snapped};
use enfilade_demo::{Generated, Site};
use enfilade_demo::{OpeningKind, Side};
use model::{BAY, CORRIDOR, CORRIDOR_WALL, FACADE, PARTITION, SLAB, STAIRWELL, STOREY, Tower};
use model::{WING, Wing};

pub use params::TowerParams;

/// An office tower that stands in the open.
///
/// Storeys of one or more wings: a corridor of 2 m with rooms of varied width on both sides, joined by a
/// cross corridor if there are several wings. Walls are closed solids (facade 30 cm, corridors 15 cm,
/// partitions 12 cm), floors are slabs of 25 cm with holes for the flights of the stairwells. The first room
/// of each wing's north row is its stairwell. 85 to 150 structural triangles per room, the fewer the more
/// rooms lie inside. O(rooms) time and memory.
#[must_use]
pub fn office_tower(params: &TowerParams) -> Generated {
    let mut site = Site::new("office-tower");
    let palette = Palette::new(&mut site);
    let furniture = Furniture::new(&mut site, &palette);
    let concrete = site.material("concrete", [0.55, 0.55, 0.53]);
    let storeys = params.storeys.max(1);
    let per_storey = params.rooms_per_storey.max(4);
    let has_stairs = params.stairwell && storeys > 1;

    let n_wings = per_storey.div_ceil(WING);
    let common = if n_wings > 1 { n_wings + 1 } else { 1 };
    let stairs = if has_stairs { n_wings } else { 0 };
    let offices = per_storey - (common + stairs).min(per_storey - 1);
    // Dealt out one by one, so that no row is longer than another by more than one office.
    let mut rows = vec![[0, 0]; n_wings];
    for i in 0..offices {
        // Rows with a stairwell fill up last.
        rows[i / 2 % n_wings][(i + 1) % 2] += 1;
    }
    let longest = rows.iter().flatten().copied().max().unwrap_or(1).max(1);
    let stair_length = if has_stairs {
        STAIRWELL + PARTITION
    } else {
        0.0
    };
    let cross = if n_wings > 1 {
        CORRIDOR + CORRIDOR_WALL
    } else {
        0.0
    };
    let mut tower = Tower {
        params,
        site,
        palette,
        furniture,
        rng: Rng::new(params.seed),
        walls: MeshBuilder::new(concrete),
        row_length: snapped(longest as f64 * BAY + stair_length),
        row_start: FACADE + cross,
        rows,
        has_stairs,
        concrete,
    };
    tower.build(storeys);
    tower.site.finish()
}

/// Steps from storey to storey.
const STEPS: Steps = Steps {
    n: 18,
    riser: STOREY / 18.0,
    going: 0.27,
    waist: 0.16,
};
/// Start of the flight within the stairwell; there is a landing at both ends. [Units: wu]
const LANDING: f64 = 0.8;

impl Tower<'_> {
    fn build(&mut self, storeys: usize) {
        let mut stairwells = Vec::new();
        for s in 0..storeys {
            let has_flight = self.has_stairs && s + 1 < storeys;
            stairwells = self.add_storey(s, has_flight, &stairwells);
        }
        let size = self.size();
        let top = storeys as f64 * STOREY;
        let mut roof = MeshBuilder::new(self.concrete);
        roof.cuboid(aabb([0.0, top - SLAB, 0.0], [size.x, top, size.z]));
        self.site.structure("roof", roof);
        if self.params.ground {
            let turf = self.site.material("turf", [0.2, 0.35, 0.15]);
            let mut ground = MeshBuilder::new(turf);
            ground.cuboid(aabb(
                [-10.0, -0.6, -10.0],
                [size.x + 10.0, -0.15, size.z + 10.0],
            ));
            self.site.structure("ground", ground);
        }
    }

    /// Adds a storey above one with the stairwells `below`; returns its own stairwells.
    fn add_storey(&mut self, s: usize, has_flight: bool, below: &[Side]) -> Vec<Side> {
        let floor = s as f64 * STOREY;
        let storey = self.site.storey(&format!("storey {s}"), floor);
        let up = [floor, snapped(floor + STOREY - SLAB)];
        self.add_slab(s, floor);
        let cross = (self.rows.len() > 1).then(|| {
            let air = aabb(
                [FACADE, up[0], FACADE],
                [FACADE + CORRIDOR, up[1], FACADE + self.inner_depth()],
            );
            let name = format!("storey {s}/cross corridor");
            self.site.room(&name, storey, air)
        });
        let mut wings = Vec::new();
        for w in 0..self.rows.len() {
            let flight = has_flight.then(|| self.add_flight(s, w));
            wings.push(self.wing(&Wing {
                s,
                storey,
                w,
                up,
                cross,
                flight,
            }));
        }
        self.back_walls(&wings, up);
        self.end_walls(&wings, up, cross);
        let stairwells: Vec<Side> = wings.iter().filter_map(|w| w.stairwell).collect();
        for (w, (&low, &high)) in below.iter().zip(&stairwells).enumerate() {
            let hole = self.stair_hole(w, floor);
            self.site
                .opening(OpeningKind::Opening, hole, 1, [low, high]);
        }
        let walls = std::mem::replace(&mut self.walls, MeshBuilder::new(self.concrete));
        self.site.structure(&format!("walls {s}"), walls);
        stairwells
    }

    fn add_slab(&mut self, s: usize, floor: f64) {
        let size = self.size();
        let holes: Vec<Aabb> = if self.has_stairs && s > 0 {
            let wings = 0..self.rows.len();
            wings.map(|w| self.stair_hole(w, floor)).collect()
        } else {
            Vec::new()
        };
        let mut slab = MeshBuilder::new(self.concrete);
        slab.carved(
            &[aabb([0.0, floor - SLAB, 0.0], [size.x, floor, size.z])],
            &holes,
        );
        self.site.structure(&format!("slab {s}"), slab);
    }

    /// Returns the extent of a flight along x, at the stairwell's west wall. [Units: wu]
    fn flight_x(&self) -> [f64; 2] {
        [self.row_start, self.row_start + 1.3]
    }

    /// Returns the hole for a flight in the slab below `floor`.
    fn stair_hole(&self, w: usize, floor: f64) -> Aabb {
        let (x, z) = (self.flight_x(), Self::wing_start(w) + LANDING);
        aabb([x[0], floor - SLAB, z], [x[1], floor, z + 3.6])
    }

    /// Adds a flight up from a storey; returns its bounding box, and the volume of it that the flight fills.
    fn add_flight(&mut self, s: usize, w: usize) -> (Aabb, f64) {
        let (x, floor) = (self.flight_x(), s as f64 * STOREY);
        let (width, start) = (x[1] - x[0], Self::wing_start(w) + LANDING);
        let foot = DVec3::new(f64::midpoint(x[0], x[1]), floor, start + STEPS.run());
        let mut mesh = MeshBuilder::new(self.concrete);
        mesh.flight(foot, -DVec3::Z, width, &STEPS);
        self.site.structure(&format!("stairs {s}"), mesh);
        let air = aabb(
            [x[0], floor, start],
            [x[1], floor + STOREY - SLAB, start + STEPS.run()],
        );
        (air, STEPS.volume_below(width, STOREY - SLAB))
    }
}
