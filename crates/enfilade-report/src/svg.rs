//! Writes drawings as SVG, the same bytes every time.

use std::fmt::Write;

use enfilade_cpg::CellId;
use enfilade_geom::{DVec2, shown};

use crate::drawing::{CLASSES, Class, Drawing, INK, Item, Path, Rgb, Words};

/// Drawing units per meter: centimeters, so that one decimal is a millimeter.
pub(crate) const SCALE: f64 = 100.0;

/// Formats a number with at most one decimal, omitted if zero.
pub(crate) fn number(x: f64) -> String {
    let tenths = (x * 10.0).round() as i64;
    if tenths % 10 == 0 {
        return (tenths / 10).to_string();
    }
    let sign = if tenths < 0 { "-" } else { "" };
    // The smallest number of the type has no absolute value in it.
    let tenths = tenths.unsigned_abs();
    format!("{sign}{}.{}", tenths / 10, tenths % 10)
}

/// `x y` of a point in meters, as drawn.
pub(crate) fn point(p: DVec2) -> String {
    format!("{} {}", number(p.x * SCALE), number(p.y * SCALE))
}

/// Text safe between tags and in attributes: passed through [`shown`], and so free of characters that XML cannot
/// hold.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in shown(text).to_string().chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

/// `#rrggbb`.
pub(crate) fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

impl Drawing {
    /// Writes the drawing as an SVG document. One drawing unit is a centimeter.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let mut out = String::new();
        let (w, h) = (number(self.size.x * SCALE), number(self.size.y * SCALE));
        // Pixels for viewers that do not fit the drawing to their window.
        let pixels = (1600.0 / self.size.max_element()).max(1.0);
        let _ = write!(
            out,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {w} {h}\" \
             font-family=\"sans-serif\">\n<title>{}</title>\n<style>{}</style>\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n",
            (self.size.x * pixels).round(),
            (self.size.y * pixels).round(),
            escaped(&self.title),
            style(self.zoom),
        );
        let mut is_placed = false;
        for item in &self.items {
            match item {
                Item::Place { at, storey } => {
                    if std::mem::replace(&mut is_placed, true) {
                        out.push_str("</g>\n");
                    }
                    let class = storey.as_ref().map_or(String::new(), |name| {
                        format!(" class=\"storey\" data-storey=\"{}\"", escaped(name))
                    });
                    let (x, y) = (number(at.x * SCALE), number(at.y * SCALE));
                    let _ = writeln!(out, "<g{class} transform=\"translate({x} {y})\">");
                }
                Item::Path(path) => write_path(&mut out, path),
                Item::Words(words) => write_words(&mut out, words),
            }
        }
        if is_placed {
            out.push_str("</g>\n");
        }
        out.push_str("</svg>\n");
        out
    }
}

/// The look of the classes, as CSS. Scoped to this sheet: several drawings on one page have different line widths.
fn style(zoom: f64) -> String {
    let mut out = String::new();
    for class in CLASSES {
        let look = class.look();
        let _ = write!(out, ".{}{{", look.name);
        match look.fill {
            // Each cell has its own color.
            Some(_) if matches!(class, Class::Cell) => {}
            Some((_, opacity)) if matches!(class, Class::Beyond) => {
                let _ = write!(out, "fill-opacity:{opacity};");
            }
            Some((color, opacity)) => {
                let _ = write!(out, "fill:{};fill-opacity:{opacity};", hex(color));
            }
            None => out.push_str("fill:none;"),
        }
        if let Some((color, width)) = look.stroke {
            let width = number(width * zoom);
            let _ = write!(out, "stroke:{};stroke-width:{width};", hex(color));
        }
        if matches!(class, Class::Wall) {
            out.push_str("stroke-linecap:round;");
        }
        if !look.dashes.is_empty() {
            let dashes: Vec<String> = look.dashes.iter().map(|d| number(d * zoom)).collect();
            let _ = write!(out, "stroke-dasharray:{};", dashes.join(" "));
        }
        out.push('}');
    }
    let _ = write!(out, "text{{fill:{}}}", hex(INK));
    out
}

fn of_cell(cell: Option<CellId>) -> String {
    cell.map_or(String::new(), |c| format!(" data-cell=\"{}\"", c.0))
}

fn write_path(out: &mut String, path: &Path) {
    let data: String = path
        .lines
        .iter()
        .map(|line| {
            let corners: Vec<String> = line.iter().map(|&p| point(p)).collect();
            let end = if path.is_closed { "Z" } else { "" };
            format!("M{}{end}", corners.join("L"))
        })
        .collect();
    let fill = path
        .fill
        .map_or(String::new(), |c| format!(" fill=\"{}\"", hex(c)));
    let rule = if matches!(path.class, Class::Cell | Class::Beyond | Class::Solid) {
        " fill-rule=\"evenodd\""
    } else {
        ""
    };
    let _ = write!(
        out,
        "<path class=\"{}\"{}{fill}{rule} d=\"{data}\"",
        path.class.look().name,
        of_cell(path.cell)
    );
    let _ = match &path.hint {
        Some(hint) => writeln!(out, "><title>{}</title></path>", escaped(hint)),
        None => writeln!(out, "/>"),
    };
}

fn write_words(out: &mut String, words: &Words) {
    let (x, y) = (number(words.at.x * SCALE), number(words.at.y * SCALE));
    let place = if words.is_turned {
        format!("transform=\"translate({x} {y}) rotate(-90)\"")
    } else {
        format!("x=\"{x}\" y=\"{y}\"")
    };
    let anchor = if words.is_centered { "middle" } else { "start" };
    let _ = writeln!(
        out,
        "<text {place} font-size=\"{}\" text-anchor=\"{anchor}\"{}>{}</text>",
        number(words.size * SCALE),
        of_cell(words.cell),
        escaped(&words.text)
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_any_size_are_numbers() {
        assert_eq!(number(-0.04), "0");
        assert_eq!(number(-1.25), "-1.3");
        assert_eq!(number(f64::MAX), "922337203685477580.7");
        assert_eq!(number(f64::MIN), "-922337203685477580.8");
    }
}
