//! Raw samples, with a header in JSON beside them.

use enfilade_geom::{DMat4, DVec3};
use serde_json::Value;

use super::samples::{SampleKind, Stored, read};
use super::{Beside, Volume};
use crate::{SourceError, SourceLimits};

pub(super) fn is_header(bytes: &[u8]) -> bool {
    crate::is_json_of(bytes, "volume")
}

pub(super) fn parse(
    bytes: &[u8],
    beside: &mut Beside<'_>,
    limits: &SourceLimits,
) -> Result<Volume, SourceError> {
    let bad = |place: &str, problem: &str| SourceError::new(place, problem);
    let value: Value = serde_json::from_slice(bytes)
        .map_err(|e| bad(&format!("line {}", e.line()), &format!("not JSON: {e}")))?;
    let map = value
        .as_object()
        .ok_or_else(|| bad("header", "must be an object in braces"))?;
    let keys = [
        "enfilade",
        "file",
        "size",
        "type",
        "spacing",
        "origin",
        "unit",
        "up",
        "big_endian",
        "skip",
    ];
    crate::known_keys(map, "header", &keys)?;
    let text = |key: &str| map.get(key).and_then(Value::as_str);
    let triple = |key: &str| -> Option<[f64; 3]> {
        let all: Option<Vec<f64>> = map
            .get(key)?
            .as_array()?
            .iter()
            .map(Value::as_f64)
            .collect();
        all?.try_into().ok()
    };
    let size = triple("size").filter(|s| {
        s.iter()
            .all(|n| n.fract() == 0.0 && (0.0..=1e9).contains(n))
    });
    let size = size.ok_or_else(|| bad("size", "must be three numbers of samples: [x, y, z]"))?;
    let size = size.map(|n| n as usize);
    let n = Volume::check_size(size, limits)?;
    let kind = text("type").and_then(SampleKind::of_name);
    let kind = kind.ok_or_else(|| {
        bad(
            "type",
            "must be one of int8, uint8, int16, uint16, int32, uint32, float32, float64",
        )
    })?;
    let unit = map.get("unit").map(crate::implicit::unit).transpose()?;
    let is_z_up = match text("up") {
        None | Some("y") => false,
        Some("z") => true,
        Some(_) => return Err(bad("up", "must be \"y\" or \"z\"")),
    };
    let length = |key: &str, usual: f64| match map.get(key) {
        None => Ok(DVec3::splat(usual)),
        Some(_) => triple(key)
            .map(DVec3::from_array)
            .ok_or_else(|| bad(key, "must be three numbers: [x, y, z]")),
    };
    let matrix = DMat4::from_translation(length("origin", 0.0)?)
        * DMat4::from_scale(length("spacing", 1.0)?);
    let skip = match map.get("skip").map(Value::as_u64) {
        None => 0,
        Some(Some(n)) => usize::try_from(n).unwrap_or(usize::MAX),
        Some(None) => return Err(bad("skip", "must be a number of bytes")),
    };
    let name =
        text("file").ok_or_else(|| bad("file", "must be the name of the file with the samples"))?;
    let data = beside(name).map_err(|e| bad("file", &e))?;
    let stored = Stored {
        kind,
        is_big: map.get("big_endian") == Some(&Value::Bool(true)),
        scale: [1.0, 0.0],
    };
    Ok(Volume {
        size,
        values: read(data.get(skip..).unwrap_or_default(), n, stored, limits)?,
        placement: super::checked(matrix)?,
        unit,
        is_z_up,
    })
}
