//! Drawings independent of the format they are written as: paths of a class, words, and their places.

use enfilade_cpg::CellId;
use enfilade_geom::DVec2;

/// Red, green, blue.
pub(crate) type Rgb = [u8; 3];

const BLACK: Rgb = [0, 0, 0];
/// Color of text.
pub(crate) const INK: Rgb = [0x22, 0x22, 0x22];

/// A drawing, ready to be written as SVG, PNG or PDF: one plan or several on a sheet.
#[derive(Clone, Debug)]
pub struct Drawing {
    pub(crate) title: String,
    /// [Units: wu]
    pub(crate) size: DVec2,
    /// Factor on the usual line width, for drawings of large buildings.
    pub(crate) zoom: f64,
    pub(crate) items: Vec<Item>,
}

impl Drawing {
    /// Width and height. [Units: wu]
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        self.size.to_array()
    }
}

#[derive(Clone, Debug)]
pub(crate) enum Item {
    /// Sets the origin to `at` for the items up to the next `Place`. `storey` is the storey they show, if any.
    Place {
        at: DVec2,
        storey: Option<String>,
    },
    Path(Path),
    Words(Words),
}

#[derive(Clone, Debug)]
pub(crate) struct Path {
    pub(crate) class: Class,
    /// Replaces the color of the class.
    pub(crate) fill: Option<Rgb>,
    /// Lines. Closed ones do not repeat their first point. [Units: wu]
    pub(crate) lines: Vec<Vec<DVec2>>,
    pub(crate) is_closed: bool,
    pub(crate) cell: Option<CellId>,
    /// Text shown when a pointer rests on the path.
    pub(crate) hint: Option<String>,
}

#[derive(Clone, Debug)]
pub(crate) struct Words {
    /// Start of the base line, or its middle. [Units: wu]
    pub(crate) at: DVec2,
    /// Height of the letters; for several lines, the distance between base lines. [Units: wu]
    pub(crate) size: f64,
    pub(crate) is_centered: bool,
    /// Read from bottom to top.
    pub(crate) is_turned: bool,
    pub(crate) text: String,
    pub(crate) cell: Option<CellId>,
}

/// The meaning of a path, which decides how it looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    Cell,
    Beyond,
    Thin,
    Solid,
    Void,
    Wall,
    Detail,
    Edge,
    Swing,
    Open,
    Door,
    Window,
    Crack,
    Low,
    Stair,
    Bar,
    Gap,
    Doubt,
}

pub(crate) const CLASSES: [Class; 18] = [
    Class::Cell,
    Class::Beyond,
    Class::Thin,
    Class::Solid,
    Class::Void,
    Class::Wall,
    Class::Detail,
    Class::Edge,
    Class::Swing,
    Class::Open,
    Class::Door,
    Class::Window,
    Class::Crack,
    Class::Low,
    Class::Stair,
    Class::Bar,
    Class::Gap,
    Class::Doubt,
];

/// The look of a class.
pub(crate) struct Look {
    pub(crate) name: &'static str,
    /// Color and opacity.
    pub(crate) fill: Option<(Rgb, f32)>,
    /// Color and width. [Units: cm]
    pub(crate) stroke: Option<(Rgb, f64)>,
    /// Alternating lengths of dashes and gaps. [Units: cm]
    pub(crate) dashes: &'static [f64],
}

impl Class {
    pub(crate) fn look(self) -> Look {
        let orange = [0xe8, 0x59, 0x0c];
        let filled = |name, color, opacity| Look {
            name,
            fill: Some((color, opacity)),
            stroke: None,
            dashes: &[],
        };
        let line = |name, color, width, dashes| Look {
            name,
            fill: None,
            stroke: Some((color, width)),
            dashes,
        };
        match self {
            // Each cell has a color of its own.
            Self::Cell => filled("cell", [0xff; 3], 1.0),
            Self::Beyond => filled("beyond", [0xff; 3], 0.35),
            Self::Thin => line("thin", [0x66; 3], 3.0, &[6.0, 6.0]),
            Self::Solid => filled("solid", [0x4d, 0x50, 0x57], 1.0),
            Self::Void => line("hatching", [0x99; 3], 1.0, &[]),
            Self::Wall => line("wall", [0x26, 0x28, 0x2c], 2.0, &[]),
            Self::Detail => filled("detail", [0xff; 3], 0.45),
            Self::Edge => line("edge", [0x77; 3], 1.0, &[]),
            Self::Swing => line("swing", [0x44; 3], 1.5, &[]),
            Self::Open => line("open", orange, 7.0, &[]),
            Self::Door => line("door", [0xc9, 0x2a, 0x2a], 7.0, &[]),
            Self::Window => line("window", [0x1c, 0x7e, 0xd6], 6.0, &[]),
            Self::Crack => line("crack", [0xd6, 0x24, 0x9f], 2.0, &[]),
            Self::Low => line("low", orange, 3.0, &[10.0, 8.0]),
            Self::Stair => line("stair", orange, 4.0, &[16.0, 10.0]),
            Self::Doubt => line("doubt", [0x7b, 0x2c, 0xbf], 4.0, &[]),
            Self::Bar => filled("bar", BLACK, 1.0),
            Self::Gap => Look {
                stroke: Some((BLACK, 1.0)),
                ..filled("gap", [0xff; 3], 1.0)
            },
        }
    }
}
