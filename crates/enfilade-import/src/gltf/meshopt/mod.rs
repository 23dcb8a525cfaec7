//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: buffer views compressed by meshoptimizer's codecs.
//!
//! Written from the bitstream chapters of the two extensions (Khronos, *glTF registry*) instead of binding the C++
//! library: every read is from a slice, so hostile bytes end in an error, and the filters give the same bits on every
//! processor (the library uses the processor's own reciprocal square root). Tests compare with the library.

mod filter;
mod index;
mod vertex;

use super::json::{BufferView, MeshoptDef, Root};
use crate::ImportError;
use crate::builder::Builder;
use std::borrow::Cow;

/// Returns the decompressed bytes of each compressed buffer view.
///
/// Charges memory before allocating it; linear in the decompressed bytes.
pub(super) fn decode_views(
    root: &Root,
    buffers: &[Option<Cow<'_, [u8]>>],
    builder: &mut Builder<'_>,
) -> Result<Vec<Option<Vec<u8>>>, ImportError> {
    let mut plain = Vec::new();
    for (i, view) in root.buffer_views.iter().enumerate() {
        let Some(def) = view.meshopt() else {
            plain.push(None);
            continue;
        };
        let place = format!("buffer view {i}");
        let packed = packed_bytes(def, view, buffers)
            .map_err(|problem| builder.malformed(&place, problem))?;
        builder.charge_memory(&place, def.count, def.byte_stride)?;
        let bytes = decode(def, packed)
            .map_err(|problem| builder.malformed(&place, format!("meshopt: {problem}")))?;
        builder.add_unpacked_bytes(packed.len() as u64, bytes.len() as u64);
        plain.push(Some(bytes));
    }
    Ok(plain)
}

/// Returns the compressed bytes after checking that all numbers of the extension agree.
fn packed_bytes<'b>(
    def: &MeshoptDef,
    view: &BufferView,
    buffers: &'b [Option<Cow<'_, [u8]>>],
) -> Result<&'b [u8], String> {
    let n_plain = def.count.checked_mul(def.byte_stride);
    if n_plain.is_none_or(|n| n < view.byte_length || n > u64::from(u32::MAX)) {
        return Err(format!(
            "meshopt: {} elements of {} bytes for a view of {} bytes",
            def.count, def.byte_stride, view.byte_length
        ));
    }
    let buffer = buffers
        .get(def.buffer as usize)
        .ok_or_else(|| format!("meshopt: no buffer {}", def.buffer))?;
    let buffer = buffer
        .as_ref()
        .ok_or_else(|| format!("meshopt: buffer {} has no data", def.buffer))?;
    let end = def.byte_offset.checked_add(def.byte_length);
    end.and_then(|end| {
        buffer.get(usize::try_from(def.byte_offset).ok()?..usize::try_from(end).ok()?)
    })
    .ok_or_else(|| {
        format!(
            "meshopt: needs bytes {}+{} of buffer {}, which has {}",
            def.byte_offset,
            def.byte_length,
            def.buffer,
            buffer.len()
        )
    })
}

fn decode(def: &MeshoptDef, packed: &[u8]) -> Result<Vec<u8>, String> {
    let (n, stride) = (def.count as usize, def.byte_stride as usize);
    let filter = def.filter.as_deref().unwrap_or("NONE");
    if def.mode != "ATTRIBUTES" && filter != "NONE" {
        return Err(format!("the filter {filter} on {}", def.mode));
    }
    match def.mode.as_str() {
        "ATTRIBUTES" => {
            let mut bytes = vertex::decode(packed, n, stride)?;
            filter::apply(filter, stride, &mut bytes)?;
            Ok(bytes)
        }
        "TRIANGLES" => narrowed(&index::decode_triangles(packed, n)?, stride),
        "INDICES" => narrowed(&index::decode_sequence(packed, n)?, stride),
        mode => Err(format!("unknown mode {mode}")),
    }
}

/// Returns indices as bytes, `stride` for each.
fn narrowed(indices: &[u32], stride: usize) -> Result<Vec<u8>, String> {
    match stride {
        2 => Ok(indices
            .iter()
            .flat_map(|&i| (i as u16).to_le_bytes())
            .collect()),
        4 => Ok(indices.iter().flat_map(|i| i.to_le_bytes()).collect()),
        _ => Err(format!("indices of {stride} bytes")),
    }
}

/// Errors of all decoders for too few or too many bytes.
const CUT_OFF: &str = "the data is cut off";
const TOO_LONG: &str = "bytes after the end of the data";

/// The remaining input; bytes are taken from the front.
struct Input<'b>(&'b [u8]);

impl<'b> Input<'b> {
    fn take(&mut self, n: usize) -> Result<&'b [u8], String> {
        let (head, rest) = self.0.split_at_checked(n).ok_or(CUT_OFF)?;
        self.0 = rest;
        Ok(head)
    }

    fn byte(&mut self) -> Result<u8, String> {
        Ok(self.take(1)?[0])
    }

    /// Reads an integer in up to five groups of seven bits, lowest first.
    fn var_int(&mut self) -> Result<u32, String> {
        let mut value = 0;
        for k in 0..5 {
            let group = self.byte()?;
            value |= u32::from(group & 127) << (7 * k);
            if group < 128 {
                break;
            }
        }
        Ok(value)
    }

    fn end(&self) -> Result<(), String> {
        if self.0.is_empty() {
            Ok(())
        } else {
            Err(TOO_LONG.into())
        }
    }
}

/// Splits off the header byte and returns the version, 0 or 1.
fn version_of(packed: &[u8], magic: u8) -> Result<(u8, &[u8]), String> {
    let (&head, rest) = packed.split_first().ok_or(CUT_OFF)?;
    if head & 0xF0 != magic {
        return Err(format!("begins with {head:#04x}, not {magic:#04x}"));
    }
    match head & 0x0F {
        version @ 0..=1 => Ok((version, rest)),
        version => Err(format!("version {version} of the codec is not known")),
    }
}

/// Decodes `1, 2, 3, ...` as `-1, 1, -2, ...`.
fn unzigzag(v: u32) -> u32 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_groups_of_seven_bits_end_after_five() {
        let read = |bytes: &[u8]| Input(bytes).var_int();
        assert_eq!(read(&[5]), Ok(5));
        assert_eq!(read(&[0x80, 0x01]), Ok(128));
        assert_eq!(read(&[0xFF; 9]), Ok(u32::MAX));
        assert!(read(&[0x80]).is_err());
        assert_eq!([0, 1, 2, 3].map(unzigzag), [0, u32::MAX, 1, u32::MAX - 1]);
    }

    #[test]
    fn heads_of_other_codecs_and_versions_are_refused() {
        assert_eq!(version_of(&[0xA1, 7], 0xA0), Ok((1, &[7][..])));
        for bad in [&[][..], &[0xE0], &[0xA2]] {
            assert!(version_of(bad, 0xA0).is_err(), "{bad:?}");
        }
    }
}
