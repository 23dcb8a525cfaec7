//! The palette in the window: a strip of pieces, with their plans, and of tools.

use egui::{Align2, Color32, ColorImage, Pos2, Rect, Stroke, TextureHandle, TextureOptions, Vec2};
use enfilade::kit::Kit;
use enfilade_report::palette_plan;

/// Size of an entry, and the part of it for the picture. [Units: points]
const ENTRY: Vec2 = Vec2::new(104.0, 96.0);
const PICTURE: f32 = 74.0;
/// Width of the plan of a piece. [Units: px]
const PIXELS: u32 = 208;
/// Room beside the strip: of the frame times, and of the map. [Units: points]
const BESIDE: [f32; 2] = [310.0, 300.0];

/// State of an editor that the panel shows.
pub(crate) struct EditShown {
    /// The tool in hand.
    pub(crate) chosen: usize,
    pub(crate) hint: String,
    /// Why a click would be refused.
    pub(crate) refused: Option<String>,
    /// Numbers of operations to undo and to redo.
    pub(crate) n_steps: [usize; 2],
    pub(crate) is_saved: bool,
}

/// An entry: its name, and the plan of a piece, three bytes a pixel.
struct StripEntry {
    name: String,
    is_piece: bool,
    plan: Option<([usize; 2], Vec<u8>)>,
    texture: Option<TextureHandle>,
}

/// The strip, with the pictures of its entries.
#[derive(Default)]
pub(crate) struct Strip {
    entries: Vec<StripEntry>,
}

impl Strip {
    /// Draws the plans of the pieces of a palette.
    pub(crate) fn new(kit: &Kit, palette: Vec<(String, Option<usize>)>) -> Self {
        let entry = |(name, piece): (String, Option<usize>)| {
            let world = piece.map(|number| kit.pieces()[number].world());
            let plan = world.and_then(|world| palette_plan(world));
            let plan = plan.and_then(|plan| plan.to_rgb(PIXELS).ok());
            StripEntry {
                name,
                is_piece: piece.is_some(),
                plan: plan.map(|(size, rgb)| (size.map(|x| x as usize), rgb)),
                texture: None,
            }
        };
        Self {
            entries: palette.into_iter().map(entry).collect(),
        }
    }

    /// Draws the entries around the chosen one, and a line about it.
    pub(crate) fn draw(&mut self, painter: &egui::Painter, shown: &EditShown) {
        let screen = painter.clip_rect();
        let width = (screen.width() - BESIDE[0] - BESIDE[1]).max(ENTRY.x);
        let n = ((width / ENTRY.x) as usize).clamp(1, self.entries.len().max(1));
        let first = (shown.chosen + 1).saturating_sub(n.div_ceil(2));
        let first = first.min(self.entries.len() - n.min(self.entries.len()));
        let left = screen.left() + BESIDE[0].min(screen.width() * 0.5 - ENTRY.x * 0.5);
        let top = screen.bottom() - ENTRY.y - 10.0;
        let n_pieces = self.entries.iter().filter(|e| e.is_piece).count();
        for (k, entry) in self.entries.iter_mut().enumerate().skip(first).take(n) {
            let at = Pos2::new(left + (k - first) as f32 * ENTRY.x, top);
            let rect = Rect::from_min_size(at, ENTRY - Vec2::new(6.0, 0.0));
            entry.draw(painter, rect, [k, n_pieces], k == shown.chosen);
        }
        let font = egui::FontId::proportional(14.0);
        let [done, undone] = shown.n_steps;
        let saved = if shown.is_saved { "" } else { ", not saved" };
        let (words, color) = match &shown.refused {
            Some(why) => (why.as_str(), Color32::from_rgb(255, 120, 110)),
            None => (shown.hint.as_str(), Color32::from_rgb(150, 255, 160)),
        };
        let counts = format!("Z: undo {done}; Y: redo {undone}{saved}");
        let mut bottom = top - 6.0;
        for (text, color) in [(counts.as_str(), Color32::LIGHT_GRAY), (words, color)] {
            let galley = painter.layout(text.to_owned(), font.clone(), color, width - 12.0);
            let size = galley.size();
            let rect = Rect::from_min_size(Pos2::new(left, bottom - size.y), size);
            painter.rect_filled(rect.expand(4.0), 3.0, Color32::from_black_alpha(170));
            painter.galley(rect.min, galley, color);
            bottom = rect.top() - 8.0;
        }
    }
}

impl StripEntry {
    fn draw(
        &mut self,
        painter: &egui::Painter,
        rect: Rect,
        [number, n_pieces]: [usize; 2],
        is_chosen: bool,
    ) {
        let ground = if is_chosen {
            Color32::from_rgb(40, 90, 50)
        } else {
            Color32::from_black_alpha(170)
        };
        painter.rect_filled(rect, 4.0, ground);
        let picture = Rect::from_min_size(
            rect.min + Vec2::splat(3.0),
            Vec2::new(rect.width() - 6.0, PICTURE - 3.0),
        );
        match &self.plan {
            Some((size, rgb)) => {
                let texture = self.texture.get_or_insert_with(|| {
                    let image = ColorImage::from_rgb(*size, rgb);
                    let context = painter.ctx();
                    context.load_texture(&self.name, image, TextureOptions::LINEAR)
                });
                let [w, h] = size.map(|x| x as f32);
                let scale = (picture.width() / w).min(picture.height() / h);
                let fitted = Rect::from_center_size(picture.center(), Vec2::new(w, h) * scale);
                let all = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
                painter.image(texture.id(), fitted, all, Color32::WHITE);
            }
            None => {
                // A piece without rooms is a wall.
                let name = if self.is_piece { "wall" } else { &self.name };
                let sign = sign(name, picture.center());
                painter.extend(sign);
            }
        }
        if is_chosen {
            let stroke = Stroke::new(2.0, Color32::from_rgb(120, 255, 140));
            painter.rect_stroke(rect, 4.0, stroke, egui::StrokeKind::Inside);
        }
        let font = egui::FontId::proportional(12.0);
        let key = match (self.is_piece, number) {
            (true, 0..9) => format!("{} ", number + 1),
            (true, _) => String::new(),
            (false, _) => format!("F{} ", 6 + number - n_pieces),
        };
        let at = Pos2::new(rect.center().x, rect.bottom() - 4.0);
        let text = format!("{key}{}", enfilade::geom::shown(&self.name));
        painter.text(at, Align2::CENTER_BOTTOM, text, font, Color32::WHITE);
    }
}

/// Returns the picture of a tool.
fn sign(name: &str, at: Pos2) -> Vec<egui::Shape> {
    let stroke = Stroke::new(2.0, Color32::from_rgb(255, 190, 80));
    let line = |a: [f32; 2], b: [f32; 2]| {
        let point = |[x, y]: [f32; 2]| at + Vec2::new(x, y);
        egui::Shape::line_segment([point(a), point(b)], stroke)
    };
    let frame = |w: f32, h: f32| {
        let corners = [[-w, -h], [w, -h], [w, h], [-w, h]];
        (0..4)
            .map(|i| line(corners[i], corners[(i + 1) % 4]))
            .collect::<Vec<_>>()
    };
    match name {
        "portal" => frame(14.0, 24.0),
        "door" => {
            let mut out = frame(14.0, 24.0);
            out.push(line([-14.0, -24.0], [6.0, -16.0]));
            out.push(line([6.0, -16.0], [6.0, 30.0]));
            out.push(line([6.0, 30.0], [-14.0, 24.0]));
            out
        }
        "wall" => {
            let mut out = frame(26.0, 16.0);
            out.push(line([-26.0, 0.0], [26.0, 0.0]));
            out.extend([-9.0, 9.0].map(|x| line([x, -16.0], [x, 0.0])));
            out.push(line([0.0, 0.0], [0.0, 16.0]));
            out
        }
        "mirror" => {
            let mut out = frame(18.0, 22.0);
            out.push(line([-10.0, 6.0], [2.0, -10.0]));
            out.push(line([-2.0, 12.0], [12.0, -6.0]));
            out
        }
        "lamp" => {
            let mut out = vec![egui::Shape::circle_stroke(at, 10.0, stroke)];
            for k in 0..8 {
                let (sin, cos) = (k as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
                out.push(line([cos * 15.0, sin * 15.0], [cos * 22.0, sin * 22.0]));
            }
            out
        }
        _ => {
            let mut out = frame(18.0, 18.0);
            out.push(line([-18.0, -18.0], [18.0, 18.0]));
            out.push(line([18.0, -18.0], [-18.0, 18.0]));
            out
        }
    }
}
