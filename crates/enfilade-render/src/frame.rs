//! The contents and style of a frame.

use crate::camera::Projection;
use crate::list::RenderList;
use crate::marks::PictureMark;

/// The coloring of surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Paint {
    /// Textured and lit.
    #[default]
    Lit,
    /// The color of the cell in front of the surface: point by point if light
    /// [was added](crate::Studio::add_light), else per triangle, in the color of one cell that sees it.
    Cells,
    /// The number of times that each pixel is drawn.
    Overdraw,
}

/// The style of a frame, apart from its contents.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// The coloring of surfaces.
    pub paint: Paint,
    /// True if ambient occlusion darkens the places where surfaces meet; costs about as much as everything else.
    pub dark_corners: bool,
    /// True if the sun casts shadows; the shadow map is drawn with the first frame of a world.
    pub shadows: bool,
    /// True if each place gets the light that [was computed](crate::Studio::add_light) for it; else light is uniform.
    pub daylight: bool,
    /// Height above which nothing is drawn, to take ceilings off. [Units: wu]
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
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// The projection to the screen.
    pub projection: Projection,
    /// The draws.
    pub list: &'a RenderList,
    /// The style.
    pub style: Style,
    /// Lines and polygons drawn over it.
    pub marks: &'a [PictureMark],
}
