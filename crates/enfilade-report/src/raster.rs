//! Writes drawings as PNG.

use std::fmt;

use enfilade_geom::DVec2;
use vello_cpu::color::{AlphaColor, Srgb};
use vello_cpu::kurbo::{Affine, BezPath, Cap, Stroke};
use vello_cpu::peniko::Fill;
use vello_cpu::{
    Level, Pixmap, RasterizerSettings, RenderContext, RenderMode, RenderSettings, Resources,
};

use crate::drawing::{Class, Drawing, INK, Item, Path, Rgb, Words};
use crate::font::Fonts;

/// Largest number of pixels along a side.
pub const MAX_PIXELS: u32 = 16_384;

/// A picture that cannot be made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RasterError {
    /// A side is 0, or longer than [`MAX_PIXELS`]. [Units: pixels]
    Size {
        /// The requested width and height.
        size: [u32; 2],
    },
    /// The encoder's message.
    Encoding(String),
}

impl fmt::Display for RasterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { size: [w, h] } => write!(
                f,
                "the picture would be {w} × {h} pixels; each side must have between 1 and {MAX_PIXELS}: choose another width"
            ),
            Self::Encoding(why) => write!(f, "the picture cannot be encoded as PNG: {why}"),
        }
    }
}

impl std::error::Error for RasterError {}

impl Drawing {
    /// Draws the drawing and encodes it as PNG, `width` pixels wide. Returns the same bytes on every run.
    ///
    /// # Errors
    ///
    /// [`RasterError::Size`] if a side is 0 or longer than [`MAX_PIXELS`].
    pub fn to_png(&self, width: u32) -> Result<Vec<u8>, RasterError> {
        let ([width, height], rgb) = self.to_rgb(width)?;
        encoded(&rgb, width, height)
    }

    /// Draws the drawing, `width` pixels wide; returns width and height, and three bytes a pixel, row by row from the top.
    ///
    /// # Errors
    ///
    /// As [`Drawing::to_png`].
    pub fn to_rgb(&self, width: u32) -> Result<([u32; 2], Vec<u8>), RasterError> {
        let scale = f64::from(width) / self.size.x;
        let height = (self.size.y * scale).ceil() as u32;
        let is_drawable = |x: u32| (1..=MAX_PIXELS).contains(&x);
        if !is_drawable(width) || !is_drawable(height) {
            return Err(RasterError::Size {
                size: [width, height],
            });
        }
        // Instructions that every processor of the architecture has, so that all give the same pixels.
        let settings = RenderSettings {
            level: Level::baseline(),
            num_threads: 0,
        };
        let mut brush = Brush {
            context: RenderContext::new_with(width as u16, height as u16, settings),
            fonts: Fonts::new(),
            zoom: self.zoom,
            scale,
            place: DVec2::ZERO,
        };
        // The drawing may cover the last row of pixels only in part.
        brush.paper(self.size + 1.0 / scale);
        for item in &self.items {
            match item {
                Item::Place { at, .. } => brush.place = *at,
                Item::Path(path) => brush.path(path),
                Item::Words(words) => brush.words(words),
            }
        }
        brush.context.flush();
        let mut pixels = Pixmap::new(width as u16, height as u16);
        let settings = RasterizerSettings {
            render_mode: RenderMode::OptimizeQuality,
            ..RasterizerSettings::default()
        };
        brush
            .context
            .render_with(&mut pixels, &mut Resources::new(), settings);
        // The paper is opaque.
        let rgb = pixels.data().iter().flat_map(|p| [p.r, p.g, p.b]);
        Ok(([width, height], rgb.collect()))
    }
}

/// Encodes three bytes per pixel.
fn encoded(rgb: &[u8], width: u32, height: u32) -> Result<Vec<u8>, RasterError> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let done = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(rgb)?;
        writer.finish()
    });
    done.map_err(|why| RasterError::Encoding(why.to_string()))?;
    Ok(out)
}

struct Brush {
    context: RenderContext,
    fonts: Fonts,
    zoom: f64,
    /// Pixels per world unit.
    scale: f64,
    place: DVec2,
}

fn paint([r, g, b]: Rgb, opacity: f32) -> AlphaColor<Srgb> {
    AlphaColor::from_rgb8(r, g, b).with_alpha(opacity)
}

impl Brush {
    fn paper(&mut self, size: DVec2) {
        let corners = [DVec2::ZERO, DVec2::X * size, size, DVec2::Y * size];
        let outline = lines(&[corners.to_vec()], true);
        self.context.set_transform(Affine::scale(self.scale));
        self.context.set_paint(paint([0xff; 3], 1.0));
        self.context.fill_path(&outline);
    }

    fn path(&mut self, path: &Path) {
        let look = path.class.look();
        let outline = lines(&path.lines, path.is_closed);
        let at = (self.place.x, self.place.y);
        self.context
            .set_transform(Affine::scale(self.scale) * Affine::translate(at));
        if let Some((color, opacity)) = look.fill {
            self.context.set_fill_rule(Fill::EvenOdd);
            self.context
                .set_paint(paint(path.fill.unwrap_or(color), opacity));
            self.context.fill_path(&outline);
        }
        if let Some((color, width)) = look.stroke {
            let cap = if matches!(path.class, Class::Wall) {
                Cap::Round
            } else {
                Cap::Butt
            };
            // Styles are in centimeters; lines thinner than half a pixel would fade away.
            let width = (width * self.zoom / 100.0).max(0.5 / self.scale);
            let mut stroke = Stroke::new(width).with_caps(cap);
            if !look.dashes.is_empty() {
                stroke = stroke.with_dashes(0.0, look.dashes.iter().map(|d| d * self.zoom / 100.0));
            }
            self.context.set_stroke(stroke);
            self.context.set_paint(paint(color, 1.0));
            self.context.stroke_path(&outline);
        }
    }

    fn words(&mut self, words: &Words) {
        let (outline, length) = self.fonts.outlines(&words.text);
        let at = self.place + words.at;
        self.context.set_transform(
            Affine::scale(self.scale) * Affine::translate((at.x, at.y)) * laid(words, length),
        );
        self.context.set_fill_rule(Fill::NonZero);
        self.context.set_paint(paint(INK, 1.0));
        self.context.fill_path(&outline);
    }
}

/// The transform from a line of text that begins at the origin to its place and direction.
pub(crate) fn laid(words: &Words, length: f64) -> Affine {
    let turn = if words.is_turned {
        -std::f64::consts::FRAC_PI_2
    } else {
        0.0
    };
    let start = if words.is_centered {
        -0.5 * length
    } else {
        0.0
    };
    Affine::rotate(turn) * Affine::scale(words.size) * Affine::translate((start, 0.0))
}

fn lines(lines: &[Vec<DVec2>], is_closed: bool) -> BezPath {
    let mut out = BezPath::new();
    for line in lines {
        for (i, p) in line.iter().enumerate() {
            if i == 0 {
                out.move_to((p.x, p.y));
            } else {
                out.line_to((p.x, p.y));
            }
        }
        if is_closed && !line.is_empty() {
            out.close_path();
        }
    }
    out
}
