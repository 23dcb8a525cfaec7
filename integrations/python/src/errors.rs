//! Exceptions, with the texts of the command.

use std::io;

use enfilade::bake::BakeError as Bake;
use enfilade::import::ImportError;
use pyo3::exceptions::{PyFileNotFoundError, PyPermissionError, PyValueError};
use pyo3::{PyErr, create_exception};

create_exception!(
    enfilade,
    EnfiladeError,
    pyo3::exceptions::PyException,
    "Base of the exceptions of this package. Wrong arguments are ``ValueError`` or ``TypeError``."
);
create_exception!(
    enfilade,
    SceneError,
    EnfiladeError,
    "A scene cannot be read: its file is damaged, or has no triangles, or its unit or axis is wrong."
);
create_exception!(
    enfilade,
    BakeError,
    EnfiladeError,
    "No world can be made of a scene: nothing bounds rooms, no room was found, or a limit was reached."
);
create_exception!(
    enfilade,
    WorldError,
    EnfiladeError,
    "A file is not a world, or is damaged, or cannot be written."
);
create_exception!(
    enfilade,
    NoPathError,
    EnfiladeError,
    "No walk leads from one point to the other."
);

/// Returns the exception for a file that cannot be read or written.
pub(crate) fn of_io(text: String, source: &io::Error, other: fn(String) -> PyErr) -> PyErr {
    match source.kind() {
        io::ErrorKind::NotFound => PyFileNotFoundError::new_err(text),
        io::ErrorKind::PermissionDenied => PyPermissionError::new_err(text),
        _ => other(text),
    }
}

/// Returns the exception for a scene that cannot be read.
pub(crate) fn of_import(error: &ImportError) -> PyErr {
    let text = error.to_string();
    match error {
        ImportError::Read { reason, .. } => of_io(text, reason, SceneError::new_err),
        ImportError::BadOption(_) => PyValueError::new_err(text),
        _ => SceneError::new_err(text),
    }
}

/// Returns the exception for a failed bake.
pub(crate) fn of_bake(error: &Bake) -> PyErr {
    let text = error.to_string();
    match error {
        Bake::Setting { .. } => PyValueError::new_err(text),
        _ => BakeError::new_err(text),
    }
}

/// Returns the exception for a file that is not a world.
pub(crate) fn of_file(error: &enfilade::FileError) -> PyErr {
    let text = error.to_string();
    match error {
        enfilade::FileError::Read { source, .. } | enfilade::FileError::Write { source, .. } => {
            of_io(text, source, WorldError::new_err)
        }
        _ => WorldError::new_err(text),
    }
}
