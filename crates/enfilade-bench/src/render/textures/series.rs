//! A walk drawn one way: triangles and time of each frame.

use std::ops::ControlFlow;
use std::time::Instant;

use enfilade::World;
use enfilade_render::{
    Camera, Culling, Frame, Picture, PortalTextureCounts, PortalTextureMaking,
    PortalTextureOptions, PortalTexturePaint, Sparing, Studio, Style, Viewpoints,
};

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
    /// Warped textures, those of the walk made before.
    Warm,
    /// Warped textures, made as they are needed.
    Cold,
    /// Flat textures every degree, made as they are needed.
    ColdEvery1,
    /// Flat textures every ten degrees, made as they are needed.
    ColdEvery10,
    /// Warped textures, of at most 50,000 triangles a frame.
    Bound,
}

/// The bound of [`DrawMode::Bound`].
pub(super) const MOST_TRIANGLES: u64 = 50_000;

impl DrawMode {
    pub(super) fn label(self) -> &'static str {
        match self {
            Self::Frustum => "frustum culling",
            Self::Portals => "portal culling",
            Self::Room => "the eye's room alone",
            Self::Warm => "portal textures",
            Self::Cold => "portal textures, cold",
            Self::ColdEvery1 => "flat textures every degree, cold",
            Self::ColdEvery10 => "flat textures every 10 degrees, cold",
            Self::Bound => "portal textures, at most 50,000 triangles",
        }
    }

    fn culling(self) -> Culling {
        match self {
            Self::Frustum => Culling::Frustum,
            Self::Portals | Self::Room => Culling::Portals,
            _ => Culling::PortalTextures,
        }
    }

    /// Readies the studio for a walk. Ways with pictures forget those of the last walk here, or make them.
    pub(super) fn begin(self, studio: &mut Studio) -> anyhow::Result<()> {
        studio.remove_portal_textures();
        if let Some(options) = self.textures() {
            studio.add_portal_textures(options)?;
        }
        studio.sparing = Sparing {
            // No portal has as many pixels.
            stop_below: if self == Self::Room { 1e9 } else { 0.0 },
            ..Sparing::default()
        };
        Ok(())
    }

    /// Returns the settings of portal textures, if it uses any.
    fn textures(self) -> Option<PortalTextureOptions> {
        let default = PortalTextureOptions::default();
        Some(match self {
            Self::Frustum | Self::Portals | Self::Room => return None,
            Self::Warm | Self::Cold => default,
            Self::ColdEvery1 | Self::ColdEvery10 => PortalTextureOptions {
                viewpoints: Viewpoints::semicircle(if self == Self::ColdEvery1 {
                    1.0
                } else {
                    10.0
                }),
                ..default
            },
            Self::Bound => PortalTextureOptions {
                max_triangles: MOST_TRIANGLES,
                ..default
            },
        })
    }
}

/// Frames of a walk.
#[derive(Clone, Debug, Default)]
pub(super) struct Series {
    /// Triangles of each frame.
    pub(super) triangles: Vec<f64>,
    /// Time of each frame, from its query until it is drawn. [Units: s]
    pub(super) seconds: Vec<f64>,
    /// Textures made in each frame, those of transitions included, and triangles drawn for them, which count in `triangles`, too.
    pub(super) made: Vec<[f64; 2]>,
    /// Most memory of textures. [Units: byte]
    pub(super) n_bytes: u64,
    /// Numbers of textures made before the walk, and left out for want of room.
    pub(super) ahead: [usize; 2],
    /// Number of textures taken from them.
    pub(super) n_loaded: usize,
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
pub(super) fn style() -> Style {
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
    world: &World,
    cameras: &[Camera],
    mode: DrawMode,
    size: [u32; 2],
    ahead: u64,
) -> anyhow::Result<Series> {
    let target = studio.target(size)?;
    let aspect = size[0] as f32 / size[1] as f32;
    let mut series = Series::default();
    mode.begin(studio)?;
    if mode == DrawMode::Warm {
        series.ahead = make_ahead(studio, world, size[1], ahead)?;
    }
    let warm = cameras.iter().take(3).map(|camera| (camera, false));
    for (camera, counts) in warm.chain(cameras.iter().map(|camera| (camera, true))) {
        if series.seconds.is_empty() && mode != DrawMode::Warm {
            studio.clear_portal_textures();
        }
        let begin = Instant::now();
        let made = match mode.culling() {
            Culling::PortalTextures => studio.plan_portal_textures(camera, style(), size)?,
            _ => PortalTextureCounts::default(),
        };
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
            let n_made = made.n_made_triangles;
            series.triangles.push((list.n_triangles() + n_made) as f64);
            let n_textures = made.n_made + made.n_turning;
            series.made.push([n_textures as f64, n_made as f64]);
            series.n_loaded += made.n_loaded;
            series.n_bytes = series.n_bytes.max(made.n_bytes);
        }
        studio.give_list(list);
    }
    Ok(series)
}

/// Makes the textures of a whole world before the walk, and loads them; returns their number, and that of those left out.
fn make_ahead(
    studio: &mut Studio,
    world: &World,
    lines: u32,
    max_bytes: u64,
) -> anyhow::Result<[usize; 2]> {
    let making = PortalTextureMaking {
        style: style(),
        max_bytes,
        lines,
    };
    let made = studio.make_portal_textures(world, &making, &mut |_| ControlFlow::Continue(()))?;
    let n = studio.load_portal_textures(&made.bytes)?;
    Ok([n, made.n_left_out])
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

/// A frame of textures: the picture, and for each pixel whether a texture fills it, and whether none shows what is there.
pub(super) struct TexturedShot {
    pub(super) picture: Picture,
    pub(super) is_textured: Vec<bool>,
    pub(super) is_hole: Vec<bool>,
    pub(super) counts: PortalTextureCounts,
}

/// Plans a frame of textures once, and draws it in three paints.
pub(super) fn textured_shot(
    studio: &mut Studio,
    camera: &Camera,
    size: [u32; 2],
) -> anyhow::Result<TexturedShot> {
    let aspect = size[0] as f32 / size[1] as f32;
    let counts = studio.plan_portal_textures(camera, style(), size)?;
    let view = camera.view(aspect)?;
    let list = studio.take_list(&view, camera.eye, Culling::PortalTextures, size);
    let mut draw = |paint| {
        studio.paint_portal_textures(paint);
        let frame = Frame {
            projection: camera.projection(aspect)?,
            list: &list,
            style: style(),
            marks: &[],
        };
        anyhow::Ok(studio.picture_of(&frame, size)?)
    };
    let tinted = draw(PortalTexturePaint::Tinted)?;
    let holes = draw(PortalTexturePaint::Holes)?;
    let picture = draw(PortalTexturePaint::Plain)?;
    studio.give_list(list);
    let differs = |other: &Picture| {
        let pairs = (picture.rgba.chunks_exact(4)).zip(other.rgba.chunks_exact(4));
        pairs.map(|(a, b)| a != b).collect()
    };
    Ok(TexturedShot {
        is_textured: differs(&tinted),
        is_hole: differs(&holes),
        picture,
        counts,
    })
}
