//! Fits the name of a cell into the cell: finds a place and a size.

use std::borrow::Cow;

use enfilade_geom::DVec2;

use crate::section::{Label, Region, Section};

/// The width of a letter as a fraction of its height: an upper estimate over common fonts, since each viewer has its
/// own.
const LETTER: f64 = 0.62;
/// The height of a line as a fraction of the letters' height.
const LINE: f64 = 1.15;
/// Factor on the size until the text fits.
const SMALLER: f64 = 0.88;
/// Height of the area below a name as a fraction of the name's.
const AREA: f64 = 0.7;
/// Space between a name and what stands beside it, as a fraction of the letters' height.
const AROUND: f64 = 0.3;

/// Most letters of a name in drawings and pages.
const LONGEST: usize = 64;

/// A name as drawn: the first 63 letters and an ellipsis if it has more than 64.
pub(crate) fn shortened(name: &str) -> Cow<'_, str> {
    let mut ends = name.char_indices().map(|(at, _)| at);
    let (last, beyond) = (ends.nth(LONGEST - 1), ends.next());
    match (last, beyond) {
        (Some(last), Some(_)) => format!("{}…", &name[..last]).into(),
        _ => name.into(),
    }
}

/// The sizes that letters may have. [Units: wu]
#[derive(Clone, Copy)]
pub(crate) struct Sizes {
    pub(crate) least: f64,
    pub(crate) most: f64,
}

/// Lines of text and their place.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fitted {
    /// Top line first.
    pub(crate) lines: Vec<String>,
    /// The last line is the area, in smaller letters.
    pub(crate) has_area: bool,
    /// The center of all lines. [Units: wu]
    pub(crate) at: DVec2,
    /// [Units: wu]
    pub(crate) size: f64,
    pub(crate) is_turned: bool,
    /// The name did not fit; the cell's number replaces it.
    pub(crate) is_number: bool,
}

/// Fits the name, with the area if there is space: on one line, else turned, else on several lines, else the number
/// alone.
pub(crate) fn fit(
    section: &Section,
    label: Label,
    region: &Region,
    [name, area, number]: [&str; 3],
    sizes: Sizes,
) -> Fitted {
    let floor = Mask::new(section, label, region, true);
    let mask = Mask::new(section, label, region, false);
    let mut tries = vec![
        Try::new(&[name, area], true, false),
        Try::new(&[name], false, false),
        Try::new(&[name], false, true),
    ];
    let parts = wrapped(name);
    if parts.len() > 1 {
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        tries.push(Try::new(&parts, false, false));
    }
    // On free floor if the letters stay at least half as large as they may be.
    let readable = Sizes {
        least: sizes.least.max(0.5 * sizes.most),
        ..sizes
    };
    let found = (tries
        .iter()
        .find_map(|t| t.largest(&floor, readable, AROUND)))
    .or_else(|| tries.iter().find_map(|t| t.largest(&mask, sizes, 0.0)));
    found.unwrap_or_else(|| {
        let one = Try::new(&[number], false, false);
        let small = Sizes {
            most: sizes.least,
            ..sizes
        };
        // Beyond the walls rather than too small to read.
        let mut out = one.largest(&mask, small, 0.0).unwrap_or_else(|| Fitted {
            at: mask.middle(),
            size: sizes.least,
            ..one.fitted()
        });
        out.is_number = number != name;
        out
    })
}

/// The estimated width of text, in heights of its letters.
pub(crate) fn width(words: &str) -> f64 {
    // East Asian letters are as wide as they are high.
    let letter = |c: char| if c < '\u{1100}' { LETTER } else { 1.0 };
    words.chars().map(letter).sum()
}

/// The parts of a name that may go on separate lines: broken after spaces, hyphens, underscores, dots, colons and
/// slashes.
fn wrapped(name: &str) -> Vec<String> {
    let parts = name.split_inclusive([' ', '-', '_', '.', ':', '/']);
    parts
        .map(|p| p.trim().to_owned())
        .filter(|p| !p.is_empty())
        .collect()
}

/// One way to write a label.
struct Try {
    lines: Vec<String>,
    has_area: bool,
    is_turned: bool,
}

impl Try {
    fn new(lines: &[&str], has_area: bool, is_turned: bool) -> Self {
        Self {
            lines: lines.iter().map(ToString::to_string).collect(),
            has_area,
            is_turned,
        }
    }

    /// Width and height of all lines, in heights of their letters.
    fn extent(&self) -> DVec2 {
        let last = self.lines.len() - 1;
        let mut out = DVec2::ZERO;
        for (i, line) in self.lines.iter().enumerate() {
            let size = if self.has_area && i == last {
                AREA
            } else {
                1.0
            };
            out = DVec2::new(out.x.max(width(line) * size), out.y + LINE * size);
        }
        if self.is_turned {
            DVec2::new(out.y, out.x)
        } else {
            out
        }
    }

    fn fitted(&self) -> Fitted {
        Fitted {
            lines: self.lines.clone(),
            has_area: self.has_area,
            at: DVec2::ZERO,
            size: 0.0,
            is_turned: self.is_turned,
            is_number: false,
        }
    }

    /// The largest size that fits with some space around it, in heights of its letters, with its place.
    fn largest(&self, mask: &Mask, sizes: Sizes, around: f64) -> Option<Fitted> {
        let extent = self.extent() + 2.0 * around;
        let least = sizes.least / if self.has_area { AREA } else { 1.0 };
        let mut size = sizes.most.max(least);
        loop {
            if let Some(at) = mask.place(extent * size) {
                return Some(Fitted {
                    at,
                    size,
                    ..self.fitted()
                });
            }
            if size <= least {
                return None;
            }
            size = (size * SMALLER).max(least);
        }
    }
}

/// The points of one label, with sums over rectangles: a test of whether a text fits takes four look-ups.
struct Mask {
    origin: DVec2,
    step: f64,
    width: usize,
    height: usize,
    /// Number of the label's points above and left of each grid vertex; rows of `width + 1`.
    sums: Vec<u32>,
    /// A point well inside.
    inner: DVec2,
}

impl Mask {
    /// `is_free` leaves out points on which something stands.
    fn new(section: &Section, label: Label, region: &Region, is_free: bool) -> Self {
        let (first, [width, height]) = (region.first, region.size);
        let mut sums = vec![0_u32; (width + 1) * (height + 1)];
        for row in 0..height {
            let mut in_row = 0;
            for column in 0..width {
                let [at, line] = [first[0] + column, first[1] + row];
                let is_in = section.is(label, at, line) && (!is_free || section.is_free(at, line));
                in_row += u32::from(is_in);
                sums[(row + 1) * (width + 1) + column + 1] =
                    sums[row * (width + 1) + column + 1] + in_row;
            }
        }
        Self {
            origin: section.corner(first[0], first[1]),
            step: section.step(),
            width,
            height,
            sums,
            inner: region.inner,
        }
    }

    fn middle(&self) -> DVec2 {
        self.inner
    }

    /// The center of a rectangle of this size inside the label, the one nearest to its inner point; `None` if it does
    /// not fit.
    fn place(&self, size: DVec2) -> Option<DVec2> {
        let points = (size / self.step).ceil();
        if points.x > self.width as f64 || points.y > self.height as f64 {
            return None;
        }
        let (w, h) = (points.x as usize, points.y as usize);
        let row = self.width + 1;
        let is_free = |x: usize, y: usize| {
            let at = |x: usize, y: usize| self.sums[y * row + x];
            at(x + w, y + h) + at(x, y) - at(x + w, y) - at(x, y + h) == (w * h) as u32
        };
        let middle = |x: usize, y: usize| {
            self.origin + (DVec2::new(x as f64, y as f64) + 0.5 * points) * self.step
        };
        let mut best: Option<(f64, DVec2)> = None;
        // An error of an eighth of a letter is invisible.
        let stride = (h.min(w) / 8).max(1);
        for y in (0..=self.height - h).step_by(stride) {
            for x in (0..=self.width - w).step_by(stride) {
                if is_free(x, y) {
                    let distance = middle(x, y).distance_squared(self.inner);
                    if best.is_none_or(|b| distance < b.0) {
                        best = Some((distance, middle(x, y)));
                    }
                }
            }
        }
        best.map(|b| b.1)
    }
}

/// Height of the letters of a line: smaller for the area.
pub(crate) fn line_size(fitted: &Fitted, line: usize) -> f64 {
    let is_area = fitted.has_area && line + 1 == fitted.lines.len();
    fitted.size * if is_area { AREA } else { 1.0 }
}

/// Distance from one line's top to the next, as a fraction of the letters' height.
pub(crate) const fn line_height() -> f64 {
    LINE
}
