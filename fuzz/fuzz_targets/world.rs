//! `decode_glb` on any bytes: no panic, and what it accepts is valid and can be written.
//!
//! Good seeds are small worlds; the lengths of header and chunks are mended first, so that
//! mutations get past them and into what they describe.

#![no_main]

use enfilade_cpg::wire::{decode_glb, encode_glb};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    check(data);
    check(&with_lengths_mended(data));
});

fn check(bytes: &[u8]) {
    let Ok(world) = decode_glb(bytes) else { return };
    assert_eq!(world.validate(), Ok(()));
    let written = encode_glb(&world).expect("a valid world can be written");
    let back = decode_glb(&written).expect("what was written can be read");
    assert!(encode_glb(&back).expect("and written again") == written);
}

/// Sets the lengths in the header and before both chunks to what the bytes hold.
fn with_lengths_mended(data: &[u8]) -> Vec<u8> {
    let mut out = data.to_vec();
    if out.len() < 20 {
        return out;
    }
    let all = out.len();
    let mut set = |at: usize, n: usize| out[at..at + 4].copy_from_slice(&(n as u32).to_le_bytes());
    set(8, all);
    match data[20..].windows(4).position(|w| w == b"BIN\0").filter(|&at| at >= 4) {
        Some(at) => {
            set(12, at - 4);
            set(20 + at - 4, all - (20 + at + 4));
        }
        None => set(12, all - 20),
    }
    out
}
