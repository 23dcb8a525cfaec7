//! Pages of E57 files with their checksums.

/// Bytes of a page of E57, and those before its checksum.
const PAGE: usize = 1024;
const PAYLOAD: usize = PAGE - 4;

/// The content of an E57 file without its checksums.
pub(super) struct Unpaged {
    pub(super) bytes: Vec<u8>,
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
pub(super) fn paged(content: &[u8]) -> Vec<u8> {
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
    use super::super::scans::files;
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
