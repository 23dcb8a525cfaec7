//! Handmade evidence files.

use std::io::Write;

/// Packs a body of evidence into a file with correct length and checksum.
pub(crate) fn pack(body: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(body).unwrap();
    let packed = encoder.finish().unwrap();
    let sum = packed.iter().fold(0xcbf2_9ce4_8422_2325_u64, |sum, &b| {
        (sum ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
    });
    let mut file = b"ENFEVID4".to_vec();
    file.extend((body.len() as u64).to_le_bytes());
    file.extend(sum.to_le_bytes());
    file.extend(packed);
    file
}
