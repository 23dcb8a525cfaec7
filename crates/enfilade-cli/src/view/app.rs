//! The program in the window: events, keys, frames.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use enfilade::cpg::World;
use enfilade::geom::DVec3;
use enfilade::runtime::Target;
use enfilade::world::{PartId, Pose, Space};
use enfilade_render::{
    Camera, FOV, Paint, PortalTextureOptions, Sparing, Studio, good_camera, portal_looked_at,
};
use winit::application::ApplicationHandler;
use winit::event::{
    DeviceEvent, DeviceId, ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent,
};
use winit::event_loop::ActiveEventLoop;
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::WindowId;

use super::args::View;
use super::bare::BareWindow;
use super::editing::{EditKey, Editor, Strip, edit_key};
use super::mode::Mode;
use super::open::Open;
use super::panel::{Panel, Shown};
use super::pointed::{FAR, Pointed};
use super::reviewing::{Reviewer, review_key};
use super::strider::start_in;
use super::titles::Titles;
use super::walker::Walker;
use crate::formats::Format;
use crate::living::{Lived, STEP};
use crate::output::{Outputs, write_whole};
use enfilade_cli::cameras::path_text;
use enfilade_cli::streamed::{Packed, Streamed};

/// Reach of a click, in lengths of the view direction.
const CLICK: f32 = 30.0;

pub(super) struct App<'a> {
    pub(super) args: &'a View,
    /// Hollow if it is streamed.
    pub(super) world: Arc<World>,
    pub(super) packed: Option<Packed>,
    /// Until the window opens.
    pub(super) lived: Option<Lived>,
    /// Cameras still to show.
    pub(super) path: Option<VecDeque<Camera>>,
    /// Files read, and files written in this walk.
    pub(super) outputs: Outputs,
    /// The editor, if the world is edited.
    pub(super) editor: Option<Editor>,
    /// The reviewer, if a decimation is reviewed, and the number of frames until it bakes.
    pub(super) reviewer: Option<Reviewer<'a>>,
    pub(super) baking: Option<u32>,
    pub(super) open: Option<Open>,
    pub(super) failed: Option<anyhow::Error>,
}

impl ApplicationHandler for App<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_some() {
            return;
        }
        match self.open_window(events) {
            Ok(mut open) => {
                if !self.args.free_mouse && self.args.path.is_none() {
                    open.capture(true);
                }
                if let Some(notes) = self.editor.as_mut().and_then(Editor::take_notes) {
                    open.say(notes);
                }
                if let Some(reviewer) = &self.reviewer {
                    open.say(reviewer.step_words());
                }
                self.open = Some(open);
            }
            Err(why) => self.fail(events, why),
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        let is_taken = open.panel.on_event(&open.window, &event);
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::Resized(size) => open.resize(size),
            // The panel has no use for Tab, and keys that it took may still be released.
            WindowEvent::KeyboardInput {
                event,
                is_synthetic,
                ..
            } if !is_taken
                || event.physical_key == KeyCode::Tab
                || event.state == ElementState::Released =>
            {
                if let Err(why) = self.on_key(events, &event, is_synthetic) {
                    self.fail(events, why);
                }
            }
            WindowEvent::Focused(is_focused) => {
                open.keys.clear();
                // The mouse is free while another window has the focus, and held as chosen afterwards.
                open.hold(is_focused && open.wants_mouse);
            }
            WindowEvent::MouseWheel { delta, .. } if !is_taken => {
                if let Err(why) = self.on_wheel(delta) {
                    self.fail(events, why);
                }
            }
            WindowEvent::CursorMoved { position, .. } => {
                let to = [position.x, position.y];
                if open.pressed_at.is_some() && !is_taken && !open.is_captured {
                    open.turn([to[0] - open.pointer[0], to[1] - open.pointer[1]], 0.004);
                }
                open.pointer = to;
            }
            WindowEvent::MouseInput {
                state,
                button: MouseButton::Left,
                ..
            } if !is_taken => match state {
                ElementState::Pressed => open.pressed_at = Some(open.pointer),
                ElementState::Released => {
                    if let Err(why) = self.on_release() {
                        self.fail(events, why);
                    }
                }
            },
            WindowEvent::RedrawRequested => {
                if let Err(why) = self.frame(events) {
                    self.fail(events, why);
                }
            }
            _ => {}
        }
    }

    fn device_event(&mut self, _: &ActiveEventLoop, _: DeviceId, event: DeviceEvent) {
        if let (Some(open), DeviceEvent::MouseMotion { delta }) = (&mut self.open, event)
            && open.is_captured
        {
            open.turn(delta.into(), 0.002);
        }
    }

    fn about_to_wait(&mut self, _: &ActiveEventLoop) {
        if let Some(open) = &self.open {
            open.window.request_redraw();
        }
    }
}

impl App<'_> {
    fn fail(&mut self, events: &ActiveEventLoop, why: anyhow::Error) {
        self.failed = Some(why);
        events.exit();
    }

    fn open_window(&mut self, events: &ActiveEventLoop) -> anyhow::Result<Open> {
        let lived = self.lived.take().context("a window opens once")?;
        let title = format!("enfilade: {}", self.args.name());
        let BareWindow {
            window,
            surface,
            config,
            gpu,
        } = BareWindow::open(events, title, self.args.size, &self.args.adapter)?;
        let strip = self.editor.as_ref();
        let strip = strip.map(|editor| Strip::new(editor.kit(), editor.palette()));
        let mut panel = Panel::new(&gpu, &window, config.format, strip);
        let (mut studio, streamed) = match &self.packed {
            Some(packed) => {
                let sight = lived.space.sight(PartId::ROOT).clone();
                let memory = self.args.memory << 20;
                let opened = Streamed::for_walk(packed.clone(), gpu, sight, memory, config.format)?;
                (opened.0, Some(opened.1))
            }
            None => (Studio::with_format(gpu, &self.world, config.format)?, None),
        };
        if self.args.lod > 0.0 {
            studio.add_levels(&self.world)?;
        }
        studio.sparing = self.sparing();
        // A lamp takes the software adapter many milliseconds a frame.
        if self.args.living.is_some() || !studio.gpu.is_software() {
            lived.furnish(&mut studio)?;
        }
        let is_in_parts = self.editor.as_ref().is_some_and(Editor::has_parts);
        if is_in_parts {
            studio.follow_parts(&lived.space)?;
        }
        panel.renew_map(is_in_parts);
        let start = self.start(&mut studio, &lived.space)?;
        let [x, y, z] = start.toward;
        let shown = Shown {
            // The software adapter draws the plain picture several times as fast.
            plain: studio.gpu.is_software() || self.editor.is_some() || self.reviewer.is_some(),
            spares: studio.sparing != Sparing::default(),
            zoom: 1.0,
            ..Shown::default()
        };
        let mut walker = Walker::new(start.eye, streamed.is_some());
        walker.flies = self.editor.is_some() || self.reviewer.is_some();
        walker.rides = self.args.living.is_some();
        let titles = self.editor.as_ref().map(Editor::titles);
        Ok(Open {
            walker,
            has_company: self.args.living.is_some(),
            is_living: self.args.living.is_some()
                || is_in_parts
                || !self.world.graph.specials.is_empty(),
            is_in_parts,
            titles: Titles(titles.unwrap_or_default()),
            lived,
            window,
            surface,
            config,
            studio,
            panel,
            yaw: z.atan2(x),
            pitch: y.atan2(x.hypot(z)),
            keys: BTreeSet::new(),
            pointer: [0.0; 2],
            pressed_at: None,
            shown,
            mode: if self.args.portal_textures || self.args.max_triangles.is_some() {
                Mode::PortalTextures
            } else {
                Mode::default()
            },
            textures_ahead: (self.args.textures.as_ref())
                .map(|path| std::fs::read(path).with_context(|| path.display().to_string()))
                .transpose()?,
            texture_options: PortalTextureOptions {
                max_triangles: self.args.max_triangles.unwrap_or(u64::MAX),
                ..PortalTextureOptions::default()
            },
            is_captured: false,
            wants_mouse: false,
            // Daylight needs the whole world, in rooms.
            has_asked_for_light: streamed.is_some() || self.reviewer.is_some(),
            streamed,
            turning: Vec::new(),
            recorded: None,
            n_shots: 0,
            last: Instant::now(),
            props: Vec::new(),
        })
    }

    /// The first camera.
    fn start(&self, studio: &mut Studio, space: &Space) -> anyhow::Result<Camera> {
        if let Some(eye) = self.args.eye {
            return Ok(Camera {
                eye,
                toward: [1.0, 0.0, 0.0],
                fov_y: FOV,
            });
        }
        if let Some(camera) = self.review_camera(space) {
            return Ok(camera);
        }
        if self.packed.is_some() {
            return Ok(start_in(&self.world, &studio.sight));
        }
        let parts = (1..space.n_parts() as u32).map(PartId);
        let mut parts = parts.filter(|part| space.world(*part).graph.rooms().next().is_some());
        if let (true, Some(first)) = (self.editor.is_some(), parts.next()) {
            let own = start_in(space.world(first), space.sight(first));
            return Ok(moved(&own, space.pose(first)));
        }
        if self.editor.is_some() && self.world.graph.rooms().next().is_none() {
            // Before the place where the first piece will stand.
            return Ok(Camera {
                eye: [0.0, 3.0, 14.0],
                toward: [0.0, -0.2, -1.0],
                fov_y: FOV,
            });
        }
        Ok(good_camera(studio, &self.world)?)
    }

    /// Acts once when a key goes down. Synthetic events report keys that were down already when the window got the
    /// focus.
    fn on_key(
        &mut self,
        events: &ActiveEventLoop,
        event: &KeyEvent,
        is_synthetic: bool,
    ) -> anyhow::Result<()> {
        let asked = self.sparing();
        let (Some(open), PhysicalKey::Code(key)) = (&mut self.open, event.physical_key) else {
            return Ok(());
        };
        if event.state == ElementState::Released {
            open.keys.remove(&key);
            return Ok(());
        }
        let is_held = !open.keys.insert(key);
        if is_held || is_synthetic {
            return Ok(());
        }
        if let Some(key) = edit_key(key)
            && self.edit(key)?
        {
            return Ok(());
        }
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        let is_there = [KeyCode::ShiftLeft, KeyCode::ShiftRight]
            .iter()
            .any(|k| open.keys.contains(k));
        if let Some(key) = review_key(key, is_there)
            && self.review(key)?
        {
            return Ok(());
        }
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        let shown = &mut open.shown;
        match key {
            KeyCode::Escape => self.leave(events),
            KeyCode::F2 => self.save(),
            KeyCode::F1 => shown.help = !shown.help,
            KeyCode::KeyF => open.walker.flies = !open.walker.flies,
            KeyCode::KeyM => open.mode = open.mode.next(),
            KeyCode::KeyL => {
                let on = open.studio.sparing == Sparing::default();
                open.studio.sparing = match (on, asked == Sparing::default()) {
                    (false, _) => Sparing::default(),
                    (true, false) => asked,
                    // Defaults: portals of 16 by 16 pixels, objects seen through four times that area.
                    (true, true) => Sparing {
                        stop_below: 256.0,
                        objects_below: 1024.0,
                        ..Sparing::default()
                    },
                };
                shown.spares = on;
            }
            KeyCode::Tab => {
                let on = !open.wants_mouse;
                open.capture(on);
            }
            KeyCode::Equal | KeyCode::NumpadAdd => open.zoom(1.0),
            KeyCode::Minus | KeyCode::NumpadSubtract => open.zoom(-1.0),
            KeyCode::KeyC => {
                shown.paint = match shown.paint {
                    Paint::Lit => Paint::Cells,
                    Paint::Cells => Paint::Overdraw,
                    Paint::Overdraw => Paint::Lit,
                };
            }
            KeyCode::KeyR => shown.radar = !shown.radar,
            KeyCode::KeyI => shown.whys = !shown.whys,
            KeyCode::KeyO => shown.portals = !shown.portals,
            KeyCode::KeyP => shown.plain = !shown.plain,
            KeyCode::KeyT => shown.tints = !shown.tints,
            KeyCode::F4 => open.recorded = Some(Vec::new()),
            KeyCode::F5 => {
                if let Some(path) = open.recorded.take() {
                    let record = &self.args.record;
                    let text = path_text(&path);
                    let written = self.outputs.write("--record", Format::Cameras, record);
                    match written.and_then(|()| write_whole(record, text.as_bytes())) {
                        Ok(()) => open.say(format!("wrote {}", record.display())),
                        // The recording stays, and so does the window.
                        Err(why) => {
                            open.recorded = Some(path);
                            open.warn(format!("{why:#}"));
                        }
                    }
                }
            }
            KeyCode::F12 => self.take_picture(),
            _ => {}
        }
        Ok(())
    }

    /// Writes a picture. The walk goes on even if that fails.
    fn take_picture(&mut self) {
        let Some(open) = &mut self.open else { return };
        let asked = (self.args.screenshot.as_path(), &self.args.adapter);
        let review = self.reviewer.as_mut();
        let marks = review.map_or_else(Vec::new, Reviewer::lend_marks);
        let made = open.shot(asked.0, asked.1, &self.world, &marks, &mut self.outputs);
        if let Some(reviewer) = &mut self.reviewer {
            reviewer.take_marks(marks);
        }
        if let Err(why) = made {
            open.warn(format!("no picture: {why:#}"));
        }
    }

    /// Takes another tool while editing; otherwise zooms the map.
    fn on_wheel(&mut self, delta: MouseScrollDelta) -> anyhow::Result<()> {
        let notches = match delta {
            MouseScrollDelta::LineDelta(_, y) => y,
            MouseScrollDelta::PixelDelta(by) => by.y as f32 / 40.0,
        };
        let is_taken = self.edit(EditKey::Step(if notches < 0.0 { 1 } else { -1 }))?;
        if let (Some(open), false) = (&mut self.open, is_taken) {
            open.zoom(notches);
        }
        Ok(())
    }

    /// Uses the tool in hand, or the door there, unless the view was dragged.
    fn on_release(&mut self) -> anyhow::Result<()> {
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        let from = open.pressed_at.take().unwrap_or(open.pointer);
        let moved = (from[0] - open.pointer[0]).hypot(from[1] - open.pointer[1]);
        let more = open.keys.contains(&KeyCode::ShiftLeft);
        let is_click = open.is_captured || moved < 4.0;
        if is_click && !self.edit(EditKey::Use { more })? {
            self.toggle_portal();
        }
        Ok(())
    }

    /// Closes the window; tells what is not saved.
    fn leave(&mut self, events: &ActiveEventLoop) {
        let words = self.editor.as_ref().and_then(Editor::farewell);
        let reviewed = self.reviewer.as_ref().map(Reviewer::farewell);
        let words = words.into_iter().chain(reviewed.into_iter().flatten());
        if let Some(open) = &mut self.open {
            words.for_each(|words| open.say(words));
        }
        events.exit();
    }

    /// Opens or closes the portal at the pointer.
    fn toggle_portal(&mut self) {
        let Some(open) = &mut self.open else { return };
        let ray = open.pointer();
        // The leaf at the pointer, or else the opening; in a mirror, what it shows there.
        let space = &open.lived.space;
        let pointed = Pointed::at(space, &ray, CLICK);
        let leaf_of = match pointed.hit.map(|h| (h.part, h.target)) {
            Some((part, Target::Detail { detail, .. })) => {
                let leaf_of = space.sight(part).portals_of(detail).next();
                leaf_of.map(|portal| (part, portal))
            }
            _ => None,
        };
        let opening = || portal_looked_at(space, &pointed.ray).map(|found| (found.0, found.1));
        let portal = leaf_of.or_else(opening);
        match portal {
            Some(portal) => open.toggle(portal.0, portal.1),
            None => open.say("no portal there".into()),
        }
    }

    fn frame(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        let now = Instant::now();
        let seconds = (now - open.last).as_secs_f64();
        open.last = now;
        if let Some(path) = &mut self.path {
            let Some(camera) = path.pop_front() else {
                events.exit();
                return Ok(());
            };
            let [x, y, z] = camera.toward;
            open.walker.frame = PartId::ROOT;
            open.walker.eye = DVec3::from(camera.eye.map(f64::from));
            open.lived.step(&open.walker.player(), STEP);
            (open.yaw, open.pitch) = (z.atan2(x), y.atan2(x.hypot(z)));
        } else {
            open.turn_leaves(seconds);
            let wish = open.wish();
            open.lived.step(&open.walker.player(), seconds);
            open.walker.step(wish, seconds, &open.lived.space);
        }
        if let Some(editor) = &mut self.editor {
            let wants_parts = editor.has_parts() && open.can_show_parts();
            if wants_parts && !open.is_in_parts {
                open.show_parts(editor)?;
                self.world = Arc::clone(open.lived.space.world(PartId::ROOT));
            } else if !wants_parts && open.is_in_parts {
                self.world = Arc::new(editor.world()?.world.clone());
                open.show_world(&self.world)?;
            }
        }
        let camera = open.camera();
        let outside = open.camera_in_root();
        if let Some(recorded) = &mut open.recorded {
            recorded.push(outside);
        }
        let mut marks = self.look_at_edits();
        if self.reviewer.is_some() {
            marks = self.look_at_review()?;
        } else if let Some(open) = &mut self.open {
            open.shown.ahead = if open.streamed.is_some() {
                open.titles.here(&open.lived.space, &outside)
            } else {
                let pointed = Pointed::at(&open.lived.space, &outside, FAR);
                if open.shown.whys {
                    open.titles.why_ahead(&open.lived.space, &pointed.ray)
                } else {
                    open.titles.ahead(&open.lived.space, &pointed.ray)
                }
            };
        }
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        open.draw(&self.world, &camera, seconds, &mut marks)?;
        if let Some(reviewer) = &mut self.reviewer {
            reviewer.take_marks(marks);
        }
        Ok(())
    }

    /// The sparing of distant rooms that the options request.
    fn sparing(&self) -> Sparing {
        Sparing {
            stop_below: self.args.stop,
            objects_below: self.args.objects,
            lod: self.args.lod,
            ..Sparing::default()
        }
    }
}

/// Returns a camera that stands in a part.
fn moved(camera: &Camera, pose: &Pose) -> Camera {
    let vector = |p: [f32; 3]| DVec3::from(p.map(f64::from));
    Camera {
        eye: pose.point(vector(camera.eye)).as_vec3().to_array(),
        toward: pose.direction(vector(camera.toward)).as_vec3().to_array(),
        ..*camera
    }
}
