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
