//! Geometry shared by all crates of enfilade: boxes, planes, windings (convex planar polygons), the input
//! scene, and the bounding volume hierarchy.
//!
//! Conventions, everywhere: right-handed, +Y up, meters; front faces are counter-clockwise; builders
//! compute in `f64`, files hold `f32`.

mod aabb;
mod allowance;
mod attitude;
mod bvh;
mod clock;
pub mod filler;
mod flight;
mod loose_grid;
mod open_floor;
mod plane;
pub mod poly;
pub mod portable;
pub mod ray;
mod rectangle;
pub mod scene;
mod sets;
mod shells;
mod shown;
mod similarity;
pub mod solid;
mod tolerance;
mod winding;

pub use aabb::Aabb;
pub use allowance::{Allowance, AllowanceEnd, MemoryProbe, PROGRAM, Purse, Tab};
pub use attitude::{Attitude, faces, is_rather_level, lies_along};
pub use bvh::{Bvh, NearSeries, Nearest};
pub use clock::Instant;
#[cfg(all(target_family = "wasm", target_os = "unknown"))]
pub use clock::set_clock;
pub use flight::{MOST_FLIGHT_PLAN, are_treads, is_flight};
pub use glam::{DMat3, DMat4, DQuat, DVec2, DVec3, DVec4};
pub use loose_grid::LooseGrid;
pub use open_floor::{OPEN_WORLD, open_floor};
pub use plane::Plane;
pub use ray::{Ray, RayHit, closest_point_on_segment, closest_point_on_triangle};
pub use rectangle::{Mask, Rectangle, facing};
pub use sets::Sets;
pub use shells::{in_closed_shells, shells};
pub use shown::{Shown, is_hidden, shown};
pub use similarity::Similarity;
pub use solid::{BoxTree, ConvexSolid, SolidError};
pub use tolerance::{plane_tolerance, world_tolerance};
pub use winding::Winding;

/// A triangle in world space. [Units: wu]
pub type Triangle = [DVec3; 3];

/// Returns the normal of a triangle with twice its area as length.
#[must_use]
pub fn triangle_area_normal(t: &Triangle) -> DVec3 {
    (t[1] - t[0]).cross(t[2] - t[0])
}
