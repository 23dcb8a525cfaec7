//! Scenes that are not triangles, as one field with one surface.
//!
//! A [`Field`] tells how far a point is from the surface between matter and air: negative in matter, positive in air. Volumes of
//! samples, implicit surfaces and scans are such fields. [`extract`] makes the closed triangle surface of a field, and
//! says how far the two are apart; from there on it is a scene like any other.
//!
//! ```
//! use enfilade_source::{ImplicitScene, SourceLimits};
//!
//! let text = br#"{ "enfilade": "implicit", "air": { "ball": { "at": [0, 2, 0], "radius": 2 } } }"#;
//! let scene = ImplicitScene::parse(text, &SourceLimits::default())?;
//! let surface = scene.surface(&SourceLimits::default())?;
//! assert!(surface.distance < 0.05, "{} m", surface.distance);
//! # Ok::<(), enfilade_source::SourceError>(())
//! ```
//!
//! It does not promise that details thinner than the step of the extraction survive.

mod blocks;
mod error;
mod field;
mod freeform;
mod heights;
mod implicit;
mod json;
mod patches;
mod qef;
mod scan;
mod simplify;
mod surface;
mod volume;

pub use blocks::Lattice;
pub use error::{SourceError, SourceLimits};
pub use field::{Field, Interval};
pub use freeform::{
    FreeformCurve, FreeformMesh, FreeformPatch, FreeformScene, FreeformSurface, SplineBasis,
    TrimCurve, tessellate,
};
pub use heights::{HeightMap, HeightOptions};
pub use implicit::ImplicitScene;
pub use scan::{Scan, ScanOptions};
pub use surface::{ExtractOptions, Surface, extract};
pub use volume::{AirSide, Beside, Level, SampleKind, Volume, VolumeSummary, gunzip, is_gzip};

use json::{is_json_of, known_keys, shortened};
