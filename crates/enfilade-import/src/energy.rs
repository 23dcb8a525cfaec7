//! Energy models: gbXML 0.37 to 7, and HBJSON of Honeybee.
//!
//! Their surfaces become structure, cut where their openings are: sheets without thickness, or, where spaces of gbXML have shells, walls
//! between these. Openings become doors and windows,
//! spaces the names of rooms, surfaces of air openings that their author marked. Both formats have a known unit, and Z up. Nodes are called by the classes
//! of IFC, which decide the roles: `IfcWall/su-12`.

#[cfg(feature = "energy")]
mod gbxml;
#[cfg(feature = "energy")]
mod hbjson;
#[cfg(feature = "energy")]
mod model;
#[cfg(feature = "energy")]
mod thick;

use std::borrow::Cow;

use crate::ImportError;
use crate::builder::Builder;

/// Bytes in which a file tells what it is.
const HEAD: usize = 1 << 12;

/// Returns `true` for a file whose first element is `gbXML`, in UTF-8 or UTF-16.
pub(crate) fn is_gbxml(bytes: &[u8]) -> bool {
    let head = text(&bytes[..bytes.len().min(HEAD)]);
    let start = head.trim_start();
    start.starts_with('<') && (start.contains("<gbXML") || start.contains(":gbXML"))
}

/// Returns `true` for a model in HBJSON, by its name's ending or the keys of Honeybee.
pub(crate) fn is_hbjson(bytes: &[u8], ending: &str) -> bool {
    let head = text(&bytes[..bytes.len().min(HEAD)]);
    let has = |key: &str| head.contains(&format!("\"{key}\""));
    head.trim_start().starts_with('{')
        && (ending == "hbjson" || has("identifier") && (has("rooms") || has("ModelProperties")))
}

/// Returns the text of a file, in UTF-8 or, with a mark of byte order, in UTF-16.
fn text(bytes: &[u8]) -> Cow<'_, str> {
    let utf_16 = |unit: fn([u8; 2]) -> u16| {
        let units = bytes[2..].as_chunks::<2>().0.iter().map(|&u| unit(u));
        let chars = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        Cow::Owned(chars.collect())
    };
    match bytes {
        [0xff, 0xfe, ..] => utf_16(u16::from_le_bytes),
        [0xfe, 0xff, ..] => utf_16(u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => String::from_utf8_lossy(rest),
        _ => String::from_utf8_lossy(bytes),
    }
}

/// Reads a gbXML file.
#[cfg(feature = "energy")]
pub(crate) fn read_gbxml(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    gbxml::read(bytes, builder)?.place(builder)
}

/// Reads an HBJSON file.
#[cfg(feature = "energy")]
pub(crate) fn read_hbjson(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    hbjson::read(bytes, builder)?.place(builder)
}

#[cfg(not(feature = "energy"))]
pub(crate) fn read_gbxml(_: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    Err(builder.malformed("file", crate::not_built("gbXML", "energy")))
}

#[cfg(not(feature = "energy"))]
pub(crate) fn read_hbjson(_: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    Err(builder.malformed("file", crate::not_built("HBJSON", "energy")))
}
