//! What lies over the picture: counters, frame times, a small map, help.

use std::collections::VecDeque;

use egui::{Align2, Color32, Pos2, Rect, Stroke, Vec2};
use enfilade::cpg::CellId;
use enfilade::cpg::World;
use enfilade_render::{Camera, Culling, Gpu, Paint, cell_color};
use winit::event::WindowEvent;
use winit::window::Window;

/// What the panel shows.
#[derive(Default)]
pub(super) struct Shown {
    pub(super) help: bool,
    pub(super) portals: bool,
    pub(super) plain: bool,
    pub(super) paint: Paint,
    pub(super) cells: Vec<u32>,
    pub(super) closed: Vec<u32>,
    /// Triangles drawn, of all, and draws.
    pub(super) counts: [u64; 3],
    pub(super) camera: Option<Camera>,
    pub(super) culling: Culling,
    pub(super) is_recording: bool,
    pub(super) flies: bool,
    pub(super) message: String,
    pub(super) times: VecDeque<f32>,
}

impl Shown {
    /// Remembers the time of a frame.
    pub(super) fn seconds(&mut self, seconds: f64) {
        if self.times.len() == 120 {
            self.times.pop_front();
        }
        self.times.push_back(seconds as f32 * 1e3);
    }
}

/// Cells and portals as seen from above.
struct Map {
    /// By cell, none for outdoors: least and greatest corner.
    cells: Vec<Option<[[f32; 3]; 2]>>,
    /// By portal: two ends and the height.
    portals: Vec<([f32; 2], [f32; 2], [f32; 2])>,
    low: [f32; 2],
    high: [f32; 2],
}

impl Map {
    fn new(world: &World) -> Self {
        let cells: Vec<_> = world
            .graph
            .cells
            .iter()
            .map(|c| (!c.outdoor).then_some(c.aabb))
            .collect();
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for [a, b] in cells.iter().flatten() {
            for (k, axis) in [0, 2].into_iter().enumerate() {
                low[k] = low[k].min(a[axis]);
                high[k] = high[k].max(b[axis]);
            }
        }
        let portals = world.graph.portals.iter().map(|p| {
            let flat = |c: &[f32; 3]| [c[0], c[2]];
            // The two corners farthest apart, seen from above.
            let mut ends = ([0.0; 2], [0.0; 2]);
            let mut longest = -1.0;
            let (mut bottom, mut top) = (f32::INFINITY, f32::NEG_INFINITY);
            for a in &p.outline {
                (bottom, top) = (bottom.min(a[1]), top.max(a[1]));
                for b in &p.outline {
                    let d = (a[0] - b[0]).hypot(a[2] - b[2]);
                    if d > longest {
                        (longest, ends) = (d, (flat(a), flat(b)));
                    }
                }
            }
            (ends.0, ends.1, [bottom, top])
        });
        Self {
            portals: portals.collect(),
            cells,
            low,
            high,
        }
    }

    fn draw(&self, painter: &egui::Painter, area: Rect, shown: &Shown) {
        painter.rect_filled(area, 4.0, Color32::from_black_alpha(170));
        let Some(camera) = shown.camera.filter(|_| self.low[0] < self.high[0]) else {
            return;
        };
        let size = [self.high[0] - self.low[0], self.high[1] - self.low[1]];
        let scale = ((area.width() - 12.0) / size[0]).min((area.height() - 12.0) / size[1]);
        let place = |p: [f32; 2]| {
            let middle = [0, 1].map(|k| p[k] - (self.low[k] + self.high[k]) * 0.5);
            area.center() + Vec2::from(middle) * scale
        };
        let y = camera.eye[1];
        for (i, cell) in (0..).zip(&self.cells) {
            let Some([low, high]) = cell else { continue };
            if y < low[1] || y > high[1] {
                continue;
            }
            let is_seen = shown.cells.contains(&i);
            let [r, g, b] = cell_color(CellId(i)).map(|c| (c * 255.0) as u8);
            let rect = Rect::from_two_pos(place([low[0], low[2]]), place([high[0], high[2]]));
            let alpha = if is_seen { 200 } else { 50 };
            painter.rect_filled(rect, 0.0, Color32::from_rgba_unmultiplied(r, g, b, alpha));
        }
        for (i, (a, b, [bottom, top])) in (0..).zip(&self.portals) {
            if y < *bottom - 1.0 || y > *top + 1.0 {
                continue;
            }
            let color = if shown.closed.contains(&i) {
                Color32::RED
            } else {
                Color32::from_rgb(255, 150, 30)
            };
            painter.line_segment([place(*a), place(*b)], Stroke::new(2.0, color));
        }
        let eye = place([camera.eye[0], camera.eye[2]]);
        let ahead = Vec2::new(camera.toward[0], camera.toward[2]).normalized() * 14.0;
        painter.line_segment([eye, eye + ahead], Stroke::new(2.0, Color32::WHITE));
        painter.circle_filled(eye, 4.0, Color32::WHITE);
    }
}

/// Draws with egui over a picture.
pub(super) struct Panel {
    context: egui::Context,
    state: egui_winit::State,
    renderer: egui_wgpu::Renderer,
    map: Map,
}

const HELP: &str = "\
W A S D        walk; Shift: run
mouse, drag    look around
click          open or close the doorway there
F              fly; Q and E: down and up
M              drawn: portals, frustum, everything
C              paint: lit, cells, overdraw
O              outline doorways and narrowed views
P              plain: no shadows, no dark corners
F4, F5         record a path; write it
F12            picture to a file
F1             this help
Esc            close";

impl Panel {
    pub(super) fn new(
        gpu: &Gpu,
        window: &Window,
        format: wgpu::TextureFormat,
        world: &World,
    ) -> Self {
        let context = egui::Context::default();
        let side = gpu.device.limits().max_texture_dimension_2d as usize;
        let id = context.viewport_id();
        let state = egui_winit::State::new(context.clone(), id, window, None, None, Some(side));
        let options = egui_wgpu::RendererOptions::default();
        Self {
            renderer: egui_wgpu::Renderer::new(&gpu.device, format, options),
            context,
            state,
            map: Map::new(world),
        }
    }

    /// Whether the panel wants an event for itself.
    pub(super) fn on_event(&mut self, window: &Window, event: &WindowEvent) -> bool {
        self.state.on_window_event(window, event).consumed
    }

    pub(super) fn draw(
        &mut self,
        gpu: &Gpu,
        window: &Window,
        output: &wgpu::TextureView,
        size: [u32; 2],
        shown: &Shown,
    ) {
        let input = self.state.take_egui_input(window);
        let map = &self.map;
        let full = self.context.run_ui(input, |ui| paint(ui, map, shown));
        self.state
            .handle_platform_output(window, full.platform_output);
        let screen = egui_wgpu::ScreenDescriptor {
            size_in_pixels: size,
            pixels_per_point: full.pixels_per_point,
        };
        let jobs = self.context.tessellate(full.shapes, full.pixels_per_point);
        for (id, deltas) in &full.textures_delta.set {
            for delta in deltas {
                self.renderer
                    .update_texture(&gpu.device, &gpu.queue, *id, delta);
            }
        }
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let before =
            self.renderer
                .update_buffers(&gpu.device, &gpu.queue, &mut encoder, &jobs, &screen);
        {
            let attachment = wgpu::RenderPassColorAttachment {
                view: output,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Load,
                    store: wgpu::StoreOp::Store,
                },
            };
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("panel"),
                color_attachments: &[Some(attachment)],
                ..wgpu::RenderPassDescriptor::default()
            });
            self.renderer
                .render(&mut pass.forget_lifetime(), &jobs, &screen);
        }
        gpu.queue
            .submit(before.into_iter().chain([encoder.finish()]));
        for id in &full.textures_delta.free {
            self.renderer.free_texture(id);
        }
    }
}

fn paint(ui: &egui::Ui, map: &Map, shown: &Shown) {
    let painter = ui.painter();
    let screen = ui.max_rect();
    let font = egui::FontId::monospace(13.0);
    let write = |at: Pos2, anchor: Align2, text: String| {
        let galley = painter.layout_no_wrap(text, font.clone(), Color32::WHITE);
        let rect = anchor.anchor_size(at, galley.size());
        painter.rect_filled(rect.expand(6.0), 4.0, Color32::from_black_alpha(150));
        painter.galley(rect.min, galley, Color32::WHITE);
    };
    let mean = shown.times.iter().sum::<f32>() / shown.times.len().max(1) as f32;
    let [drawn, all, draws] = shown.counts;
    let mut text = format!(
        "{drawn} of {all} triangles ({:.2} %), {draws} draws\n{} cells seen, {mean:.1} ms, {}",
        100.0 * drawn as f64 / all.max(1) as f64,
        shown.cells.len(),
        match shown.culling {
            Culling::Everything => "everything",
            Culling::Frustum => "frustum culling",
            Culling::Portals => "portals",
        }
    );
    for (is_so, words) in [
        (shown.flies, "flying"),
        (shown.is_recording, "recording (F5 writes)"),
    ] {
        if is_so {
            text += "\n";
            text += words;
        }
    }
    if !shown.message.is_empty() {
        text += "\n";
        text += &shown.message;
    }
    if !shown.help {
        text += "\nF1: help";
    }
    write(
        screen.left_top() + Vec2::splat(12.0),
        Align2::LEFT_TOP,
        text,
    );
    // Frame times: a bar each, a line at 16.7 ms.
    let graph = Rect::from_min_size(
        screen.left_bottom() + Vec2::new(10.0, -70.0),
        Vec2::new(240.0, 60.0),
    );
    painter.rect_filled(graph, 4.0, Color32::from_black_alpha(150));
    let bar = |x: f32, ms: f32| {
        let height = (ms / 50.0 * graph.height()).min(graph.height());
        [
            Pos2::new(x, graph.bottom()),
            Pos2::new(x, graph.bottom() - height),
        ]
    };
    for (i, &ms) in shown.times.iter().enumerate() {
        let color = if ms > 33.4 {
            Color32::LIGHT_RED
        } else {
            Color32::LIGHT_GREEN
        };
        painter.line_segment(
            bar(graph.left() + i as f32 * 2.0 + 1.0, ms),
            Stroke::new(1.5, color),
        );
    }
    let y = graph.bottom() - 16.7 / 50.0 * graph.height();
    painter.line_segment(
        [Pos2::new(graph.left(), y), Pos2::new(graph.right(), y)],
        Stroke::new(1.0, Color32::from_white_alpha(120)),
    );
    let area = Rect::from_min_size(
        screen.right_bottom() - Vec2::splat(230.0),
        Vec2::splat(220.0),
    );
    map.draw(painter, area, shown);
    if shown.help {
        write(screen.center(), Align2::CENTER_CENTER, HELP.into());
    }
}
