//! Height maps: of no size and of all sizes, cut off, without heights.

use enfilade_testkit::Rng;
use flate2::Compression;

use super::cases::{BadSource, Cases};

const OPTIONS: [&str; 4] = ["--cell", "1", "--heights", "0,10"];

/// A PNG with a head of its own and rows of its own.
fn png(size: [u32; 2], depth: u8, color: u8, rows: &[u8]) -> Vec<u8> {
    crate::input::formats::png(size, [depth, color], Compression::fast(), [rows])
}

/// A TIFF of one strip of 32-bit numbers, with entries that replace its own: tag, kind, count, value.
fn tiff([w, h]: [u32; 2], samples: &[f32], other: &[[u32; 4]]) -> Vec<u8> {
    let data: Vec<u8> = samples.iter().flat_map(|s| s.to_le_bytes()).collect();
    let mut entries = vec![
        [256, 4, 1, w],
        [257, 4, 1, h],
        [258, 3, 1, 32],
        [259, 3, 1, 1],
        [262, 3, 1, 1],
        [273, 4, 1, 8],
        [277, 3, 1, 1],
        [278, 4, 1, h],
        [279, 4, 1, data.len() as u32],
        [339, 3, 1, 3],
    ];
    for entry in other {
        match entries.iter_mut().find(|e| e[0] == entry[0]) {
            Some(own) => *own = *entry,
            None => entries.push(*entry),
        }
    }
    entries.sort_by_key(|e| e[0]);
    let mut file = b"II*\0".to_vec();
    file.extend((8 + data.len() as u32).to_le_bytes());
    file.extend(data);
    file.extend((entries.len() as u16).to_le_bytes());
    for [tag, kind, n, value] in entries {
        file.extend((tag as u16).to_le_bytes());
        file.extend((kind as u16).to_le_bytes());
        file.extend(n.to_le_bytes());
        file.extend(value.to_le_bytes());
    }
    file.extend([0; 4]);
    file
}

pub(super) fn cases() -> Vec<BadSource> {
    let mut all = Cases::new("png", &OPTIONS);
    pngs(&mut all);
    all.ending = "tif";
    tiffs(&mut all);
    let good = png([20, 20], 8, 0, &rows(20, 20));
    all.ending = "png";
    all.cut("png ", &good, |c| c >= 12);
    all.ending = "tif";
    all.cut("tif ", &tiff([20, 20], &slope(), &[]), |c| c >= 12);
    all.all
        .push(BadSource::new("png without options", "png", good));
    all.all
}

fn field(n: usize, of: impl Fn(usize) -> f32) -> Vec<f32> {
    (0..n).map(of).collect()
}

/// Rows of a PNG of 8 bits.
fn rows(w: usize, h: usize) -> Vec<u8> {
    (0..h)
        .flat_map(|z| std::iter::once(0).chain((0..w).map(move |x| (x * z) as u8)))
        .collect()
}

/// Rows of heights of 20 by 20 samples.
fn slope() -> Vec<f32> {
    field(400, |i| (i % 20) as f32)
}

fn pngs(all: &mut Cases) {
    for size in [
        [0, 0],
        [0, 20],
        [1, 1],
        [1, 20],
        [2, 2],
        [65_535, 65_535],
        [1 << 30, 2],
        [u32::MAX, u32::MAX],
        [8192, 8192],
        [20, 21],
    ] {
        all.add(format!("png of {size:?}"), png(size, 8, 0, &rows(20, 20)));
    }
    for (depth, color) in [
        (0, 0),
        (1, 0),
        (8, 2),
        (8, 3),
        (8, 6),
        (16, 0),
        (255, 0),
        (8, 255),
    ] {
        all.add(
            format!("png of {depth} bits, color {color}"),
            png([20, 20], depth, color, &rows(20, 20)),
        );
    }
    // Rows of nothing, packed a thousandfold.
    all.add(
        "png of 67 million samples of nothing",
        png([8192, 8192], 8, 0, &vec![0; 8193 * 8192]),
    );
    let mut rng = Rng::new(3);
    let mut noise = rows(2049, 2049);
    noise
        .iter_mut()
        .enumerate()
        .filter(|(i, _)| i % 2050 != 0)
        .for_each(|(_, b)| *b = rng.below(256) as u8);
    all.add("png of noise", png([2049, 2049], 8, 0, &noise));
}

fn tiffs(all: &mut Cases) {
    let slope = slope();
    for size in [
        [0, 0],
        [0, 20],
        [1, 20],
        [2, 2],
        [20, 21],
        [65_535, 65_535],
        [u32::MAX, u32::MAX],
        [8192, 8192],
    ] {
        all.add(format!("tiff of {size:?}"), tiff(size, &slope, &[]));
    }
    for entry in [
        [258, 3, 1, 0],
        [258, 3, 1, 64],
        [258, 3, 1, 7],
        [258, 3, 1 << 30, 8],
        [259, 3, 1, 5],
        [259, 3, 1, 7],
        [259, 3, 1, 8],
        [259, 3, 1, 32773],
        [259, 3, 1, 9999],
        [262, 3, 1, 2],
        [273, 4, 1, u32::MAX],
        [273, 4, u32::MAX, 8],
        [277, 3, 1, 0],
        [277, 3, 1, 3],
        [277, 3, 1, 65_535],
        [278, 4, 1, 0],
        [278, 4, 1, 1],
        [279, 4, 1, 0],
        [279, 4, 1, u32::MAX],
        [279, 4, u32::MAX, 8],
        [322, 4, 1, 1 << 31],
        [33550, 12, 3, 8],
        [33550, 12, u32::MAX, 8],
        [33922, 12, 6, u32::MAX],
        [34735, 3, 1 << 31, 8],
        [42113, 2, 1 << 31, 8],
    ] {
        all.add(
            format!("tiff with {entry:?}"),
            tiff([20, 20], &slope, &[entry]),
        );
    }
    for (name, samples) in [
        ("all NaN", field(400, |_| f32::NAN)),
        (
            "every second NaN",
            field(400, |i| if i % 2 == 0 { f32::NAN } else { 1.0 }),
        ),
        (
            "infinite",
            field(400, |i| {
                if i % 2 == 0 {
                    f32::INFINITY
                } else {
                    f32::NEG_INFINITY
                }
            }),
        ),
        (
            "of all heights",
            field(400, |i| if i % 2 == 0 { f32::MAX } else { f32::MIN }),
        ),
        (
            "of great heights",
            field(400, |i| if i % 2 == 0 { 9e5 } else { -9e5 }),
        ),
    ] {
        all.add(format!("tiff {name}"), tiff([20, 20], &samples, &[]));
    }
}
