//! `enfilade view`: a walk in a window.

mod panel;
mod walker;

use std::collections::{BTreeSet, VecDeque};
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, anyhow};
use enfilade::cpg::{PortalId, World};
use enfilade::geom::DVec3;
use enfilade::runtime::Sightlines;
use enfilade_render::{AdapterChoice, Camera, Culling, Frame, Mark, Paint, Shape, Studio, Style};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, KeyEvent, MouseButton, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{Window, WindowId};

use self::panel::{Panel, Shown};
use self::walker::Walker;
use crate::formats::Format;
use crate::output::{Outputs, refuse_stream, write_whole};
use crate::render::portal_marks;
use enfilade_cli::adapter;
use enfilade_cli::cameras::{FOV, good_camera, path_text, portal_looked_at, read_path};
use enfilade_cli::values::{point, size};
use enfilade_cli::world::read_world;

/// Opens a window to walk through a world: W A S D and the mouse; F1 there tells the rest.
#[derive(clap::Args)]
pub(crate) struct View {
    /// World written by `enfilade bake`.
    world: PathBuf,
    /// Where to begin, in meters; without it, a place with much to see is looked for.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    eye: Option<[f32; 3]>,
    /// Walk along this path, a camera a frame, and close at its end.
    #[arg(long, value_name = "FILE")]
    path: Option<PathBuf>,
    /// Where F5 writes the path walked since F4, for --path here and in `render`.
    #[arg(long, value_name = "FILE", default_value = "path.txt")]
    record: PathBuf,
    /// Where F12 writes pictures; `shot.png` becomes `shot-1.png` and so on.
    #[arg(long, value_name = "PNG", default_value = "shot.png")]
    screenshot: PathBuf,
    /// Size of the window.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x720")]
    size: [u32; 2],
    /// Objects are drawn with fewer triangles where that moves their surface by at most so many pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    lod: f32,
    /// What draws: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME")]
    adapter: AdapterChoice,
}

pub(crate) fn run(args: &View) -> anyhow::Result<()> {
    let outputs = Outputs::reading([&args.world].into_iter().chain(&args.path))?;
    // Where they may be written is asked when a key asks for them: most walks write nothing.
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
    let world = read_world(&args.world)?;
    let events = EventLoop::new()
        .context("no window can be opened here; `enfilade render` draws without one")?;
    events.set_control_flow(ControlFlow::Poll);
    let mut app = App {
        args,
        lines: Sightlines::build(&world),
        world,
        path: path.map(Into::into),
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

struct App<'a> {
    args: &'a View,
    world: World,
    lines: Sightlines,
    /// Cameras still to come.
    path: Option<VecDeque<Camera>>,
    /// What was read, and what was written in this walk.
    outputs: Outputs,
    open: Option<Open>,
    failed: Option<anyhow::Error>,
}

/// What there is once the window is.
struct Open {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    studio: Studio,
    panel: Panel,
    walker: Walker,
    yaw: f32,
    pitch: f32,
    keys: BTreeSet<KeyCode>,
    /// Where the pointer is, and where it went down, in pixels.
    pointer: [f64; 2],
    pressed_at: Option<[f64; 2]>,
    shown: Shown,
    culling: Culling,
    closed: BTreeSet<PortalId>,
    recorded: Option<Vec<Camera>>,
    n_shots: u32,
    last: Instant,
}

impl ApplicationHandler for App<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_some() {
            return;
        }
        match self.open_window(events) {
            Ok(open) => self.open = Some(open),
            Err(why) => self.fail(events, why),
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        let is_taken = open.panel.on_event(&open.window, &event);
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::Resized(size) => open.resize(size),
            WindowEvent::KeyboardInput { event, .. } if !is_taken => {
                if let Err(why) = self.on_key(events, &event) {
                    self.fail(events, why);
                }
            }
            WindowEvent::CursorMoved { position, .. } => {
                let to = [position.x, position.y];
                if open.pressed_at.is_some() && !is_taken {
                    open.yaw += (to[0] - open.pointer[0]) as f32 * 0.004;
                    let pitch = open.pitch - (to[1] - open.pointer[1]) as f32 * 0.004;
                    open.pitch = pitch.clamp(-1.5, 1.5);
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
                    if moved < 4.0 {
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
        // Shading is in linear light: the window's texture does the rest.
        if let Some(&format) = formats.iter().find(|f| f.is_srgb()) {
            config.format = format;
        }
        surface.configure(&gpu.device, &config);
        let panel = Panel::new(&gpu, &window, config.format, &self.world);
        let mut studio = Studio::with_format(gpu, &self.world, config.format)?;
        if self.args.lod > 0.0 {
            studio.add_levels(&self.world)?;
            studio.sparing.lod = self.args.lod;
        }
        let start = match self.args.eye {
            Some(eye) => Camera {
                eye,
                toward: [1.0, 0.0, 0.0],
                fov_y: FOV,
            },
            None => good_camera(&mut studio, &self.world)?,
        };
        let [x, y, z] = start.toward;
        let shown = Shown {
            // Software draws the plain picture several times as fast.
            plain: studio.gpu.is_software(),
            ..Shown::default()
        };
        Ok(Open {
            walker: Walker::new(&self.world, start.eye),
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
            culling: Culling::Portals,
            closed: BTreeSet::new(),
            recorded: None,
            n_shots: 0,
            last: Instant::now(),
        })
    }

    fn on_key(&mut self, events: &ActiveEventLoop, event: &KeyEvent) -> anyhow::Result<()> {
        let (Some(open), PhysicalKey::Code(key)) = (&mut self.open, event.physical_key) else {
            return Ok(());
        };
        if event.state == ElementState::Released {
            open.keys.remove(&key);
            return Ok(());
        }
        open.keys.insert(key);
        if event.repeat {
            return Ok(());
        }
        let shown = &mut open.shown;
        match key {
            KeyCode::Escape => events.exit(),
            KeyCode::F1 => shown.help = !shown.help,
            KeyCode::KeyF => open.walker.flies = !open.walker.flies,
            KeyCode::KeyM => {
                open.culling = match open.culling {
                    Culling::Portals => Culling::Frustum,
                    Culling::Frustum => Culling::Everything,
                    Culling::Everything => Culling::Portals,
                };
            }
            KeyCode::KeyC => {
                shown.paint = match shown.paint {
                    Paint::Lit => Paint::Cells,
                    Paint::Cells => Paint::Overdraw,
                    Paint::Overdraw => Paint::Lit,
                };
            }
            KeyCode::KeyO => shown.portals = !shown.portals,
            KeyCode::KeyP => shown.plain = !shown.plain,
            KeyCode::F4 => open.recorded = Some(Vec::new()),
            KeyCode::F5 => {
                if let Some(path) = open.recorded.take() {
                    let record = &self.args.record;
                    let text = path_text(&path);
                    let written = self.outputs.write("--record", Format::Cameras, record);
                    match written.and_then(|()| write_whole(record, text.as_bytes())) {
                        Ok(()) => open.say(format!("wrote {}", record.display())),
                        // What was walked stays, and so does the window.
                        Err(why) => {
                            open.recorded = Some(path);
                            open.warn(format!("{why:#}"));
                        }
                    }
                }
            }
            KeyCode::F12 => open.shot(self.args, &self.world, &mut self.outputs)?,
            _ => {}
        }
        Ok(())
    }

    /// Opens or closes what the pointer is at.
    fn toggle_portal(&mut self) {
        let Some(open) = &mut self.open else { return };
        let [w, h] = [open.config.width, open.config.height].map(f64::from);
        let camera = open.camera();
        let [right, up, forward] = camera.axes();
        let tan = (camera.fov_y * 0.5).tan();
        let x = (open.pointer[0] / w * 2.0 - 1.0) as f32 * tan * (w / h) as f32;
        let y = (1.0 - open.pointer[1] / h * 2.0) as f32 * tan;
        let ray = Camera {
            toward: (forward + right * x + up * y).to_array(),
            ..camera
        };
        let Some((portal, _)) = portal_looked_at(&self.world, &self.lines, &ray) else {
            open.say("no portal there".into());
            return;
        };
        if open.closed.remove(&portal) {
            open.studio.state.open(portal);
            open.say(format!("{portal} is open"));
        } else {
            open.closed.insert(portal);
            open.studio.state.close(portal);
            open.say(format!("{portal} is closed"));
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
            open.walker.eye = DVec3::from(camera.eye.map(f64::from));
            (open.yaw, open.pitch) = (z.atan2(x), y.atan2(x.hypot(z)));
        } else {
            open.walker.step(open.wish(), seconds);
        }
        let camera = open.camera();
        if let Some(recorded) = &mut open.recorded {
            recorded.push(camera);
        }
        open.draw(&self.world, &camera, seconds)
    }
}

impl Open {
    /// In the window, and on standard error for who comes back to the terminal.
    fn say(&mut self, message: String) {
        let _ = writeln!(crate::output::Told, "enfilade: {message}");
        self.shown.message = message;
    }

    /// The same for what could not be done.
    fn warn(&mut self, message: String) {
        let _ = writeln!(crate::output::Warned, "enfilade: {message}");
        self.shown.message = message;
    }

    fn resize(&mut self, size: PhysicalSize<u32>) {
        let limit = self.studio.gpu.device.limits().max_texture_dimension_2d;
        self.config.width = size.width.clamp(1, limit);
        self.config.height = size.height.clamp(1, limit);
        self.surface
            .configure(&self.studio.gpu.device, &self.config);
    }

    fn camera(&self) -> Camera {
        let (sin, cos) = self.yaw.sin_cos();
        let level = self.pitch.cos();
        Camera {
            eye: self.walker.eye.as_vec3().to_array(),
            toward: [cos * level, self.pitch.sin(), sin * level],
            fov_y: FOV,
        }
    }

    /// Where the keys lead. [Units: wu/s]
    fn wish(&self) -> DVec3 {
        let [right, _, forward] = self.camera().axes().map(|v| v.as_dvec3());
        let key = |code| f64::from(u8::from(self.keys.contains(&code)));
        let ahead = key(KeyCode::KeyW) - key(KeyCode::KeyS);
        let aside = key(KeyCode::KeyD) - key(KeyCode::KeyA);
        let up = key(KeyCode::KeyE) - key(KeyCode::KeyQ);
        let forward = if self.walker.flies {
            forward
        } else {
            DVec3::new(forward.x, 0.0, forward.z).normalize_or_zero()
        };
        let speed = if self.keys.contains(&KeyCode::ShiftLeft) {
            5.0
        } else {
            1.8
        };
        (forward * ahead + right * aside + DVec3::Y * up).normalize_or_zero() * speed
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

    fn draw(&mut self, world: &World, camera: &Camera, seconds: f64) -> anyhow::Result<()> {
        use wgpu::CurrentSurfaceTexture as Got;
        let size = [self.config.width, self.config.height];
        let target = match self.surface.get_current_texture() {
            Got::Success(t) | Got::Suboptimal(t) => t,
            Got::Outdated | Got::Lost => {
                self.surface
                    .configure(&self.studio.gpu.device, &self.config);
                return Ok(());
            }
            // Hidden, or late: the next frame will do.
            _ => return Ok(()),
        };
        let aspect = size[0] as f32 / size[1] as f32;
        let view = camera.view(aspect)?;
        let mut marks = self.leaves(world);
        if self.shown.portals {
            marks.extend(portal_marks(&mut self.studio, world, camera, size)?);
        }
        let list = self.studio.take_list(&view, camera.eye, self.culling, size);
        let output = target
            .texture
            .create_view(&wgpu::TextureViewDescriptor::default());
        let frame = Frame {
            projection: camera.projection(aspect)?,
            list: &list,
            style: self.style(),
            marks: &marks,
        };
        self.studio.draw(&frame, &output, size)?;
        let seen = self
            .studio
            .viewer
            .see(&self.studio.sight, &self.studio.state, &view);
        self.shown.cells = seen.cells().iter().map(|c| c.0).collect();
        self.shown.seconds(seconds);
        self.shown.counts = [
            list.n_triangles(),
            self.studio.world.n_triangles(),
            list.n_draws() as u64,
        ];
        self.shown.camera = Some(*camera);
        self.shown.culling = self.culling;
        self.shown.closed = self.closed.iter().map(|p| p.0).collect();
        self.shown.is_recording = self.recorded.is_some();
        self.shown.flies = self.walker.flies;
        self.studio.give_list(list);
        self.panel
            .draw(&self.studio.gpu, &self.window, &output, size, &self.shown);
        self.window.pre_present_notify();
        self.studio.gpu.queue.present(target);
        Ok(())
    }

    /// What fills the portals that are closed: else one would see the sky through them.
    fn leaves(&self, world: &World) -> Vec<Mark> {
        let portals = &world.graph.portals;
        let closed = self.closed.iter();
        closed
            .map(|p| Mark {
                shape: Shape::Area(portals[p.0 as usize].outline.clone()),
                color: [0.23, 0.13, 0.07, 1.0],
                width: 0.0,
                on_top: false,
            })
            .collect()
    }

    /// A picture of the world as it is shown now, without the panel.
    fn shot(&mut self, args: &View, world: &World, outputs: &mut Outputs) -> anyhow::Result<()> {
        self.n_shots += 1;
        let stem = args
            .screenshot
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy();
        let to = args
            .screenshot
            .with_file_name(format!("{stem}-{}.png", self.n_shots));
        let camera = self.camera();
        // In a studio of its own: a window's pictures do not come back.
        let mut studio = Studio::new(adapter::open(&args.adapter)?, world)?;
        for &p in &self.closed {
            studio.state.close(p);
        }
        let size = [self.config.width, self.config.height];
        let leaves = self.leaves(world);
        let picture = studio.picture(&camera, self.culling, self.style(), &leaves, size)?;
        let png = picture.to_png()?;
        let written = outputs.write("--screenshot", Format::Picture, &to);
        if let Err(why) = written.and_then(|()| write_whole(&to, &png)) {
            // The walk goes on.
            self.warn(format!("{why:#}"));
            return Ok(());
        }
        let [drawn, ..] = self.shown.counts;
        self.say(format!("wrote {}, {drawn} triangles", to.display()));
        Ok(())
    }
}
