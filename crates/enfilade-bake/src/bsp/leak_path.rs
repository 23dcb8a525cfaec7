//! A way out of a map that leaks.

use enfilade_geom::DVec3;

/// A way through open space from something inside to the void.
#[derive(Clone, Debug, PartialEq)]
pub struct LeakPath {
    /// Which of the points inside it begins at.
    pub from: usize,
    /// Its corners, from that point to beyond the outermost surface. [Units: wu]
    pub points: Vec<DVec3>,
}
