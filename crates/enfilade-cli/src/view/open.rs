//! The open window: its contents, and how they are drawn.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use enfilade::cpg::{CellId, PortalId, World};
use enfilade::geom::shown;
use enfilade::runtime::View;
use enfilade::stream::Eye;
use enfilade::world::{PartId, Place, Space};
use enfilade_render::{
    AdapterChoice, Camera, Culling, Frame, Paint, PictureMark, PortalTextureOptions,
    PortalTexturePaint, Prop, SpaceShot, Sparing, Studio, Style,
};
use winit::dpi::PhysicalSize;
use winit::keyboard::KeyCode;
use winit::window::{CursorGrabMode, Window};

use super::editing::Editor;
use super::mode::Mode;
use super::panel::{MapSource, Panel, Shown};
use super::titles::Titles;
use super::walker::{RUN, Walker};
use crate::formats::Format;
use crate::living::{Lived, LivingFile, radar_words};
use crate::output::{Outputs, write_whole};
use crate::render::{add_portal_marks, light, portal_marks};
use enfilade_cli::streamed::{Streamed, cells_in_view, view_of};

/// Time of a frame in which pieces are put on the adapter.
const SLICE: Duration = Duration::from_millis(1);

/// State that exists once the window is open.
pub(super) struct Open {
    pub(super) window: Arc<Window>,
    pub(super) surface: wgpu::Surface<'static>,
    pub(super) config: wgpu::SurfaceConfiguration,
    pub(super) studio: Studio,
    /// The pieces of a packed world.
    pub(super) streamed: Option<Streamed>,
    pub(super) panel: Panel,
    pub(super) walker: Walker,
    pub(super) lived: Lived,
    /// `true` if something lives in the world.
    pub(super) has_company: bool,
    /// `true` if that is so, or if the world has special portals or parts: then it is drawn as a space.
    pub(super) is_living: bool,
    /// `true` if the world is a level that is edited part by part.
    pub(super) is_in_parts: bool,
    pub(super) titles: Titles,
    pub(super) yaw: f32,
    pub(super) pitch: f32,
    pub(super) keys: BTreeSet<KeyCode>,
    /// Position of the pointer, and where it was pressed, in pixels.
    pub(super) pointer: [f64; 2],
    pub(super) pressed_at: Option<[f64; 2]>,
    pub(super) shown: Shown,
    pub(super) mode: Mode,
    /// A file of textures made ahead.
    pub(super) textures_ahead: Option<Vec<u8>>,
    /// Settings of portal textures, until they are on.
    pub(super) texture_options: PortalTextureOptions,
    /// `true` if the pointer is held in the window, and its movements turn the view.
    pub(super) is_captured: bool,
    /// `true` if it should be, while the window has the keyboard.
    pub(super) wants_mouse: bool,
    /// `true` if the light of each place was computed, or cannot be.
    pub(super) has_asked_for_light: bool,
    /// Moving doors: how far their leaves are open now, and at the end.
    pub(super) turning: Vec<((PartId, PortalId), [f32; 2])>,
    pub(super) recorded: Option<Vec<Camera>>,
    pub(super) n_shots: u32,
    pub(super) last: Instant,
    pub(super) props: Vec<Prop>,
}

impl Open {
    /// Holds the pointer in the window, or releases it; returns `true` on success.
    pub(super) fn hold(&mut self, on: bool) -> bool {
        // Some systems lock the pointer in place, others only keep it inside.
        self.is_captured = on
            && (self.window.set_cursor_grab(CursorGrabMode::Locked))
                .or_else(|_| self.window.set_cursor_grab(CursorGrabMode::Confined))
                .is_ok();
        if !self.is_captured {
            // Releasing a free pointer may fail without harm.
            let _ = self.window.set_cursor_grab(CursorGrabMode::None);
        }
        self.window.set_cursor_visible(!self.is_captured);
        self.is_captured == on
    }

    /// Holds or releases the pointer as the user chose, and reports it.
    pub(super) fn capture(&mut self, on: bool) {
        self.wants_mouse = on;
        match (self.hold(on), on) {
            (true, true) => self.say("the mouse is captured; Tab lets go of it".into()),
            (true, false) => self.say("the mouse is free; Tab captures it".into()),
            (false, _) => {
                self.warn("the mouse cannot be captured here: drag to look around".into());
            }
        }
    }

    /// Shows a message in the window, and on standard error for the terminal.
    pub(super) fn say(&mut self, message: String) {
        let _ = writeln!(crate::screen::Told, "enfilade: {message}");
        self.shown.message = message;
    }

    /// Like [`say`](Self::say), for failures.
    pub(super) fn warn(&mut self, message: String) {
        let _ = writeln!(crate::screen::Warned, "enfilade: {message}");
        self.shown.message = message;
    }

    pub(super) fn resize(&mut self, size: PhysicalSize<u32>) {
        let limit = self.studio.gpu.device.limits().max_texture_dimension_2d;
        self.config.width = size.width.clamp(1, limit);
        self.config.height = size.height.clamp(1, limit);
        self.surface
            .configure(&self.studio.gpu.device, &self.config);
    }

    /// Goes on in another world in one piece, as after an edit: its doors are as in its file.
    pub(super) fn show_world(&mut self, world: &Arc<World>) -> anyhow::Result<()> {
        self.studio.replace_world(world)?;
        let space = Space::with_sight(Arc::clone(world), self.studio.sight.clone());
        self.is_living = !world.graph.specials.is_empty() || !world.fixtures.is_empty();
        self.titles = Titles::default();
        self.show_space(space, false)
    }

    /// Goes on in a level of parts, which [`Open::follow_edit`] then keeps as it is edited.
    pub(super) fn show_parts(&mut self, editor: &mut Editor) -> anyhow::Result<()> {
        let space = editor.new_space()?;
        self.studio.replace_world(space.world(PartId::ROOT))?;
        self.is_living = true;
        self.titles = Titles(editor.titles());
        self.show_space(space, true)
    }

    /// Returns `true` if nothing asked for needs the world in one piece: light, or what is made from its list of draws.
    pub(super) fn can_show_parts(&self) -> bool {
        let is_by_list = matches!(self.mode, Mode::PortalTextures | Mode::Queries);
        self.shown.plain && self.shown.paint != Paint::Cells && !is_by_list
    }

    fn show_space(&mut self, space: Space, is_in_parts: bool) -> anyhow::Result<()> {
        self.lived = Lived::in_space(space, LivingFile::default(), Vec::new(), None)?;
        self.lived.furnish(&mut self.studio)?;
        self.is_in_parts = is_in_parts;
        self.has_asked_for_light = false;
        self.turning.clear();
        self.panel.renew_map(is_in_parts);
        self.walker.frame = PartId::ROOT;
        Ok(())
    }

    /// Changes a level of parts by what has changed in the session.
    pub(super) fn follow_edit(&mut self, editor: &mut Editor) -> anyhow::Result<()> {
        editor.follow(&mut self.lived.space)?;
        self.studio.follow_parts(&self.lived.space)?;
        let space = &self.lived.space;
        self.turning
            .retain(|((part, _), _)| space.is_present(*part));
        self.titles = Titles(editor.titles());
        self.lived.forget_radar();
        self.panel.renew_map(true);
        Ok(())
    }

    /// Updates what the radar shows.
    fn scan(&mut self, world: &World) {
        self.shown.blips.clear();
        self.shown.told.clear();
        if self.shown.radar {
            let player = self.walker.player();
            self.shown
                .blips
                .extend_from_slice(self.lived.radar(&player));
            let name = |c: CellId| shown(&world.graph[c].name).to_string();
            self.shown.told = radar_words(&self.shown.blips, name);
        }
    }

    /// Fetches the pieces of a packed world that are in view, or may soon be, and puts some of them on the adapter.
    fn stream(&mut self, view: &View) {
        let position = self.camera_in_root().eye;
        let Some(streamed) = &mut self.streamed else {
            return;
        };
        let (sight, mut cells) = (&self.studio.sight, BTreeMap::new());
        if self.is_living {
            self.props.clear();
            let player = self.walker.player();
            let (_, seen, _) = self.lived.see(&player, view, &mut self.props);
            for seen in seen.contexts().filter_map(|c| c.of_part(PartId::ROOT)) {
                cells_in_view(&seen, sight.n_cells(), &mut cells);
            }
        } else {
            let seen = self.studio.viewer.see(sight, &self.studio.state, view);
            cells_in_view(&seen, sight.n_cells(), &mut cells);
        }
        streamed.look(view_of(&cells));
        let eye = Eye {
            cell: sight.locate(position),
            position,
            speed: RUN,
        };
        streamed.frame(&mut self.studio, eye, SLICE);
        self.shown.streamed = streamed.counts().to_string();
        if let Some(problem) = streamed.problem() {
            self.shown.streamed += "\n";
            self.shown.streamed += &problem;
        }
    }

    /// Makes room for portal textures if the mode uses them; if they cannot be, another mode follows.
    fn begin_textures(&mut self) {
        if self.mode != Mode::PortalTextures {
            return;
        }
        if self.studio.portal_texture_options().is_none() {
            if let Err(why) = (self.studio).add_portal_textures(self.texture_options.clone()) {
                self.mode = Mode::Portals;
                self.warn(format!("no portal textures: {why}"));
                return;
            }
            if let Some(bytes) = &self.textures_ahead {
                match self.studio.load_portal_textures(bytes) {
                    Ok(n) => self.say(format!("{n} portal textures were made ahead")),
                    Err(why) => self.warn(format!("without textures made ahead: {why}")),
                }
            }
        }
        self.studio.paint_portal_textures(self.texture_paint());
    }

    fn texture_paint(&self) -> PortalTexturePaint {
        if self.shown.tints {
            PortalTexturePaint::Tinted
        } else {
            PortalTexturePaint::Plain
        }
    }

    fn style(&self) -> Style {
        Style {
            paint: self.shown.paint,
            dark_corners: !self.shown.plain,
            shadows: !self.shown.plain,
            daylight: !self.shown.plain,
            ..Style::default()
        }
    }

    pub(super) fn draw(
        &mut self,
        world: &World,
        camera: &Camera,
        seconds: f64,
        marks: &mut Vec<PictureMark>,
    ) -> anyhow::Result<()> {
        use wgpu::CurrentSurfaceTexture as Got;
        let size = [self.config.width, self.config.height];
        let target = match self.surface.get_current_texture() {
            Got::Success(t) | Got::Suboptimal(t) => t,
            Got::Outdated | Got::Lost => {
                self.surface
                    .configure(&self.studio.gpu.device, &self.config);
                return Ok(());
            }
            // Hidden or late: draw in the next frame.
            _ => return Ok(()),
        };
        let aspect = size[0] as f32 / size[1] as f32;
        let view = camera.view(aspect)?;
        self.stream(&view);
        if self.shown.portals && !self.is_living {
            marks.extend(portal_marks(&mut self.studio, world, camera, size)?);
        }
        let style = self.style();
        if !self.has_asked_for_light && (style.daylight || style.paint == Paint::Cells) {
            self.has_asked_for_light = true;
            light(&mut self.studio, world)?;
        }
        self.shown.queries = None;
        self.shown.textures = None;
        self.begin_textures();
        self.scan(world);
        if self.is_living {
            return self.draw_living(camera, &view, target, seconds, marks);
        }
        let list = if self.mode == Mode::Queries {
            let (list, counts) = self.studio.list_by_queries(world, camera, size)?;
            self.shown.queries = Some([counts.n_rounds, counts.n_queries]);
            list
        } else {
            let culling = self.mode.culling();
            if culling == Culling::PortalTextures {
                let counts = self.studio.plan_portal_textures(camera, style, size)?;
                self.shown.textures = Some(counts);
            }
            self.studio.take_list(&view, camera.eye, culling, size)
        };
        let output = target
            .texture
            .create_view(&wgpu::TextureViewDescriptor::default());
        let frame = Frame {
            projection: camera.projection(aspect)?,
            list: &list,
            style,
            marks,
        };
        self.studio.draw(&frame, &output, size)?;
        let seen = self
            .studio
            .viewer
            .see(&self.studio.sight, &self.studio.state, &view);
        self.shown.cells = seen.cells().iter().map(|c| c.0).collect();
        self.shown.cells.sort_unstable();
        self.shown.seconds(seconds);
        self.shown.counts = [
            list.n_triangles(),
            self.studio.world.n_triangles(),
            list.n_draws() as u64,
        ];
        self.shown.camera = Some(*camera);
        self.shown.mode = self.mode;
        let shut = self.studio.state.shut_portals();
        self.shown.closed = shut.map(|p| (PartId::ROOT, p)).collect();
        self.shown.is_recording = self.recorded.is_some();
        self.shown.flies = self.walker.flies;
        self.studio.give_list(list);
        self.panel.draw(
            &self.studio.gpu,
            &self.window,
            &output,
            size,
            &MapSource {
                space: &self.lived.space,
                titles: &self.titles,
            },
            &self.shown,
        );
        self.window.pre_present_notify();
        self.studio.gpu.queue.present(target);
        Ok(())
    }

    /// Draws a world that is lived in: all of its parts, people, lamps.
    fn draw_living(
        &mut self,
        camera: &Camera,
        view: &View,
        target: wgpu::SurfaceTexture,
        seconds: f64,
        marks: &[PictureMark],
    ) -> anyhow::Result<()> {
        let size = [self.config.width, self.config.height];
        let output = target
            .texture
            .create_view(&wgpu::TextureViewDescriptor::default());
        let player = self.walker.player();
        let (style, outside) = (self.style(), self.camera_in_root());
        self.props.clear();
        let is_textured = self.mode == Mode::PortalTextures;
        if is_textured {
            let shot = SpaceShot {
                space: &self.lived.space,
                frame: player.frame,
                camera: *camera,
                seen: None,
                style,
                marks: &[],
                props: &[],
                lamps: None,
            };
            self.shown.textures = Some(self.studio.plan_space_textures(&shot, size)?);
        }
        let stops = self.studio.portal_texture_stops().filter(|_| is_textured);
        let behind = self.studio.cells_in_portal_textures();
        let (space, seen, lamps) =
            (self.lived).see_to(&player, view, &mut self.props, stops.map(|s| (s, behind)));
        self.shown.cells.clear();
        self.shown.closed.clear();
        let mut marks = marks.to_vec();
        for (part, seen) in seen.parts() {
            let numbers = seen.cells().iter();
            let numbers = numbers.map(|cell| space.cell_number(Place { part, cell: *cell }));
            self.shown.cells.extend(numbers);
            let shut = space.state(part).shut_portals();
            self.shown.closed.extend(shut.map(|portal| (part, portal)));
            if self.shown.portals {
                let of = (&**space.world(part), &space.between(part, player.frame));
                add_portal_marks(&mut marks, of.0, of.1, &seen, camera, size);
            }
        }
        self.shown.cells.sort_unstable();
        let is_culled = matches!(
            self.mode.culling(),
            Culling::Portals | Culling::PortalTextures
        );
        let counts = self.studio.draw_space(
            &SpaceShot {
                space,
                frame: player.frame,
                camera: *camera,
                seen: is_culled.then_some(seen),
                style,
                marks: &marks,
                props: &self.props,
                lamps: Some(if self.shown.plain { &[] } else { lamps }),
            },
            &output,
            size,
        )?;
        self.shown.seconds(seconds);
        self.shown.counts = [
            counts.n_triangles,
            self.studio.n_triangles_in(&self.lived.space),
            counts.n_draws as u64,
        ];
        self.shown.camera = Some(outside);
        self.shown.mode = self.mode;
        self.shown.is_recording = self.recorded.is_some();
        self.shown.flies = self.walker.flies;
        if self.has_company {
            self.shown.living = self.lived.words(&player);
        }
        let (gpu, window) = (&self.studio.gpu, &self.window);
        self.panel.draw(
            gpu,
            window,
            &output,
            size,
            &MapSource {
                space: &self.lived.space,
                titles: &self.titles,
            },
            &self.shown,
        );
        self.window.pre_present_notify();
        self.studio.gpu.queue.present(target);
        Ok(())
    }

    /// Writes a picture of the world as shown now, without the panel; `marks` are drawn into a world in one piece.
    pub(super) fn shot(
        &mut self,
        screenshot: &Path,
        adapter: &AdapterChoice,
        world: &World,
        marks: &[PictureMark],
        outputs: &mut Outputs,
    ) -> anyhow::Result<()> {
        self.n_shots += 1;
        let stem = screenshot.file_stem().unwrap_or_default().to_string_lossy();
        let to = screenshot.with_file_name(format!("{stem}-{}.png", self.n_shots));
        let camera = self.camera();
        // In a separate studio: pictures of a window cannot be read back.
        let gpu = enfilade_cli::adapter::open(adapter)?;
        let mut studio = match &self.streamed {
            Some(streamed) => {
                let state = (self.studio.sight.clone(), self.studio.state.clone());
                let (packed, view) = (streamed.packed().clone(), streamed.in_view().to_vec());
                let opened = Streamed::for_views(
                    packed,
                    gpu,
                    state.0,
                    state.1,
                    std::slice::from_ref(&view),
                )?;
                let (mut studio, mut streamed) = opened;
                streamed.look(view);
                streamed.settle(&mut studio, Eye::default())?;
                studio
            }
            None => Studio::new(gpu, world)?,
        };
        studio.state = self.studio.state.clone();
        studio.sparing = Sparing {
            // Its levels would have to be rebuilt.
            lod: 0.0,
            ..self.studio.sparing
        };
        let has_light = self.style().daylight || self.shown.paint == Paint::Cells;
        if has_light && self.streamed.is_none() {
            light(&mut studio, world)?;
        }
        let size = [self.config.width, self.config.height];
        let picture = if self.is_living {
            self.lived.furnish(&mut studio)?;
            let (frame, style) = (self.walker.frame, self.style());
            self.lived
                .picture(&mut studio, frame, &camera, style, size)?
        } else {
            if self.mode == Mode::PortalTextures && self.streamed.is_none() {
                studio.add_portal_textures(PortalTextureOptions {
                    // There is one frame for all of them.
                    max_made: u32::MAX,
                    ..self.texture_options.clone()
                })?;
                studio.paint_portal_textures(self.texture_paint());
            }
            studio.picture(&camera, self.mode.culling(), self.style(), marks, size)?
        };
        let png = picture.to_png()?;
        outputs.write("--screenshot", Format::Picture, &to)?;
        write_whole(&to, &png)?;
        let [drawn, ..] = self.shown.counts;
        self.say(format!("wrote {}, {drawn} triangles", to.display()));
        Ok(())
    }
}
