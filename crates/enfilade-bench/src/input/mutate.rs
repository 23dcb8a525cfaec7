//! Small damage to a file: to its bytes, numbers and words.

use std::io::{Read, Write};
use std::ops::Range;

use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;

use super::random::Random;

/// Extreme numbers, as text.
const NUMBERS: &str = "0 -0 1 -1 2 3 7 255 256 65535 65536 2147483647 2147483648 4294967295 4294967296 \
    18446744073709551615 1e-320 1e-7 1e38 1e308 1e999 nan";

/// Extreme numbers as 32 bits, integers and floats.
const WORDS: [u32; 12] = [
    0,
    1,
    0xff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_fffe,
    0xffff_ffff,
    0x7f80_0000,
    0x7fc0_0000,
    0x7f7f_ffff,
    0x0000_0400,
];

/// Texts that occur in input files, and names of files that should not.
const TEXTS: [&[u8]; 22] = [
    b"\0",
    b"\xff\xfe",
    b"\n",
    b"\r\n",
    b" ",
    b"\"",
    b"{",
    b"}",
    b"[",
    b"]",
    b"(",
    b")",
    b"/",
    b"#",
    b"null",
    b"true",
    b"[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[",
    b"../two.bin",
    b"/dev/zero",
    b"%2e%2e/x",
    b"two.obj",
    b"data:;base64,AAAA",
];

/// Returns a damaged copy. The same random numbers give the same damage.
pub(super) fn mutated(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    // For compressed files with check sums, damage that the sums do not reveal is more interesting.
    if is_packed(bytes) && random.below(4) > 0 {
        return repacked(bytes, |body| damage(body, random)).unwrap_or_default();
    }
    let mut out = bytes.to_vec();
    damage(&mut out, random);
    if out.starts_with(b"glTF") && random.below(4) > 0 {
        mend_lengths(&mut out);
    }
    out
}

fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..=random.below(4) {
        damage_once(bytes, random);
    }
}

fn damage_once(bytes: &mut Vec<u8>, random: &mut Random) {
    let at = random.below(bytes.len());
    let end = (at + 1 + random.below(32)).min(bytes.len());
    match random.below(16) {
        _ if bytes.is_empty() => bytes.push(b'0'),
        0 => bytes[at] ^= 1 << random.below(8),
        1 => bytes[at] = random.bits() as u8,
        2 => bytes.truncate(at),
        3 => drop(bytes.drain(at..end)),
        4 => {
            let copy = bytes[at..end].to_vec();
            let to = random.below(bytes.len());
            bytes.splice(to..to, copy);
        }
        5 => {
            let text = random.one_of(&TEXTS);
            bytes.splice(at..at, text.iter().copied());
        }
        6 | 7 => {
            let word = random.one_of(&WORDS).to_le_bytes();
            // Fields are mostly aligned.
            let at = if random.below(4) > 0 { at & !3 } else { at };
            for (to, from) in bytes[at..].iter_mut().zip(word) {
                *to = from;
            }
        }
        8 | 9 => swap_lines(bytes, random, at),
        _ => change_number(bytes, random, at),
    }
}

/// Replaces the next number by another, or by one from elsewhere in the file.
fn change_number(bytes: &mut Vec<u8>, random: &mut Random, at: usize) {
    let Some(place) = number_after(bytes, at) else {
        return;
    };
    let from = random.below(bytes.len());
    let other = number_after(bytes, from).map(|r| bytes[r].to_vec());
    let new = match other {
        Some(other) if random.below(2) == 0 => other,
        _ => {
            let all: Vec<&str> = NUMBERS.split(' ').collect();
            random.one_of(&all).as_bytes().to_vec()
        }
    };
    bytes.splice(place, new);
}

/// Returns the first run of digits, signs and points at or after `at` that contains a digit.
fn number_after(bytes: &[u8], at: usize) -> Option<Range<usize>> {
    let digit = at + bytes[at..].iter().position(u8::is_ascii_digit)?;
    let is_part = |b: &&u8| b.is_ascii_digit() || b"+-.".contains(b);
    let before = bytes[..digit].iter().rev().take_while(is_part).count();
    let after = bytes[digit..].iter().take_while(is_part).count();
    Some(digit - before..digit + after)
}

/// Swaps two lines, duplicates one, or removes one.
fn swap_lines(bytes: &mut Vec<u8>, random: &mut Random, at: usize) {
    let line = |bytes: &[u8], at: usize| {
        let begin = bytes[..at]
            .iter()
            .rposition(|&b| b == b'\n')
            .map_or(0, |i| i + 1);
        let end = bytes[at..].iter().position(|&b| b == b'\n');
        begin..end.map_or(bytes.len(), |i| at + i + 1)
    };
    let other = random.below(bytes.len());
    let (a, b) = (line(bytes, at.min(other)), line(bytes, at.max(other)));
    // A file without lines has nothing to swap.
    if a.len().max(b.len()) > 1000 || a.end > b.start {
        return;
    }
    let (first, second) = (bytes[a.clone()].to_vec(), bytes[b.clone()].to_vec());
    match random.below(3) {
        0 => drop(bytes.drain(a)),
        1 => drop(bytes.splice(b, first)),
        _ => {
            bytes.splice(b, first);
            bytes.splice(a, second);
        }
    }
}

/// Returns `true` for evidence and checkpoints: a head of 24 bytes, the last 8 of which are the check sum of the rest.
fn is_packed(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ENFEVID") || bytes.starts_with(b"ENFVCHK")
}

/// Changes the compressed data, and corrects sum and length.
fn repacked(bytes: &[u8], change: impl FnOnce(&mut Vec<u8>)) -> std::io::Result<Vec<u8>> {
    let mut body = Vec::new();
    ZlibDecoder::new(&bytes[24..]).read_to_end(&mut body)?;
    change(&mut body);
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&body)?;
    let packed = encoder.finish()?;
    let mut out = bytes[..16].to_vec();
    if bytes.starts_with(b"ENFEVID") {
        out[8..].copy_from_slice(&(body.len() as u64).to_le_bytes());
    }
    let fnv = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    let sum = packed.iter().fold(0xcbf2_9ce4_8422_2325, fnv);
    out.extend(sum.to_le_bytes());
    out.extend(packed);
    Ok(out)
}

/// Sets the lengths in a GLB's header and before its chunks to those of its bytes.
fn mend_lengths(bytes: &mut [u8]) {
    if bytes.len() < 28 {
        return;
    }
    let all = bytes.len();
    let bin = bytes
        .windows(4)
        .position(|w| w == b"BIN\0")
        .filter(|&at| at >= 24);
    let mut set =
        |at: usize, n: usize| bytes[at..at + 4].copy_from_slice(&(n as u32).to_le_bytes());
    set(8, all);
    match bin {
        Some(at) => {
            set(12, at - 24);
            set(at - 4, all - at - 4);
        }
        None => set(12, all - 20),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damage_is_the_same_every_time_and_hardly_ever_none() {
        let text = b"v 1 2 3\nv 4 5 6\nv 7 8 9\nf 1 2 3\n";
        let changed = (0..200).filter(|&i| mutated(text, &mut Random(i)) != text);
        assert!(changed.count() > 180);
        for i in 0..200 {
            assert_eq!(mutated(text, &mut Random(i)), mutated(text, &mut Random(i)));
        }
        // Empty input must not fail.
        for i in 0..200 {
            let _ = mutated(b"", &mut Random(i));
        }
    }

    #[test]
    fn sums_of_what_is_packed_are_mended() {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(b"body").expect("memory");
        let file = [
            &b"ENFEVID4"[..],
            &[0; 16],
            &encoder.finish().expect("memory"),
        ]
        .concat();
        let file = repacked(&file, |body| body.push(b'!')).expect("packed");
        assert_eq!(file[8..16], 5u64.to_le_bytes());
        let again = repacked(&file, |body| assert_eq!(body, b"body!")).expect("packed");
        assert_eq!(again, file);
    }
}
