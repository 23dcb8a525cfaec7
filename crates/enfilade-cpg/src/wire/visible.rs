//! The potentially visible set as stored in the buffer.

use super::WireError;
use super::json::PvsJson;
use super::rows::{eight, pairs};
use crate::{Pvs, VisibleParts, VisibleVolumes};

/// Reads the rows without checking them. `view` returns a buffer view's bytes, empty if absent, and counts their
/// cost.
pub(super) fn read_pvs<'a>(
    json: &PvsJson,
    mut view: impl FnMut(Option<u32>) -> Result<&'a [u8], WireError>,
    cut_off: &dyn Fn() -> WireError,
) -> Result<Pvs, WireError> {
    let ends = |bytes: &[u8]| {
        let (ends, rest) = bytes.as_chunks::<4>();
        let read = || ends.iter().map(|&e| u32::from_le_bytes(e)).collect();
        rest.is_empty().then(read).ok_or_else(cut_off)
    };
    let runs = |bytes: &[u8]| pairs(bytes).ok_or_else(cut_off);
    let mut pvs = Pvs {
        ends: ends(view(json.rows)?)?,
        runs: runs(view(json.runs)?)?,
        parts: None,
        volumes: None,
    };
    if let Some(parts) = &json.parts {
        pvs.parts = Some(VisibleParts {
            ends: ends(view(parts.rows)?)?,
            runs: runs(view(parts.runs)?)?,
        });
    }
    if let Some(volumes) = &json.volumes {
        pvs.volumes = Some(VisibleVolumes {
            ends: ends(view(volumes.rows)?)?,
            piece_ends: ends(view(volumes.pieces)?)?,
            planes: planes(view(volumes.planes)?).ok_or_else(cut_off)?,
        });
    }
    Ok(pvs)
}

fn planes(bytes: &[u8]) -> Option<Vec<[f64; 4]>> {
    let (planes, rest) = bytes.as_chunks::<32>();
    let number = |p: &[u8; 32], i: usize| f64::from_le_bytes(eight(p, 8 * i));
    let plane = |p: &[u8; 32]| [0, 1, 2, 3].map(|i| number(p, i));
    rest.is_empty().then(|| planes.iter().map(plane).collect())
}

/// Returns the words of each buffer view of counts, in the order in which they are stored; the planes follow.
pub(super) fn words(pvs: &Pvs) -> impl Iterator<Item = &[u32]> {
    let parts = pvs.parts.iter();
    let parts = parts.flat_map(|p| [&p.ends[..], p.runs.as_flattened()]);
    let volumes = pvs.volumes.iter();
    let volumes = volumes.flat_map(|v| [&v.ends[..], &v.piece_ends[..]]);
    let rows = [&pvs.ends[..], pvs.runs.as_flattened()].into_iter();
    rows.chain(parts).chain(volumes)
}
