//! Compressed files.

use std::io::Read;

/// Returns `true` if a file is compressed by gzip.
#[must_use]
pub fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b])
}

/// Unpacks at most `most` bytes; `None` if the file is damaged before that or ends within its head.
#[must_use]
pub fn gunzip(bytes: &[u8], most: u64) -> Option<Vec<u8>> {
    let mut plain = Vec::new();
    let mut from = flate2::read::MultiGzDecoder::new(bytes).take(most);
    match from.read_to_end(&mut plain) {
        Ok(_) => Some(plain),
        // Bytes from before a file was cut off tell how much is missing.
        Err(_) => (!plain.is_empty()).then_some(plain),
    }
}
