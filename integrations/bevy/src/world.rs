//! A baked world as an asset.

use std::sync::Arc;

use bevy::prelude::*;
use enfilade::stream::PackedHead;
use enfilade::{Sight, Sightlines};

/// Label of the [`PortalWorld`] in its file: `asset_server.load("house.glb#PortalWorld")`.
pub const WORLD_LABEL: &str = "PortalWorld";

/// A baked world, prepared for queries. Loaded with the glTF file that holds it, under [`WORLD_LABEL`].
#[derive(Asset, TypePath)]
pub struct PortalWorld {
    /// Cells, portals, batches of triangles and detail objects.
    pub world: Arc<enfilade::World>,
    /// The world prepared for views.
    pub sight: Sight,
    /// The world prepared for lines of sight and picking.
    pub lines: Sightlines,
}

impl PortalWorld {
    /// Prepares a world, such as one that was baked by the program itself. Takes about as long as reading its file.
    ///
    /// # Errors
    ///
    /// If the world is not valid; decoded and baked ones are.
    pub fn new(world: impl Into<Arc<enfilade::World>>) -> Result<Self, enfilade::SightError> {
        let world = world.into();
        Ok(Self {
            sight: Sight::build(&world)?,
            lines: Sightlines::build(&world),
            world,
        })
    }

    /// Prepares the world of a packed one. Views are answered as by the whole world; lines of sight and picks meet doors alone.
    pub(crate) fn hollow(head: &PackedHead) -> Result<Self, enfilade::SightError> {
        Ok(Self {
            sight: head.sight()?,
            lines: Sightlines::build(&head.world),
            world: Arc::new(head.world.clone()),
        })
    }
}
