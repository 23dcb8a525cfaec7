//! Parameters of an office tower.

/// Parameters of an office tower. [`TowerParams::default`] is 4 storeys of 16 rooms with all features.
#[derive(Clone, Debug, PartialEq)]
pub struct TowerParams {
    /// Number of storeys. [Limit: >= 1]
    pub storeys: usize,
    /// Rooms of a storey, corridors and stairwells included. [Limit: >= 4]
    pub rooms_per_storey: usize,
    /// Seed of room widths, door positions and furniture.
    pub seed: u64,
    /// Desks, chairs, shelves and plants, as detail.
    pub furniture: bool,
    /// Gaps of 2-20 mm where some walls meet slabs or other walls.
    pub cracks: bool,
    /// Some partitions of two leaves with a cavity of 6 cm, which opens into their doorways.
    pub double_walls: bool,
    /// Windows above parapets in the facades.
    pub windows: bool,
    /// Stairwells through all storeys, one per wing.
    pub stairwell: bool,
    /// Door leaves and window panes, as detail.
    pub leaves: bool,
    /// The ground that the tower stands on.
    pub ground: bool,
}

impl Default for TowerParams {
    fn default() -> Self {
        Self {
            storeys: 4,
            rooms_per_storey: 16,
            seed: 1,
            furniture: true,
            cracks: false,
            double_walls: false,
            windows: true,
            stairwell: true,
            leaves: false,
            ground: true,
        }
    }
}

impl TowerParams {
    /// Makes a tower of about `rooms` rooms whose storeys and wings both grow, at constant density: exact for
    /// 16, 64, 256, 1024 and 4096.
    #[must_use]
    pub fn with_rooms(rooms: usize, seed: u64) -> Self {
        // Two storeys at 16 rooms, twice as many for every factor of 4.
        let storeys = 1 << (rooms.max(4).ilog2() / 2).saturating_sub(1);
        let rooms_per_storey = rooms.div_ceil(storeys).max(4);
        Self {
            storeys,
            rooms_per_storey,
            seed,
            ..Self::default()
        }
    }
}
