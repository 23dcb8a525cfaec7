//! Options of `enfilade render`.

use std::path::PathBuf;

use clap::ValueEnum;
use enfilade_render::{AdapterChoice, Culling, PHOTO_FOV};

use crate::limits::Limits;
use enfilade_cli::values::{door, point, size};

/// Draws a picture of a world, or one for each camera of a path, to PNG files; does not need a display.
#[derive(clap::Args)]
pub(crate) struct Render {
    /// World written by `enfilade bake`, or packed, on disk or at an address; `-` for standard input. Of a packed one, only what is
    /// in view is loaded, with --plain and the options of cameras but --walk.
    pub(super) world: PathBuf,
    /// File for the picture, `-` for standard output; for a path, `walk.png` becomes `walk-0001.png` and so on.
    #[arg(short, long, value_name = "PNG")]
    pub(super) output: PathBuf,
    /// Position of the eye, in meters; a place with much to see if not given.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true, requires = "look")]
    pub(super) eye: Option<[f32; 3]>,
    /// The point looked at, in meters; not a direction.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true, requires = "eye")]
    pub(super) look: Option<[f32; 3]>,
    /// Draw a picture for each line of this file: eye and point looked at, `x y z x y z`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["eye", "walk"])]
    pub(super) path: Option<PathBuf>,
    /// Draw this many pictures on a walk through the doorways, 10,000 at most.
    #[arg(long, value_name = "N", conflicts_with = "eye", value_parser = clap::value_parser!(u32).range(0..=10_000))]
    pub(super) walk: Option<u32>,
    /// Write the cameras of the pictures to this file, for use with --path.
    #[arg(long, value_name = "FILE")]
    pub(super) record: Option<PathBuf>,
    /// Angle from the lower to the upper edge of the picture, in degrees.
    #[arg(long, value_name = "DEG", default_value_t = PHOTO_FOV.to_degrees(), value_parser = angle)]
    pub(super) fov: f32,
    /// Width and height of the picture.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x720")]
    pub(super) size: [u32; 2],
    /// Set of things to draw: everything, all in the view, all visible through portals, or the same with far portals as
    /// textures of what lies behind them.
    #[arg(long, value_enum, default_value_t = RenderMode::Portals)]
    pub(super) mode: RenderMode,
    /// Textures made ahead by `enfilade portals` for this world and light, with --mode portal-textures; others are made for the
    /// picture.
    #[arg(long, value_name = "PTX")]
    pub(super) textures: Option<PathBuf>,
    /// Triangles of the picture at most, with --mode portal-textures: nearer portals become textures, too, until it holds.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(super) max_triangles: Option<u64>,
    /// Colors of surfaces: lit materials, one color per cell, or how often pixels are drawn.
    #[arg(long, value_enum, default_value_t = Colors::Lit)]
    pub(super) paint: Colors,
    /// Outline the portals in view, and the view as each one narrows it.
    #[arg(long)]
    pub(super) portals: bool,
    /// Show the world from above, with the view and what is culled: gray is out of view, reddish behind
    /// walls, brown hidden by a large polygon; the portals looked through are orange lines.
    #[arg(long)]
    pub(super) above: bool,
    /// Remove everything higher than this, in meters, and light the rest evenly; with --above, 0.5 above the eye by
    /// default.
    #[arg(long, value_name = "METERS", allow_hyphen_values = true)]
    pub(super) cut: Option<f32>,
    /// Portals to close, by number: their leaves are shut, and a panel fills those without leaves.
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub(super) close: Vec<u32>,
    /// Lifts, people, lamps and sounds in the world, as `demo --living` writes them; pictures of a path are a 30th of a
    /// second apart.
    #[arg(long, value_name = "JSON", conflicts_with_all = ["above", "portals", "close", "door", "stop", "objects", "lod", "mode"])]
    pub(super) living: Option<PathBuf>,
    /// Time of the first picture of --living, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, requires = "living", value_parser = time)]
    pub(super) time: f64,
    /// How far the leaves of a portal are open, from shut (0) to open (1); as in the model if not given.
    #[arg(long, value_name = "ID=SHARE", value_delimiter = ',', value_parser = door)]
    pub(super) door: Vec<(u32, f32)>,
    /// Do not look through portals that cover fewer pixels: the mean color of the cell behind replaces the view.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    pub(super) stop: f32,
    /// Leave the portals of --stop empty.
    #[arg(long, requires = "stop")]
    pub(super) stop_at_nothing: bool,
    /// Do not draw objects in cells that are seen through fewer pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    pub(super) objects: f32,
    /// Draw objects with fewer triangles if that moves their surface by at most this many pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    pub(super) lod: f32,
    /// No shadows, no ambient occlusion, no lamps, the same daylight everywhere: faster.
    #[arg(long)]
    pub(super) plain: bool,
    /// Leave the lamps of the world dark: its point and spot lights.
    #[arg(long)]
    pub(super) no_lamps: bool,
    /// Share of the daylight that is left, from night (0) to day (1).
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = share)]
    pub(super) daylight: f32,
    /// Adapter to draw with: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME")]
    pub(super) adapter: AdapterChoice,
    /// Print a report on the pictures as JSON for machines; for a path, as a list.
    #[arg(long)]
    pub(super) json: bool,
    #[command(flatten)]
    pub(super) limits: Limits,
}

/// The set of things to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RenderMode {
    Everything,
    Frustum,
    Portals,
    PortalTextures,
}

impl RenderMode {
    pub(crate) fn culling(self) -> Culling {
        match self {
            Self::Everything => Culling::Everything,
            Self::Frustum => Culling::Frustum,
            Self::Portals => Culling::Portals,
            Self::PortalTextures => Culling::PortalTextures,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Colors {
    Lit,
    Cells,
    Overdraw,
}

fn time(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..=3600.0).contains(&x) => Ok(x),
        _ => Err("a time between 0 and 3600 seconds is needed".into()),
    }
}

fn angle(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if (1.0..=165.0).contains(&x) => Ok(x),
        _ => Err("an angle between 1 and 165 degrees is needed".into()),
    }
}

fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("a number from 0 to 1 is needed".into()),
    }
}
