//! Random numbers determined by a seed, an actor and an event alone.
//!
//! The mixing function of SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014) over
//! a state that advances by their odd constant. O(1); integers only, so equal on every machine.

/// Random numbers of one event of one actor.
#[derive(Clone, Debug)]
pub struct Chance {
    state: u64,
}

const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

fn mixed(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

impl Chance {
    /// Makes the generator from a world's seed, an actor's index and its event's index.
    #[must_use]
    pub fn new(seed: u64, actor: u32, event: u32) -> Self {
        let both = u64::from(actor) << 32 | u64::from(event);
        Self {
            state: mixed(mixed(seed.wrapping_add(STEP)) ^ both),
        }
    }

    /// Returns 64 random bits.
    #[doc(hidden)]
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(STEP);
        mixed(self.state)
    }

    /// Returns a number from 0 up to, not including, 1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a number from the first up to the second.
    pub fn range(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns an integer below `n`; 0 if `n` is 0. Uniform up to `n` in 2³².
    pub fn below(&mut self, n: u32) -> u32 {
        ((u64::from(n) * (self.bits() >> 32)) >> 32) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Covers W13: neighboring actors and events are uncorrelated, and all numbers occur.
    #[test]
    fn chance_is_spread_and_decided_by_seed_actor_and_event() {
        let first = |seed, actor, event| Chance::new(seed, actor, event).bits();
        assert_eq!(first(1, 2, 3), first(1, 2, 3));
        let mut all: Vec<u64> = Vec::new();
        for a in 0..30 {
            for e in 0..30 {
                all.push(first(1, a, e));
                all.push(first(2, a, e));
            }
        }
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 1800);
        let mut n = [0; 7];
        let mut sum = 0.0;
        for e in 0..7000 {
            let mut chance = Chance::new(9, 1, e);
            n[chance.below(7) as usize] += 1;
            sum += chance.range([2.0, 4.0]);
        }
        assert!(n.iter().all(|n| (850..1150).contains(n)), "{n:?}");
        assert!((sum / 7000.0 - 3.0).abs() < 0.03);
        assert_eq!(Chance::new(0, 0, 0).below(0), 0);
    }
}
