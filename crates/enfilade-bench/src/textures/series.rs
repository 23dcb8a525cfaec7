//! A walk drawn one way: triangles and time of each frame.

use std::time::Instant;

use enfilade_render::{Camera, Culling, Frame, Picture, Sparing, Studio, Style};

use crate::measure::quantile;

/// The ways to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum DrawMode {
    /// Everything in the view frustum; its pictures are the truth.
    Frustum,
    /// Cells seen through portals.
    Portals,
    /// The eye's cell alone, as if each doorway were a picture for nothing: the least that pictures can reach.
    Room,
}

impl DrawMode {
    pub(super) fn label(self) -> &'static str {
        match self {
            Self::Frustum => "frustum culling",
            Self::Portals => "portal culling",
            Self::Room => "the eye's room alone",
        }
    }

    fn culling(self) -> Culling {
        match self {
            Self::Frustum => Culling::Frustum,
            Self::Portals | Self::Room => Culling::Portals,
        }
    }

    /// Readies the studio for a walk. Ways with pictures forget those of the last walk here, or make them.
    pub(super) fn begin(self, studio: &mut Studio) {
        studio.sparing = Sparing {
            // No portal has as many pixels.
            stop_below: if self == Self::Room { 1e9 } else { 0.0 },
            ..Sparing::default()
        };
    }
}

/// Frames of a walk.
#[derive(Clone, Debug, Default)]
pub(super) struct Series {
    /// Triangles of each frame.
    pub(super) triangles: Vec<f64>,
    /// Time of each frame, from its query until it is drawn. [Units: s]
    pub(super) seconds: Vec<f64>,
}

impl Series {
    pub(super) fn mean_triangles(&self) -> f64 {
        self.triangles.iter().sum::<f64>() / self.triangles.len().max(1) as f64
    }

    pub(super) fn most_triangles(&self) -> f64 {
        self.triangles.iter().copied().fold(0.0, f64::max)
    }

    /// Returns mean, median and 99th percentile of the times. [Units: ms]
    pub(super) fn times(&self) -> [f64; 3] {
        let mut ms: Vec<f64> = self.seconds.iter().map(|s| s * 1e3).collect();
        let mean = ms.iter().sum::<f64>() / ms.len().max(1) as f64;
        [mean, quantile(&mut ms, 0.5), quantile(&mut ms, 0.99)]
    }
}

/// Surfaces lit alike: what a picture of a room holds does not depend on where it is looked at from.
fn style() -> Style {
    Style {
        dark_corners: false,
        shadows: false,
        daylight: false,
        ..Style::default()
    }
}

/// Draws a walk, waiting for each frame. The first frames are drawn before it as well, so that pipelines are built and buffers
/// have grown.
pub(super) fn measure(
    studio: &mut Studio,
    cameras: &[Camera],
    mode: DrawMode,
    size: [u32; 2],
) -> anyhow::Result<Series> {
    let target = studio.target(size)?;
    let aspect = size[0] as f32 / size[1] as f32;
    let mut series = Series::default();
    let warm = cameras.iter().take(3).map(|camera| (camera, false));
    for (camera, counts) in warm.chain(cameras.iter().map(|camera| (camera, true))) {
        if series.seconds.is_empty() {
            mode.begin(studio);
        }
        let begin = Instant::now();
        let (view, projection) = (camera.view(aspect)?, camera.projection(aspect)?);
        let list = studio.take_list(&view, camera.eye, mode.culling(), size);
        let frame = Frame {
            projection,
            list: &list,
            style: style(),
            marks: &[],
        };
        studio.draw_to(&frame, &target)?;
        studio.gpu.wait()?;
        if counts {
            series.seconds.push(begin.elapsed().as_secs_f64());
            series.triangles.push(list.n_triangles() as f64);
        }
        studio.give_list(list);
    }
    Ok(series)
}

/// Draws a picture in the style of the walk.
pub(super) fn shot(
    studio: &mut Studio,
    camera: &Camera,
    mode: DrawMode,
    size: [u32; 2],
) -> anyhow::Result<Picture> {
    Ok(studio.picture(camera, mode.culling(), style(), &[], size)?)
}
