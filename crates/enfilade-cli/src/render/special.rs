//! Pictures of worlds with special portals, such as mirrors.

use std::collections::BTreeMap;

use enfilade::cpg::{CellId, PortalId, World};
use enfilade::runtime::{Sight, View};
use enfilade::world::{PartId, Space, SpaceViewer};
use enfilade_render::{
    Camera, Culling, Picture, PictureMark, PortalTextureCounts, SpaceShot, Studio, Style,
};

use super::textured::settle;
use enfilade_cli::streamed::cells_in_view;

/// A world whose special portals are looked into.
pub(crate) struct Mirrored {
    space: Space,
    viewer: SpaceViewer,
}

impl Mirrored {
    /// Prepares a world, its leaves and shut portals; `None` if it has no special portals. `sight` is that of the world.
    pub(crate) fn new(
        world: &World,
        sight: &Sight,
        leaves: &[(u32, f32)],
        shut: &[u32],
    ) -> Option<Self> {
        if world.graph.specials.is_empty() {
            return None;
        }
        let mut space = Space::with_sight(world.clone(), sight.clone());
        for &(portal, share) in leaves {
            space.set_leaves(PartId::ROOT, PortalId(portal), share);
        }
        for &portal in shut {
            space.close(PartId::ROOT, PortalId(portal));
        }
        let viewer = SpaceViewer::new(&space);
        Some(Self { space, viewer })
    }

    /// Lists the cells in view, those that special portals show included.
    pub(crate) fn cells(&mut self, view: &View, out: &mut BTreeMap<CellId, f32>) {
        let seen = self.viewer.see(&self.space, PartId::ROOT, view);
        let n_cells = self.space.sight(PartId::ROOT).n_cells();
        for context in seen.contexts() {
            if let Some(seen) = context.of_part(PartId::ROOT) {
                cells_in_view(&seen, n_cells, out);
            }
        }
    }

    /// Draws a picture. Counts textures, of which there are none while a special portal is in view.
    ///
    /// # Errors
    ///
    /// As [`Studio::space_picture`].
    pub(crate) fn picture(
        &mut self,
        studio: &mut Studio,
        camera: &Camera,
        culling: Culling,
        style: Style,
        marks: &[PictureMark],
        size: [u32; 2],
    ) -> anyhow::Result<(Picture, PortalTextureCounts)> {
        let view = camera.view(size[0] as f32 / size[1] as f32)?;
        let shot = SpaceShot {
            space: &self.space,
            frame: PartId::ROOT,
            camera: *camera,
            seen: None,
            style,
            marks,
            props: &[],
            lamps: None,
        };
        let mut counts = PortalTextureCounts::default();
        self.viewer.stops_mut().clear();
        if culling == Culling::PortalTextures {
            counts = settle(studio, |s| Ok(s.plan_space_textures(&shot, size)?))?;
            if let Some(stops) = studio.portal_texture_stops() {
                self.viewer.stops_mut().clone_from(stops);
            }
            let seen = self.viewer.see(&self.space, PartId::ROOT, &view);
            if seen.contexts().len() > 1 || !seen.stopped_specials().is_empty() {
                self.viewer.stops_mut().clear();
                counts = PortalTextureCounts::default();
            }
        }
        let is_culled = matches!(culling, Culling::Portals | Culling::PortalTextures);
        let seen = self.viewer.see(&self.space, PartId::ROOT, &view);
        let shot = SpaceShot {
            seen: is_culled.then_some(seen),
            ..shot
        };
        Ok((studio.space_picture(&shot, size)?.0, counts))
    }
}
