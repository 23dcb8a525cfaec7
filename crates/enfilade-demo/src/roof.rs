//! A pitched roof over gable walls, and the attic below it.

use enfilade_geom::{Aabb, DVec3};

use crate::site::Site;
use crate::solid::{MeshBuilder, aabb};
use crate::truth::Convex;

/// Dimensions of a roof whose ridge runs along x, over a house with its minimum x and z at the origin.
#[derive(Clone, Copy, Debug)]
pub struct GableRoof {
    /// Outer size along x. [Units: wu]
    pub length: f64,
    /// Outer size along z. [Units: wu]
    pub depth: f64,
    /// Thickness of the walls. [Units: wu]
    pub wall: f64,
    /// Floor of the attic. [Units: wu]
    pub floor: f64,
    /// Underside of the roof at the inner face of the eaves walls. [Units: wu]
    pub eaves: f64,
    /// Rise per run.
    pub slope: f64,
    /// Sill and head of a window of 1 m in either gable. [Units: wu]
    pub window: Option<[f64; 2]>,
}

/// Vertical thickness of the roof, and its overhang. [Units: wu]
const THICKNESS: f64 = 0.3;
const OVERHANG: f64 = 0.5;

/// Overlap of walls with the roof, so that no gap is left where they meet. [Units: wu]
const BURIED: f64 = 0.02;

impl GableRoof {
    /// Returns the height of the underside at `z`. [Units: wu]
    fn underside(&self, z: f64) -> f64 {
        let middle = self.depth * 0.5;
        self.eaves + self.slope * (middle - self.wall - (z - middle).abs())
    }

    /// Returns the air below the roof.
    pub fn loft(&self) -> Convex {
        let (low, high) = (self.wall, self.depth - self.wall);
        let section = [
            [self.floor, low],
            [self.floor, high],
            [self.eaves, high],
            [self.underside(self.depth * 0.5), self.depth * 0.5],
            [self.eaves, low],
        ];
        let section = section.map(|[y, z]| DVec3::new(self.wall, y, z));
        Convex::prism(&section, DVec3::X * (self.length - 2.0 * self.wall))
    }

    /// Returns the holes of the windows in the west and the east gable; flat if there are none.
    pub fn gable_windows(&self) -> [Aabb; 2] {
        let middle = self.depth * 0.5;
        let [low, high] = self.window.unwrap_or([self.eaves; 2]);
        [0.0, self.length - self.wall]
            .map(|x| aabb([x, low, middle - 0.5], [x + self.wall, high, middle + 0.5]))
    }

    /// Adds the roof and the walls below it, from the attic floor up.
    pub fn add_to(&self, site: &mut Site, tiles: u32, plaster: u32) {
        let middle = self.depth * 0.5;
        let at = |lift: f64| move |z: f64| DVec3::new(-0.4, self.underside(z) + lift, z);
        let below = [-OVERHANG, middle, self.depth + OVERHANG].map(at(0.0));
        let above = [self.depth + OVERHANG, middle, -OVERHANG].map(at(THICKNESS));
        let mut roof = MeshBuilder::new(tiles);
        roof.prism(&[below, above].concat(), DVec3::X * (self.length + 0.8));
        site.structure("roof", roof);

        for z in [[0.0, self.wall], [self.depth - self.wall, self.depth]] {
            let point = |y: f64, z: f64| DVec3::new(self.wall, y, z);
            let profile = [
                point(self.floor, z[0]),
                point(self.floor, z[1]),
                point(self.underside(z[1]) + BURIED, z[1]),
                point(self.underside(z[0]) + BURIED, z[0]),
            ];
            let mut wall = MeshBuilder::new(plaster);
            wall.prism(&profile, DVec3::X * (self.length - 2.0 * self.wall));
            site.structure("wall", wall);
        }
        for hole in self.gable_windows() {
            let x = hole.min.x;
            let (left, right, along) = (hole.min.z, hole.max.z, DVec3::X * self.wall);
            let top = |z: f64| DVec3::new(x, self.underside(z) + BURIED, z);
            let point = |y: f64, z: f64| DVec3::new(x, y, z);
            let floor = self.floor;
            let mut gable = MeshBuilder::new(plaster);
            gable.prism(
                &[point(floor, 0.0), point(floor, left), top(left), top(0.0)],
                along,
            );
            let end = self.depth;
            gable.prism(
                &[point(floor, right), point(floor, end), top(end), top(right)],
                along,
            );
            gable.cuboid(aabb([x, floor, left], [x + self.wall, hole.min.y, right]));
            let head = [point(hole.max.y, left), point(hole.max.y, right)];
            gable.prism(
                &[head.to_vec(), vec![top(right), top(middle), top(left)]].concat(),
                along,
            );
            site.structure("wall", gable);
        }
    }
}
