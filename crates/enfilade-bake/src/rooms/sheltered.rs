//! Spaces of the outdoors that look like rooms: a floor, a ceiling and walls on nearly all sides.
//!
//! Where a model has a hole, the flood takes the room behind it for a part of the outdoors. From inside, such a room is like any other:
//! rays meet something in nearly all directions. Under a porch, eaves or a bridge, they do not.
//!
//! Cost: up to 10 rays from each point of a lattice in the outdoors.

use enfilade_cpg::{Fact, Reason, Why};
use enfilade_geom::{Allowance, Bvh, DVec3, Ray, Sets};
use rayon::prelude::*;

use super::regions::{CloseJoin, Regions};
use crate::budget::WORK_A_LOOK;
use crate::judge::LEAST_SHELTER;
use crate::proposal::FoundPlace;
use crate::structure::OUTDOORS;
use crate::voxel::{Grid, Labels};

/// Distance between the points of the lattice: about half the width of a small room. [Units: wu]
const SPACING: f64 = 0.8;
/// Reach of rays: halls are hardly wider or higher. [Units: wu]
const REACH: f64 = 20.0;
/// Rays in the horizontal.
const ASIDE: usize = 8;

/// Returns a point of each sheltered space of a room's size in the outdoors, in the axes of the grid.
pub(super) fn sheltered(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    surfaces: Surfaces<'_>,
    allowance: &Allowance,
) -> Vec<FoundPlace> {
    let step = ((SPACING / grid.voxel).round() as usize).max(1);
    let dims = grid.dims.map(|n| n / step);
    let [nx, ny, nz] = dims;
    let voxel = |i: usize| [i % nx, i / nx % ny, i / (nx * ny)].map(|k| k * step + step / 2);
    let shelter = |i: usize| {
        let [x, y, z] = voxel(i);
        let is_out = regions.region_of_basin[labels.at([x, y, z]) as usize] == OUTDOORS;
        let p = grid.center(x, y, z);
        let is_around =
            is_out && surfaces.bvh.bounds().contains(p) && allowance.spend(2 * WORK_A_LOOK);
        (is_around && surfaces.cover(p)).then(|| surfaces.share_around(p))
    };
    let found: Vec<Option<f64>> = (0..nx * ny * nz).into_par_iter().map(shelter).collect();
    let is_in = |i: usize| found[i].is_some_and(|share| share >= LEAST_SHELTER);
    let mut sets = Sets::new(found.len());
    for i in (0..found.len()).filter(|&i| is_in(i)) {
        let [x, y, z] = [i % nx, i / nx % ny, i / (nx * ny)];
        for (at, n, far) in [(x, nx, 1), (y, ny, nx), (z, nz, nx * ny)] {
            if at + 1 < n && is_in(i + far) {
                sets.join(i as u32, (i + far) as u32);
            }
        }
    }
    let set_of = sets.into_least();
    let mut size = vec![0_usize; found.len()];
    (0..found.len())
        .filter(|&i| is_in(i))
        .for_each(|i| size[set_of[i] as usize] += 1);
    let cell = (step as f64 * grid.voxel).powi(3);
    let spaces = (0..found.len()).filter(|&i| size[i] as f64 * cell >= CloseJoin::LEAST_VOLUME);
    let place = |i: usize| {
        let [x, y, z] = voxel(i);
        let facts = [
            (Fact::Shelter, found[i].unwrap_or(0.0)),
            (Fact::Volume, size[i] as f64 * cell),
        ];
        FoundPlace {
            at: grid.center(x, y, z),
            why: Why::compared(Reason::Sheltered, LEAST_SHELTER, &facts),
        }
    };
    spaces.map(place).collect()
}

/// The surfaces of the structure.
#[derive(Clone, Copy)]
pub(super) struct Surfaces<'a> {
    pub(super) bvh: &'a Bvh,
    /// They face the air, so that what shows its back bounds matter.
    pub(super) face_air: bool,
}

impl Surfaces<'_> {
    /// Returns `true` if something is above and below.
    fn cover(self, p: DVec3) -> bool {
        // Slightly off, so that rays do not run along edges.
        let up = DVec3::new(0.013, 1.0, 0.007);
        self.bound(p, up) && self.bound(p, -up)
    }

    /// Returns the share of the rays in the horizontal that meet something.
    fn share_around(self, p: DVec3) -> f64 {
        let direction = |k: usize| {
            let (sin, cos) = (0.1 + k as f64 * std::f64::consts::TAU / ASIDE as f64).sin_cos();
            DVec3::new(cos, 0.01, sin)
        };
        let n = (0..ASIDE).filter(|&k| self.bound(p, direction(k))).count();
        n as f64 / ASIDE as f64
    }

    /// Returns `true` if the ray from a point meets a surface that faces it, or may.
    fn bound(self, origin: DVec3, direction: DVec3) -> bool {
        let ray = Ray {
            origin,
            direction,
            t_max: REACH,
        };
        let hit = self.bvh.closest_hit(&ray, |_| false);
        hit.is_some_and(|h| h.front || !self.face_air)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::Aabb;

    #[test]
    fn the_inside_of_a_piece_of_wall_is_no_shelter_where_surfaces_face_the_air() {
        let wall = Aabb::new(DVec3::ZERO, DVec3::new(4.0, 3.0, 0.5));
        let bvh = Bvh::build(&wall.triangles());
        for (face_air, share) in [(true, 0.0), (false, 1.0)] {
            let surfaces = Surfaces {
                bvh: &bvh,
                face_air,
            };
            assert_eq!(surfaces.cover(wall.center()), !face_air);
            assert_eq!(surfaces.share_around(wall.center()), share);
        }
    }
}
