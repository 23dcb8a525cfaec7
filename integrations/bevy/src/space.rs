//! Conversions between the engine's space and that of a world, whose root may stand anywhere.

use bevy::camera::primitives::Aabb;
use bevy::math::{Affine3A, Vec3A};
use bevy::prelude::*;
use enfilade::CellId;
use enfilade::cpg::Locator;
use enfilade::geom::DVec3;

/// Added to every reach, for rounding in `f32` on the way to the world's space and in shaders. [Units: wu]
const SLACK: f64 = 0.01;

pub(crate) fn precise(p: Vec3A) -> DVec3 {
    DVec3::from_array(p.to_array().map(f64::from))
}

/// Returns the map from the engine's space to that of a root; `None` if the root is flattened.
pub(crate) fn into_root(root: &GlobalTransform) -> Option<Affine3A> {
    let inverse = root.affine().inverse();
    inverse.is_finite().then_some(inverse)
}

/// Returns an upper bound of the factor by which a map lengthens anything.
pub(crate) fn stretch(map: &Affine3A) -> f32 {
    let m = map.matrix3;
    let lengths = [m.x_axis, m.y_axis, m.z_axis].map(Vec3A::length);
    let longest = lengths.into_iter().fold(0.0, f32::max);
    let pairs = [
        m.x_axis.dot(m.y_axis),
        m.y_axis.dot(m.z_axis),
        m.z_axis.dot(m.x_axis),
    ];
    let is_square = pairs.iter().all(|d| d.abs() <= 1e-4 * longest * longest);
    // Otherwise by the norm of the whole matrix, which is never less.
    let norm = lengths.iter().map(|l| l * l).sum::<f32>().sqrt();
    if is_square { longest * 1.0001 } else { norm }
}

/// The space that something takes up in a world: a moving object, or the sphere of a light.
#[derive(Clone, Debug)]
pub(crate) struct Extent {
    /// Cells that it may touch, ascending.
    pub(crate) cells: Vec<CellId>,
    /// Bounding box in the world's space.
    pub(crate) bounds: [[f32; 3]; 2],
    /// True if it reaches beyond the world, where no cell is.
    pub(crate) is_beyond: bool,
}

impl Extent {
    fn of_hull(locator: &Locator, points: &[DVec3], margin: f64) -> Self {
        let margin = margin + SLACK;
        let mut cells = Vec::new();
        locator.cells_near(points, margin, &mut cells);
        let low = points.iter().fold(DVec3::INFINITY, |a, p| a.min(*p)) - margin;
        let high = points.iter().fold(DVec3::NEG_INFINITY, |a, p| a.max(*p)) + margin;
        let is_inside = locator.bounds.contains(low) && locator.bounds.contains(high);
        Self {
            cells,
            bounds: [low, high].map(|p| p.as_vec3().to_array()),
            is_beyond: !is_inside && locator.outside.is_none(),
        }
    }

    /// Returns that of a box in its own space, placed by `map` in the world's.
    pub(crate) fn of_box(locator: &Locator, aabb: &Aabb, map: &Affine3A) -> Self {
        let vertex = |i: u32| {
            let side = |k: u32| if i >> k & 1 == 0 { -1.0 } else { 1.0 };
            let sides = Vec3A::new(side(0), side(1), side(2));
            precise(map.transform_point3a(aabb.center + aabb.half_extents * sides))
        };
        let points: [DVec3; 8] = std::array::from_fn(|i| vertex(i as u32));
        Self::of_hull(locator, &points, 0.0)
    }

    /// Returns that of a sphere around the origin of its own space, placed by `map` in the world's.
    pub(crate) fn of_sphere(locator: &Locator, radius: f32, center: Vec3A, stretch: f32) -> Self {
        Self::of_hull(locator, &[precise(center)], f64::from(radius * stretch))
    }

    /// Returns that of both together.
    pub(crate) fn joined(mut self, other: &Self) -> Self {
        self.cells.extend_from_slice(&other.cells);
        self.cells.sort_unstable();
        self.cells.dedup();
        let ([low, high], [low_2, high_2]) = (self.bounds, other.bounds);
        self.bounds = [
            [0, 1, 2].map(|k| low[k].min(low_2[k])),
            [0, 1, 2].map(|k| high[k].max(high_2[k])),
        ];
        self.is_beyond |= other.is_beyond;
        self
    }

    /// Returns `true` if it is surely in none of the cells that `is_seen` accepts. Nothing is sure of what is in solid matter or
    /// beyond the world.
    pub(crate) fn is_apart_from(&self, is_seen: impl Fn(CellId) -> bool) -> bool {
        !self.is_beyond && !self.cells.is_empty() && !self.cells.iter().any(|c| is_seen(*c))
    }
}
