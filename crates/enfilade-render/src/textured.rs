//! Views in which far portals are [textures](crate::portal_textures).

mod ahead;
mod places;
mod plan;

use enfilade_world::PartId;

pub use ahead::{MadePortalTextures, PortalTextureMaking, PortalTextureProgress};

use plan::{PlanShot, eye_of};

use crate::camera::Camera;
use crate::frame::{Paint, Style};
use crate::gpu::RenderError;
use crate::portal_texture_options::{
    PortalTextureCounts, PortalTextureOptions, PortalTexturePaint,
};
use crate::portal_textures::{PortalTextures, TextureArrays};
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
        self.portal_textures = Some(Box::new(PortalTextures::new(options, arrays)));
        Ok(())
    }

    /// Ends portal textures, and frees their memory.
    pub fn remove_portal_textures(&mut self) {
        self.portal_textures = None;
    }

    /// Returns the settings of portal textures, if they are on.
    #[must_use]
    pub fn portal_texture_options(&self) -> Option<&PortalTextureOptions> {
        self.portal_textures.as_ref().map(|own| &own.options)
    }

    /// Changes the coloring of pixels from portal textures.
    pub fn paint_portal_textures(&mut self, paint: PortalTexturePaint) {
        if let Some(own) = &mut self.portal_textures {
            own.options.paint = paint;
        }
    }

    /// Drops all portal textures, so that they are made anew.
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
        let counts = if style.paint == Paint::Lit {
            self.plan_with(&mut own, &shot)
        } else {
            own.shown.clear();
            own.stops.clear();
            Ok(PortalTextureCounts::default())
        };
        self.portal_textures = Some(own);
        counts
    }
}
