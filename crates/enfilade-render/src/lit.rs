//! The lamps of a picture: their choice, and the upkeep of their maps.

use enfilade_cpg::{CellId, PortalId};
use enfilade_runtime::{Seen, Sight, SightState, View, Viewer};
use enfilade_world::{PartId, Pose, Space, SpaceSeen, SpaceViewer};
use glam::{DVec3, Vec3};
use wgpu::util::DeviceExt;

use crate::frame::{Paint, Style};
use crate::gpu::{Gpu, RenderError};
use crate::lamps::{
    ActiveLamp, LampEvent, LampLight, LampOptions, LampReach, MOST_LAMPS, WatchedPart,
    brightness_at, chosen_lamps, face_projection,
};
use crate::list::{RenderList, Shot, Sparing};
use crate::piece_of::PieceOf;
use crate::renderer::Renderer;
use crate::resources::depth_attachment;
use crate::scene::GpuWorld;
use crate::shadings::set_buffers;
use crate::shown::DrawnPart;
use crate::space::SpaceShot;
use crate::stage::{Exposed, Globals};
use crate::studio::{Studio, drawn_parts, world_of};

/// Distance of the parameters of draws in a buffer, as adapters need it. [Units: bytes]
const ALIGNED: usize = 512;

impl Studio {
    /// Sets the lamps, in place of those before. Those that are not finite, or whose range is not above 0, do not shine.
    /// Lamps that stay as they were keep their maps.
    ///
    /// # Errors
    ///
    /// More maps than the adapter can hold; see [`Studio::set_lamp_options`].
    pub fn set_lamps(&mut self, lights: Vec<LampLight>) -> Result<(), RenderError> {
        self.lamps.lights = lights;
        self.reserve_lamps()
    }

    /// Returns the lamps.
    #[must_use]
    pub fn lamps(&self) -> &[LampLight] {
        &self.lamps.lights
    }

    /// Sets the number and quality of lamps in a picture.
    ///
    /// # Errors
    ///
    /// More maps than the adapter can hold.
    #[doc(hidden)]
    pub fn set_lamp_options(&mut self, options: LampOptions) -> Result<(), RenderError> {
        self.lamps.options = options;
        self.reserve_lamps()
    }

    fn reserve_lamps(&mut self) -> Result<(), RenderError> {
        let most = self.lamps.options.most.min(MOST_LAMPS);
        let n = self.lamps.lights.len().min(most);
        let is_new = (self.renderer.lamps).reserve(&self.gpu, n, &self.lamps.options)?;
        if is_new {
            self.renderer.bind(&self.gpu, &mut self.stage);
            for part in &mut self.parts {
                self.renderer.bind(&self.gpu, &mut part.stage);
            }
        }
        Ok(())
    }

    /// Returns the lamps of a frame, with current maps. `eye` is in the frame of the first world.
    pub(crate) fn active_lamps(
        &mut self,
        space: Option<&Space>,
        style: &Style,
        eye: DVec3,
        chosen: Option<&[u32]>,
    ) -> Vec<ActiveLamp> {
        if self.lamps.lights.is_empty() || !style.daylight || style.paint == Paint::Overdraw {
            return Vec::new();
        }
        self.follow_lamps(space);
        let n_parts = space.map_or(1, Space::n_parts) as u32;
        let most = self.lamps.options.most.min(MOST_LAMPS);
        let shines = |l: &LampLight| {
            l.part.0 < n_parts && l.range > 0.0 && l.range.is_finite() && l.point().is_finite()
        };
        let brightness = |l: &LampLight| {
            let pose = shines(l).then(|| self.stage_of(l.part).pose);
            pose.map_or(-1.0, |pose| brightness_at(l, &pose, eye))
        };
        let ids = chosen_lamps(&self.lamps.lights, chosen, most, brightness);
        let lights = ids.iter().map(|i| self.lamps.lights[*i as usize]);
        let lights: Vec<LampLight> = lights.filter(shines).collect();
        let slots = self.renderer.lamps.assign(&lights);
        let mut out = Vec::new();
        for (light, (slot, is_due)) in lights.into_iter().zip(slots) {
            let pose = self.stage_of(light.part).pose;
            let layer = 6 * slot as u32;
            let lamp = ActiveLamp { light, pose, layer };
            if is_due {
                self.draw_lamp(space, &lamp, slot);
            }
            out.push(lamp);
        }
        out
    }

    /// Returns the lamps of a view of a space: those that the caller chooses, or of the brightest at the eye those that reach
    /// a cell in view.
    pub(crate) fn space_lamps(
        &mut self,
        shot: &SpaceShot<'_>,
        seen: Option<SpaceSeen<'_>>,
    ) -> Vec<ActiveLamp> {
        let eye = Vec3::from(shot.camera.eye).as_dvec3();
        let eye = shot.space.pose(shot.frame).point(eye);
        let mut lamps = self.active_lamps(Some(shot.space), &shot.style, eye, shot.lamps);
        let seen = seen.filter(|_| shot.seen.is_some() && shot.lamps.is_none());
        let Some(seen) = seen else {
            return lamps;
        };
        let visible: LampReach = (seen.contexts())
            .flat_map(|context| context.parts())
            .map(|(id, seen)| {
                let (world, space) = (world_of(&self.world, &self.parts, id), shot.space);
                let cells = cells_of(&seen, world, space.sight(id), space.state(id));
                (id, cells)
            })
            .collect();
        lamps.retain(|lamp| self.renderer.lamps.reaches(lamp, &visible));
        lamps
    }

    /// Draws the map of a lamp.
    fn draw_lamp(&mut self, space: Option<&Space>, lamp: &ActiveLamp, slot: usize) {
        let (mut lists, reach) = self.reached(space, &lamp.light);
        if !self.lamps.options.is_culled {
            let ids = (0..space.map_or(1, Space::n_parts) as u32).map(PartId);
            lists = ids.map(|id| (id, self.everything_of(space, id))).collect();
        }
        let mut parts = drawn_parts(&self.world, &mut self.stage, &mut self.parts, &lists);
        self.renderer.draw_lamp(&self.gpu, &mut parts, lamp, slot);
        self.renderer.lamps.set_current(slot, reach);
    }

    /// Returns what a lamp reaches: lists of draws and cells, by part.
    pub(crate) fn reached(
        &mut self,
        space: Option<&Space>,
        light: &LampLight,
    ) -> (Vec<(PartId, RenderList)>, LampReach) {
        let (mut lists, mut reach) = (Vec::new(), Vec::new());
        let Ok(view) = View::around(light.at).and_then(|v| v.with_far(light.range)) else {
            return (lists, reach);
        };
        let sparing = Sparing::default();
        let size = [1, 1];
        let has_scissors = false;
        let Some(space) = space else {
            let viewer = (self.lamps.viewer).get_or_insert_with(|| Viewer::new(&self.sight));
            let seen = viewer.see(&self.sight, &self.state, &view);
            let shot = Shot {
                view: &view,
                state: &self.state,
                size,
                has_scissors,
            };
            (self.lister).seen(&self.world, &self.sight, &seen, &shot, &sparing);
            lists.push((PartId::ROOT, self.lister.take()));
            let cells = cells_of(&seen, &self.world, &self.sight, &self.state);
            reach.push((PartId::ROOT, cells));
            return (lists, reach);
        };
        let viewer = (self.lamps.space_viewer).get_or_insert_with(|| SpaceViewer::new(space));
        for (id, seen) in viewer.see(space, light.part, &view).parts() {
            let shot = Shot {
                view: &view,
                state: space.state(id),
                size,
                has_scissors,
            };
            let world = world_of(&self.world, &self.parts, id);
            (self.lister).seen(world, space.sight(id), &seen, &shot, &sparing);
            lists.push((id, self.lister.take()));
            let cells = cells_of(&seen, world, space.sight(id), space.state(id));
            reach.push((id, cells));
        }
        (lists, reach)
    }

    /// Finds the doors and parts that have changed since the last frame, and the maps that show them.
    fn follow_lamps(&mut self, space: Option<&Space>) {
        let n_parts = space.map_or(1, Space::n_parts);
        if self.lamps.watched.len() != n_parts {
            (self.renderer.lamps).follow(&LampEvent::All, |_| Pose::IDENTITY);
            self.lamps.watched.clear();
        }
        for i in 0..n_parts {
            let id = PartId(i as u32);
            let state = space.map_or(&self.state, |s| s.state(id));
            let pose = self.stage_of(id).pose;
            let Some(old) = self.lamps.watched.get(i) else {
                self.lamps.watched.push(WatchedPart {
                    shares: state.shares().to_vec(),
                    shut: state.shut_portals().collect(),
                    pose,
                });
                continue;
            };
            let is_same = old.pose == pose
                && old.shares == state.shares()
                && state.shut_portals().eq(old.shut.iter().copied());
            if is_same {
                continue;
            }
            let new = WatchedPart {
                shares: state.shares().to_vec(),
                shut: state.shut_portals().collect(),
                pose,
            };
            let old = std::mem::replace(&mut self.lamps.watched[i], new);
            self.part_changed(id, &old);
        }
    }

    /// Marks the maps of lamps that reach a piece of the first world.
    pub(crate) fn piece_changed(&mut self, of: PieceOf) {
        let cells;
        let event = if self.lamps.lights.is_empty() {
            LampEvent::All
        } else {
            cells = self.world.cells_of_piece(of);
            LampEvent::Doors(PartId::ROOT, &cells)
        };
        self.renderer.lamps.follow(&event, |_| Pose::IDENTITY);
    }

    fn part_changed(&mut self, id: PartId, old: &WatchedPart) {
        let world = world_of(&self.world, &self.parts, id);
        let new = &self.lamps.watched[id.0 as usize];
        let changed = |a: &[PortalId], b: &[PortalId]| -> Vec<PortalId> {
            let is_new = |p: &&PortalId| b.binary_search(p).is_err();
            a.iter().filter(is_new).copied().collect()
        };
        let portals = [changed(&old.shut, &new.shut), changed(&new.shut, &old.shut)].concat();
        let mut cells: Vec<CellId> = (portals.iter())
            .flat_map(|p| world.portal_cells[p.0 as usize])
            .collect();
        for (k, (a, b)) in old.shares.iter().zip(&new.shares).enumerate() {
            if a != b {
                cells.extend(world.cells_of_leaf(k));
            }
        }
        let [low, high] = world.bounds;
        let middle = ((low + high) * 0.5).as_dvec3();
        let centers = [old.pose, new.pose].map(|pose| pose.point(middle));
        let radius = f64::from((high - low).length() * 0.5);
        let has_moved = old.pose != new.pose;
        let stages: Vec<Pose> = (0..=self.parts.len() as u32)
            .map(|i| self.stage_of(PartId(i)).pose)
            .collect();
        let pose = |part: PartId| stages.get(part.0 as usize).copied().unwrap_or_default();
        let maps = &mut self.renderer.lamps;
        maps.follow(&LampEvent::Doors(id, &cells), pose);
        if has_moved {
            maps.follow(&LampEvent::Moved(id, centers, radius), pose);
        }
    }
}

/// Returns the cells whose air or surfaces are seen, ascending; all for an eye in none.
fn cells_of(seen: &Seen<'_>, world: &GpuWorld, sight: &Sight, state: &SightState) -> Vec<CellId> {
    let counts = seen.counts();
    if counts.is_eye_lost || counts.is_capped {
        return (0..sight.n_cells() as u32).map(CellId).collect();
    }
    let mut cells = seen.cells().to_vec();
    cells.sort_unstable();
    let n = cells.len();
    // A shut leaf stands in the cells on both sides of its portal.
    for portal in state.shut_portals() {
        let ends = world.portal_cells[portal.0 as usize];
        let is_beside = ends.iter().any(|c| cells[..n].binary_search(c).is_ok());
        if is_beside && !sight.leaves(portal).is_empty() {
            cells.extend(ends);
        }
    }
    cells.sort_unstable();
    cells.dedup();
    cells
}

impl Renderer {
    /// Draws the six faces of a lamp's map.
    fn draw_lamp(&self, gpu: &Gpu, parts: &mut [DrawnPart<'_>], lamp: &ActiveLamp, slot: usize) {
        let exposed = Exposed {
            style: &Style::default(),
            size: [1, 1],
            sun: self.sun,
            exposure: 1.0,
            day: 1.0,
            lamps: &[],
        };
        let layers = self.lamps.layers(slot);
        let side = self.lamps.options().side.max(8);
        let mut bytes = Vec::new();
        for face in 0..layers.len() {
            let own = face_projection(&lamp.light, face, side);
            for part in &*parts {
                let motion = lamp.pose.inverse().after(&part.stage.pose);
                let projection = own.in_frame(&motion);
                let globals = Globals::new(&projection, &part.stage.pose, &exposed);
                bytes.extend_from_slice(bytemuck::bytes_of(&globals));
                bytes.resize(bytes.len().next_multiple_of(ALIGNED), 0);
            }
        }
        let buffer = gpu
            .device
            .create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("lamp"),
                contents: &bytes,
                usage: wgpu::BufferUsages::UNIFORM,
            });
        for part in &mut *parts {
            part.stage.write_instances(gpu, part.world, part.list);
        }
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (face, layer) in layers.iter().enumerate() {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("lamp"),
                depth_stencil_attachment: Some(depth_attachment(layer, Some(1.0))),
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_pipeline(&self.pipelines.lamp);
            for (i, part) in parts.iter().enumerate() {
                let offset = ((face * parts.len() + i) * ALIGNED) as u64;
                let group = self.globals_at(gpu, &buffer, offset);
                pass.set_bind_group(0, &group, &[]);
                set_buffers(&mut pass, part.world, &part.stage.first().instances);
                for run in &part.list.opaque {
                    pass.draw_indexed(run.first..run.first + run.n, 0, run.instances.clone());
                }
            }
        }
        gpu.queue.submit([encoder.finish()]);
    }

    fn globals_at(&self, gpu: &Gpu, buffer: &wgpu::Buffer, offset: u64) -> wgpu::BindGroup {
        let size = std::num::NonZeroU64::new(size_of::<Globals>() as u64);
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("lamp"),
            layout: &self.layouts.globals,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer,
                    offset,
                    size,
                }),
            }],
        })
    }
}
