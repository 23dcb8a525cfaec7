//! Text as outlines, for formats whose readers may lack our fonts.
//!
//! The fonts are the ones egui shows its text in: the window of `view` includes them anyway, and their licenses are
//! open.

use skrifa::instance::{LocationRef, Size};
use skrifa::outline::{DrawSettings, OutlinePen};
use skrifa::{FontRef, GlyphId, MetadataProvider};
use vello_cpu::kurbo::{Affine, BezPath};

/// The fonts searched for a letter, in order.
pub(crate) struct Fonts {
    fonts: Vec<FontRef<'static>>,
}

impl Fonts {
    pub(crate) fn new() -> Self {
        let files = [
            epaint_default_fonts::UBUNTU_LIGHT,
            epaint_default_fonts::HACK_REGULAR,
        ];
        let fonts = files.into_iter().filter_map(|f| FontRef::new(f).ok());
        Self {
            fonts: fonts.collect(),
        }
    }

    /// Outlines of a line of text (base line from the origin, y down, letters 1 high), and its length.
    pub(crate) fn outlines(&self, words: &str) -> (BezPath, f64) {
        let mut path = BezPath::new();
        let mut x = 0.0;
        for letter in words.chars() {
            let Some((font, glyph)) = self.glyph(letter) else {
                continue;
            };
            let location = LocationRef::default();
            let mut pen = Tracer(BezPath::new());
            if let Some(outline) = font.outline_glyphs().get(glyph) {
                let settings = DrawSettings::unhinted(Size::new(1.0), location);
                // A glyph with an invalid outline stays a gap.
                if outline.draw(settings, &mut pen).is_ok() {
                    path.extend(Affine::translate((x, 0.0)) * pen.0);
                }
            }
            let metrics = font.glyph_metrics(Size::new(1.0), location);
            x += f64::from(metrics.advance_width(glyph).unwrap_or(0.5));
        }
        (path, x)
    }

    /// The glyph of a letter in the first font that has one; otherwise that of a question mark.
    fn glyph(&self, letter: char) -> Option<(&FontRef<'static>, GlyphId)> {
        let find = |c: char| {
            self.fonts
                .iter()
                .find_map(|f| Some((f, f.charmap().map(c)?)))
        };
        find(letter).or_else(|| find('?'))
    }
}

/// Receives an outline with y up.
struct Tracer(BezPath);

fn at(x: f32, y: f32) -> (f64, f64) {
    (f64::from(x), -f64::from(y))
}

impl OutlinePen for Tracer {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(at(x, y));
    }
    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(at(x, y));
    }
    fn quad_to(&mut self, cx: f32, cy: f32, x: f32, y: f32) {
        self.0.quad_to(at(cx, cy), at(x, y));
    }
    fn curve_to(&mut self, cx0: f32, cy0: f32, cx1: f32, cy1: f32, x: f32, y: f32) {
        self.0.curve_to(at(cx0, cy0), at(cx1, cy1), at(x, y));
    }
    fn close(&mut self) {
        self.0.close_path();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_that_no_font_has_are_question_marks() {
        let fonts = Fonts::new();
        let (path, length) = fonts.outlines("m²");
        assert!(length > 0.8 && length < 2.0 && !path.is_empty(), "{length}");
        assert_eq!(fonts.outlines("\u{10ffff}").0, fonts.outlines("?").0);
        assert!(fonts.outlines(" ").1 > 0.1);
    }
}
