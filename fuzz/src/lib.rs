//! The bodies of the fuzz targets. Each function panics where a promise is broken, and nowhere else.

pub mod bake;
pub mod files;
pub mod packed;
pub mod scene;
pub mod settings;
pub mod sight;
pub mod world;

// The command's settings (`settings`) are compiled again here, and refer to these modules by the name of its library.
extern crate self as enfilade_cli;
#[doc(hidden)]
#[path = "../../crates/enfilade-cli/src/input.rs"]
pub mod input;
#[doc(hidden)]
#[path = "../../crates/enfilade-cli/src/memory.rs"]
pub mod memory;
#[doc(hidden)]
#[path = "../../crates/enfilade-cli/src/values.rs"]
pub mod values;

/// Takes numbers off the front of some bytes; zeros at their end.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut out = [0; N];
        let n = self.0.len().min(N);
        let (first, rest) = self.0.split_at(n);
        out[..n].copy_from_slice(first);
        self.0 = rest;
        out
    }

    fn byte(&mut self) -> u8 {
        self.take::<1>()[0]
    }

    /// Returns any `f32`, or a plain one in ±128 from two bytes, which hits things more often.
    fn float(&mut self, is_any: bool) -> f32 {
        if is_any {
            f32::from_le_bytes(self.take())
        } else {
            f32::from(i16::from_le_bytes(self.take())) / 256.0
        }
    }

    fn point(&mut self, is_any: bool) -> [f32; 3] {
        [0; 3].map(|_| self.float(is_any))
    }
}
