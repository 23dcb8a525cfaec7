//! Compressed files.

use std::io::Read;

use crate::{SourceError, SourceLimits};

/// Returns `true` if a file is compressed by gzip.
#[must_use]
pub fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b])
}

/// Bytes unpacked between two looks at the limits.
const PART: u64 = 1 << 20;

/// Samples to which any file may unpack. [Units: samples]
const MOST_FREE: u64 = 1 << 27;
/// Most samples beyond that for each packed byte.
const RATIO: u64 = 64;

/// Refuses samples out of proportion to their packed bytes, unless there is a limit on memory.
pub(crate) fn check_ratio(
    packed: &[u8],
    n: usize,
    limits: &SourceLimits,
) -> Result<(), SourceError> {
    let most = MOST_FREE.saturating_add(RATIO.saturating_mul(packed.len() as u64));
    let is_held = limits.allowance.as_ref().is_some_and(|a| a.holds_memory());
    if n as u64 <= most || is_held {
        return Ok(());
    }
    let problem = format!(
        "{n} unpack from {} bytes, far more than data do; if they are right, set a limit on memory (--max-memory 0 for none)",
        packed.len()
    );
    Err(SourceError::new("samples", problem))
}

/// Works as [`gunzip`], as long as the limits allow.
pub(crate) fn gunzip_within(
    bytes: &[u8],
    most: u64,
    limits: &SourceLimits,
) -> Result<Option<Vec<u8>>, SourceError> {
    let mut plain = Vec::new();
    let mut from = flate2::read::MultiGzDecoder::new(bytes).take(most);
    loop {
        // A few nanoseconds for each byte.
        limits.spend(PART / 32)?;
        match from.by_ref().take(PART).read_to_end(&mut plain) {
            Ok(0) => return Ok(Some(plain)),
            Ok(_) => {}
            // Bytes from before a file was cut off tell how much is missing.
            Err(_) => return Ok((!plain.is_empty()).then_some(plain)),
        }
    }
}

/// Unpacks at most `most` bytes; `None` if the file is damaged before that or ends within its head.
#[must_use]
pub fn gunzip(bytes: &[u8], most: u64) -> Option<Vec<u8>> {
    gunzip_within(bytes, most, &SourceLimits::default())
        .ok()
        .flatten()
}
