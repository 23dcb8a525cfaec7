//! Scans with bytes that are others: those of the points, the head, and the description in XML. Seeded by the number of the case.

use enfilade_testkit::Rng;

use super::cases::BadSource;
use super::pages::{paged, unpaged};
use super::scans::{ORIGIN, STATION, files, ply, small};

/// Damaged files of each of five kinds.
const COUNT: u64 = 80;

pub(super) fn cases() -> Vec<BadSource> {
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
            all.push(BadSource::new(format!("{ending} {i}"), ending, bytes).with(options));
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
        all.push(BadSource::new(
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
