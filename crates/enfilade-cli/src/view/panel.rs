//! The panel over the picture: counters, frame times, a crosshair, a small map, help.

use std::collections::VecDeque;

use egui::{Align2, Color32, Pos2, Rect, Stroke, Vec2};
use enfilade::cpg::PortalId;
use enfilade::world::{PartId, Space};
use enfilade_render::{Camera, Gpu, Paint, PortalTextureCounts};
use winit::event::WindowEvent;
use winit::window::Window;

use super::editing::{EDIT_HELP, EditShown, Strip};
use super::map::{Map, MapShown};
use super::mode::Mode;
use super::reviewing::{REVIEW_HELP, ReviewShown, draw_review};
use super::titles::Titles;
use crate::living::Blip;

/// The contents of the panel.
#[derive(Default)]
pub(super) struct Shown {
    pub(super) help: bool,
    pub(super) portals: bool,
    /// `true` if the radar is on.
    pub(super) radar: bool,
    /// `true` if the crosshair tells why what is there is there.
    pub(super) whys: bool,
    pub(super) plain: bool,
    pub(super) paint: Paint,
    pub(super) cells: Vec<u32>,
    pub(super) closed: Vec<(PartId, PortalId)>,
    /// Triangles drawn, triangles in total, and draw calls.
    pub(super) counts: [u64; 3],
    pub(super) camera: Option<Camera>,
    pub(super) mode: Mode,
    /// Waits for the adapter, and occlusion queries, in the mode that uses them.
    pub(super) queries: Option<[u32; 2]>,
    /// Name of the cell at the crosshair, or why it is there.
    pub(super) ahead: String,
    /// `true` if distant rooms and objects are spared.
    pub(super) spares: bool,
    /// Counters of portal textures, in the mode that uses them.
    pub(super) textures: Option<PortalTextureCounts>,
    /// `true` if portals that are textures are tinted.
    pub(super) tints: bool,
    /// Magnification of the map, relative to the whole.
    pub(super) zoom: f32,
    pub(super) is_recording: bool,
    pub(super) flies: bool,
    pub(super) message: String,
    /// Counters of the pieces of a packed world, in lines.
    pub(super) streamed: String,
    /// Counters and sounds of what lives there, in lines.
    pub(super) living: String,
    /// The things on the radar, and what it says of them.
    pub(super) blips: Vec<Blip>,
    pub(super) told: String,
    pub(super) times: VecDeque<f32>,
    /// The editor, while editing is on.
    pub(super) edit: Option<EditShown>,
    /// The review, if a decimation is reviewed.
    pub(super) review: Option<ReviewShown>,
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

/// Draws with egui over a picture.
pub(super) struct Panel {
    context: egui::Context,
    state: egui_winit::State,
    renderer: egui_wgpu::Renderer,
    map: Map,
    /// The palette, if the world can be edited.
    strip: Option<Strip>,
}

const HELP: &str = "\
W A S D        walk; Shift: run
mouse          look around; Tab: let go of it, then drag
click          open or close the door or doorway there
wheel, + -     zoom of the map
F              fly; Q and E: down and up
M              drawn: portals, far portals as textures,
               occlusion queries, frustum, everything
T              tint the portals that are textures
L              spare small portals and what is behind them
R              radar: things around, on the map and in words
I              why the room or doorway at the crosshair is there
C              paint: lit, cells, overdraw
O              outline doorways and narrowed views
P              plain: no shadows, no ambient occlusion
F4, F5         record a path; write it
F12            picture to a file
F1             this help
Esc            close";

/// Rooms and their names, for the map.
pub(super) struct MapSource<'a> {
    pub(super) space: &'a Space,
    pub(super) titles: &'a Titles,
}

impl Panel {
    pub(super) fn new(
        gpu: &Gpu,
        window: &Window,
        format: wgpu::TextureFormat,
        strip: Option<Strip>,
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
            map: Map::default(),
            strip,
        }
    }

    /// Shows the map of another world, with what stands in it if `has_parts`.
    pub(super) fn renew_map(&mut self, has_parts: bool) {
        self.map.renew(has_parts);
    }

    /// Returns `true` if the panel consumes an event.
    pub(super) fn on_event(&mut self, window: &Window, event: &WindowEvent) -> bool {
        self.state.on_window_event(window, event).consumed
    }

    pub(super) fn draw(
        &mut self,
        gpu: &Gpu,
        window: &Window,
        output: &wgpu::TextureView,
        size: [u32; 2],
        map: &MapSource<'_>,
        shown: &Shown,
    ) {
        let input = self.state.take_egui_input(window);
        if let Some(camera) = shown.camera {
            self.map.follow(map.space, map.titles, camera.eye);
        }
        let (map, strip) = (&mut self.map, &mut self.strip);
        let mut full = self
            .context
            .run_ui(input, |ui| paint(ui, map, strip, shown));
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
        // They are applied; dropped as they are, they would count as forgotten.
        full.textures_delta.clear();
    }
}

/// Returns a line about portal textures.
fn textures_told(counts: &PortalTextureCounts) -> String {
    let PortalTextureCounts {
        n_textured,
        n_turning,
        n_made,
        n_plain,
        n_bytes,
        ..
    } = *counts;
    let mib = n_bytes as f64 / f64::from(1 << 20);
    let mut text = format!("\n{n_textured} portals are textures ({mib:.0} MiB)");
    for (n, words) in [
        (n_turning, "turning"),
        (n_made, "made"),
        (n_plain, "of one color"),
    ] {
        if n > 0 {
            text += &format!(", {n} {words}");
        }
    }
    text
}

fn paint(ui: &egui::Ui, map: &mut Map, strip: &mut Option<Strip>, shown: &Shown) {
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
        shown.mode.words()
    );
    if let Some([rounds, queries]) = shown.queries {
        text += &format!("\n{queries} occlusion queries in {rounds} rounds");
    }
    if let Some(counts) = shown.textures {
        text += &textures_told(&counts);
    }
    for (is_so, words) in [
        (shown.spares, "small portals spared"),
        (shown.flies, "flying"),
        (shown.is_recording, "recording (F5 writes)"),
    ] {
        if is_so {
            text += "\n";
            text += words;
        }
    }
    for line in [&shown.streamed, &shown.living, &shown.told, &shown.message] {
        if !line.is_empty() {
            text += "\n";
            text += line;
        }
    }
    if !shown.help {
        text += "\nF1: help";
    }
    write(
        screen.left_top() + Vec2::splat(12.0),
        Align2::LEFT_TOP,
        text,
    );
    draw_crosshair(painter, screen.center(), &shown.ahead);
    draw_times(painter, screen, &shown.times);
    let area = Rect::from_min_size(
        screen.right_bottom() - Vec2::splat(290.0),
        Vec2::splat(280.0),
    );
    let has_map = !shown.review.as_ref().is_some_and(|it| it.is_without_map);
    if let Some(camera) = shown.camera.filter(|_| has_map) {
        let shown = MapShown {
            camera,
            cells: &shown.cells,
            closed: &shown.closed,
            zoom: shown.zoom,
            blips: &shown.blips,
        };
        map.draw(painter, area, &shown);
    }
    if let (Some(strip), Some(edit)) = (strip.as_mut(), &shown.edit) {
        strip.draw(painter, edit);
    }
    if let Some(review) = &shown.review {
        draw_review(painter, screen, review);
    }
    if shown.help {
        let text = match (strip, &shown.review) {
            (Some(_), _) => format!("{EDIT_HELP}\n\n{HELP}"),
            (None, Some(_)) => format!("{REVIEW_HELP}\n\n{HELP}"),
            (None, None) => HELP.to_owned(),
        };
        write(screen.center(), Align2::CENTER_CENTER, text);
    }
}

/// Draws the point that a click hits, and the name of its cell.
fn draw_crosshair(painter: &egui::Painter, at: Pos2, name: &str) {
    for (width, color) in [(3.0, Color32::from_black_alpha(140)), (1.0, Color32::WHITE)] {
        for d in [Vec2::new(8.0, 0.0), Vec2::new(0.0, 8.0)] {
            painter.line_segment([at - d, at + d], Stroke::new(width, color));
        }
    }
    let font = egui::FontId::proportional(13.0);
    let below = at + Vec2::new(0.0, 16.0);
    for (shift, color) in [(1.0, Color32::BLACK), (0.0, Color32::WHITE)] {
        let at = below + Vec2::splat(shift);
        painter.text(at, Align2::CENTER_TOP, name, font.clone(), color);
    }
}

/// Draws frame times: a bar each, up to 50 ms, with a line at 16.7 ms.
fn draw_times(painter: &egui::Painter, screen: Rect, times: &VecDeque<f32>) {
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
    for (i, &ms) in times.iter().enumerate() {
        // Above 30 frames a second, a frame is smooth; slower ones are marked, and no alarm.
        let color = if ms > 33.4 {
            Color32::LIGHT_YELLOW
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
    let font = egui::FontId::proportional(10.0);
    for (ms, y) in [
        ("16.7 ms", y),
        ("50 ms", graph.top() + 6.0),
        ("0", graph.bottom() - 5.0),
    ] {
        let at = Pos2::new(graph.right() + 4.0, y);
        painter.text(at, Align2::LEFT_CENTER, ms, font.clone(), Color32::WHITE);
    }
}
