//! Buildings with the faults of models as people draw, export and download them.
//!
//! Each has exactly the fault that names it. Its truth is a visitor's view: the rooms, and the places
//! where one walks or looks from one to the next.

mod corridors;
mod glazing;
mod plan;
mod slabs;
mod solids;
mod walls;

use enfilade_demo::Generated;

/// A fault or difficulty of a building.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Fault {
    /// Walls begin 2 mm above the slab that they stand on.
    WallsAboveSlabs,
    /// Ceilings hang below a plenum, each with a shadow gap of 107 mm to the walls around it.
    HungCeilings,
    /// Inner walls end at a hung ceiling; above it a plenum lies over all rooms.
    WallsToCeiling,
    /// A storey is glazed from slab to slab on all sides, between mullions and transoms.
    CurtainWall,
    /// Inner partitions are panes between mullions, with a door in one bay; windows are divided.
    Mullions,
    /// Columns stand in the walls, thicker than these and modelled separately.
    ColumnsInWalls,
    /// Four doorways around one post, each at the very end of its rooms' walls.
    CornerDoors,
    /// Door leaves stand open into a corridor and take up most of its width.
    LeavesInCorridor,
    /// Ten walls around seven rooms, without a floor or a ceiling.
    WallsAlone,
    /// Two rooms joined by 20 m of corridor, 1.6 m wide and as high as the rooms.
    CorridorWide,
    /// The same, 1.2 m wide.
    CorridorMedium,
    /// The same, 0.9 m wide.
    CorridorNarrow,
    /// A corridor with a bend.
    CorridorL,
    /// A corridor that ends at the side of another.
    CorridorT,
    /// Two corridors that cross.
    CorridorCross,
    /// Closed blocks on open land, with streets between them and without any room.
    CityBlocks,
    /// Closed free-standing columns in a hall.
    Columns,
    /// Closed boxes of furniture size, not marked as detail, on floors, at walls, in stacks.
    Boxes,
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 18] = [
        Self::WallsAboveSlabs,
        Self::HungCeilings,
        Self::WallsToCeiling,
        Self::CurtainWall,
        Self::Mullions,
        Self::ColumnsInWalls,
        Self::CornerDoors,
        Self::LeavesInCorridor,
        Self::WallsAlone,
        Self::CorridorWide,
        Self::CorridorMedium,
        Self::CorridorNarrow,
        Self::CorridorL,
        Self::CorridorT,
        Self::CorridorCross,
        Self::CityBlocks,
        Self::Columns,
        Self::Boxes,
    ];

    /// Returns its name, which is also the name of its scene.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::WallsAboveSlabs => "walls-above-slabs",
            Self::HungCeilings => "hung-ceilings",
            Self::WallsToCeiling => "walls-to-ceiling",
            Self::CurtainWall => "curtain-wall",
            Self::Mullions => "mullions",
            Self::ColumnsInWalls => "columns-in-walls",
            Self::CornerDoors => "corner-doors",
            Self::LeavesInCorridor => "leaves-in-corridor",
            Self::WallsAlone => "walls-alone",
            Self::CorridorWide => "corridor-wide",
            Self::CorridorMedium => "corridor-medium",
            Self::CorridorNarrow => "corridor-narrow",
            Self::CorridorL => "corridor-l",
            Self::CorridorT => "corridor-t",
            Self::CorridorCross => "corridor-cross",
            Self::CityBlocks => "city-blocks",
            Self::Columns => "columns",
            Self::Boxes => "boxes",
        }
    }

    /// Builds it.
    #[must_use]
    pub fn build(self) -> Generated {
        let name = self.name();
        match self {
            Self::WallsAboveSlabs => slabs::walls_above_slabs(name),
            Self::HungCeilings => slabs::hung_ceilings(name),
            Self::WallsToCeiling => slabs::walls_to_ceiling(name),
            Self::CurtainWall => glazing::curtain_wall(name),
            Self::Mullions => glazing::mullions(name),
            Self::ColumnsInWalls => walls::columns_in_walls(name),
            Self::CornerDoors => walls::corner_doors(name),
            Self::LeavesInCorridor => walls::leaves_in_corridor(name),
            Self::WallsAlone => walls::walls_alone(name),
            Self::CorridorWide => corridors::straight(name, 1.6),
            Self::CorridorMedium => corridors::straight(name, 1.2),
            Self::CorridorNarrow => corridors::straight(name, 0.9),
            Self::CorridorL => corridors::bend(name),
            Self::CorridorT => corridors::junction(name),
            Self::CorridorCross => corridors::crossing(name),
            Self::CityBlocks => solids::city_blocks(name),
            Self::Columns => solids::columns(name),
            Self::Boxes => solids::boxes(name),
        }
    }
}
