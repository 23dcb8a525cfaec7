//! Everything needed to draw one world.

use std::sync::Arc;

use enfilade_cpg::World;
use enfilade_runtime::{Sight, SightState, View, Viewer};
use enfilade_world::{PartId, Pose, Space, SpaceViewer};

use crate::camera::Camera;
use crate::explain::Explanation;
use crate::frame::{Frame, Style};
use crate::gpu::{Gpu, RenderError};
use crate::lamps::{ActiveLamp, LampState};
use crate::light::{Light, sun_of};
use crate::list::{Lister, RenderList, Shot, Sparing};
use crate::marks::PictureMark;
use crate::picture::Picture;
use crate::piece_of::PieceOf;
use crate::portal_textures::PortalTextures;
use crate::renderer::Renderer;
use crate::scene::{GpuPiece, GpuWorld, Put, StreamLimits};
use crate::shown::{DrawnPart, Shown};
use crate::stage::{RenderStage, StagedWorld};

/// The part of a world that is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Culling {
    /// Everything.
    Everything,
    /// Everything that meets the view frustum.
    Frustum,
    /// Everything visible through portals.
    #[default]
    Portals,
    /// Everything visible through near portals, and [textures](Studio::add_portal_textures) of what lies behind far ones, as
    /// [planned](Studio::plan_portal_textures).
    PortalTextures,
}

/// An off-screen target, for benchmarks.
#[derive(Debug)]
pub struct StudioTarget {
    pub(crate) view: wgpu::TextureView,
    pub(crate) size: [u32; 2],
}

/// A world beside the first, on the adapter.
pub(crate) struct StudioPart {
    /// The world, to tell it from others.
    pub(crate) of: Arc<World>,
    /// Copies of a part share it until their leaves move.
    pub(crate) world: Arc<GpuWorld>,
    pub(crate) stage: RenderStage,
    /// Positions of the leaves as drawn last.
    pub(crate) placed: Vec<Option<f32>>,
}

/// An adapter, a world on it, and the visibility queries that cull it.
pub struct Studio {
    /// The adapter.
    pub gpu: Gpu,
    /// The world on it.
    #[doc(hidden)]
    pub world: GpuWorld,
    /// The world prepared for queries.
    pub sight: Sight,
    /// The state of doors, such as open portals.
    pub state: SightState,
    /// The viewer that runs the queries.
    pub viewer: Viewer,
    /// Reductions for distant rooms with culling by portals. Off by default.
    #[doc(hidden)]
    pub sparing: Sparing,
    pub(crate) renderer: Renderer,
    pub(crate) stage: RenderStage,
    pub(crate) lister: Lister,
    /// Positions of the leaves as drawn last: [`SightState::shares`].
    pub(crate) placed: Vec<Option<f32>>,
    /// Worlds beside the first, by [`PartId`] less one.
    pub(crate) parts: Vec<StudioPart>,
    /// The lamps.
    pub(crate) lamps: LampState,
    /// Share of the daylight that is left, from night (0) to day (1).
    pub day: f32,
    /// Poses of the worlds that cast the shadows in the sun's map; `None` if it is out of date.
    pub(crate) shadows_of: Option<Vec<Option<Pose>>>,
    /// For pictures of everything: finds what special portals show.
    pub(crate) special_viewer: Option<SpaceViewer>,
    pub(crate) portal_textures: Option<Box<PortalTextures>>,
}

impl Studio {
    /// Uploads a world to an adapter.
    ///
    /// # Errors
    ///
    /// A world that breaks invariants or exceeds the adapter's limits.
    pub fn new(gpu: Gpu, world: &World) -> Result<Self, RenderError> {
        Self::with_format(gpu, world, wgpu::TextureFormat::Rgba8UnormSrgb)
    }

    /// Uploads a world for a window, whose pictures have this `format`.
    ///
    /// # Errors
    ///
    /// As [`Studio::new`].
    #[doc(hidden)]
    pub fn with_format(
        gpu: Gpu,
        world: &World,
        format: wgpu::TextureFormat,
    ) -> Result<Self, RenderError> {
        let sight = Sight::build(world)?;
        let on_gpu = GpuWorld::load(&gpu, world, &sight)?;
        Self::of_world(gpu, world, sight, on_gpu, format)
    }

    /// Makes room for a hollow world, whose pieces are [put](Studio::put) and [taken](Studio::take) as they come into view;
    /// see [`GpuWorld::hollow`]. `sight` is that of [`Sight::build_hollow`].
    ///
    /// Light that needs the whole world is off: shadows of the sun, and daylight through portals. Lamps shine, and their shadows
    /// are those of what is there.
    ///
    /// # Errors
    ///
    /// Limits beyond the adapter's buffers.
    #[doc(hidden)]
    pub fn hollow(
        gpu: Gpu,
        world: &World,
        sight: Sight,
        limits: &StreamLimits,
        format: wgpu::TextureFormat,
    ) -> Result<Self, RenderError> {
        let on_gpu = GpuWorld::hollow(&gpu, world, &sight, limits)?;
        Self::of_world(gpu, world, sight, on_gpu, format)
    }

    fn of_world(
        gpu: Gpu,
        world: &World,
        sight: Sight,
        on_gpu: GpuWorld,
        format: wgpu::TextureFormat,
    ) -> Result<Self, RenderError> {
        let renderer = Renderer::new(&gpu, format, sun_of(world));
        let state = SightState::new(&sight);
        let stage = renderer.stage(&gpu, Light::uniform(&gpu)?);
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
            lister: Lister::new(),
            parts: Vec::new(),
            lamps: LampState::default(),
            day: 1.0,
            shadows_of: None,
            special_viewer: None,
            portal_textures: None,
        })
    }

    /// Puts a piece of a hollow world on the adapter: see [`GpuWorld::put`].
    ///
    /// # Errors
    ///
    /// As [`GpuWorld::put`].
    #[doc(hidden)]
    pub fn put(&mut self, piece: &GpuPiece) -> Result<Put, RenderError> {
        let is_new = !self.world.has(piece.of());
        let put = self.world.put(&self.gpu, piece)?;
        if is_new && put == Put::Done {
            self.piece_changed(piece.of());
        }
        Ok(put)
    }

    /// Takes a piece of a hollow world off the adapter. Returns `true` if it was there.
    #[doc(hidden)]
    pub fn take(&mut self, of: PieceOf) -> bool {
        let was_there = self.world.take(of);
        if was_there {
            self.piece_changed(of);
        }
        was_there
    }

    /// Gives objects levels of detail, for [`Sparing::lod`]. `world` is the one from which the studio was made.
    ///
    /// # Errors
    ///
    /// As [`Studio::new`]; a hollow world.
    pub fn add_levels(&mut self, world: &World) -> Result<(), RenderError> {
        self.check_whole("the measurement of levels of detail")?;
        self.world = GpuWorld::load_with_levels(&self.gpu, world, &self.sight)?;
        self.world.place(&self.state);
        // Light does not depend on levels.
        let light = std::mem::replace(&mut self.stage.light, Light::uniform(&self.gpu)?);
        self.stage = self.renderer.stage(&self.gpu, light);
        self.shadows_of = None;
        Ok(())
    }

    /// Computes daylight through portals, from room to room. `world` is the one from which the studio was made.
    /// Without it, all rooms are lit alike. Takes at most a second for a world of a thousand rooms; once is enough.
    ///
    /// # Errors
    ///
    /// A world whose locator or cells exceed the adapter's textures, or a hollow world. It is drawn without this light, as
    /// before.
    pub fn add_light(&mut self, world: &World) -> Result<(), RenderError> {
        if self.stage.light.is_known() {
            return Ok(());
        }
        self.check_whole("daylight through portals")?;
        let toward = self.renderer.sun.toward;
        let light = Light::of_world(&self.gpu, world, &self.sight, toward)?;
        self.stage = self.renderer.stage(&self.gpu, light);
        Ok(())
    }

    pub(crate) fn check_whole(&self, what: &'static str) -> Result<(), RenderError> {
        let needs = RenderError::NeedsWhole { what };
        (!self.world.is_hollow()).then_some(()).ok_or(needs)
    }

    /// Returns the style as it can be drawn: the sun casts shadows of whole worlds only.
    pub(crate) fn drawable(&self, style: Style) -> Style {
        Style {
            shadows: style.shadows && !self.world.is_hollow(),
            ..style
        }
    }

    /// Moves leaves as the state has them.
    pub(crate) fn follow_state(&mut self) {
        if self.placed == self.state.shares() {
            return;
        }
        self.placed.clear();
        self.placed.extend_from_slice(self.state.shares());
        self.world.place(&self.state);
        self.shadows_of = None;
    }

    /// Draws the shadow map unless it is current.
    pub(crate) fn follow_sun(&mut self, style: &Style) {
        let alone = vec![Some(Pose::IDENTITY)];
        if !self.drawable(*style).shadows || self.shadows_of.as_ref() == Some(&alone) {
            return;
        }
        self.shadows_of = Some(alone);
        let all = [(PartId::ROOT, self.everything_of(None, PartId::ROOT))];
        let mut parts = drawn_parts(&self.world, &mut self.stage, &mut self.parts, &all);
        self.renderer.draw_shadows(&self.gpu, &mut parts);
    }

    /// Returns the frame apart from the world.
    fn shown<'f>(&self, frame: &'f Frame<'_>, lamps: &'f [ActiveLamp]) -> Shown<'f> {
        let (style, projection) = (self.drawable(frame.style), frame.projection);
        // Parallel pictures have one exposure for all rooms.
        let is_eye = !projection.is_parallel && style.daylight;
        Shown {
            projection,
            pose: Pose::IDENTITY,
            style,
            marks: frame.marks,
            props: &[],
            lamps,
            textures: None,
            day: self.day,
            exposure: if is_eye {
                self.stage.light.exposure(projection.origin, 1.0)
            } else {
                1.0
            },
        }
    }

    /// Adds the textures of a list's doorways to a frame.
    pub(crate) fn with_textures<'f>(
        &self,
        shown: Shown<'f>,
        textures: Option<&'f mut PortalTextures>,
        list: &RenderList,
    ) -> Shown<'f> {
        let Some(own) = textures.filter(|_| !list.doorways.is_empty()) else {
            return shown;
        };
        let seen_by = (&shown.projection_in(&self.stage), shown.exposure);
        let (layouts, marks) = (&self.renderer.layouts, shown.style.dark_corners);
        Shown {
            textures: Some(own.write(&self.gpu, layouts, list, seen_by.0, seen_by.1, marks)),
            ..shown
        }
    }

    /// Lists the draws of a view, with leaves and plugs as [`Studio::state`] has them.
    pub fn list(
        &mut self,
        view: &View,
        eye: [f32; 3],
        culling: Culling,
        size: [u32; 2],
    ) -> &RenderList {
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
            Culling::PortalTextures => {
                let planned = self.portal_textures.as_ref();
                if let Some(own) = planned {
                    self.viewer.stops_mut().clone_from(&own.stops);
                }
                let seen = self.viewer.see(sight, &self.state, view);
                (self.lister).seen(world, sight, &seen, &shot, &self.sparing);
                self.viewer.stops_mut().clear();
                if let Some(own) = planned {
                    own.sort_out(self.lister.list_mut());
                }
                self.lister.list()
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

    /// Same as [`Studio::list`], but moves the list out. [Give it back](Studio::give_list) so that nothing is
    /// allocated.
    #[doc(hidden)]
    pub fn take_list(
        &mut self,
        view: &View,
        eye: [f32; 3],
        culling: Culling,
        size: [u32; 2],
    ) -> RenderList {
        self.list(view, eye, culling, size);
        self.lister.take()
    }

    /// Takes the buffers of a list back.
    #[doc(hidden)]
    pub fn give_list(&mut self, list: RenderList) {
        self.lister.give(list);
    }

    /// Makes an off-screen target in the studio's format.
    ///
    /// # Errors
    ///
    /// A size beyond the adapter's limit.
    pub fn target(&self, size: [u32; 2]) -> Result<StudioTarget, RenderError> {
        self.gpu.check_picture(size)?;
        let texture = crate::resources::texture(
            &self.gpu,
            "target",
            size,
            self.renderer.format(),
            wgpu::TextureUsages::COPY_SRC,
        );
        Ok(StudioTarget {
            view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            size,
        })
    }

    /// Draws a frame to a target.
    ///
    /// # Errors
    ///
    /// As [`Studio::draw`].
    pub fn draw_to(&mut self, frame: &Frame<'_>, target: &StudioTarget) -> Result<(), RenderError> {
        self.draw(frame, &target.view, target.size)
    }

    /// Draws a picture from a camera, with marks over it.
    ///
    /// # Errors
    ///
    /// A camera without direction; a size beyond the adapter's limit; a device that was lost.
    pub fn picture(
        &mut self,
        camera: &Camera,
        culling: Culling,
        style: Style,
        marks: &[PictureMark],
        size: [u32; 2],
    ) -> Result<Picture, RenderError> {
        let aspect = size[0] as f32 / size[1] as f32;
        let (view, projection) = (camera.view(aspect)?, camera.projection(aspect)?);
        if culling == Culling::PortalTextures {
            self.plan_portal_textures(camera, style, size)?;
        }
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

    /// Draws a picture of a given frame.
    ///
    /// # Errors
    ///
    /// A size beyond the adapter's limit; a device that was lost.
    #[doc(hidden)]
    pub fn picture_of(
        &mut self,
        frame: &Frame<'_>,
        size: [u32; 2],
    ) -> Result<Picture, RenderError> {
        self.follow_state();
        self.follow_sun(&frame.style);
        let eye = frame.projection.origin.as_dvec3();
        let lamps = self.active_lamps(None, &frame.style, eye, None);
        let mut textures = self.portal_textures.take();
        let shown = self.shown(frame, &lamps);
        let shown = self.with_textures(shown, textures.as_deref_mut(), frame.list);
        let part = DrawnPart {
            id: PartId::ROOT,
            world: &self.world,
            stage: &mut self.stage,
            list: frame.list,
        };
        let picture = (self.renderer).picture(&self.gpu, &mut [part], &shown, size);
        self.portal_textures = textures;
        picture
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
        self.follow_state();
        self.follow_sun(&frame.style);
        let eye = frame.projection.origin.as_dvec3();
        let lamps = self.active_lamps(None, &frame.style, eye, None);
        let mut textures = self.portal_textures.take();
        let shown = self.shown(frame, &lamps);
        let shown = self.with_textures(shown, textures.as_deref_mut(), frame.list);
        let part = DrawnPart {
            id: PartId::ROOT,
            world: &self.world,
            stage: &mut self.stage,
            list: frame.list,
        };
        let drawn = (self.renderer).draw(&self.gpu, &mut [part], &shown, output, size);
        self.portal_textures = textures;
        drawn
    }

    /// Draws everything that `projection` shows, colored by why each point is visible from another camera or not:
    /// normal if visible, dark out of view, red behind walls, orange behind a large polygon; solid matter, where it
    /// is cut, is black.
    ///
    /// Needs [`Studio::add_light`], which provides the cell of each point; without it, the picture explains nothing.
    ///
    /// # Errors
    ///
    /// As [`Studio::picture_of`].
    #[doc(hidden)]
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

    /// Lists everything.
    #[doc(hidden)]
    pub fn everything(&mut self) -> RenderList {
        self.follow_state();
        (self.lister)
            .everything(&self.world, &self.sight, &self.state, [0.0; 3])
            .clone()
    }

    pub(crate) fn stage_of(&self, part: PartId) -> &RenderStage {
        match part.0 as usize {
            0 => &self.stage,
            i => &self.parts[i - 1].stage,
        }
    }

    /// Lists everything of a part, with the doors of the space, or of the studio without one.
    pub(crate) fn everything_of(&mut self, space: Option<&Space>, id: PartId) -> RenderList {
        if space.is_some_and(|space| !space.is_present(id)) {
            return RenderList::default();
        }
        let world = world_of(&self.world, &self.parts, id);
        let (sight, state) = match space {
            Some(space) => (space.sight(id), space.state(id)),
            None => (&self.sight, &self.state),
        };
        self.lister.everything(world, sight, state, [0.0; 3]);
        self.lister.take()
    }
}

pub(crate) fn world_of<'a>(
    root: &'a GpuWorld,
    others: &'a [StudioPart],
    id: PartId,
) -> &'a GpuWorld {
    match id.0 as usize {
        0 => root,
        i => &others[i - 1].world,
    }
}

/// Returns all worlds by part.
pub(crate) fn staged_worlds<'a>(
    root: &'a GpuWorld,
    root_stage: &'a mut RenderStage,
    others: &'a mut [StudioPart],
) -> Vec<StagedWorld<'a>> {
    let others = others.iter_mut().map(|p| (&*p.world, &mut p.stage));
    std::iter::once((root, root_stage)).chain(others).collect()
}

/// Returns the worlds of `lists`, whose parts ascend.
pub(crate) fn drawn_parts<'a>(
    root: &'a GpuWorld,
    root_stage: &'a mut RenderStage,
    others: &'a mut [StudioPart],
    lists: &'a [(PartId, RenderList)],
) -> Vec<DrawnPart<'a>> {
    let others = others.iter_mut().map(|p| (&*p.world, &mut p.stage));
    let worlds = std::iter::once((root, root_stage)).chain(others);
    let mut lists = lists.iter().peekable();
    let drawn = (0..).map(PartId).zip(worlds).filter_map(|(id, part)| {
        let (_, list) = lists.next_if(|l| l.0 == id)?;
        let (world, stage) = part;
        Some(DrawnPart {
            id,
            world,
            stage,
            list,
        })
    });
    drawn.collect()
}
