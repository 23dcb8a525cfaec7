//! `enfilade view`: a walk in a window.

mod map;
mod mode;
mod open;
mod panel;
mod pointed;
mod strider;
mod walker;

use std::collections::{BTreeSet, VecDeque};
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, anyhow};
use enfilade::cpg::World;
use enfilade::geom::DVec3;
use enfilade::runtime::{Sightlines, Target};
use enfilade::world::{PartId, Space};
use enfilade_render::{
    AdapterChoice, Camera, FOV, Paint, PortalTextureOptions, Sparing, Studio, good_camera,
    portal_looked_at,
};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{
    DeviceEvent, DeviceId, ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent,
};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{Window, WindowId};

use self::mode::Mode;
use self::open::{Open, name_ahead, name_here};
use self::panel::{Panel, Shown};
use self::pointed::{FAR, Pointed};
use self::strider::start_in;
use self::walker::Walker;
use crate::formats::Format;
use crate::limits::Limits;
use crate::living::{Lived, LivingFile, STEP};
use crate::output::{Outputs, refuse_stream, write_whole};
use crate::screen::Told;
use crate::walk::WorldFile;
use enfilade_cli::adapter;
use enfilade_cli::cameras::{path_text, read_path};
use enfilade_cli::streamed::{Packed, Streamed};
use enfilade_cli::values::{point, size};
use enfilade_cli::world::read_world_hashed;

/// Opens a window to walk through a world: W A S D and the mouse; F1 in the window lists all keys.
#[derive(clap::Args)]
pub(crate) struct View {
    /// World written by `enfilade bake`, or packed, on disk or at an address. Of a packed one, pieces are loaded as they come into
    /// view, or are about to, unless --living or --lod is given.
    world: PathBuf,
    /// Lifts that one rides, people, lamps and sounds in it, as `demo --living` writes them.
    #[arg(long, value_name = "JSON")]
    living: Option<PathBuf>,
    /// Start, in meters; a place with much to see if not given.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    eye: Option<[f32; 3]>,
    /// Walk along this path, a camera a frame, and close at its end.
    #[arg(long, value_name = "FILE")]
    path: Option<PathBuf>,
    /// File that F5 writes the path since F4 to, for --path here and in `render`.
    #[arg(long, value_name = "FILE", default_value = "path.txt")]
    record: PathBuf,
    /// File that F12 writes pictures to; `shot.png` becomes `shot-1.png` and so on.
    #[arg(long, value_name = "PNG", default_value = "shot.png")]
    screenshot: PathBuf,
    /// Size of the window.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x720")]
    size: [u32; 2],
    /// Leave the mouse free at first: drag to look around; Tab captures it.
    #[arg(long)]
    free_mouse: bool,
    /// Do not look through portals that cover fewer pixels, as in `render`; L turns that off and on.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    stop: f32,
    /// Do not draw objects in cells that are seen through fewer pixels, as in `render`; L turns that off and on.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    objects: f32,
    /// Draw objects with fewer triangles if that moves their surface by at most this many pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    lod: f32,
    /// Draw far portals as textures of what lies behind them: M changes that, T tints them.
    #[arg(long)]
    portal_textures: bool,
    /// Textures made ahead by `enfilade portals` for this world; others are made as they are needed.
    #[arg(long, value_name = "PTX", requires = "portal_textures")]
    textures: Option<PathBuf>,
    /// Triangles drawn in a frame at most: nearer portals become textures, too, until it holds.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    max_triangles: Option<u64>,
    /// Adapter to draw with: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME")]
    adapter: AdapterChoice,
    /// Most memory of the pieces of a packed world, in MiB.
    #[arg(long, value_name = "MIB", default_value_t = 1024, value_parser = clap::value_parser!(u64).range(8..=1 << 20))]
    memory: u64,
    #[command(flatten)]
    limits: Limits,
}

pub(crate) fn run(args: &View) -> anyhow::Result<()> {
    args.limits.begin()?;
    let inputs = [&args.world].into_iter().chain(&args.path);
    let inputs = inputs.chain(&args.textures);
    let outputs = Outputs::reading(inputs.chain(&args.living))?;
    // Writability is tested when a key requests a file: most walks write none.
    for (option, format, path) in [
        ("--record", Format::Cameras, &args.record),
        ("--screenshot", Format::Picture, &args.screenshot),
    ] {
        refuse_stream(option, path, "files of a walk")?;
        format.check(option, path)?;
    }
    let path = args
        .path
        .as_deref()
        .map(|p| read_path(p, FOV))
        .transpose()?;
    let (world, lived, packed) = read(args)?;
    let events = EventLoop::new()
        .context("no window can be opened here; `enfilade render` draws without one")?;
    events.set_control_flow(ControlFlow::Poll);
    let mut app = App {
        args,
        lines: Sightlines::build(&world),
        world,
        packed,
        path: path.map(Into::into),
        lived: Some(lived),
        outputs,
        open: None,
        failed: None,
    };
    events.run_app(&mut app)?;
    match app.failed {
        Some(why) => Err(why),
        None => Ok(()),
    }
}

/// Reads the world, and what lives in it; of a packed one only the head, if that is enough.
fn read(args: &View) -> anyhow::Result<(World, Lived, Option<Packed>)> {
    if Packed::is_at(&args.world) {
        let needs_whole = [
            (args.living.is_some(), "--living"),
            (args.lod > 0.0, "--lod"),
            (args.portal_textures, "--portal-textures"),
            (args.max_triangles.is_some(), "--max-triangles"),
        ];
        let Some((_, option)) = needs_whole.into_iter().find(|n| n.0) else {
            let packed = Packed::open(&args.world)?;
            let world = packed.head.world.clone();
            let space = Space::with_sight(world.clone(), packed.head.sight()?);
            let lived = Lived::in_space(space, LivingFile::default(), Vec::new(), None)?;
            let name = args.world.display();
            let memory = args.memory;
            writeln!(
                Told,
                "enfilade: {name} is streamed into {memory} MiB, without daylight and shadows of the sun"
            )?;
            return Ok((world, lived, Some(packed)));
        };
        let name = args.world.display();
        writeln!(
            Told,
            "enfilade: {name} is loaded whole: {option} needs all of it"
        )?;
    }
    let (world, hash) = read_world_hashed(&args.world)?;
    let file = WorldFile {
        path: &args.world,
        hash,
    };
    let lived = match &args.living {
        Some(path) => Lived::read(path, &world, Some(file))?,
        None => Lived::new(world.clone(), LivingFile::default(), Vec::new(), None)?,
    };
    Ok((world, lived, None))
}

/// Reach of a click, in lengths of the view direction.
const CLICK: f32 = 30.0;

struct App<'a> {
    args: &'a View,
    /// Hollow if it is streamed.
    world: World,
    packed: Option<Packed>,
    lines: Sightlines,
    /// Until the window opens.
    lived: Option<Lived>,
    /// Cameras still to show.
    path: Option<VecDeque<Camera>>,
    /// Files read, and files written in this walk.
    outputs: Outputs,
    open: Option<Open>,
    failed: Option<anyhow::Error>,
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
            WindowEvent::MouseWheel { delta, .. } if !is_taken => open.zoom(match delta {
                MouseScrollDelta::LineDelta(_, y) => y,
                MouseScrollDelta::PixelDelta(by) => by.y as f32 / 40.0,
            }),
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
                    let from = open.pressed_at.take().unwrap_or(open.pointer);
                    let moved = (from[0] - open.pointer[0]).hypot(from[1] - open.pointer[1]);
                    if open.is_captured || moved < 4.0 {
                        self.toggle_portal();
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
        let [w, h] = self.args.size;
        let attributes = Window::default_attributes()
            .with_title(format!("enfilade: {}", self.args.world.display()))
            .with_inner_size(PhysicalSize::new(w, h));
        let window = Arc::new(events.create_window(attributes)?);
        let display = Box::new(events.owned_display_handle());
        let asked = wgpu::InstanceDescriptor::new_with_display_handle_from_env(display);
        let instance = wgpu::Instance::new(asked);
        let surface = instance.create_surface(window.clone())?;
        let gpu = adapter::open_with(&instance, &self.args.adapter, Some(&surface))?;
        let size = window.inner_size();
        let mut config = surface
            .get_default_config(&gpu.adapter, size.width.max(1), size.height.max(1))
            .ok_or_else(|| anyhow!("{} cannot draw to this window", gpu.name()))?;
        let formats = surface.get_capabilities(&gpu.adapter).formats;
        // Shading is in linear light: the window's texture format converts it.
        if let Some(&format) = formats.iter().find(|f| f.is_srgb()) {
            config.format = format;
        }
        surface.configure(&gpu.device, &config);
        let panel = Panel::new(&gpu, &window, config.format, &self.world);
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
        let start = self.start(&mut studio)?;
        let [x, y, z] = start.toward;
        let shown = Shown {
            // The software adapter draws the plain picture several times as fast.
            plain: studio.gpu.is_software(),
            spares: studio.sparing != Sparing::default(),
            zoom: 1.0,
            ..Shown::default()
        };
        Ok(Open {
            walker: Walker::new(start.eye, streamed.is_some()),
            has_company: self.args.living.is_some(),
            is_living: self.args.living.is_some() || !self.world.graph.specials.is_empty(),
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
            // Daylight needs the whole world.
            has_asked_for_light: streamed.is_some(),
            streamed,
            turning: Vec::new(),
            recorded: None,
            n_shots: 0,
            last: Instant::now(),
            props: Vec::new(),
        })
    }

    /// The first camera.
    fn start(&self, studio: &mut Studio) -> anyhow::Result<Camera> {
        if let Some(eye) = self.args.eye {
            return Ok(Camera {
                eye,
                toward: [1.0, 0.0, 0.0],
                fov_y: FOV,
            });
        }
        if self.packed.is_some() {
            return Ok(start_in(&self.world, &studio.sight));
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
        let shown = &mut open.shown;
        match key {
            KeyCode::Escape => events.exit(),
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
            KeyCode::F12 => {
                // The walk goes on even if a picture fails.
                let asked_of_it = (self.args.screenshot.as_path(), &self.args.adapter);
                if let Err(why) = open.shot(asked_of_it, &self.world, &mut self.outputs) {
                    open.warn(format!("no picture: {why:#}"));
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Opens or closes the portal at the pointer.
    fn toggle_portal(&mut self) {
        let Some(open) = &mut self.open else { return };
        let [w, h] = [open.config.width, open.config.height].map(f64::from);
        let at = if open.is_captured {
            [w * 0.5, h * 0.5]
        } else {
            open.pointer
        };
        let camera = open.camera_in_root();
        let [right, up, forward] = camera.axes();
        let tan = (camera.fov_y * 0.5).tan();
        let x = (at[0] / w * 2.0 - 1.0) as f32 * tan * (w / h) as f32;
        let y = (1.0 - at[1] / h * 2.0) as f32 * tan;
        let ray = Camera {
            toward: (forward + right * x + up * y).to_array(),
            ..camera
        };
        // The leaf at the pointer, or else the opening; in a mirror, what it shows there.
        let pointed = Pointed::at(&open.lived.space, &self.lines, &ray, CLICK);
        let leaf_of = match pointed.hit.map(|h| h.target) {
            Some(Target::Detail { detail, .. }) => open.studio.sight.portals_of(detail).next(),
            _ => None,
        };
        let opening = || Some(portal_looked_at(&self.world, &self.lines, &pointed.ray)?.0);
        let portal = leaf_of.or_else(opening);
        match portal {
            Some(portal) => open.toggle(portal),
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
        let camera = open.camera();
        let outside = open.camera_in_root();
        if let Some(recorded) = &mut open.recorded {
            recorded.push(outside);
        }
        open.shown.ahead = if open.streamed.is_some() {
            name_here(&self.world, &outside)
        } else {
            let pointed = Pointed::at(&open.lived.space, &self.lines, &outside, FAR);
            name_ahead(&self.world, &self.lines, &pointed.ray)
        };
        open.draw(&self.world, &camera, seconds)
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
