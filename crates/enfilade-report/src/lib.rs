//! Reports on enfilade worlds for people: floor plans as SVG, with the feature `print` also as PNG and PDF, with `page` an HTML page
//! about a world, and a verdict on it.
//!
//! ```
//! use enfilade_cpg::World;
//! use enfilade_report::{PlanOptions, plan_svg};
//!
//! let svg = plan_svg(&World::default(), &PlanOptions::default());
//! assert!(svg.starts_with("<?xml"));
//! ```
//!
//! All functions take a valid world (`World::validate`) and return the same bytes every time. A plan is a drawing:
//! shapes are accurate to about a pixel of its sampling grid, not evidence.

mod borders;
mod clip;
mod doubts;
mod drawing;
mod floors;
#[cfg(feature = "print")]
mod font;
#[cfg(feature = "page")]
mod graph;
#[cfg(feature = "page")]
mod html;
mod label;
mod marks;
#[cfg(feature = "page")]
mod matrix;
mod palette_page;
#[cfg(feature = "print")]
mod pdf;
mod plain;
mod plan;
#[cfg(feature = "print")]
mod raster;
#[cfg(feature = "page")]
mod reasons;
mod relief;
mod rooms;
mod section;
mod shafts;
mod shapes;
mod sheet;
mod storeys;
mod svg;
mod verdict;
#[cfg(feature = "page")]
mod walk;

pub use drawing::Drawing;
#[cfg(feature = "page")]
pub use html::{Figure, ReportParts, Table, report_html};
pub use palette_page::{PaletteEntry, palette_html, palette_plan};
#[cfg(feature = "print")]
pub use pdf::{PAPERS, Paper, PaperError, to_pdf};
pub use plain::{
    SceneFile, SceneFiles, cells_csv, graph_dot, graph_graphml, graph_json, portals_csv,
    surfaces_obj,
};
pub use plan::{PlanOptions, Plans, plan_svg};
#[cfg(feature = "print")]
pub use raster::{MAX_PIXELS, RasterError};
pub use rooms::{measured_room_facts, room_facts};
pub use shapes::{PlanLabel, PlanShape};
pub use storeys::{Storey, find_storeys};
pub use verdict::{InputDoubt, Verdict, cells_in_words, is_empty, why_empty};
#[cfg(feature = "page")]
pub use walk::{WalkPage, WalkStorey};
