//! Pictures of ids, of everything and of what culling leaves.

use crate::camera::Camera;
use crate::gpu::RenderError;
use crate::ids::IdPicture;
use crate::list::RenderList;
use crate::studio::{Culling, Studio};

impl Studio {
    /// Draws the id pictures of a camera: opaque surfaces, and the nearest transparent one.
    ///
    /// # Errors
    ///
    /// As [`Studio::picture`].
    #[doc(hidden)]
    pub fn ids(
        &mut self,
        camera: &Camera,
        culling: Culling,
        size: [u32; 2],
    ) -> Result<[IdPicture; 2], RenderError> {
        let aspect = size[0] as f32 / size[1] as f32;
        let mut list = self
            .list(&camera.view(aspect)?, camera.eye, culling, size)
            .clone();
        list.sort();
        self.ids_of(camera, &list, size)
    }

    /// Draws the id pictures of everything, and of what portals leave. The latter is drawn first in both, so that
    /// both show the same one of two coincident triangles.
    ///
    /// # Errors
    ///
    /// As [`Studio::picture`].
    #[doc(hidden)]
    pub fn ids_compared(
        &mut self,
        camera: &Camera,
        size: [u32; 2],
    ) -> Result<[[IdPicture; 2]; 2], RenderError> {
        let view = camera.view(size[0] as f32 / size[1] as f32)?;
        let mut culled = self.list(&view, camera.eye, Culling::Portals, size).clone();
        culled.sort();
        let mut all = self
            .list(&view, camera.eye, Culling::Everything, size)
            .clone();
        all.sort();
        let mut whole = culled.clone();
        whole.append(&all);
        Ok([
            self.ids_of(camera, &whole, size)?,
            self.ids_of(camera, &culled, size)?,
        ])
    }

    fn ids_of(
        &mut self,
        camera: &Camera,
        list: &RenderList,
        size: [u32; 2],
    ) -> Result<[IdPicture; 2], RenderError> {
        let projection = camera.projection(size[0] as f32 / size[1] as f32)?;
        self.renderer.ids(
            &self.gpu,
            &self.world,
            &mut self.stage,
            &projection,
            list,
            size,
        )
    }
}
