//! The part of the panel about a review: the step, and the classes of weights with their colors.

use egui::{Color32, Painter, Pos2, Rect, Vec2};

/// State of a review that the panel shows.
pub(crate) struct ReviewShown {
    /// `true` if the scene is shown, which has no rooms to draw a map of.
    pub(crate) is_without_map: bool,
    pub(super) lines: Vec<String>,
    pub(super) legend: Vec<LegendLine>,
}

/// A class of portals: its color as sRGB, the number of portals, and what they are.
pub(super) struct LegendLine {
    pub(super) color: [u8; 3],
    pub(super) n: usize,
    pub(super) words: String,
}

/// Size of the patch of a color. [Units: points]
const PATCH: Vec2 = Vec2::new(22.0, 12.0);
const GAP: f32 = 8.0;

/// Draws it at the upper right.
pub(crate) fn draw_review(painter: &Painter, screen: Rect, shown: &ReviewShown) {
    let font = egui::FontId::monospace(13.0);
    let laid = |text: String| painter.layout_no_wrap(text, font.clone(), Color32::WHITE);
    let rows = shown.lines.iter().map(|line| (None, laid(line.clone())));
    let legend = shown.legend.iter().map(|line| {
        let text = format!("{:>5}  {}", line.n, line.words);
        (Some(line.color), laid(text))
    });
    let rows: Vec<_> = rows.chain(legend).collect();
    let indent = |color: Option<[u8; 3]>| color.map_or(0.0, |_| PATCH.x + GAP);
    let widths = rows
        .iter()
        .map(|(color, text)| indent(*color) + text.size().x);
    let width = widths.fold(0.0, f32::max);
    let height: f32 = rows.iter().map(|(_, text)| text.size().y).sum();
    let least = Pos2::new(screen.right() - 18.0 - width, screen.top() + 18.0);
    let area = Rect::from_min_size(least, Vec2::new(width, height));
    painter.rect_filled(area.expand(6.0), 4.0, Color32::from_black_alpha(170));
    let mut at = least;
    for (color, text) in rows {
        let size = text.size();
        if let Some([r, g, b]) = color {
            let top = at.y + (size.y - PATCH.y) * 0.5;
            let patch = Rect::from_min_size(Pos2::new(at.x, top), PATCH);
            painter.rect_filled(patch, 2.0, Color32::from_rgb(r, g, b));
        }
        let text_at = Pos2::new(at.x + indent(color), at.y);
        painter.galley(text_at, text, Color32::WHITE);
        at.y += size.y;
    }
}
