//! The height map of a scene: for each square of the plan, the highest surface and the lowest.

use enfilade_geom::{Aabb, Allowance, Attitude, Triangle, triangle_area_normal};

/// Least edge of a square: six of them are as wide as a lane. [Units: wu]
const SQUARE: f64 = 0.5;
/// Most squares along one side of the plan.
const MOST_ALONG: f64 = 1024.0;
/// Cost of a square that a triangle touches, in units of [`Allowance`]: so many of them are one.
const SQUARES_A_WORK: u64 = 16;

/// Heights over a plan of squares, `[z][x]`.
pub(super) struct Relief {
    /// Least x and z. [Units: wu]
    pub(super) origin: [f64; 2],
    /// Edge of a square. [Units: wu]
    pub(super) square: f64,
    /// Squares along x and z.
    pub(super) dims: [usize; 2],
    /// Highest surface in each square; [`NOTHING`] where there is none. [Units: wu]
    pub(super) top: Vec<f32>,
    /// Lowest surface in each square. [Units: wu]
    pub(super) ground: Vec<f32>,
}

/// Height of squares without a surface.
pub(super) const NOTHING: f32 = f32::NEG_INFINITY;

impl Relief {
    /// Draws triangles from above. A square has the height of each triangle that touches it, at the square's middle.
    ///
    /// Linear in the squares that triangles touch.
    pub(super) fn of(triangles: &[Triangle], bounds: &Aabb, allowance: &Allowance) -> Self {
        let size = bounds.size();
        let square = SQUARE.max(size.x.max(size.z) / MOST_ALONG);
        let dims = [size.x, size.z].map(|s| (s / square).ceil().max(1.0) as usize);
        let n = dims[0] * dims[1];
        let mut relief = Self {
            origin: [bounds.min.x, bounds.min.z],
            square,
            dims,
            top: vec![NOTHING; n],
            ground: vec![f32::INFINITY; n],
        };
        for triangle in triangles {
            if !relief.draw(triangle, allowance) {
                break;
            }
        }
        relief
    }

    fn draw(&mut self, t: &Triangle, allowance: &Allowance) -> bool {
        let square = self.square;
        let [nx, nz] = self.dims;
        let normal = triangle_area_normal(t);
        let bounds = Aabb::of_points(t);
        let is_steep = Attitude::of(normal) == Attitude::Upright;
        let height = |x: f64, z: f64| {
            let up = (normal.x * (x - t[0].x) + normal.z * (z - t[0].z)) / normal.y;
            (t[0].y - up).clamp(bounds.min.y, bounds.max.y)
        };
        let place = |at: f64, from: f64, n: usize| (((at - from) / square) as usize).min(n - 1);
        let rows =
            place(bounds.min.z, self.origin[1], nz)..=place(bounds.max.z, self.origin[1], nz);
        for z in rows {
            let from = self.origin[1] + z as f64 * square;
            let [low, high] = extent_within(t, [from, from + square]);
            if low > high {
                continue;
            }
            let columns = place(low, self.origin[0], nx)..=place(high, self.origin[0], nx);
            if !allowance.spend(1 + (columns.end() - columns.start()) as u64 / SQUARES_A_WORK) {
                return false;
            }
            for x in columns {
                let i = x + nx * z;
                let [low, high] = if is_steep {
                    [bounds.min.y, bounds.max.y]
                } else {
                    let [x, z] = self.middle([x, z]);
                    [height(x, z); 2]
                };
                self.top[i] = self.top[i].max(high as f32);
                self.ground[i] = self.ground[i].min(low as f32);
            }
        }
        true
    }

    /// Returns the x and z of a square's middle. [Units: wu]
    pub(super) fn middle(&self, at: [usize; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.origin[k] + (at[k] as f64 + 0.5) * self.square)
    }

    /// Returns the square at an x and z, if any. [Units: wu]
    pub(super) fn square_at(&self, [x, z]: [f64; 2]) -> Option<usize> {
        let at = [x - self.origin[0], z - self.origin[1]].map(|d| (d / self.square).floor());
        let is_in = (0..2).all(|k| at[k] >= 0.0 && at[k] < self.dims[k] as f64);
        is_in.then(|| at[0] as usize + self.dims[0] * at[1] as usize)
    }

    /// Returns the coordinates of a square.
    pub(super) fn at(&self, i: usize) -> [usize; 2] {
        [i % self.dims[0], i / self.dims[0]]
    }

    pub(super) fn len(&self) -> usize {
        self.top.len()
    }

    /// Returns the squares that share an edge with a square, those along x first.
    pub(super) fn beside(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let ([x, z], [nx, nz]) = (self.at(i), self.dims);
        let all = [
            (x > 0, i.wrapping_sub(1)),
            (x + 1 < nx, i + 1),
            (z > 0, i.wrapping_sub(nx)),
            (z + 1 < nz, i + nx),
        ];
        all.into_iter().filter(|n| n.0).map(|n| n.1)
    }
}

/// Returns the least and the greatest x of the part of a triangle between two values of z.
fn extent_within(t: &Triangle, [from, to]: [f64; 2]) -> [f64; 2] {
    let mut found = [f64::MAX, f64::MIN];
    let mut add = |x: f64| found = [found[0].min(x), found[1].max(x)];
    for i in 0..3 {
        let (a, b) = (t[i], t[(i + 1) % 3]);
        if (from..=to).contains(&a.z) {
            add(a.x);
        }
        for z in [from, to] {
            if (a.z < z) != (b.z < z) {
                add(a.x + (b.x - a.x) * ((z - a.z) / (b.z - a.z)));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use enfilade_geom::DVec3;

    use super::*;

    #[test]
    fn squares_have_the_height_of_the_highest_surface_that_touches_them() {
        let floor = Aabb::new(DVec3::ZERO, DVec3::new(10.0, 0.0, 10.0));
        let wall = [
            DVec3::new(2.2, 0.0, 1.0),
            DVec3::new(2.2, 3.0, 1.0),
            DVec3::new(2.2, 3.0, 9.0),
        ];
        let mut triangles: Vec<Triangle> = floor.triangles().into_iter().collect();
        triangles.push(wall);
        let bounds = Aabb::of_points(triangles.as_flattened());
        let relief = Relief::of(&triangles, &bounds, &Allowance::default());
        assert_eq!(relief.dims, [20, 20]);
        let at = |x: f64, z: f64| relief.top[relief.square_at([x, z]).unwrap()];
        assert_eq!([at(1.0, 5.0), at(2.2, 5.0), at(2.7, 5.0)], [0.0, 3.0, 0.0]);
        assert_eq!(at(2.2, 0.7), 0.0);
        assert_eq!(relief.ground[relief.square_at([2.2, 5.0]).unwrap()], 0.0);
        assert_eq!(relief.square_at([-0.1, 5.0]), None);
    }
}
