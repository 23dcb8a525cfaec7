//! Writes drawings as PDF, each on a page of paper, at a scale in architectural use.

use std::fmt;
use std::io::Write as _;

use enfilade_geom::DVec2;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{LineCapStyle, TextRenderingMode};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};
use vello_cpu::kurbo::{Affine, BezPath, PathEl};

use crate::drawing::{Class, Drawing, INK, Item, Path, Rgb, Words};
use crate::font::Fonts;
use crate::raster::laid;

/// Points per millimeter.
const POINT: f64 = 72.0 / 25.4;
/// Paper that printers leave white, and space for the scale below the drawing. [Units: mm]
const MARGIN: f64 = 10.0;
const FOOT: f64 = 8.0;
/// Common scales, times powers of ten.
const SCALES: [f64; 7] = [1.0, 1.25, 2.0, 2.5, 4.0, 5.0, 7.5];

/// A size of paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paper {
    /// `A4`, for example.
    pub name: &'static str,
    /// Shorter and longer side. [Units: mm]
    pub sides: [f64; 2],
}

/// The supported sizes, smallest first.
pub const PAPERS: [Paper; 8] = [
    Paper {
        name: "A5",
        sides: [148.0, 210.0],
    },
    Paper {
        name: "A4",
        sides: [210.0, 297.0],
    },
    Paper {
        name: "Letter",
        sides: [215.9, 279.4],
    },
    Paper {
        name: "Tabloid",
        sides: [279.4, 431.8],
    },
    Paper {
        name: "A3",
        sides: [297.0, 420.0],
    },
    Paper {
        name: "A2",
        sides: [420.0, 594.0],
    },
    Paper {
        name: "A1",
        sides: [594.0, 841.0],
    },
    Paper {
        name: "A0",
        sides: [841.0, 1189.0],
    },
];

/// A drawing that does not fit its paper.
#[derive(Clone, Debug, PartialEq)]
pub struct PaperError {
    /// The requested scale is 1 to this.
    pub scale: f64,
    /// Width and height of the drawing at that scale. [Units: mm]
    pub size: [f64; 2],
    /// The paper's name.
    pub paper: &'static str,
    /// The largest common scale that fits is 1 to this.
    pub fits: f64,
}

impl fmt::Display for PaperError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [w, h] = self.size;
        write!(
            f,
            "at 1:{} the drawing is {w:.0} × {h:.0} mm and does not fit {} with its margins; use 1:{} or larger paper",
            self.scale, self.paper, self.fits
        )
    }
}

impl std::error::Error for PaperError {}

/// Writes each drawing as a page. `scale` is 1 to that number; without it, each page gets the largest common scale
/// that fits. The text can be searched. The same drawings give the same bytes.
///
/// # Errors
///
/// [`PaperError`] if a drawing does not fit the paper at the given scale.
pub fn to_pdf(
    drawings: &[Drawing],
    paper: Paper,
    scale: Option<f64>,
) -> Result<Vec<u8>, PaperError> {
    let mut pdf = Pdf::new();
    let [catalog, pages, font, faint, pale] = [1, 2, 3, 4, 5].map(Ref::new);
    let page_of = |k: usize| Ref::new(10 + 2 * k as i32);
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages)
        .kids((0..drawings.len()).map(page_of))
        .count(drawings.len() as i32);
    pdf.type1_font(font)
        .base_font(Name(b"Helvetica"))
        .encoding_predefined(Name(b"WinAnsiEncoding"));
    for (id, class) in [(faint, Class::Detail), (pale, Class::Beyond)] {
        let opacity = class.look().fill.map_or(1.0, |f| f.1);
        pdf.ext_graphics(id).non_stroking_alpha(opacity);
    }
    let fonts = Fonts::new();
    for (k, drawing) in drawings.iter().enumerate() {
        let sheet = OnPaper::new(drawing, paper, scale)?;
        let stream = Ref::new(page_of(k).get() + 1);
        let mut page = pdf.page(page_of(k));
        let [w, h] = sheet.paper;
        page.media_box(Rect::new(0.0, 0.0, (w * POINT) as f32, (h * POINT) as f32))
            .parent(pages)
            .contents(stream);
        let mut resources = page.resources();
        resources.fonts().pair(Name(b"F"), font);
        let mut states = resources.ext_g_states();
        states.pair(Name(Class::Detail.look().name.as_bytes()), faint);
        states.pair(Name(Class::Beyond.look().name.as_bytes()), pale);
        states.finish();
        resources.finish();
        page.finish();
        let content = sheet.content(drawing, &fonts);
        pdf.stream(stream, &content).filter(Filter::FlateDecode);
    }
    if let Some(first) = drawings.first() {
        pdf.document_info(Ref::new(6)).title(TextStr(&first.title));
    }
    Ok(pdf.finish())
}

/// Placement of a drawing on its paper.
struct OnPaper {
    /// Width and height. [Units: mm]
    paper: [f64; 2],
    scale: f64,
    name: &'static str,
}

impl OnPaper {
    fn new(drawing: &Drawing, paper: Paper, scale: Option<f64>) -> Result<Self, PaperError> {
        let [short, long] = paper.sides;
        let size = drawing.size * 1e3;
        let is_wide = size.x > size.y;
        let [w, h] = if is_wide {
            [long, short]
        } else {
            [short, long]
        };
        let room = DVec2::new(w - 2.0 * MARGIN, h - 2.0 * MARGIN - FOOT);
        let least = (size / room).max_element();
        let fits = usual_scale(least);
        if let Some(scale) = scale
            && scale < least
        {
            return Err(PaperError {
                scale,
                size: (size / scale).to_array(),
                paper: paper.name,
                fits,
            });
        }
        Ok(Self {
            paper: [w, h],
            scale: scale.unwrap_or(fits),
            name: paper.name,
        })
    }

    /// The page's commands, compressed.
    fn content(&self, drawing: &Drawing, fonts: &Fonts) -> Vec<u8> {
        // Points per world unit.
        let unit = 1e3 / self.scale * POINT;
        let top = (self.paper[1] - MARGIN) * POINT;
        let base = Affine::new([unit, 0.0, 0.0, -unit, MARGIN * POINT, top]);
        let mut pen = Pen {
            content: Content::new(),
            fonts,
            base,
            place: DVec2::ZERO,
            line: drawing.zoom * unit / 100.0,
        };
        for item in &drawing.items {
            match item {
                Item::Place { at, .. } => pen.place = *at,
                Item::Path(path) => pen.path(path),
                Item::Words(words) => pen.words(words),
            }
        }
        pen.base = Affine::new([POINT, 0.0, 0.0, -POINT, MARGIN * POINT, MARGIN * POINT]);
        pen.place = DVec2::ZERO;
        pen.words(&Words {
            at: DVec2::ZERO,
            size: 3.0,
            is_centered: false,
            is_turned: false,
            text: format!("1:{} on {}", self.scale, self.name),
            cell: None,
        });
        let commands = pen.content.finish();
        let mut out = ZlibEncoder::new(Vec::new(), Compression::default());
        // Writing to memory cannot fail.
        let written = out.write_all(&commands).and_then(|()| out.finish());
        written.unwrap_or_default()
    }
}

/// The largest common scale (1 to the smallest number) that is at most 1 to `least`.
fn usual_scale(least: f64) -> f64 {
    let power = 10.0_f64.powi(least.max(1.0).log10().floor() as i32);
    let usual = SCALES.iter().map(|s| s * power);
    usual
        .chain([10.0 * power])
        .find(|s| *s >= least)
        .unwrap_or(least)
}

struct Pen<'a> {
    content: Content,
    fonts: &'a Fonts,
    /// From the drawing to points.
    base: Affine,
    place: DVec2,
    /// Width of a line of width 1. [Units: points]
    line: f64,
}

fn channels(color: Rgb) -> [f32; 3] {
    color.map(|c| f32::from(c) / 255.0)
}

impl Pen<'_> {
    fn path(&mut self, path: &Path) {
        let look = path.class.look();
        self.content.save_state();
        if let Some((color, opacity)) = look.fill {
            if opacity < 1.0 {
                self.content.set_parameters(Name(look.name.as_bytes()));
            }
            let [r, g, b] = channels(path.fill.unwrap_or(color));
            self.content.set_fill_rgb(r, g, b);
        }
        if let Some((color, width)) = look.stroke {
            let [r, g, b] = channels(color);
            self.content.set_stroke_rgb(r, g, b);
            self.content.set_line_width((width * self.line) as f32);
            if matches!(path.class, Class::Wall) {
                self.content.set_line_cap(LineCapStyle::RoundCap);
            }
            let dashes = look.dashes.iter().map(|d| (d * self.line) as f32);
            self.content.set_dash_pattern(dashes, 0.0);
        }
        for line in &path.lines {
            for (i, p) in line.iter().enumerate() {
                let at = self.base * point(self.place + *p);
                if i == 0 {
                    self.content.move_to(at.x as f32, at.y as f32);
                } else {
                    self.content.line_to(at.x as f32, at.y as f32);
                }
            }
            if path.is_closed && !line.is_empty() {
                self.content.close_path();
            }
        }
        match (look.fill, look.stroke) {
            (Some(_), Some(_)) => self.content.fill_even_odd_and_stroke(),
            (Some(_), None) => self.content.fill_even_odd(),
            _ => self.content.stroke(),
        };
        self.content.restore_state();
    }

    /// Draws visible outlines, and the same text invisibly for searching, as far as a standard font covers it.
    fn words(&mut self, words: &Words) {
        let (outline, length) = self.fonts.outlines(&words.text);
        let at = self.place + words.at;
        let laid = self.base * Affine::translate((at.x, at.y)) * laid(words, length);
        let [r, g, b] = channels(INK);
        self.content.set_fill_rgb(r, g, b);
        self.outline(&(laid * outline));
        self.content.fill_nonzero();
        let letters: Vec<u8> = words
            .text
            .chars()
            .map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?'))
            .collect();
        // In text space, y points up.
        let matrix = (laid * Affine::scale_non_uniform(1.0, -1.0)).as_coeffs();
        self.content
            .begin_text()
            .set_font(Name(b"F"), 1.0)
            .set_text_rendering_mode(TextRenderingMode::Invisible)
            .set_text_matrix(matrix.map(|x| x as f32))
            .show(Str(&letters))
            .end_text();
    }

    fn outline(&mut self, outline: &BezPath) {
        let mut last = vello_cpu::kurbo::Point::ORIGIN;
        for element in outline.elements() {
            match *element {
                PathEl::MoveTo(p) => {
                    self.content.move_to(p.x as f32, p.y as f32);
                }
                PathEl::LineTo(p) => {
                    self.content.line_to(p.x as f32, p.y as f32);
                }
                PathEl::QuadTo(c, p) => {
                    // The equivalent cubic curve.
                    let [a, b] = [last.lerp(c, 2.0 / 3.0), p.lerp(c, 2.0 / 3.0)];
                    self.cubic([a, b, p]);
                }
                PathEl::CurveTo(a, b, p) => self.cubic([a, b, p]),
                PathEl::ClosePath => {
                    self.content.close_path();
                }
            }
            last = element.end_point().unwrap_or(last);
        }
    }

    fn cubic(&mut self, points: [vello_cpu::kurbo::Point; 3]) {
        let [a, b, c] = points.map(|p| [p.x as f32, p.y as f32]);
        self.content.cubic_to(a[0], a[1], b[0], b[1], c[0], c[1]);
    }
}

fn point(p: DVec2) -> vello_cpu::kurbo::Point {
    vello_cpu::kurbo::Point::new(p.x, p.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_scale_is_the_next_smaller_one() {
        for (least, usual) in [
            (0.3, 1.0),
            (1.0, 1.0),
            (41.0, 50.0),
            (50.0, 50.0),
            (99.0, 100.0),
            (101.0, 125.0),
            (780.0, 1000.0),
        ] {
            assert_eq!(usual_scale(least), usual, "{least}");
        }
    }
}
