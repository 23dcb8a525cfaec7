//! All that it takes to draw one world, put together.

use enfilade_cpg::World;
use enfilade_runtime::{Sight, SightState, View, Viewer};

use crate::camera::Camera;
use crate::explain::Explanation;
use crate::frame::{Frame, Style};
use crate::gpu::{Gpu, RenderError};
use crate::ids::IdPicture;
use crate::light::{Light, sun_of};
use crate::list::{DrawList, Lister, Shot, Sparing};
use crate::marks::Mark;
use crate::picture::Picture;
use crate::renderer::{Renderer, Stage};
use crate::scene::GpuWorld;

/// What of a world is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Culling {
    /// All of it.
    Everything,
    /// What meets the view frustum.
    Frustum,
    /// What is seen through portals.
    #[default]
    Portals,
}

/// What frames that nobody looks at are drawn to.
pub struct Target {
    view: wgpu::TextureView,
    size: [u32; 2],
}

/// An adapter, a world on it, and what answers what is seen of it.
pub struct Studio {
    /// The adapter.
    pub gpu: Gpu,
    /// The world on it.
    pub world: GpuWorld,
    /// What the viewer asks.
    pub sight: Sight,
    /// Which portals are open.
    pub state: SightState,
    /// Who asks.
    pub viewer: Viewer,
    /// What far away rooms are spared, where portals cull. Off unless set.
    pub sparing: Sparing,
    pub(crate) renderer: Renderer,
    pub(crate) stage: Stage,
    pub(crate) lister: Lister,
    /// How leaves are drawn: [`SightState::shares`].
    placed: Vec<Option<f32>>,
}

impl Studio {
    /// Puts a world on an adapter.
    ///
    /// # Errors
    ///
    /// A world that breaks invariants, or is larger than the adapter's limits.
    pub fn new(gpu: Gpu, world: &World) -> Result<Self, RenderError> {
        Self::with_format(gpu, world, wgpu::TextureFormat::Rgba8UnormSrgb)
    }

    /// The same for a window, whose pictures are of `format`.
    ///
    /// # Errors
    ///
    /// As [`Studio::new`].
    pub fn with_format(
        gpu: Gpu,
        world: &World,
        format: wgpu::TextureFormat,
    ) -> Result<Self, RenderError> {
        let sight = Sight::build(world)?;
        let on_gpu = GpuWorld::load(&gpu, world, &sight)?;
        let mut renderer = Renderer::with_format(&gpu, format);
        renderer.sun = sun_of(world);
        let mut lister = Lister::new();
        let state = SightState::new(&sight);
        let all = lister.everything(&on_gpu, &sight, &state, [0.0; 3]);
        let light = Light::uniform(&gpu)?;
        let stage = renderer.set_stage(&gpu, &on_gpu, light, all);
        Ok(Self {
            placed: state.shares().to_vec(),
            state,
            viewer: Viewer::new(&sight),
            sparing: Sparing::default(),
            gpu,
            world: on_gpu,
            sight,
            renderer,
            stage,
            lister,
        })
    }

    /// Gives objects levels of detail, for [`Sparing::lod`]. `world` is the one that the studio was made of.
    ///
    /// # Errors
    ///
    /// As [`Studio::new`].
    pub fn add_levels(&mut self, world: &World) -> Result<(), RenderError> {
        self.world = GpuWorld::load_with_levels(&self.gpu, world, &self.sight)?;
        self.world.place(&self.state);
        // Light has nothing to do with levels.
        let light = std::mem::replace(&mut self.stage.light, Light::uniform(&self.gpu)?);
        let all = (self.lister).everything(&self.world, &self.sight, &self.state, [0.0; 3]);
        self.stage = self.renderer.set_stage(&self.gpu, &self.world, light, all);
        Ok(())
    }

    /// Computes which light falls where: daylight through portals, from room to room. `world` is the one that the studio
    /// was made of. Without it, all rooms are lit alike. Takes a second at most for a world of a thousand rooms; once is
    /// enough.
    ///
    /// # Errors
    ///
    /// A world whose locator or cells are more than the adapter's textures hold. It is drawn without this light, as before.
    pub fn add_light(&mut self, world: &World) -> Result<(), RenderError> {
        if self.stage.light.is_known() {
            return Ok(());
        }
        let light = Light::of_world(&self.gpu, world, &self.sight, self.renderer.sun)?;
        let all = (self.lister).everything(&self.world, &self.sight, &self.state, [0.0; 3]);
        self.stage = (self.renderer).set_stage(&self.gpu, &self.world, light, all);
        Ok(())
    }

    /// Moves leaves to where the state has them, and what the sun sees with them.
    pub(crate) fn follow_state(&mut self) {
        if self.placed == self.state.shares() {
            return;
        }
        self.placed.clear();
        self.placed.extend_from_slice(self.state.shares());
        self.world.place(&self.state);
        let all = (self.lister).everything(&self.world, &self.sight, &self.state, [0.0; 3]);
        self.renderer
            .draw_shadows(&self.gpu, &self.world, &self.stage, all);
    }

    /// What is drawn of a view: leaves of doors as [`Studio::state`] has them, and what fills portals that it shuts.
    pub fn list(
        &mut self,
        view: &View,
        eye: [f32; 3],
        culling: Culling,
        size: [u32; 2],
    ) -> &DrawList {
        self.follow_state();
        let (world, sight) = (&self.world, &self.sight);
        let shot = Shot {
            view,
            state: &self.state,
            size,
            has_scissors: culling == Culling::Portals,
        };
        match culling {
            Culling::Everything => self.lister.everything(world, sight, &self.state, eye),
            Culling::Frustum => {
                let seen = self.viewer.see_through_walls(sight, view);
                let sparing = Sparing {
                    lod: self.sparing.lod,
                    ..Sparing::default()
                };
                self.lister.seen(world, sight, &seen, &shot, &sparing)
            }
            Culling::Portals => {
                let pixels = (size[0] as f32 * size[1] as f32).max(1.0);
                let options = self.viewer.options_mut();
                let before = options.min_share;
                options.min_share = self.sparing.stop_below / pixels;
                let seen = self.viewer.see(sight, &self.state, view);
                let list = (self.lister).seen(world, sight, &seen, &shot, &self.sparing);
                self.viewer.options_mut().min_share = before;
                list
            }
        }
    }

    /// The same, to keep: until it is [given back](Studio::give_list), so that nothing is allocated.
    pub fn take_list(
        &mut self,
        view: &View,
        eye: [f32; 3],
        culling: Culling,
        size: [u32; 2],
    ) -> DrawList {
        self.list(view, eye, culling, size);
        self.lister.take()
    }

    /// Gives the buffers of a list back.
    pub fn give_list(&mut self, list: DrawList) {
        self.lister.give(list);
    }

    /// A target of the studio's format, for frames that nobody looks at.
    ///
    /// # Errors
    ///
    /// A size beyond the adapter's limit.
    pub fn target(&self, size: [u32; 2]) -> Result<Target, RenderError> {
        self.gpu.check_picture(size)?;
        let texture = crate::resources::texture(
            &self.gpu,
            "target",
            size,
            self.renderer.format(),
            wgpu::TextureUsages::COPY_SRC,
        );
        Ok(Target {
            view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            size,
        })
    }

    /// Draws a frame to a target.
    ///
    /// # Errors
    ///
    /// As [`Studio::draw`].
    pub fn draw_to(&mut self, frame: &Frame<'_>, target: &Target) -> Result<(), RenderError> {
        self.draw(frame, &target.view, target.size)
    }

    /// A picture from a camera, with marks over it.
    ///
    /// # Errors
    ///
    /// A camera that looks nowhere; a size beyond the adapter's limit; a device that was lost.
    pub fn picture(
        &mut self,
        camera: &Camera,
        culling: Culling,
        style: Style,
        marks: &[Mark],
        size: [u32; 2],
    ) -> Result<Picture, RenderError> {
        let aspect = size[0] as f32 / size[1] as f32;
        let (view, projection) = (camera.view(aspect)?, camera.projection(aspect)?);
        let list = self.list(&view, camera.eye, culling, size).clone();
        self.picture_of(
            &Frame {
                projection,
                list: &list,
                style,
                marks,
            },
            size,
        )
    }

    /// A picture of a frame of one's own.
    ///
    /// # Errors
    ///
    /// A size beyond the adapter's limit; a device that was lost.
    pub fn picture_of(
        &mut self,
        frame: &Frame<'_>,
        size: [u32; 2],
    ) -> Result<Picture, RenderError> {
        self.renderer
            .picture(&self.gpu, &self.world, &self.stage, frame, size)
    }

    /// Draws a frame to a texture of the studio's format.
    ///
    /// # Errors
    ///
    /// A size beyond the adapter's limit.
    pub fn draw(
        &mut self,
        frame: &Frame<'_>,
        output: &wgpu::TextureView,
        size: [u32; 2],
    ) -> Result<(), RenderError> {
        self.renderer
            .draw(&self.gpu, &self.world, &self.stage, frame, output, size)
    }

    /// Pictures of numbers from a camera: what hides, and the nearest that does not.
    ///
    /// # Errors
    ///
    /// As [`Studio::picture`].
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

    /// Such pictures of everything, and of what portals leave. What they leave is drawn first in both, so that of
    /// two triangles in one place both show the same.
    ///
    /// # Errors
    ///
    /// As [`Studio::picture`].
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
        list: &DrawList,
        size: [u32; 2],
    ) -> Result<[IdPicture; 2], RenderError> {
        let projection = camera.projection(size[0] as f32 / size[1] as f32)?;
        self.renderer
            .ids(&self.gpu, &self.world, &self.stage, &projection, list, size)
    }

    /// A picture of everything that `projection` shows, colored by why each point is seen from another camera's view or is
    /// not: what is seen looks as it does, what is out of view is dark, what walls hide is red, what a large polygon
    /// hides is orange; solid matter, where it is cut, is black.
    ///
    /// Needs [`Studio::add_light`], which tells which cell a point is in; without it, the picture explains nothing.
    ///
    /// # Errors
    ///
    /// As [`Studio::picture_of`].
    pub fn explained(
        &mut self,
        view: &View,
        frame: &Frame<'_>,
        size: [u32; 2],
    ) -> Result<Picture, RenderError> {
        if self.stage.light.is_known() {
            let explanation = Explanation::new(
                &mut self.viewer,
                &self.sight,
                &self.state,
                view,
                self.stage.light.origin(),
            );
            let table = explanation.table(&self.gpu)?;
            self.renderer
                .explain(&self.gpu, &mut self.stage, Some(table));
        }
        let picture = self.picture_of(frame, size);
        self.renderer.explain(&self.gpu, &mut self.stage, None);
        picture
    }

    /// The list of all that there is.
    pub fn everything(&mut self) -> DrawList {
        self.follow_state();
        (self.lister)
            .everything(&self.world, &self.sight, &self.state, [0.0; 3])
            .clone()
    }
}
