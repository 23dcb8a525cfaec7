//! Renders the sound that a listener hears, block by block, to two channels of samples.
//!
//! Each ear has a delay line whose delay and gain change linearly within a block (Zölzer, "DAFX", §3.2), behind it an
//! [equalizer](Equalizer) with the levels of the octave bands. The room's tail begins when the sound arrives; it comes from eight delay
//! lines, fed back through a Hadamard matrix with filters that give the decay times at mid frequencies and at 4 kHz (Jot &
//! Chaigne, "Digital delay networks for designing artificial reverberators", 1991). O(samples). A delay changes by at
//! most a tenth of real time, so that a switch to another shortest path bends the pitch instead of clicking.

use std::fmt;

use crate::sound::bands::{N_BANDS, OCTAVES};
use crate::sound::equalizer::Equalizer;
use crate::sound::reverb::SPEED_OF_SOUND;

/// Samples for which one answer of the listener is used.
pub const AUDIO_BLOCK: usize = 256;
/// Delay lines of the tail, with almost no common divisors. [Units: s]
const LINES: [f64; N_LINES] = [
    0.0297, 0.0331, 0.0371, 0.0411, 0.0437, 0.0479, 0.0523, 0.0571,
];
const N_LINES: usize = 8;
/// Factor on all samples, so that loud rooms do not clip.
const LEVEL: f64 = 0.25;
/// Largest change of a delay, as a fraction of real time.
const FASTEST: f64 = 0.1;

/// The sound heard at the end of a block.
#[derive(Clone, Copy, Debug, Default)]
pub struct AudioBlock {
    /// Length of the path to the listener. [Units: wu]
    pub length: f64,
    /// Amplitude along the paths, in [octave bands](crate::OCTAVES).
    pub bands: [f64; N_BANDS],
    /// Share of the amplitude, and delay relative to the nearer ear, left and right. [Units: s]
    pub ears: [(f64, f64); 2],
    /// Amplitude of the room, in octave bands.
    pub room: [f64; N_BANDS],
    /// Decay time of the room, in octave bands. [Units: s]
    pub rt60: [f64; N_BANDS],
}

/// Renders the sound heard, block by block. The source repeats.
pub struct Auralizer<'s> {
    source: &'s [f32],
    rate: f64,
    /// Delays of the ears at the end of the previous block. [Units: samples]
    delays: Option<[f64; 2]>,
    ears: [Equalizer; 2],
    tail: Tail,
    /// Samples so far.
    now: u64,
    out: Vec<[f32; 2]>,
}

impl fmt::Debug for Auralizer<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Auralizer")
            .field("rate", &self.rate)
            .field("now", &self.now)
            .finish_non_exhaustive()
    }
}

impl<'s> Auralizer<'s> {
    /// Returns a renderer of the sound of one source, in samples at a rate. [Units: 1/s]
    #[must_use]
    pub fn new(source: &'s [f32], rate: u32) -> Self {
        let rate = f64::from(rate);
        Self {
            source,
            rate,
            delays: None,
            ears: [Equalizer::new(rate), Equalizer::new(rate)],
            tail: Tail::new(rate),
            now: 0,
            out: Vec::with_capacity(AUDIO_BLOCK),
        }
    }

    /// Returns the samples of the next block, left and right.
    pub fn render(&mut self, block: &AudioBlock) -> &[[f32; 2]] {
        self.out.clear();
        if self.source.is_empty() {
            return &self.out;
        }
        let goal = (block.ears).map(|e| (block.length / SPEED_OF_SOUND + e.1) * self.rate);
        let is_first = self.delays.is_none();
        let delays = self.delays.unwrap_or(goal);
        for (ear, (share, _)) in self.ears.iter_mut().zip(block.ears) {
            ear.begin(&block.bands.map(|a| a * share), is_first);
        }
        self.tail.begin(block, is_first);
        let most = FASTEST * AUDIO_BLOCK as f64;
        let next = [0, 1].map(|k| goal[k].clamp(delays[k] - most, delays[k] + most));
        for i in 0..AUDIO_BLOCK {
            let share = (i + 1) as f64 / AUDIO_BLOCK as f64;
            let mix = |a: f64, b: f64| a + (b - a) * share;
            let now = self.now as f64;
            let come = [0, 1].map(|k| now - mix(delays[k], next[k]));
            let room = self.tail.next(at(self.source, come[0].max(come[1])), share);
            let ears = [0, 1].map(|k| {
                let direct = self.ears[k].next(at(self.source, come[k]), share);
                (LEVEL * (direct + room[k])).clamp(-1.0, 1.0) as f32
            });
            self.out.push(ears);
            self.now += 1;
        }
        self.delays = Some(next);
        &self.out
    }
}

/// The source at a time in samples, interpolated linearly; 0 before it starts.
fn at(source: &[f32], time: f64) -> f64 {
    if time < 0.0 {
        return 0.0;
    }
    let i = time.floor();
    let sample = |k: usize| f64::from(source[k % source.len()]);
    let (a, b) = (sample(i as usize), sample(i as usize + 1));
    a + (b - a) * (time - i)
}

/// A delay line of the tail, with the filter of one pole that it is fed back through.
struct Line {
    samples: Vec<f64>,
    head: usize,
    /// Shares of the input and of the last output that go into the next output.
    fed: f64,
    kept: f64,
    last: f64,
}

impl Line {
    /// Sets the decay times at mid frequencies and at 4 kHz. A time that grows with frequency counts as equal at all.
    fn set(&mut self, rate: f64, [mid, high]: [f64; 2]) {
        let seconds = self.samples.len() as f64 / rate;
        let [mid, high] = [mid, high].map(|t| 10f64.powf(-3.0 * seconds / t.max(0.05)));
        let ratio = (high / mid).powi(2);
        // The pole at which the filter has this ratio of energies between 4 kHz and 0 Hz.
        let (a, b) = (
            1.0 - ratio,
            1.0 - ratio * angle(OCTAVES[N_BANDS - 1], rate).cos(),
        );
        self.kept = if a > 1e-6 {
            (b - (b * b - a * a).max(0.0).sqrt()) / a
        } else {
            0.0
        };
        self.fed = mid * (1.0 - self.kept);
    }

    /// Returns the share of energy that a round keeps at a frequency.
    fn share(&self, hertz: f64, rate: f64) -> f64 {
        let cos = angle(hertz, rate).cos();
        self.fed.powi(2) / (1.0 - 2.0 * self.kept * cos + self.kept.powi(2))
    }
}

/// Returns a frequency in radians a sample, at most that of half the rate.
fn angle(hertz: f64, rate: f64) -> f64 {
    std::f64::consts::TAU * (hertz / rate).min(0.5)
}

struct Tail {
    lines: [Line; N_LINES],
    rate: f64,
    /// Decay times of the last block: they rarely change.
    rt60: [f64; N_BANDS],
    /// Factor on the amplitude of the input, so that the energy of a steady sound in the lines is that of the room.
    whole: [f64; N_BANDS],
    input: Equalizer,
}

impl Tail {
    fn new(rate: f64) -> Self {
        Self {
            lines: LINES.map(|s| Line {
                samples: vec![0.0; (s * rate).round().max(1.0) as usize],
                head: 0,
                fed: 0.0,
                kept: 0.0,
                last: 0.0,
            }),
            rate,
            rt60: [f64::NAN; N_BANDS],
            whole: [1.0; N_BANDS],
            input: Equalizer::new(rate),
        }
    }

    /// Begins a block, at whose end the room is as loud as `block` says.
    fn begin(&mut self, block: &AudioBlock, is_first: bool) {
        if block.rt60 != self.rt60 {
            self.rt60 = block.rt60;
            let times = [0.5 * (self.rt60[2] + self.rt60[3]), self.rt60[N_BANDS - 1]];
            for line in &mut self.lines {
                line.set(self.rate, times);
            }
            for (whole, hertz) in self.whole.iter_mut().zip(OCTAVES) {
                let kept = self.lines.iter().map(|l| l.share(hertz, self.rate));
                *whole = (1.0 - kept.sum::<f64>() / N_LINES as f64).max(0.0).sqrt();
            }
        }
        let amplitudes = std::array::from_fn(|k| block.room[k] * self.whole[k]);
        self.input.begin(&amplitudes, is_first);
    }

    /// Returns the next sample at both ears, `share` of the block being over.
    fn next(&mut self, input: f64, share: f64) -> [f64; 2] {
        let input = self.input.next(input, share);
        let out: [f64; N_LINES] =
            std::array::from_fn(|k| self.lines[k].samples[self.lines[k].head]);
        let fed = input / (N_LINES as f64).sqrt();
        for (line, mixed) in self.lines.iter_mut().zip(mixed(out)) {
            line.last = line.fed * mixed + line.kept * line.last;
            line.samples[line.head] = line.last + fed;
            line.head = (line.head + 1) % line.samples.len();
        }
        // Half of the lines at each ear; the energy of both is that of the room.
        [0, 1].map(|ear| out.iter().skip(ear).step_by(2).sum())
    }
}

/// Multiplies by an orthogonal Hadamard matrix.
fn mixed(mut lines: [f64; N_LINES]) -> [f64; N_LINES] {
    let mut half = 1;
    while half < N_LINES {
        for i in (0..N_LINES).filter(|i| i & half == 0) {
            let (a, b) = (lines[i], lines[i + half]);
            (lines[i], lines[i + half]) = (a + b, a - b);
        }
        half *= 2;
    }
    lines.map(|x| x / (N_LINES as f64).sqrt())
}

/// A sound for trials: two soft tones, struck twice a second.
#[must_use]
pub fn test_sound(rate: u32) -> Vec<f32> {
    let n = rate / 2;
    let sample = |i: u32| {
        let t = f64::from(i) / f64::from(rate);
        let struck = (t * 200.0).min(1.0) * (-8.0 * t).exp() * ((0.5 - t) * 50.0).min(1.0);
        let tone = |hertz: f64| (std::f64::consts::TAU * hertz * t).sin();
        (0.5 * struck * (tone(440.0) + 0.5 * tone(660.0))) as f32
    };
    (0..n).map(sample).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W11: the tail falls by 60 dB in its decay time, in each band that it is asked in.
    #[test]
    fn a_tail_decays_in_its_time() {
        let rate = 16_000.0;
        for (hertz, seconds) in [(700.0, 1.2), (4000.0, 0.6)] {
            let mut tail = Tail::new(rate);
            let rt60 = [1.2, 1.2, 1.2, 1.2, 0.9, 0.6];
            let room = [1.0; N_BANDS];
            let block = AudioBlock {
                room,
                rt60,
                ..AudioBlock::default()
            };
            tail.begin(&block, true);
            // A tone that ends: what follows is the tail alone.
            let mut now = 0;
            let mut energy = |n: usize, is_on: bool| -> f64 {
                (0..n)
                    .map(|_| {
                        now += 1;
                        let tone = (std::f64::consts::TAU * hertz * f64::from(now) / rate).sin();
                        let out = tail.next(if is_on { tone } else { 0.0 }, 1.0);
                        out.iter().map(|x| x * x).sum::<f64>()
                    })
                    .sum()
            };
            energy(32_000, true);
            energy(800, false);
            let early = energy(1600, false);
            energy(3200, false);
            let late = energy(1600, false);
            let fallen = 10.0 * (early / late).log10();
            let expected = 60.0 * 0.3 / seconds;
            assert!(
                (fallen / expected - 1.0).abs() < 0.12,
                "{hertz} Hz: {fallen} dB, {expected}"
            );
        }
    }

    /// W11: a room is as loud as asked in each band, and not before the sound arrives.
    #[test]
    fn a_room_is_as_loud_as_asked_and_no_sooner() {
        let rate = 16_000_u32;
        let mut offs = Vec::new();
        for (band, hertz) in OCTAVES.into_iter().enumerate() {
            // A noise of one octave, which repeats after two seconds: 150 tones.
            let wide = hertz * std::f64::consts::FRAC_1_SQRT_2;
            let tones = (0..150).map(|k| (2.0 * wide * (1.0 + f64::from(k) / 150.0)).round() / 2.0);
            let tones: Vec<f64> = tones.collect();
            let source: Vec<f32> = (0..2 * rate)
                .map(|i| {
                    let t = f64::from(i) / f64::from(rate);
                    let waves = tones.iter().enumerate();
                    let wave = |(k, f): (usize, &f64)| {
                        (std::f64::consts::TAU * f * t + 2.4 * (k * k) as f64).sin()
                    };
                    (0.05 * waves.map(wave).sum::<f64>()) as f32
                })
                .collect();
            let room = [1.0, 0.9, 0.7, 0.5, 0.3, 0.2];
            let block = AudioBlock {
                length: 100.0,
                room,
                rt60: [0.6, 0.6, 0.5, 0.5, 0.4, 0.3],
                ..AudioBlock::default()
            };
            let mut renderer = Auralizer::new(&source, rate);
            let n = 4 * rate as usize / AUDIO_BLOCK;
            let out: Vec<[f32; 2]> = (0..n)
                .flat_map(|_| renderer.render(&block).to_vec())
                .collect();
            let arrival = (100.0 / SPEED_OF_SOUND * f64::from(rate)) as usize;
            assert!(
                out[..arrival].iter().all(|s| *s == [0.0; 2]),
                "before the sound"
            );
            let square = |s: &[f32; 2]| s.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
            let late = &out[out.len() - 2 * rate as usize..];
            let mean = late.iter().map(square).sum::<f64>() / late.len() as f64;
            let given =
                source.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / source.len() as f64;
            let off = 10.0 * (mean / (LEVEL * LEVEL * given * room[band] * room[band])).log10();
            offs.push(off);
        }
        // Eight lines have 30 modes in the lowest octave, which a sound meets or misses, as in a room.
        assert!(offs[0].abs() < 2.0, "{offs:?} dB");
        assert!(offs[1..].iter().all(|off| off.abs() < 1.0), "{offs:?} dB");
    }

    /// W11: a path that suddenly becomes 20 m shorter makes no jump.
    #[test]
    fn ways_that_change_make_no_clicks() {
        let source = test_sound(44100);
        let jump = |s: &[f32]| {
            s.windows(2)
                .map(|w| (w[1] - w[0]).abs())
                .fold(0.0, f32::max)
        };
        let block = |length: f64| AudioBlock {
            length,
            bands: [1.0; N_BANDS],
            ears: [(1.0, 0.0), (0.7, 3e-4)],
            ..AudioBlock::default()
        };
        let blocks: Vec<_> = (0..300)
            .map(|k| block(if k < 150 { 30.0 } else { 10.0 }))
            .collect();
        let mut renderer = Auralizer::new(&source, 44100);
        let out: Vec<_> = (blocks.iter())
            .flat_map(|b| renderer.render(b).to_vec())
            .collect();
        for k in 0..2 {
            let channel: Vec<f32> = out.iter().map(|s| s[k]).collect();
            assert!(jump(&channel) <= 1.15 * LEVEL as f32 * jump(&source));
        }
    }
}
