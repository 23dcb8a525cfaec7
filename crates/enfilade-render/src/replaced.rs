//! A studio that goes on with another world, as after an edit.

use enfilade_cpg::World;
use enfilade_runtime::{Sight, SightState, Viewer};

use crate::gpu::RenderError;
use crate::lamps::LampState;
use crate::light::Light;
use crate::list::Lister;
use crate::scene::GpuWorld;
use crate::studio::Studio;

impl Studio {
    /// Replaces the world. Pipelines, meshes of props and the direction of the sun stay; doors, parts, lamps, portal textures and
    /// the light of the old world go.
    ///
    /// # Errors
    ///
    /// As [`Studio::new`]; the old world stays then.
    #[doc(hidden)]
    pub fn replace_world(&mut self, world: &World) -> Result<(), RenderError> {
        let sight = Sight::build(world)?;
        let on_gpu = GpuWorld::load(&self.gpu, world, &sight)?;
        let light = Light::uniform(&self.gpu)?;
        self.world = on_gpu;
        self.state = SightState::new(&sight);
        self.placed = self.state.shares().to_vec();
        self.viewer = Viewer::new(&sight);
        self.sight = sight;
        self.stage = self.renderer.stage(&self.gpu, light);
        self.lister = Lister::new();
        self.parts.clear();
        self.lamps = LampState::default();
        self.shadows_of = None;
        self.special_viewer = None;
        self.portal_textures = None;
        Ok(())
    }
}
