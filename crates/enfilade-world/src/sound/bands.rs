//! Octave bands.

/// Number of octave bands.
pub(super) const N_BANDS: usize = 6;
/// Centers of the octave bands, those in which materials are measured (ISO 354). [Units: Hz]
pub const OCTAVES: [f64; N_BANDS] = [125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0];
