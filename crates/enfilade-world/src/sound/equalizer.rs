//! A filter with a level of its own in each octave band.
//!
//! Shelves of second order between the bands (Bristow-Johnson, "Cookbook formulae for audio equalizer biquad filter
//! coefficients"), whose heights follow from the levels wanted at the centers of the bands, by Newton's method with the slopes of
//! low shelves: within 0.2 dB there for sound behind edges and leaves, whose bands differ little from their neighbors. Shelves cannot
//! follow steps above 12 dB from band to band; they come as near as they are steep. Nothing sounds before the sound. O(1) a sample.

use crate::sound::bands::{N_BANDS, OCTAVES};

const N_SHELVES: usize = N_BANDS - 1;
/// Steps of Newton's method.
const STEPS: usize = 8;
/// Greatest height of a shelf. [Units: dB]
const HIGHEST_SHELF: f64 = 30.0;
/// Greatest difference of two bands. [Units: dB]
const STEEPEST: f64 = 60.0;
/// Highest frequency of a filter, as a share of the rate of samples.
const HIGHEST: f64 = 0.45;

/// A filter of second order, with its state.
#[derive(Clone, Copy, Debug, Default)]
struct Shelf {
    /// Coefficients of the input, and of the output after the first.
    input: [f64; 3],
    output: [f64; 2],
    state: [f64; 2],
}

impl Shelf {
    /// Makes it raise what is above a frequency, in radians a sample, by a height in decibels; its state stays.
    fn set(&mut self, frequency: f64, height: f64) {
        let a = 10f64.powf(height / 40.0);
        let (sin, cos) = frequency.sin_cos();
        let bend = std::f64::consts::SQRT_2 * a.sqrt() * sin;
        let (sum, difference) = (a + 1.0, a - 1.0);
        let first = sum - difference * cos + bend;
        self.input = [
            a * (sum + difference * cos + bend),
            -2.0 * a * (difference + sum * cos),
            a * (sum + difference * cos - bend),
        ]
        .map(|x| x / first);
        self.output = [
            2.0 * (difference - sum * cos) / first,
            (sum - difference * cos - bend) / first,
        ];
    }

    /// Returns the level at a frequency. [Units: dB]
    fn level(&self, frequency: f64) -> f64 {
        let energy = |c: [f64; 3]| {
            let (cos, cos2) = (frequency.cos(), (2.0 * frequency).cos());
            let [a, b, c] = c;
            a * a + b * b + c * c + 2.0 * (b * (a + c) * cos + a * c * cos2)
        };
        let [a, b] = self.output;
        10.0 * (energy(self.input) / energy([1.0, a, b])).log10()
    }

    fn next(&mut self, x: f64) -> f64 {
        let y = self.input[0] * x + self.state[0];
        self.state = [
            self.input[1] * x - self.output[0] * y + self.state[1],
            self.input[2] * x - self.output[1] * y,
        ];
        y
    }
}

/// A filter with a level in each octave band, which changes from block to block.
#[derive(Clone, Debug)]
pub(super) struct Equalizer {
    /// Frequencies of the shelves and of the centers. [Units: radians a sample]
    edges: [f64; N_SHELVES],
    centers: [f64; N_BANDS],
    /// From steps between bands to heights of shelves.
    heights_of: [[f64; N_SHELVES]; N_SHELVES],
    shelves: [Shelf; N_SHELVES],
    heights: [f64; N_SHELVES],
    /// Factor on what comes in, so that the bands are as loud as asked: all of them together have 1.
    base: f64,
    /// Amplitude at the end of the last block and of this one.
    loudness: [f64; 2],
}

impl Equalizer {
    pub(super) fn new(rate: f64) -> Self {
        let angle = |hertz: f64| std::f64::consts::TAU * hertz.min(HIGHEST * rate) / rate;
        let edges = std::array::from_fn(|i| angle(OCTAVES[i] * std::f64::consts::SQRT_2));
        let centers = OCTAVES.map(angle);
        let mut shelves = [Shelf::default(); N_SHELVES];
        for (shelf, &edge) in shelves.iter_mut().zip(&edges) {
            shelf.set(edge, 1.0);
        }
        let slopes =
            std::array::from_fn(|i| shelves.map(|s| s.level(centers[i + 1]) - s.level(centers[i])));
        for (shelf, &edge) in shelves.iter_mut().zip(&edges) {
            shelf.set(edge, 0.0);
        }
        Self {
            edges,
            centers,
            heights_of: inverse(slopes),
            shelves,
            heights: [0.0; N_SHELVES],
            base: 1.0,
            loudness: [0.0; 2],
        }
    }

    /// Begins a block at whose end the bands have these amplitudes; the first block has them from its beginning.
    pub(super) fn begin(&mut self, amplitudes: &[f64; N_BANDS], is_first: bool) {
        let square = amplitudes.iter().map(|a| a * a).sum::<f64>() / N_BANDS as f64;
        let loudness = square.sqrt();
        self.loudness = [if is_first { loudness } else { self.loudness[1] }, loudness];
        if !(loudness > 0.0 && loudness.is_finite()) {
            return;
        }
        let least = 10f64.powf(-STEEPEST / 20.0);
        let levels = amplitudes.map(|a| 20.0 * (a / loudness).max(least).log10());
        for _ in 0..STEPS {
            let reached = self.levels();
            let lacks: [f64; N_SHELVES] =
                std::array::from_fn(|i| levels[i + 1] - levels[i] - (reached[i + 1] - reached[i]));
            for (i, row) in self.heights_of.iter().enumerate() {
                let rise: f64 = row.iter().zip(lacks).map(|(a, b)| a * b).sum();
                self.heights[i] = (self.heights[i] + rise).clamp(-HIGHEST_SHELF, HIGHEST_SHELF);
                self.shelves[i].set(self.edges[i], self.heights[i]);
            }
        }
        self.base = 10f64.powf((levels[0] - self.levels()[0]) / 20.0);
    }

    /// Returns what the shelves alone do at the centers. [Units: dB]
    fn levels(&self) -> [f64; N_BANDS] {
        self.centers
            .map(|center| self.shelves.iter().map(|s| s.level(center)).sum())
    }

    /// Filters a sample, the share of the block up to it being `share`.
    pub(super) fn next(&mut self, x: f64, share: f64) -> f64 {
        let [before, after] = self.loudness;
        let x = x * self.base * (before + (after - before) * share);
        self.shelves.iter_mut().fold(x, |x, shelf| shelf.next(x))
    }
}

/// Returns the inverse of a matrix with a dominant diagonal, by Gauss and Jordan; rows that are nothing stay so.
fn inverse<const N: usize>(mut of: [[f64; N]; N]) -> [[f64; N]; N] {
    let mut out = [[0.0; N]; N];
    for (i, row) in out.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for i in 0..N {
        let pivot = of[i][i];
        if pivot.abs() < 1e-6 {
            out[i] = [0.0; N];
            continue;
        }
        (of[i], out[i]) = (of[i].map(|x| x / pivot), out[i].map(|x| x / pivot));
        for k in (0..N).filter(|&k| k != i) {
            let factor = of[k][i];
            for j in 0..N {
                of[k][j] -= factor * of[i][j];
                out[k][j] -= factor * out[i][j];
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amplitude of a tone behind the filter, from its sum of squares over whole periods.
    fn heard(rate: f64, hertz: f64, amplitudes: &[f64; N_BANDS]) -> f64 {
        let mut filter = Equalizer::new(rate);
        filter.begin(amplitudes, true);
        let n = rate as usize;
        let mut square = 0.0;
        for i in 0..2 * n {
            let tone = (std::f64::consts::TAU * hertz * i as f64 / rate).sin();
            let out = filter.next(tone, 1.0);
            square += if i < n {
                0.0
            } else {
                2.0 * out * out / n as f64
            };
        }
        square.sqrt()
    }

    /// W11: each octave has its level.
    #[test]
    fn each_octave_has_its_level() {
        for amplitudes in [
            [1.0; N_BANDS],
            [1.0, 0.8, 0.5, 0.25, 0.1, 0.03],
            [0.3, 0.35, 0.5, 0.6, 0.6, 0.5],
            [0.6, 0.5, 0.6, 0.5, 0.6, 0.5],
        ] {
            for (hertz, amplitude) in OCTAVES.into_iter().zip(amplitudes) {
                let off = 20.0 * (heard(44_100.0, hertz, &amplitudes) / amplitude).log10();
                assert!(off.abs() < 0.2, "{amplitudes:?}, {hertz} Hz: {off} dB");
            }
        }
        // Bands above what the rate can hold are left out.
        let low = [1.0, 0.5, 0.25, 0.12, 0.06, 0.03];
        let off = 20.0 * (heard(8000.0, 500.0, &low) / 0.25).log10();
        assert!(off.abs() < 0.2, "{off}");
    }
}
