//! Renders the sound that a listener hears, block by block, to two channels of samples.
//!
//! Each ear has a delay line whose delay and gain change linearly within a block (Zölzer, "DAFX", §3.2). The room's
//! tail comes from four delay lines, fed back through a Hadamard matrix with losses that give the decay time (Jot &
//! Chaigne, "Digital delay networks for designing artificial reverberators", 1991). O(samples). A delay changes by at
//! most a tenth of real time, so that a switch to another shortest path bends the pitch instead of clicking.

use std::fmt;

use crate::sound::reverb::SPEED_OF_SOUND;

/// Samples for which one answer of the listener is used.
pub const AUDIO_BLOCK: usize = 256;
/// Delay lines of the tail, with almost no common divisors. [Units: s]
const LINES: [f64; 4] = [0.0297, 0.0371, 0.0411, 0.0437];
/// Factor on all samples, so that loud rooms do not clip.
const LEVEL: f64 = 0.25;
/// Largest change of a delay, as a fraction of real time.
const FASTEST: f64 = 0.1;

/// The sound heard at the end of a block.
#[derive(Clone, Copy, Debug, Default)]
pub struct AudioBlock {
    /// Length of the path to the listener. [Units: wu]
    pub length: f64,
    /// Amplitude, and delay relative to the nearer ear, left and right. [Units: s]
    pub ears: [(f64, f64); 2],
    /// Amplitude of the room.
    pub room: f64,
    /// Decay time of the room. [Units: s]
    pub rt60: f64,
}

/// Renders the sound heard, block by block. The source repeats.
pub struct Auralizer<'s> {
    source: &'s [f32],
    rate: f64,
    /// Delays of the ears at the end of the previous block. [Units: samples]
    delays: Option<[f64; 2]>,
    last: AudioBlock,
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
            last: AudioBlock::default(),
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
        let delays = self.delays.unwrap_or(goal);
        let last = if self.delays.is_some() {
            self.last
        } else {
            *block
        };
        let most = FASTEST * AUDIO_BLOCK as f64;
        let next = [0, 1].map(|k| goal[k].clamp(delays[k] - most, delays[k] + most));
        for i in 0..AUDIO_BLOCK {
            let share = (i + 1) as f64 / AUDIO_BLOCK as f64;
            let mix = |a: f64, b: f64| a + (b - a) * share;
            let now = self.now as f64;
            let room = self.tail.next(
                at(self.source, now) * mix(last.room, block.room),
                mix(last.rt60, block.rt60),
            );
            let ears = [0, 1].map(|k| {
                let direct = at(self.source, now - mix(delays[k], next[k]));
                let sample = direct * mix(last.ears[k].0, block.ears[k].0) + room[k];
                (LEVEL * sample).clamp(-1.0, 1.0) as f32
            });
            self.out.push(ears);
            self.now += 1;
        }
        (self.delays, self.last) = (Some(next), *block);
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

struct Tail {
    lines: [Vec<f64>; 4],
    heads: [usize; 4],
    rate: f64,
    /// The previous decay time, and for each line the shares kept and fed: they rarely change.
    rt60: f64,
    shares: [(f64, f64); 4],
}

impl Tail {
    fn new(rate: f64) -> Self {
        Self {
            lines: LINES.map(|s| vec![0.0; (s * rate).round().max(1.0) as usize]),
            heads: [0; 4],
            rate,
            rt60: f64::NAN,
            shares: [(0.0, 0.0); 4],
        }
    }

    fn next(&mut self, input: f64, rt60: f64) -> [f64; 2] {
        if rt60 != self.rt60 {
            self.rt60 = rt60;
            self.shares = [0, 1, 2, 3].map(|k| {
                let seconds = self.lines[k].len() as f64 / self.rate;
                let kept = 10f64.powf(-3.0 * seconds / rt60.max(0.05));
                // For a steady source, the energy in the line then equals the input's.
                (kept, (1.0 - kept * kept).sqrt())
            });
        }
        let out = [0, 1, 2, 3].map(|k| self.lines[k][self.heads[k]]);
        let [a, b, c, d] = out;
        // An orthogonal Hadamard matrix.
        let mixed = [a + b + c + d, a - b + c - d, a + b - c - d, a - b - c + d].map(|x| 0.5 * x);
        for (k, mixed) in mixed.into_iter().enumerate() {
            let (kept, fed) = self.shares[k];
            let (line, head) = (&mut self.lines[k], &mut self.heads[k]);
            line[*head] = kept * mixed + 0.5 * (input * fed);
            *head = (*head + 1) % line.len();
        }
        [a + c, b + d].map(|x| x * std::f64::consts::FRAC_1_SQRT_2)
    }
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

    /// W11: the tail falls by 60 dB in its decay time.
    #[test]
    fn a_tail_decays_in_its_time() {
        let rate = 8000.0;
        let mut tail = Tail::new(rate);
        let mut energy = |n: usize, input: f64| -> f64 {
            (0..n)
                .map(|_| tail.next(input, 1.0).iter().map(|x| x * x).sum::<f64>())
                .sum()
        };
        energy(1, 1.0);
        energy(1600, 0.0);
        let early = energy(800, 0.0);
        energy(3200, 0.0);
        let late = energy(800, 0.0);
        // 4,000 samples are half a second: 30 dB.
        let fallen = 10.0 * (early / late).log10();
        assert!((fallen - 30.0).abs() < 2.0, "{fallen}");
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
