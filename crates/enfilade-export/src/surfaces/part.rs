//! Parts of the boundary of a cell, with all that tells one surface from another.

use enfilade_geom::DVec3;

use super::piece::SurfaceCover;
use super::room::Behind;

/// Differences that part surfaces of one plane: cover and what lies behind, there with its plane and cover, so that both sides are cut alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    pub(crate) plane: u32,
    pub(crate) cover: SurfaceCover,
    pub(crate) behind: Behind,
    pub(crate) far: Option<(u32, SurfaceCover)>,
}

/// A convex part of the boundary of a cell, or the mouth of a recess.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) key: Key,
    pub(crate) normal: DVec3,
    pub(crate) points: Vec<DVec3>,
    pub(crate) depth: f64,
}
