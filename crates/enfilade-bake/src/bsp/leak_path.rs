//! The path out of a map that leaks.

use enfilade_geom::DVec3;

/// A path through open space from a point inside to the void.
#[derive(Clone, Debug, PartialEq)]
pub struct LeakPath {
    /// Index of the point inside where it begins.
    pub from: usize,
    /// Its vertices, from that point to beyond the outermost surface. [Units: wu]
    pub points: Vec<DVec3>,
}
