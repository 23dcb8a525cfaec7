//! Errors of the import, each with its place and a remedy.

use std::path::{Path, PathBuf};

use enfilade_geom::{AllowanceEnd, shown};

/// The reason why an import stopped. The text names the problem, the place and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A file could not be read.
    #[error("cannot read {}: {reason}", shown(path.display()))]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's message; part of the text, and so not a source of its own.
        reason: std::io::Error,
    },
    /// The file has none of the supported formats.
    #[error(
        "{}: not a glTF, GLB, OBJ, PLY, STL, IFC or Quake map file; convert it to GLB (Blender and most modelers export it)",
        shown(path.display())
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file breaks its format.
    #[error("{}: {}: {}", shown(path.display()), shown(place), shown(problem))]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Element, index or line.
        place: String,
        /// The problem and the remedy.
        problem: String,
    },
    /// The file is sound but uses an unsupported feature.
    #[error("{}: {} is not supported; {}", shown(path.display()), shown(feature), shown(advice))]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The unsupported feature.
        feature: String,
        /// The remedy.
        advice: String,
    },
    /// A limit of [`crate::Limits`] would be passed.
    #[error(
        "{}: {}: {n} {what}, more than the limit of {limit}; split the input or raise the limit",
        shown(path.display()), shown(place)
    )]
    TooMuch {
        /// The file.
        path: PathBuf,
        /// Element, index or line.
        place: String,
        /// The quantity that is too large.
        what: &'static str,
        /// Its value.
        n: u64,
        /// The largest allowed value.
        limit: u64,
    },
    /// The input needs far more memory than its size explains.
    #[error(
        "{}: {}: needs {n} bytes of memory, more than {limit}, the most for input of this size; \
         it is damaged or malicious, or places large structural meshes very often: split it, or \
         make those meshes detail",
        shown(path.display()), shown(place)
    )]
    Bomb {
        /// The file.
        path: PathBuf,
        /// Element, index or line.
        place: String,
        /// Bytes needed so far.
        n: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// The allowance of the options was over before a file was read.
    #[error("{}: {}: {}", shown(path.display()), shown(place), words_of(*end))]
    Ended {
        /// The file.
        path: PathBuf,
        /// Element that was being read.
        place: String,
        /// Reason for the end.
        end: AllowanceEnd,
    },
    /// No triangle was found in any file.
    #[error("no triangles in {}; {}", shown(paths), shown(advice))]
    NoTriangles {
        /// The files, comma separated.
        paths: String,
        /// The remedy.
        advice: String,
    },
    /// The scene is far larger or smaller than a building: the unit is probably wrong.
    #[error(
        "{paths}: the scene is {x} x {y} x {z} m, {bound}{offender}; {advice}",
        paths = shown(paths), x = meters(size[0]), y = meters(size[1]), z = meters(size[2]),
        offender = offender.as_ref().map(|name| format!(", because object '{}' sticks out", shown(name))).unwrap_or_default()
    )]
    Extent {
        /// The files, comma separated.
        paths: String,
        /// Edge lengths of the scene's box. [Units: wu]
        size: [f64; 3],
        /// The limit that it breaks, as text.
        bound: String,
        /// The one object without which the scene would fit.
        offender: Option<String>,
        /// The remedy.
        advice: String,
    },
    /// An option is invalid.
    #[error(transparent)]
    BadOption(#[from] enfilade_prepare::BadOption),
}

/// Returns the reason for an end, and the remedy.
fn words_of(end: AllowanceEnd) -> &'static str {
    match end {
        AllowanceEnd::Work => {
            "reading takes more work than allowed; allow more, or give less or coarser input"
        }
        AllowanceEnd::Time => {
            "the time was up before it was read (--max-time); allow more, or give less or coarser input"
        }
        AllowanceEnd::Memory => {
            "reading takes more memory than allowed (--max-memory); allow more, or give less or coarser input"
        }
        AllowanceEnd::Cancelled => "cancelled",
    }
}

/// Formats a length short enough for one line, however wrong it is.
fn meters(length: f64) -> String {
    if length.abs() < 1e7 {
        format!("{length:.4}")
    } else {
        format!("{length:.1e}")
    }
}

impl ImportError {
    pub(crate) fn malformed(
        path: &Path,
        place: impl Into<String>,
        problem: impl Into<String>,
    ) -> Self {
        Self::Malformed {
            path: path.to_path_buf(),
            place: place.into(),
            problem: problem.into(),
        }
    }
}
