//! Settings of what is made from a world.

/// How a world is made ready.
#[derive(Clone, Copy, Debug)]
pub struct SightOptions {
    /// Triangles that are culled together, at most. [Limit: above 0]
    ///
    /// Smaller chunks are culled more tightly, and cost a box test of about 2 ns each.
    pub chunk_triangles: usize,
    /// Large polygons kept of each cell, behind which things are not seen. [Limit: 0 for none]
    pub occluders: usize,
    /// Smallest area of such a polygon. [Units: wu²]
    pub occluder_area: f32,
    /// Portals of a cell that are skipped together, at most, where it has more than 16. Changes what a
    /// question costs, not its answer. [Limit: 0 for each by itself]
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
