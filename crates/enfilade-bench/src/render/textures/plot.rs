//! Line plots as SVG.

use std::fmt::Write;

/// Size of a plot, and its margins left, above, right and below. [Units: px]
const SIZE: [f64; 2] = [800.0, 400.0];
const MARGINS: [f64; 4] = [64.0, 52.0, 16.0, 48.0];
/// Width of a character of the legend, and of the line before a label with its gaps; estimated. [Units: px]
const LETTER: f64 = 5.7;
const SAMPLE: f64 = 34.0;
/// Colors that are told apart without seeing red or green (Okabe & Ito 2008).
const COLORS: [&str; 5] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000"];

/// A named line of values, one a frame.
pub(super) struct PlotLine<'a> {
    pub(super) label: &'a str,
    pub(super) values: Vec<f64>,
}

/// Lines over the number of the frame, from zero upwards.
pub(super) struct Plot<'a> {
    pub(super) title: &'a str,
    /// Labels of the axes.
    pub(super) x: &'a str,
    pub(super) y: &'a str,
    pub(super) lines: &'a [PlotLine<'a>],
}

impl Plot<'_> {
    pub(super) fn to_svg(&self) -> String {
        let [width, height] = SIZE;
        let [left, top, right, bottom] = MARGINS;
        let (inner_w, inner_h) = (width - left - right, height - top - bottom);
        let values = || self.lines.iter().flat_map(|l| l.values.iter().copied());
        let most = values().filter(|v| v.is_finite()).fold(0.0, f64::max);
        let n = self.lines.iter().map(|l| l.values.len()).max().unwrap_or(0);
        let (step_x, step_y) = (tick((n as f64).max(1.0)), tick(most.max(1e-9)));
        let end_y = (most / step_y).ceil().max(1.0) * step_y;
        let x = |frame: f64| left + frame / (n as f64 - 1.0).max(1.0) * inner_w;
        let y = |value: f64| top + (1.0 - value / end_y) * inner_h;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
             font-size=\"12\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n"
        );
        let text = |at: [f64; 2], anchor: &str, more: &str, text: &str| {
            let [x, y] = at;
            format!(
                "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\"{more}>{text}</text>\n"
            )
        };
        out += &text([left, 20.0], "start", " font-size=\"15\"", self.title);
        let mut value = 0.0;
        while value <= end_y * 1.0001 {
            let at = y(value);
            let to = width - right;
            let line = format!("<path d=\"M{left} {at:.1}H{to}\" stroke=\"#ddd\"/>\n");
            out += &line;
            out += &text([left - 6.0, at + 4.0], "end", "", &short(value));
            value += step_y;
        }
        let mut frame = 0.0;
        while frame < n as f64 {
            let at = [x(frame), height - bottom + 16.0];
            out += &text(at, "middle", "", &short(frame));
            frame += step_x;
        }
        out += &text([left + inner_w * 0.5, height - 10.0], "middle", "", self.x);
        let middle = top + inner_h * 0.5;
        let turned = format!(" transform=\"rotate(-90 14 {middle:.1})\"");
        out += &text([14.0, middle], "middle", &turned, self.y);
        let mut at = left;
        for (i, line) in self.lines.iter().enumerate() {
            let color = COLORS[i % COLORS.len()];
            let mut points = String::new();
            for (frame, value) in line.values.iter().enumerate() {
                // Writing to a string does not fail.
                let _ = write!(points, "{:.1},{:.1} ", x(frame as f64), y(*value));
            }
            let points = points.trim_end();
            out += &format!("<polyline points=\"{points}\" fill=\"none\" stroke=\"{color}\"/>\n");
            let to = at + 18.0;
            out += &format!(
                "<path d=\"M{at:.1} 36H{to:.1}\" stroke=\"{color}\" stroke-width=\"3\"/>\n"
            );
            out += &text([to + 5.0, 40.0], "start", " font-size=\"11\"", line.label);
            at += SAMPLE + LETTER * line.label.len() as f64;
        }
        out + "</svg>\n"
    }
}

/// Returns a distance of ticks, 1, 2 or 5 times a power of ten, for four to nine up to `most`.
fn tick(most: f64) -> f64 {
    let power = 10_f64.powf((most / 4.0).log10().floor());
    let fits = |k: &f64| k * power <= most / 4.0;
    [5.0, 2.0, 1.0].into_iter().find(fits).unwrap_or(1.0) * power
}

/// Formats without zeros at the end.
fn short(x: f64) -> String {
    let text = format!("{x:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_has_its_lines_within_its_frame_and_round_ticks() {
        let line = |label, values: &[f64]| PlotLine {
            label,
            values: values.to_vec(),
        };
        let lines = [line("up", &[0.0, 50.0, 97.0]), line("none", &[])];
        let plot = Plot {
            title: "A plot",
            x: "frame",
            y: "value",
            lines: &lines,
        };
        let svg = plot.to_svg();
        assert!(svg.contains("points=\"64.0,352.0 424.0,"), "{svg}");
        for shown in [">up<", ">none<", ">20<", ">100<", ">frame<", ">value<"] {
            assert!(svg.contains(shown), "{shown}: {svg}");
        }
        assert_eq!([tick(97.0), tick(1000.0), tick(0.7)], [20.0, 200.0, 0.1]);
        assert_eq!([short(0.30000000000000004), short(120.0)], ["0.3", "120"]);
    }
}
