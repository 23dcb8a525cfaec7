//! What can go wrong on the way in, with the place and the way out.

use std::path::{Path, PathBuf};

use enfilade_geom::shown;

/// Why an import stopped. Every text says what was found, where, and what to change.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A file could not be read.
    #[error("cannot read {}: {reason}", shown(path.display()))]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said; part of the text, and so no source of its own.
        reason: std::io::Error,
    },
    /// The file is of no format that is read here.
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
        /// What is wrong and what to change.
        problem: String,
    },
    /// The file is sound but uses something that is not read here.
    #[error("{}: {} is not supported; {}", shown(path.display()), shown(feature), shown(advice))]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it uses.
        feature: String,
        /// What to do instead.
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
        /// What there is too much of.
        what: &'static str,
        /// How much there is.
        n: u64,
        /// How much is allowed.
        limit: u64,
    },
    /// The input asks for far more memory than its size explains.
    #[error(
        "{}: {}: asks for {n} bytes of memory, over {limit}, the most for input of this size; \
         it is damaged or made to harm, or places large structural meshes very often: split it, or \
         make those detail",
        shown(path.display()), shown(place)
    )]
    Bomb {
        /// The file.
        path: PathBuf,
        /// Element, index or line.
        place: String,
        /// Bytes asked for so far.
        n: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// No triangle was found in any file.
    #[error("no triangles in {}; {}", shown(paths), shown(advice))]
    NoTriangles {
        /// The files, comma separated.
        paths: String,
        /// What to look at.
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
        /// What to do.
        advice: String,
    },
    /// An option makes no sense.
    #[error("{option}: {problem}")]
    BadOption {
        /// The option.
        option: &'static str,
        /// What is wrong with it.
        problem: String,
    },
}

/// A length that fits a line, however wrong it is.
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
