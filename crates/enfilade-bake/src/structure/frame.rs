//! The direction of a building's walls, along which the voxel grid is laid.
//!
//! In a grid askew to the walls, each wall is a staircase, and the flat front between two rooms
//! becomes a sloping one, whose leftovers become portals of their own. So the grid follows the direction
//! of most walls. Only the voxel grid turns: all results are turned back, and the cell complex cuts the scene
//! as it stands.

use std::borrow::Cow;

use enfilade_geom::{Aabb, Attitude, DVec3, Triangle, Winding, portable, triangle_area_normal};

/// Walls within this angle of a direction count for it. [Units: degrees]
const SPREAD: usize = 1;
/// Least share of all walls that a direction needs.
const MIN_SHARE: f64 = 0.2;
/// … and least ratio of its walls to those along the axes.
const MIN_GAIN: f64 = 1.25;

/// A rotation about the vertical axis, from the scene to the grid and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    cos: f64,
    sin: f64,
}

impl Frame {
    /// The frame of the scene itself.
    pub(crate) const SCENE: Self = Self { cos: 1.0, sin: 0.0 };

    /// Returns the frame along most of the walls; the scene's own unless another is clearly better.
    ///
    /// Independent of the order of the triangles. Linear in them.
    #[must_use]
    pub(crate) fn of(triangles: &[Triangle]) -> Self {
        // The sum of normals for each degree of the quarter circle, in integers: such sums do not
        // depend on the order.
        let mut sums = [[0_i128; 3]; 90];
        for t in triangles {
            let n = triangle_area_normal(t);
            let area = n.length();
            if Attitude::of(n) != Attitude::Upright {
                continue;
            }
            let [x, z] = folded(n.x, n.z);
            let degree = (z.atan2(x).to_degrees() as usize).min(89);
            for (sum, value) in sums[degree].iter_mut().zip([area, x, z]) {
                *sum += (value * f64::from(1 << 20)) as i128;
            }
        }
        let around = |degree: usize| -> [f64; 3] {
            [0, 1, 2].map(|k| {
                (90 + degree - SPREAD..=90 + degree + SPREAD)
                    .map(|d| sums[d % 90][k])
                    .sum::<i128>() as f64
            })
        };
        let total: f64 = sums.iter().map(|s| s[0]).sum::<i128>() as f64;
        // Half open at 90 degrees: walls along the axes are in the first and the last degree.
        let along_axes = (sums[0][0] + sums[89][0]) as f64;
        let inner = SPREAD..90 - SPREAD;
        let best = inner
            .map(around)
            .reduce(|best, next| if next[0] > best[0] { next } else { best });
        match best {
            Some([area, x, z])
                if area >= MIN_SHARE * total && area > MIN_GAIN * along_axes && area > 0.0 =>
            {
                let length = portable::hypot(x, z);
                Self {
                    cos: x / length,
                    sin: z / length,
                }
            }
            _ => Self::SCENE,
        }
    }

    /// Returns `true` for the scene's own frame.
    #[must_use]
    pub(crate) fn is_scene(self) -> bool {
        self == Self::SCENE
    }

    /// Returns `true` if both turn by the same angle up to `by`, and both or neither turn at all. [Units: rad]
    #[must_use]
    pub(crate) fn is_near(self, other: Self, by: f64) -> bool {
        let off = (self.cos - other.cos).hypot(self.sin - other.sin);
        self.is_scene() == other.is_scene() && off <= by
    }

    /// Returns the turn of the grid, from x toward z. [Units: degrees]
    #[must_use]
    pub(crate) fn degrees(self) -> f64 {
        portable::angle(self.sin, self.cos).to_degrees()
    }

    /// Converts a point or direction from the scene to the grid.
    #[must_use]
    pub(crate) fn to_grid(self, p: DVec3) -> DVec3 {
        DVec3::new(
            self.cos * p.x + self.sin * p.z,
            p.y,
            self.cos * p.z - self.sin * p.x,
        )
    }

    /// Converts a point or direction from the grid to the scene.
    #[must_use]
    pub(crate) fn to_scene(self, p: DVec3) -> DVec3 {
        DVec3::new(
            self.cos * p.x - self.sin * p.z,
            p.y,
            self.cos * p.z + self.sin * p.x,
        )
    }

    /// Converts triangles from the scene to the grid.
    #[must_use]
    pub(crate) fn triangles_to_grid<'a>(self, triangles: &'a [Triangle]) -> Cow<'a, [Triangle]> {
        if self.is_scene() {
            return Cow::Borrowed(triangles);
        }
        let turned = triangles.iter().map(|t| t.map(|p| self.to_grid(p)));
        Cow::Owned(turned.collect())
    }

    /// Converts a polygon from the grid to the scene.
    #[must_use]
    pub(crate) fn winding_to_scene(self, winding: &Winding) -> Winding {
        let mut out = winding.clone();
        if !self.is_scene() {
            out.points.iter_mut().for_each(|p| *p = self.to_scene(*p));
        }
        out
    }

    /// Returns the axis-aligned box in the scene around a box of the grid.
    #[must_use]
    pub(crate) fn aabb_to_scene(self, bounds: &Aabb) -> Aabb {
        if self.is_scene() {
            return *bounds;
        }
        let pick = |bit: usize, k: usize| {
            if bit >> k & 1 == 0 {
                bounds.min[k]
            } else {
                bounds.max[k]
            }
        };
        (0..8).fold(Aabb::EMPTY, |out, bit| {
            out.including(self.to_scene(DVec3::new(pick(bit, 0), pick(bit, 1), pick(bit, 2))))
        })
    }
}

/// Turns a direction by quarters into the first quadrant: x above 0, y not below.
fn folded(mut x: f64, mut y: f64) -> [f64; 2] {
    while x <= 0.0 || y < 0.0 {
        (x, y) = (y, -x);
    }
    [x, y]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Walls of a box of 8 × 5 × 3, turned by `degrees`, with a floor that must not matter.
    fn walls(degrees: f64) -> Vec<Triangle> {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let turn = |x: f64, y: f64, z: f64| DVec3::new(cos * x - sin * z, y, cos * z + sin * x);
        let corners = [[0.0, 0.0], [8.0, 0.0], [8.0, 5.0], [0.0, 5.0]];
        let mut out = vec![[
            turn(0.0, 0.0, 0.0),
            turn(8.0, 0.0, 0.0),
            turn(8.0, 0.0, 5.0),
        ]];
        for k in 0..4 {
            let ([ax, az], [bx, bz]) = (corners[k], corners[(k + 1) % 4]);
            let (a, b) = (turn(ax, 0.0, az), turn(bx, 0.0, bz));
            let (c, d) = (turn(bx, 3.0, bz), turn(ax, 3.0, az));
            out.extend([[a, b, c], [a, c, d]]);
        }
        out
    }

    #[test]
    fn walls_lie_along_the_axes_of_their_frame_whatever_their_turn() {
        for degrees in [3.0, 23.0, 45.0, 45.5, 60.0, 88.0, 135.0, 200.0, -30.0] {
            let triangles = walls(degrees);
            let frame = Frame::of(&triangles);
            assert!(!frame.is_scene(), "{degrees}");
            for t in frame.triangles_to_grid(&triangles).iter().skip(1) {
                let n = triangle_area_normal(t).normalize();
                assert!(n.abs().max_element() > 1.0 - 1e-9, "{degrees}: {n}");
            }
        }
    }

    #[test]
    fn what_lies_along_the_axes_stays() {
        for degrees in [0.0, 90.0, 180.0, -90.0, 0.4] {
            assert!(Frame::of(&walls(degrees)).is_scene(), "{degrees}");
        }
        assert!(Frame::of(&[]).is_scene());
        // As many walls along the axes as askew.
        let mut both = walls(0.0);
        both.extend(walls(30.0));
        assert!(Frame::of(&both).is_scene());
        // A tower of sixty sides has no direction.
        let side = |k: usize| {
            let (sin, cos) = (k as f64 * 6.0_f64.to_radians()).sin_cos();
            DVec3::new(cos * 9.0, 0.0, sin * 9.0)
        };
        let round: Vec<Triangle> = (0..60)
            .map(|k| [side(k), side(k + 1), side(k) + DVec3::Y])
            .collect();
        assert!(Frame::of(&round).is_scene());
    }

    #[test]
    fn the_order_of_triangles_has_no_say_and_the_way_back_is_the_way_there() {
        let mut triangles = walls(37.3);
        triangles.extend(walls(12.0).into_iter().take(4));
        let frame = Frame::of(&triangles);
        triangles.reverse();
        assert_eq!(frame, Frame::of(&triangles));
        let p = DVec3::new(12.5, -3.0, 7.25);
        assert!((frame.to_scene(frame.to_grid(p)) - p).length() < 1e-12);
        let bounds = Aabb::new(DVec3::ZERO, DVec3::new(2.0, 1.0, 3.0));
        let outer = frame.aabb_to_scene(&bounds);
        for p in [bounds.min, bounds.max, bounds.center()] {
            assert!(outer.contains(frame.to_scene(p)));
        }
    }
}
