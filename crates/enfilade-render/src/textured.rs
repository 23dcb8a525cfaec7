//! Views in which far portals are [textures](crate::portal_textures).

mod ahead;
mod places;
mod plan;
mod relit;

use enfilade_cpg::CellId;
use enfilade_runtime::Stops;
use enfilade_world::PartId;
use glam::Vec3;

pub use ahead::{MadePortalTextures, PortalTextureMaking, PortalTextureProgress};

use plan::{PlanShot, eye_of};

use crate::camera::Camera;
use crate::frame::{Paint, Style};
use crate::gpu::RenderError;
use crate::portal_texture_options::{
    PortalTextureCounts, PortalTextureOptions, PortalTexturePaint,
};
use crate::portal_textures::{PortalTextures, TextureArrays};
use crate::space::{SpaceShot, view_in};
use crate::studio::Studio;

impl Studio {
    /// Draws far portals as textures with [`Culling::PortalTextures`](crate::Culling::PortalTextures) from now on. The whole
    /// budget of memory is allocated at once, up to the adapter's number of layers.
    ///
    /// # Errors
    ///
    /// Settings out of range; a hollow world; an adapter without room.
    pub fn add_portal_textures(
        &mut self,
        options: PortalTextureOptions,
    ) -> Result<(), RenderError> {
        options.check()?;
        self.check_whole("portal textures")?;
        let side = options.side;
        self.gpu.check_picture([side, side])?;
        let most = self.gpu.device.limits().max_texture_array_layers;
        let n = (options.max_bytes / options.bytes_each()).min(u64::from(most)) as u32;
        let (format, layouts) = (self.renderer.format(), &self.renderer.layouts);
        let arrays = TextureArrays::new(&self.gpu, layouts, format, side, n.max(1));
        self.gpu.check_failed()?;
        let mut own = PortalTextures::new(options, arrays);
        own.lamps.clone_from(&self.lamps.lights);
        self.portal_textures = Some(Box::new(own));
        Ok(())
    }

    /// Ends portal textures, and frees their memory.
    #[doc(hidden)]
    pub fn remove_portal_textures(&mut self) {
        self.portal_textures = None;
    }

    /// Returns the settings of portal textures, if they are on.
    #[must_use]
    pub fn portal_texture_options(&self) -> Option<&PortalTextureOptions> {
        self.portal_textures.as_ref().map(|own| &own.options)
    }

    /// Changes the coloring of pixels from portal textures.
    #[doc(hidden)]
    pub fn paint_portal_textures(&mut self, paint: PortalTexturePaint) {
        if let Some(own) = &mut self.portal_textures {
            own.options.paint = paint;
        }
    }

    /// Drops all portal textures, so that they are made anew.
    #[doc(hidden)]
    pub fn clear_portal_textures(&mut self) {
        if let Some(own) = &mut self.portal_textures {
            own.clear();
        }
    }

    /// Chooses the textures of the next frame, and makes some of those that are missing. Call it before
    /// [`Studio::list`] with [`Culling::PortalTextures`](crate::Culling::PortalTextures), with the same camera. Without
    /// [`Studio::add_portal_textures`], it does nothing.
    ///
    /// # Errors
    ///
    /// As [`Studio::picture`].
    pub fn plan_portal_textures(
        &mut self,
        camera: &Camera,
        style: Style,
        size: [u32; 2],
    ) -> Result<PortalTextureCounts, RenderError> {
        let Some(mut own) = self.portal_textures.take() else {
            return Ok(PortalTextureCounts::default());
        };
        self.follow_state();
        self.follow_sun(&style);
        let view = camera.view(size[0] as f32 / size[1] as f32)?;
        let style = self.drawable(style);
        let shot = PlanShot {
            space: None,
            view: &view,
            eye: eye_of(None, PartId::ROOT, camera),
            fov_y: camera.fov_y,
            size,
            style,
            exposure: if style.daylight {
                self.stage.light.exposure(camera.eye.into(), 1.0)
            } else {
                1.0
            },
        };
        let counts = self.plan_styled(&mut own, &shot);
        self.portal_textures = Some(own);
        counts
    }

    /// As [`Studio::plan_portal_textures`], for a view of a space: before [`SpaceViewer::see`](enfilade_world::SpaceViewer::see), whose
    /// [stops](enfilade_world::SpaceViewer::stops_mut) must be [those of the plan](Studio::portal_texture_stops), and before
    /// [`Studio::draw_space`] with its answer. What `shot` has [seen](SpaceShot::seen) is ignored.
    ///
    /// Portals of the root become textures, but not those behind which other parts stand, which may move, or special
    /// portals are seen.
    ///
    /// # Errors
    ///
    /// As [`Studio::draw_space`].
    ///
    /// # Panics
    ///
    /// As [`Studio::draw_space`].
    pub fn plan_space_textures(
        &mut self,
        shot: &SpaceShot<'_>,
        size: [u32; 2],
    ) -> Result<PortalTextureCounts, RenderError> {
        let Some(mut own) = self.portal_textures.take() else {
            return Ok(PortalTextureCounts::default());
        };
        let counts = self.plan_in_space(&mut own, shot, size);
        own.is_planned = counts.is_ok();
        self.portal_textures = Some(own);
        counts
    }

    fn plan_in_space(
        &mut self,
        own: &mut PortalTextures,
        shot: &SpaceShot<'_>,
        size: [u32; 2],
    ) -> Result<PortalTextureCounts, RenderError> {
        self.place_parts(shot.space);
        self.cast_sun(shot);
        let view = shot.camera.view(size[0] as f32 / size[1] as f32)?;
        let eye = Vec3::from(shot.camera.eye).as_dvec3();
        let planned = PlanShot {
            space: Some(shot.space),
            view: &view_in(shot.space, PartId::ROOT, shot.frame, &view),
            eye: eye_of(Some(shot.space), shot.frame, &shot.camera),
            fov_y: shot.camera.fov_y,
            size,
            style: self.drawable(shot.style),
            exposure: self.exposure(shot, shot.frame, eye),
        };
        self.plan_styled(own, &planned)
    }

    /// Plans unless surfaces are colored to explain something.
    fn plan_styled(
        &mut self,
        own: &mut PortalTextures,
        shot: &PlanShot<'_>,
    ) -> Result<PortalTextureCounts, RenderError> {
        if shot.style.paint == Paint::Lit {
            return self.plan_with(own, shot);
        }
        own.shown.clear();
        own.stops.clear();
        Ok(PortalTextureCounts::default())
    }

    /// Returns the stops of the last plan, for the viewer whose answer is drawn.
    #[must_use]
    pub fn portal_texture_stops(&self) -> Option<&Stops> {
        self.portal_textures.as_ref().map(|own| &own.stops)
    }

    /// Returns the cells that the textures of the last plan show, with repetitions: what moves in them is drawn over the textures.
    #[doc(hidden)]
    pub fn cells_in_portal_textures(&self) -> impl Iterator<Item = CellId> {
        let own = self.portal_textures.iter();
        let shown = own.flat_map(|own| own.shown.keys().map(move |id| (own, *id)));
        let held = shown.flat_map(|(own, id)| own.of_doorway(id));
        held.flat_map(|held| held.cells.iter().copied())
    }
}
