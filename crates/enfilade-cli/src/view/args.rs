//! Arguments of `enfilade view`.

use std::path::PathBuf;

use enfilade_render::AdapterChoice;

use crate::limits::Limits;
use enfilade_cli::values::{point, size};

const EDITING: &str = "Editing";

/// Opens a window to walk through a world, or to build one: W A S D and the mouse; F1 in the window lists all keys.
///
/// With --save, the world is edited: pieces of a kit are placed, and portals, doors, mirrors, lamps and crates are made by hand.
/// Each operation is written to a journal beside the saved world at once; the same command goes on with it.
#[derive(clap::Args)]
pub(crate) struct View {
    /// World written by `enfilade bake`, or packed, on disk or at an address. Of a packed one, pieces are loaded as they come into
    /// view, or are about to, unless --living or --lod is given. Not needed to build a new one from a kit.
    #[arg(required_unless_present = "kit")]
    pub(super) world: Option<PathBuf>,
    /// Lifts that one rides, people, lamps and sounds in it, as `demo --living` writes them.
    #[arg(long, value_name = "JSON")]
    pub(super) living: Option<PathBuf>,
    /// Start, in meters; a place with much to see if not given.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub(super) eye: Option<[f32; 3]>,
    /// Walk along this path, a camera a frame, and close at its end.
    #[arg(long, value_name = "FILE")]
    pub(super) path: Option<PathBuf>,
    /// File that F5 writes the path since F4 to, for --path here and in `render`.
    #[arg(long, value_name = "FILE", default_value = "path.txt")]
    pub(super) record: PathBuf,
    /// File that F12 writes pictures to; `shot.png` becomes `shot-1.png` and so on.
    #[arg(long, value_name = "PNG", default_value = "shot.png")]
    pub(super) screenshot: PathBuf,
    /// Size of the window.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x720")]
    pub(super) size: [u32; 2],
    /// Leave the mouse free at first: drag to look around; Tab captures it.
    #[arg(long)]
    pub(super) free_mouse: bool,
    /// Do not look through portals that cover fewer pixels, as in `render`; L turns that off and on.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    pub(super) stop: f32,
    /// Do not draw objects in cells that are seen through fewer pixels, as in `render`; L turns that off and on.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    pub(super) objects: f32,
    /// Draw objects with fewer triangles if that moves their surface by at most this many pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    pub(super) lod: f32,
    /// Draw far portals as textures of what lies behind them: M changes that, T tints them.
    #[arg(long)]
    pub(super) portal_textures: bool,
    /// Textures made ahead by `enfilade portals` for this world; others are made as they are needed.
    #[arg(long, value_name = "PTX", requires = "portal_textures")]
    pub(super) textures: Option<PathBuf>,
    /// Triangles drawn in a frame at most: nearer portals become textures, too, until it holds.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(super) max_triangles: Option<u64>,
    /// Adapter to draw with: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME")]
    pub(super) adapter: AdapterChoice,
    /// Most memory of the pieces of a packed world, in MiB.
    #[arg(long, value_name = "MIB", default_value_t = 1024, value_parser = clap::value_parser!(u64).range(8..=1 << 20))]
    pub(super) memory: u64,
    /// World to save on F2 what is edited here; its journal is beside it, `level.journal` beside `level.glb`.
    #[arg(long, value_name = "GLB", conflicts_with_all = ["living", "lod", "textures", "max_triangles", "path"], help_heading = EDITING)]
    pub(super) save: Option<PathBuf>,
    /// Kit, a folder of pieces to place as `kit` checks it.
    #[arg(long, value_name = "DIR", requires = "save", help_heading = EDITING)]
    pub(super) kit: Option<PathBuf>,
    #[command(flatten)]
    pub(super) limits: Limits,
}

impl View {
    /// Returns the name of the world, as the window's title has it.
    pub(super) fn name(&self) -> String {
        let path = self.save.as_ref().or(self.world.as_ref());
        path.map_or_else(String::new, |p| p.display().to_string())
    }
}
