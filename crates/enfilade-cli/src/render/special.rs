//! Pictures of worlds with special portals, such as mirrors.

use enfilade::cpg::{PortalId, World};
use enfilade::world::{PartId, Space, SpaceViewer};
use enfilade_render::{Camera, Culling, Mark, Picture, SpaceShot, Studio, Style};

/// A world whose special portals are looked into.
pub(crate) struct Mirrored {
    space: Space,
    viewer: SpaceViewer,
}

impl Mirrored {
    /// Prepares a world, its leaves and shut portals; `None` if it has no special portals.
    ///
    /// # Errors
    ///
    /// If it cannot be prepared.
    pub(crate) fn new(
        world: &World,
        leaves: &[(u32, f32)],
        shut: &[u32],
    ) -> anyhow::Result<Option<Self>> {
        if world.graph.specials.is_empty() {
            return Ok(None);
        }
        let mut space = Space::new(world.clone())?;
        for &(portal, share) in leaves {
            space.set_leaves(PartId::ROOT, PortalId(portal), share);
        }
        for &portal in shut {
            space.close(PartId::ROOT, PortalId(portal));
        }
        let viewer = SpaceViewer::new(&space);
        Ok(Some(Self { space, viewer }))
    }

    /// Draws a picture.
    ///
    /// # Errors
    ///
    /// As [`Studio::space_picture`].
    pub(crate) fn picture(
        &mut self,
        studio: &mut Studio,
        (camera, culling): (&Camera, Culling),
        style: Style,
        marks: &[Mark],
        size: [u32; 2],
    ) -> anyhow::Result<Picture> {
        let view = camera.view(size[0] as f32 / size[1] as f32)?;
        let seen = self.viewer.see(&self.space, PartId::ROOT, &view);
        let shot = SpaceShot {
            space: &self.space,
            frame: PartId::ROOT,
            camera: *camera,
            seen: (culling == Culling::Portals).then_some(seen),
            style,
            marks,
            props: &[],
            lamps: None,
        };
        Ok(studio.space_picture(&shot, size)?.0)
    }
}
