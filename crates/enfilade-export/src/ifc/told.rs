//! Settings and results of rooms in IFC, and the reasons why there are none.

use std::fmt;

use crate::surfaces::SurfaceLevel;

/// Settings of [`ifc_with_spaces`](crate::ifc_with_spaces).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IfcOptions {
    /// Give spaces of the file that rooms are named after the body, the quantities and the boundaries of the room. Otherwise they stay
    /// as they are.
    pub replaces_spaces: bool,
    /// Level of the boundaries.
    pub level: SurfaceLevel,
}

/// A file with the rooms of a world.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IfcSpaces {
    /// The file.
    pub bytes: Vec<u8>,
    /// Spaces that were added.
    pub n_added: usize,
    /// Spaces of the file that have the bodies of rooms now.
    pub n_replaced: usize,
    /// Spaces of the file that stay as they were.
    pub n_kept: usize,
    /// Boundaries that were written.
    pub n_boundaries: usize,
    /// Surfaces for which there is no boundary, since no element of the file makes them, and the schema asks for one.
    pub n_without_element: usize,
}

/// Reason why rooms cannot be written into a file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum IfcError {
    /// Not IFC as text.
    NotIfc,
    /// A statement is none.
    Broken {
        /// Byte where it begins.
        at: usize,
    },
    /// The end is missing.
    CutOff,
    /// A schema other than IFC2X3 and IFC4 with its successors.
    Schema {
        /// Its name.
        name: String,
    },
    /// There is no project with a unit of length, a context for bodies, and a building.
    Incomplete {
        /// The class that is missing.
        what: &'static str,
    },
    /// The world has no room.
    NoRooms,
    /// None of the world's objects is in the file.
    OtherFile,
}

impl fmt::Display for IfcError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotIfc => f.write_str(
                "it is not IFC as text, which begins with ISO-10303-21; unpack .ifczip, and save .ifcxml as .ifc",
            ),
            Self::Broken { at } => write!(f, "what stands at byte {at} is no statement `#1=CLASS(...);`"),
            Self::CutOff => f.write_str("its end is missing; copy or download it again"),
            Self::Schema { name } => write!(
                f,
                "its schema is '{name}'; save it as IFC2X3, IFC4 or IFC4X3"
            ),
            Self::Incomplete { what } => write!(f, "it has no usable {what}, so spaces have no place in it"),
            Self::NoRooms => f.write_str("the world has no room; `enfilade inspect` tells what cells it has"),
            Self::OtherFile => f.write_str(
                "none of the world's objects is in it; give the file that the world was baked from",
            ),
        }
    }
}

impl std::error::Error for IfcError {}
