//! A small reproducible random generator: PCG-XSH-RR 64/32 (O'Neill 2014, "PCG: A Family of Simple
//! Fast Space-Efficient Statistically Good Algorithms for Random Number Generation").
//!
//! Scenes must be equal on every machine and for every version of any dependency, so the generator is
//! implemented here.

use enfilade_geom::{Aabb, DQuat, DVec3};

/// A reproducible random generator.
#[derive(Clone, Debug)]
pub struct Rng {
    state: u64,
}

const MULTIPLIER: u64 = 6_364_136_223_846_793_005;
const INCREMENT: u64 = 1_442_695_040_888_963_407;

impl Rng {
    /// Makes the generator of `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut rng = Self {
            state: seed.wrapping_add(INCREMENT),
        };
        rng.next_u32();
        rng
    }

    /// Makes the generator of `seed` and a `stream`, so that parts of a scene are independent.
    #[must_use]
    pub fn stream(seed: u64, stream: u64) -> Self {
        Self::new(seed ^ stream.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(17))
    }

    /// Returns any `u32`.
    pub fn next_u32(&mut self) -> u32 {
        let old = self.state;
        self.state = old.wrapping_mul(MULTIPLIER).wrapping_add(INCREMENT);
        let xored = (((old >> 18) ^ old) >> 27) as u32;
        xored.rotate_right((old >> 59) as u32)
    }

    /// Returns a number in `0.0..1.0`.
    pub fn unit(&mut self) -> f64 {
        f64::from(self.next_u32()) / 4_294_967_296.0
    }

    /// Returns a number in `low..high`.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns an index in `0..n`. `n` must be above 0 and below 2³².
    pub fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.next_u32()) * n as u64) >> 32) as usize
    }

    /// Returns `true` with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    /// Returns any rotation.
    pub fn turn(&mut self) -> DQuat {
        let mut one = || self.range(-1.0, 1.0);
        DQuat::from_xyzw(one(), one(), one(), one()).normalize()
    }

    /// Returns a point in a box.
    pub fn point_in(&mut self, b: &Aabb) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|k| self.range(b.min[k], b.max[k])))
    }

    /// Shuffles `items` (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_fill_their_ranges_and_repeat() {
        let (mut a, mut b) = (Rng::new(7), Rng::new(7));
        let mut seen = [0; 10];
        for _ in 0..10_000 {
            let x = a.range(-1.0, 1.0);
            assert!((-1.0..1.0).contains(&x));
            assert_eq!(x, b.range(-1.0, 1.0));
            seen[((x + 1.0) * 5.0) as usize] += 1;
        }
        // 1,000 expected each, standard deviation 30: 8 deviations.
        assert!(seen.iter().all(|n| (760..1240).contains(n)), "{seen:?}");
        assert!((0..1000).all(|_| a.below(3) < 3));
        assert_ne!(Rng::new(7).next_u32(), Rng::new(8).next_u32());
        assert_ne!(Rng::stream(7, 0).next_u32(), Rng::stream(7, 1).next_u32());
    }

    #[test]
    fn a_shuffle_keeps_every_item() {
        let mut items: Vec<u32> = (0..100).collect();
        Rng::new(3).shuffle(&mut items);
        assert_ne!(items, (0..100).collect::<Vec<_>>());
        items.sort_unstable();
        assert_eq!(items, (0..100).collect::<Vec<_>>());
    }
}
