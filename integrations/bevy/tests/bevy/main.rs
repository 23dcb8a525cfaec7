//! Tests of the plugin in a whole program, on a software Vulkan driver or whatever card there is. One binary: each links all of
//! Bevy.

#[cfg(feature = "bake")]
mod bake;
mod cells;
mod doors;
mod hearing;
mod movers;
mod pictures;
mod readme;
mod reload;
mod streaming;
mod support;

/// Lamps of most tests.
const LAMPS: support::Lamps = support::Lamps {
    range: 5.0,
    with_shadows: 0,
    sun: false,
};
