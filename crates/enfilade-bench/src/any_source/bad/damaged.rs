//! Scans with bytes that are others: those of the points, the head, and the description in XML. Seeded by the number of the case.

use enfilade_testkit::Rng;

use super::cases::Case;
use super::scans::{ORIGIN, STATION, files, ply, small};

/// Damaged files of each of five kinds.
const COUNT: u64 = 80;

pub(super) fn cases() -> Vec<Case> {
    let points = small();
    let cloud = ply(&points, points.len(), ORIGIN);
    let Ok([plain, packed, pages]) = files() else {
        return Vec::new();
    };
    let mut all = Vec::new();
    let kinds = [
        ("ply", &cloud, &[][..]),
        ("las", &plain, &STATION[..]),
        ("laz", &packed, &STATION[..]),
        ("e57", &pages, &[][..]),
    ];
    for (k, (ending, whole, options)) in kinds.into_iter().enumerate() {
        for i in 0..COUNT {
            let mut rng = Rng::stream(k as u64, i);
            let bytes = damaged(whole, 400, &mut rng);
            all.push(Case::new(format!("{ending} {i}"), ending, bytes).with(options));
        }
    }
    // Checksums that are right let damage pass to what reads the pages.
    let inner = unpaged(&pages);
    for i in 0..COUNT {
        let mut rng = Rng::stream(9, i);
        let mut bytes = inner.bytes.clone();
        let end = bytes.len();
        // The description is at the end.
        let range = if rng.chance(0.5) {
            48..end
        } else {
            end - end / 6..end
        };
        flip(&mut bytes[range], &mut rng);
        all.push(Case::new(
            format!("e57 with checksums {i}"),
            "e57",
            paged(&bytes),
        ));
    }
    all
}

/// Returns a copy with other bytes, half of the times in its first `head` bytes.
fn damaged(whole: &[u8], head: usize, rng: &mut Rng) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    let end = if rng.chance(0.5) {
        head.min(bytes.len())
    } else {
        bytes.len()
    };
    flip(&mut bytes[..end], rng);
    bytes
}

/// Changes one to eight bytes.
fn flip(bytes: &mut [u8], rng: &mut Rng) {
    for _ in 0..=rng.below(8) {
        let at = rng.below(bytes.len());
        bytes[at] = match rng.below(4) {
            0 => 0,
            1 => 0xff,
            2 => bytes[at] ^ 1 << rng.below(8),
            _ => rng.next_u32() as u8,
        };
    }
}

/// Bytes of a page of E57, and those before its checksum.
const PAGE: usize = 1024;
const PAYLOAD: usize = PAGE - 4;

/// The content of an E57 file without its checksums.
pub(super) struct Unpaged {
    bytes: Vec<u8>,
}

pub(super) fn unpaged(pages: &[u8]) -> Unpaged {
    let content = pages.chunks(PAGE).flat_map(|p| &p[..p.len().min(PAYLOAD)]);
    Unpaged {
        bytes: content.copied().collect(),
    }
}

impl Unpaged {
    /// Returns the file with another text in its description.
    pub(super) fn with_text(&self, old: &str, new: &str) -> Vec<u8> {
        let number = |at: usize| -> usize {
            let mut b = [0; 8];
            b.copy_from_slice(&self.bytes[at..at + 8]);
            u64::from_le_bytes(b) as usize
        };
        let (physical, length) = (number(24), number(32));
        let start = physical / PAGE * PAYLOAD + physical % PAGE;
        let text = String::from_utf8_lossy(&self.bytes[start..start + length]);
        let text = text.replace(old, new);
        let mut bytes = self.bytes[..start].to_vec();
        bytes.extend(text.as_bytes());
        bytes[32..40].copy_from_slice(&(text.len() as u64).to_le_bytes());
        let n_pages = bytes.len().div_ceil(PAYLOAD);
        bytes[16..24].copy_from_slice(&((n_pages * PAGE) as u64).to_le_bytes());
        paged(&bytes)
    }
}

/// Returns content in pages with their checksums.
fn paged(content: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    for part in content.chunks(PAYLOAD) {
        let mut page = part.to_vec();
        page.resize(PAYLOAD, 0);
        let sum = crc32c(&page);
        file.extend(page);
        file.extend(sum.to_be_bytes());
    }
    file
}

/// The checksum of Castagnoli.
fn crc32c(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = crc >> 1 ^ if crc & 1 == 1 { 0x82f6_3b78 } else { 0 };
        }
    }
    !crc
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_come_back_as_they_were() {
        let [_, _, pages] = files().expect("files");
        let content = unpaged(&pages);
        assert_eq!(paged(&content.bytes), pages);
        assert_eq!(content.with_text("no such text", ""), pages);
        assert_ne!(content.with_text("recordCount", "recordcount"), pages);
    }
}
