//! What a frame shows and how it looks.

use crate::camera::Projection;
use crate::list::DrawList;
use crate::marks::Mark;

/// How surfaces are painted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Paint {
    /// As they look.
    #[default]
    Lit,
    /// In the color of the cell before them: by point where light [was added](crate::Studio::add_light), else each
    /// triangle in the color of one that sees it.
    Cells,
    /// By how many times each pixel is drawn.
    Overdraw,
}

/// How a frame looks, apart from what is in it.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// How surfaces are painted.
    pub paint: Paint,
    /// Whether corners are darkened; costs about as much as all else.
    pub dark_corners: bool,
    /// Whether the sun casts shadows; their picture is made with the first frame of a world.
    pub shadows: bool,
    /// Whether each place has the light that reaches it, where that [was computed](crate::Studio::add_light); else all have
    /// the same.
    pub daylight: bool,
    /// What is higher is not drawn: a ceiling taken off. [Units: wu]
    pub cut_above: f32,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            paint: Paint::Lit,
            dark_corners: true,
            shadows: true,
            daylight: true,
            cut_above: f32::INFINITY,
        }
    }
}

/// One frame.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// What takes points to the screen.
    pub projection: Projection,
    /// What is drawn.
    pub list: &'a DrawList,
    /// How it looks.
    pub style: Style,
    /// Lines and polygons over it.
    pub marks: &'a [Mark],
}
