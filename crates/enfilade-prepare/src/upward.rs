//! The axis that points up, upward by where the surface is level.
//!
//! Floors and ceilings lie in few planes, and each reaches through a storey; walls lie in many, and each ends at a room
//! or at a front. So an axis is measured by the planes across it: each plane counts as the square of its share of the
//! whole surface. In buildings, levels and generated scenes, the measure of the true axis is at least 1.65 times that
//! of any other; treads and furniture change it little, and turned walls only add to it. Ground without planes is
//! open above instead, so that its front faces look up.

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Aabb, DMat3, DVec3, Triangle, triangle_area_normal};

/// Least ratio of the largest measure to the next. Below 1.65, the least in any known building, and above the 1.4 of
/// a fortress as high as wide.
const CLEAR: f64 = 1.5;
/// Least part of a unit normal along an axis if the surface is across it: at most 2.6 degrees off.
const LEVEL: f64 = 0.999;
/// Least share of the surface that must be across an axis; caves and vessels have almost none.
const LEAST_LEVEL: f64 = 0.05;
/// Least share of the surface that must be upright and face each of two directions: a plate alone may be a floor or a
/// wall.
const LEAST_WALL: f64 = 0.02;
/// Least share of the surface by which the front faces must look one way, if nothing is level.
const LEAST_OPEN: f64 = 0.3;
/// Slices of the scene's diagonal; surface in one slice, or two neighbors, is one plane.
const SLICES: usize = 1000;

/// Result of [`find_up`]. Axes are numbered from 0, as coordinates are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Upward {
    /// Floors lie across this axis.
    Clear(usize),
    /// More surface is level across this axis than across any other, but not much more.
    Likely(usize),
    /// Nothing shows it: a cave, a vessel, a single plate.
    Unknown,
}

/// Judges which axis points up, by the structural objects; by all if there are none.
///
/// Neither the unit nor the place of the scene matters, nor the order of its objects. Linear time, constant memory.
#[must_use]
pub fn find_up(scene: &Scene) -> Upward {
    let has_structure = scene.objects.iter().any(|o| o.role == Role::Structural);
    let role = if has_structure {
        Role::Structural
    } else {
        Role::Detail
    };
    let triangles = || {
        scene
            .triangle_sources(role)
            .map(|s| scene.world_triangle(s))
    };
    let bounds = triangles().fold(Aabb::EMPTY, |b, t| b.union(Aabb::of_points(&t)));
    let step = bounds.size().length() / SLICES as f64;
    if !(step.is_finite() && step > 0.0) {
        return Upward::Unknown;
    }
    let mut surface = LevelSurface::new(bounds.min, step);
    for t in triangles() {
        surface.add(&t);
    }
    surface.upward()
}

/// Areas of the surface by direction and place.
struct LevelSurface {
    from: DVec3,
    step: f64,
    area: f64,
    /// Sum of the areas, each along its normal.
    open: DVec3,
    /// Sum of the areas, each times the products of its normal's coordinates.
    spread: DMat3,
    /// Area across each axis, slice by slice, with an empty slice at each end.
    slices: [Vec<f64>; 3],
}

impl LevelSurface {
    fn new(from: DVec3, step: f64) -> Self {
        let empty = || vec![0.0; SLICES + 4];
        Self {
            from,
            step,
            area: 0.0,
            open: DVec3::ZERO,
            spread: DMat3::ZERO,
            slices: [empty(), empty(), empty()],
        }
    }

    fn add(&mut self, t: &Triangle) {
        let normal = 0.5 * triangle_area_normal(t);
        let area = normal.length();
        if !(area.is_finite() && area > 0.0) {
            return;
        }
        self.area += area;
        self.open += normal;
        let unit = normal / area;
        self.spread += DMat3::from_cols(normal * unit.x, normal * unit.y, normal * unit.z);
        for axis in 0..3 {
            if unit[axis].abs() >= LEVEL {
                let at = ((t[0][axis] - self.from[axis]) / self.step).max(0.0) as usize;
                self.slices[axis][at.min(SLICES + 1) + 1] += area;
            }
        }
    }

    fn upward(&self) -> Upward {
        if self.area <= 0.0 {
            return Upward::Unknown;
        }
        let shares = [0, 1, 2].map(|k| self.slices[k].iter().sum::<f64>() / self.area);
        if shares.iter().all(|&s| s < LEAST_LEVEL) {
            let open = self.open.abs() / self.area;
            return match ranked(open.to_array()) {
                (axis, true) if open[axis] >= LEAST_OPEN => Upward::Clear(axis),
                _ => Upward::Unknown,
            };
        }
        let measures = [0, 1, 2].map(|k| measure(&self.slices[k]));
        let (axis, is_clear) = ranked(measures);
        if self.least_wall(axis) < LEAST_WALL {
            Upward::Unknown
        } else if is_clear {
            Upward::Clear(axis)
        } else {
            Upward::Likely(axis)
        }
    }

    /// Returns the share of the surface that faces the direction across `axis` which least of it faces.
    fn least_wall(&self, axis: usize) -> f64 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let m = self.spread.to_cols_array_2d();
        let (half, product) = (0.5 * (m[u][u] + m[v][v]), m[u][v]);
        let apart = (0.25 * (m[u][u] - m[v][v]).powi(2) + product * product).sqrt();
        (half - apart) / self.area
    }
}

/// Returns the sum of the squared areas of the planes. A plane on the limit of two slices counts as if in one.
fn measure(slices: &[f64]) -> f64 {
    let around = slices.windows(3).map(|w| w[1] * (w[0] + w[1] + w[2]));
    around.sum()
}

/// Returns the axis of the largest value, and whether it is clear of the others.
fn ranked(values: [f64; 3]) -> (usize, bool) {
    let mut axes = [1, 2, 0];
    axes.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    (axes[0], values[axes[0]] >= CLEAR * values[axes[1]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::DMat4;
    use enfilade_testkit::{
        Generated, TowerParams, cave, dirkse_maze, furnished_house, mixed, office_tower, rotated,
        transformed,
    };

    /// A building as a program writes it whose z axis points up.
    fn z_up(generated: Generated) -> Generated {
        let turn = DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
        transformed(generated, &turn)
    }

    fn upward(generated: &Generated) -> Upward {
        find_up(&generated.scene)
    }

    #[test]
    fn floors_show_which_axis_points_up() {
        let buildings = || {
            let towers = [4, 64].map(|n| office_tower(&TowerParams::with_rooms(n, 1)));
            let others = [furnished_house(), dirkse_maze(1)];
            mixed::all().into_iter().chain(towers).chain(others)
        };
        for (i, building) in buildings().enumerate() {
            assert_eq!(upward(&building), Upward::Clear(1), "{i}");
            // Walls along no axis.
            let turned = rotated(building, 20.0);
            assert_eq!(upward(&turned), Upward::Clear(1), "{i}");
        }
        for (i, building) in buildings().enumerate() {
            // Millimeters, ten kilometers away.
            let far = DMat4::from_translation(DVec3::splat(1e7))
                * DMat4::from_scale(DVec3::splat(1000.0));
            let standing = transformed(z_up(building), &far);
            assert_eq!(upward(&standing), Upward::Clear(2), "{i}");
        }
    }

    #[test]
    fn a_cave_or_a_plate_does_not_show_which_axis_points_up() {
        assert_eq!(upward(&cave(1)), Upward::Unknown);
        let mut surface = LevelSurface::new(DVec3::ZERO, 0.01);
        surface.add(&[DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Z]);
        assert_eq!(surface.upward(), Upward::Unknown);
    }

    #[test]
    fn open_ground_looks_up() {
        let at = |x: i32, y: i32| {
            let height = (f64::from(x) * 0.7).sin() + (f64::from(y) * 0.9).cos();
            DVec3::new(x.into(), y.into(), height)
        };
        let mut surface = LevelSurface::new(DVec3::ZERO, 0.05);
        for (x, y) in (0..20).flat_map(|x| (0..20).map(move |y| (x, y))) {
            surface.add(&[at(x, y), at(x + 1, y), at(x + 1, y + 1)]);
            surface.add(&[at(x, y), at(x + 1, y + 1), at(x, y + 1)]);
        }
        assert_eq!(surface.upward(), Upward::Clear(2));
    }

    #[test]
    fn a_plane_between_two_slices_counts_once() {
        let whole = measure(&[0.0, 0.0, 2.0, 0.0, 0.0]);
        assert_eq!(measure(&[0.0, 1.0, 1.0, 0.0, 0.0]), whole);
    }

    #[test]
    fn a_room_as_high_as_wide_is_in_doubt() {
        let mut surface = LevelSurface::new(DVec3::ZERO, 0.005);
        let quad = |surface: &mut LevelSurface, a: DVec3, u: DVec3, v: DVec3| {
            surface.add(&[a, a + u, a + u + v]);
            surface.add(&[a, a + u + v, a + v]);
        };
        let [x, y, z] = [DVec3::X * 3.0, DVec3::Y * 2.9, DVec3::Z * 3.0];
        for (u, v, w) in [(x, y, z), (y, z, x), (z, x, y)] {
            quad(&mut surface, DVec3::ZERO, u, v);
            quad(&mut surface, w, u, v);
        }
        assert_eq!(surface.upward(), Upward::Likely(1));
    }
}
