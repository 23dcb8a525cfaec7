//! Settings for building a [`Sight`](crate::Sight).

/// Options of [`Sight::build_with`](crate::Sight::build_with).
#[derive(Clone, Copy, Debug)]
pub struct SightOptions {
    /// Maximum number of triangles culled together. [Limit: above 0]
    ///
    /// Smaller chunks are culled more tightly, at a box test of about 2 ns each.
    pub chunk_triangles: usize,
    /// Number of large polygons kept per cell to hide the things behind them. [Limit: 0 for none]
    pub occluders: usize,
    /// Smallest area of such a polygon. [Units: wu²]
    pub occluder_area: f32,
    /// Maximum number of portals skipped together in a cell with more than 16. Affects the cost of a query,
    /// not its answer. [Limit: 0 to test each by itself]
    pub portal_group: usize,
}

impl Default for SightOptions {
    fn default() -> Self {
        Self {
            // A wall with a door is 8 to 20 triangles, a room's shell about 50 (office towers,
            // Dirkse's maze): 12 splits rooms by their walls.
            chunk_triangles: 4,
            occluders: 16,
            occluder_area: 2.0,
            portal_group: 8,
        }
    }
}
