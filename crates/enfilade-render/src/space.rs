//! Pictures of a world and of the worlds that move in it.
//!
//! Each part of a [`Space`] is drawn in its own frame, by the same camera in that frame's coordinates: a part ten kilometers
//! away is as exact as a near one. All parts share one depth, one sun with its shadows, one sky and one exposure.

use std::fmt;
use std::sync::Arc;

use enfilade_cpg::World;
use enfilade_runtime::{Sight, View};
use enfilade_world::{PartId, Pose, Space, SpaceSeen, SpaceViewer};
use glam::{DVec3, Vec3};

use crate::camera::Camera;
use crate::copies::{PropCopy, copies};
use crate::frame::Style;
use crate::gpu::RenderError;
use crate::lamps::ActiveLamp;
use crate::light::Light;
use crate::list::{RenderList, Shot, Sparing};
use crate::marks::PictureMark;
use crate::picture::Picture;
use crate::prop::{Prop, PropMesh};
use crate::renderer::read_picture;
use crate::scene::GpuWorld;
use crate::shown::Shown;
use crate::studio::{Studio, StudioPart, drawn_parts, staged_worlds, world_of};

/// A view of a space of worlds.
#[derive(Clone, Copy, Debug)]
pub struct SpaceShot<'a> {
    /// The worlds, their poses and their doors.
    pub space: &'a Space,
    /// The part in whose frame the camera and the marks are.
    pub frame: PartId,
    /// The camera.
    pub camera: Camera,
    /// The answer to draw, to [this view](Camera::view) in the same frame, with what it sees in special portals; `None` draws
    /// everything of all parts, and in special portals what is seen there.
    pub seen: Option<SpaceSeen<'a>>,
    /// The style.
    pub style: Style,
    /// Lines and polygons drawn over the picture.
    pub marks: &'a [PictureMark],
    /// Things; of parts that are not seen they are left out.
    pub props: &'a [Prop],
    /// Indices of the lamps that shine, for example those [that matter](enfilade_world::Lights::that_matter); `None` for
    /// those of the brightest at the eye that reach a cell in view.
    pub lamps: Option<&'a [u32]>,
}

/// The contents of a drawn picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SpaceCounts {
    /// Drawn parts.
    pub n_parts: usize,
    /// Drawn triangles, without props.
    pub n_triangles: u64,
    /// Draws, without those of props.
    pub n_draws: usize,
    /// Contexts: the direct view, and what special portals show.
    pub n_contexts: usize,
    /// Special portals in view that show one color, or nothing: too small, or one too many.
    pub n_left_out: usize,
}

impl Studio {
    /// Uploads the worlds that stand in the studio's, or what has changed of them: after parts were added, or are others. The root is
    /// the studio's own world. Copies of a part are uploaded once. O(parts), and the size of each new world.
    ///
    /// # Errors
    ///
    /// As [`Studio::new`].
    pub fn follow_parts(&mut self, space: &Space) -> Result<(), RenderError> {
        for id in (1..space.n_parts() as u32).map(PartId) {
            let (at, of) = (id.0 as usize - 1, space.world(id));
            let known = self.parts.get(at);
            if known.is_some_and(|known| Arc::ptr_eq(&known.of, of)) {
                continue;
            }
            let twin = self.parts.iter().find(|part| Arc::ptr_eq(&part.of, of));
            let world = match twin {
                // Leaves are placed anew for each frame.
                Some(twin) => Arc::clone(&twin.world),
                None => Arc::new(GpuWorld::load(&self.gpu, of, space.sight(id))?),
            };
            let part = StudioPart {
                of: Arc::clone(of),
                placed: twin.map_or_else(Vec::new, |twin| twin.placed.clone()),
                world,
                stage: self.renderer.stage(&self.gpu, Light::uniform(&self.gpu)?),
            };
            match self.parts.get_mut(at) {
                Some(known) => *known = part,
                None => self.parts.push(part),
            }
            self.shadows_of = None;
        }
        Ok(())
    }

    /// Returns the number of triangles of structure and placed objects of all worlds that are present in a space.
    #[must_use]
    #[doc(hidden)]
    pub fn n_triangles_in(&self, space: &Space) -> u64 {
        let parts = (1..).map(PartId).zip(&self.parts);
        let present = parts.filter(|(id, _)| space.is_present(*id));
        let own = present.map(|(_, part)| part.world.n_triangles());
        self.world.n_triangles() + own.sum::<u64>()
    }

    /// Computes daylight in a part, as [`Studio::add_light`] does for the first world: that of a place outdoors, which
    /// pictures dim to the light of the room in which the part stands.
    ///
    /// # Errors
    ///
    /// As [`Studio::add_light`].
    #[doc(hidden)]
    pub fn add_part_light(
        &mut self,
        part: PartId,
        world: &World,
        sight: &Sight,
    ) -> Result<(), RenderError> {
        let toward = self.renderer.sun.toward;
        if let Some(own) = self.parts.get_mut((part.0 as usize).wrapping_sub(1)) {
            let light = Light::of_world(&self.gpu, world, sight, toward)?;
            own.stage = self.renderer.stage(&self.gpu, light);
        }
        Ok(())
    }

    /// Adds a mesh for [props](Prop): its triangles and its normals, if it has any.
    pub fn add_prop_mesh(&mut self, mesh: &enfilade_geom::scene::Primitive) -> PropMesh {
        self.renderer.props.add(&self.gpu, mesh)
    }

    /// Draws a view of a space to a texture of the studio's format. The doors are those of the space,
    /// not [`Studio::state`].
    ///
    /// # Errors
    ///
    /// A camera without direction; a size beyond the adapter's limit.
    ///
    /// # Panics
    ///
    /// If the space has parts that were not [followed](Studio::follow_parts).
    pub fn draw_space(
        &mut self,
        shot: &SpaceShot<'_>,
        output: &wgpu::TextureView,
        size: [u32; 2],
    ) -> Result<SpaceCounts, RenderError> {
        self.place_parts(shot.space);
        self.cast_sun(shot);
        if let Some(counts) = self.draw_contexts(shot, output, size)? {
            return Ok(counts);
        }
        let mut lists = self.space_lists(shot, size)?;
        let lamps = self.space_lamps(shot, shot.seen);
        let props = self.prop_copies(shot);
        let mut shown = self.space_shown(shot, &lamps, &props, size)?;
        let mut textures = self.portal_textures.take();
        if let (Some(own), Some((PartId::ROOT, list))) = (&mut textures, lists.first_mut())
            && std::mem::take(&mut own.is_planned)
        {
            own.sort_out(list);
            shown = self.with_textures(shown, Some(own), list);
        }
        let mut parts = drawn_parts(&self.world, &mut self.stage, &mut self.parts, &lists);
        let drawn = (self.renderer).draw(&self.gpu, &mut parts, &shown, output, size);
        self.portal_textures = textures;
        drawn?;
        let missed = |s: SpaceSeen<'_>| s.contexts().len() - 1 + s.stopped_specials().len();
        let is_without = !self.gpu.has_stencil();
        Ok(SpaceCounts {
            n_left_out: shot.seen.filter(|_| is_without).map_or(0, missed),
            ..counts(&lists)
        })
    }

    /// Draws a view with special portals in it; `None` without any, or if the adapter cannot.
    fn draw_contexts(
        &mut self,
        shot: &SpaceShot<'_>,
        output: &wgpu::TextureView,
        size: [u32; 2],
    ) -> Result<Option<SpaceCounts>, RenderError> {
        let space = shot.space;
        let mut ids = (0..space.n_parts() as u32).map(PartId);
        let has_specials = ids.any(|id| !space.world(id).graph.specials.is_empty());
        if !has_specials || !self.gpu.has_stencil() {
            return Ok(None);
        }
        let view = shot.camera.view(size[0] as f32 / size[1] as f32)?;
        let mut viewer = match shot.seen {
            Some(_) => None,
            None => Some(
                self.special_viewer
                    .take()
                    .unwrap_or_else(|| SpaceViewer::new(space)),
            ),
        };
        let answer = match (shot.seen, &mut viewer) {
            (None, Some(viewer)) => Some(viewer.see(space, shot.frame, &view)),
            (seen, _) => seen,
        };
        let Some(answer) = answer else {
            return Ok(None);
        };
        let drawn = match self.tree(shot, answer, shot.seen.is_none(), size)? {
            Some(tree) => {
                let lamps = self.space_lamps(shot, Some(answer));
                let props = self.prop_copies(shot);
                let shown = self.space_shown(shot, &lamps, &props, size)?;
                let mut worlds = staged_worlds(&self.world, &mut self.stage, &mut self.parts);
                (self.renderer).draw_tree(&self.gpu, &mut worlds, &tree, &shown, output)?;
                Some(tree.counts())
            }
            None => None,
        };
        if viewer.is_some() {
            self.special_viewer = viewer;
        }
        Ok(drawn)
    }

    /// Draws a picture of a space.
    ///
    /// # Errors
    ///
    /// As [`Studio::draw_space`]; a device that was lost.
    pub fn space_picture(
        &mut self,
        shot: &SpaceShot<'_>,
        size: [u32; 2],
    ) -> Result<(Picture, SpaceCounts), RenderError> {
        let target = self.renderer.picture_target(&self.gpu, size)?;
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        let counts = self.draw_space(shot, &view, size)?;
        Ok((read_picture(&self.gpu, &target, size)?, counts))
    }

    pub(crate) fn place_parts(&mut self, space: &Space) {
        let n = space.n_parts();
        assert!(n <= self.parts.len() + 1, "each part of a space was added");
        if self.placed != space.state(PartId::ROOT).shares() {
            self.placed = space.state(PartId::ROOT).shares().to_vec();
            self.world.place(space.state(PartId::ROOT));
            self.shadows_of = None;
        }
        for i in 1..n {
            let id = PartId(i as u32);
            let (host, pose) = (space.host(id), *space.pose(id));
            let [low, high] = self.parts[i - 1].world.bounds;
            let middle = pose.point(((low + high) * 0.5).as_dvec3());
            let brightness = self.brightness(host, middle);
            let part = &mut self.parts[i - 1];
            part.stage.pose = pose;
            part.stage.surroundings = brightness;
            if part.placed != space.state(id).shares() {
                part.placed = space.state(id).shares().to_vec();
                Arc::make_mut(&mut part.world).place(space.state(id));
                self.shadows_of = None;
            }
        }
    }

    /// Returns the brightness in a part at a point of the root's frame, relative to the outdoors.
    fn brightness(&self, part: PartId, p: DVec3) -> f32 {
        let stage = self.stage_of(part);
        let own = stage.pose.point_back(p).as_vec3();
        let inside = stage.light.brightness_at(own);
        inside.map_or(1.0, |b| b.min(1.0)) * stage.surroundings
    }

    /// Draws the map of the sun's shadows unless it is current. Parts in rooms cast none.
    pub(crate) fn cast_sun(&mut self, shot: &SpaceShot<'_>) {
        if !self.drawable(shot.style).shadows {
            return;
        }
        let casts = |p: &StudioPart| (p.stage.surroundings >= 1.0).then_some(p.stage.pose);
        let n_beside = shot.space.n_parts() - 1;
        let cast: Vec<Option<Pose>> = std::iter::once(Some(Pose::IDENTITY))
            .chain(self.parts[..n_beside].iter().map(casts))
            .collect();
        if self.shadows_of.as_ref() == Some(&cast) {
            return;
        }
        let casting = (0..).map(PartId).zip(&cast);
        let casting = casting.filter(|(_, pose)| pose.is_some());
        let lists: Vec<_> = casting
            .map(|(id, _)| (id, self.everything_of(Some(shot.space), id)))
            .collect();
        let mut parts = drawn_parts(&self.world, &mut self.stage, &mut self.parts, &lists);
        self.renderer.draw_shadows(&self.gpu, &mut parts);
        self.shadows_of = Some(cast);
    }

    /// Lists the draws of each part in view.
    fn space_lists(
        &mut self,
        shot: &SpaceShot<'_>,
        size: [u32; 2],
    ) -> Result<Vec<(PartId, RenderList)>, RenderError> {
        let view = shot.camera.view(size[0] as f32 / size[1] as f32)?;
        let space = shot.space;
        let Some(answer) = shot.seen else {
            let ids = (0..space.n_parts() as u32).map(PartId);
            return Ok(ids
                .map(|id| (id, self.everything_of(Some(space), id)))
                .collect());
        };
        let sparing = Sparing {
            stop_below: 0.0,
            ..self.sparing
        };
        let lists = answer.parts().map(|(id, seen)| {
            let world = world_of(&self.world, &self.parts, id);
            let own = view_in(space, id, shot.frame, &view);
            let of_part = Shot {
                view: &own,
                state: space.state(id),
                size,
                has_scissors: true,
            };
            (self.lister).seen(world, space.sight(id), &seen, &of_part, &sparing);
            (id, self.lister.take())
        });
        Ok(lists.collect())
    }

    /// Returns the props, on both sides of special portals.
    fn prop_copies(&self, shot: &SpaceShot<'_>) -> Vec<PropCopy> {
        let sphere = |mesh| self.renderer.props.sphere(mesh);
        copies(shot.space, shot.props, sphere)
    }

    /// Returns the frame apart from its worlds.
    fn space_shown<'s>(
        &self,
        shot: &SpaceShot<'s>,
        lamps: &'s [ActiveLamp],
        props: &'s [PropCopy],
        size: [u32; 2],
    ) -> Result<Shown<'s>, RenderError> {
        let projection = shot.camera.projection(size[0] as f32 / size[1] as f32)?;
        let eye = Vec3::from(shot.camera.eye).as_dvec3();
        let exposure = self.exposure(shot, shot.frame, eye);
        Ok(Shown {
            projection,
            pose: *shot.space.pose(shot.frame),
            style: self.drawable(shot.style),
            marks: shot.marks,
            props,
            lamps,
            day: self.day,
            exposure,
            textures: None,
        })
    }

    /// Returns the exposure of pictures of an eye in the frame of a part.
    pub(crate) fn exposure(&self, shot: &SpaceShot<'_>, frame: PartId, eye: DVec3) -> f32 {
        if !shot.style.daylight {
            return 1.0;
        }
        let place = shot.space.locate(frame, eye);
        let stage = self.stage_of(place.map_or(frame, |p| p.part));
        let pose = shot.space.pose(frame);
        let own = stage.pose.point_back(pose.point(eye)).as_vec3();
        stage.light.exposure(own, stage.surroundings)
    }
}

/// Returns a view of a part's frame, given in another's.
pub(crate) fn view_in(space: &Space, part: PartId, frame: PartId, view: &View) -> View {
    view.in_frame(&space.between(part, frame).into())
}

fn counts(lists: &[(PartId, RenderList)]) -> SpaceCounts {
    let mut counts = SpaceCounts {
        n_parts: lists.len(),
        n_contexts: 1,
        ..SpaceCounts::default()
    };
    for (_, list) in lists {
        counts.n_triangles += list.n_triangles();
        counts.n_draws += list.n_draws();
    }
    counts
}

impl fmt::Debug for Studio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Studio")
            .field("gpu", &self.gpu)
            .field("day", &self.day)
            .finish_non_exhaustive()
    }
}
