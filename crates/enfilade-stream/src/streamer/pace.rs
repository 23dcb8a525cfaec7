//! The pace of the link, as measured.

use std::time::Duration;

/// Busy time after which older measurements count half. [Units: s]
const MEMORY: f64 = 4.0;
/// Factor of the measured time that a request is expected to take.
const CAUTION: f64 = 2.0;

/// The bandwidth and delay of a link as far as they have shown.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pace {
    bytes: f64,
    /// Time in which something was on its way. [Units: s]
    seconds: f64,
    /// Mean time from a request to its reply. [Units: s]
    wait: f64,
}

impl Pace {
    /// Counts time in which something was on its way.
    pub(crate) fn spend(&mut self, time: Duration) {
        self.seconds += time.as_secs_f64();
        if self.seconds > MEMORY {
            self.bytes /= 2.0;
            self.seconds /= 2.0;
        }
    }

    /// Counts a reply.
    pub(crate) fn receive(&mut self, n_bytes: u64, wait: Duration) {
        let wait = wait.as_secs_f64();
        let is_first = self.bytes == 0.0;
        self.wait += (wait - self.wait) * if is_first { 1.0 } else { 0.125 };
        self.bytes += n_bytes as f64;
    }

    /// Returns `true` before the first reply.
    pub(crate) fn is_unknown(&self) -> bool {
        self.bytes == 0.0
    }

    /// Returns the time that bytes are expected to take at worst, with caution; infinite before the first reply. [Units: s]
    pub(crate) fn time_of(&self, n_bytes: u64) -> f64 {
        if self.bytes == 0.0 {
            return f64::INFINITY;
        }
        CAUTION * (self.wait + n_bytes as f64 * self.seconds / self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_is_expected_to_be_half_as_fast_as_it_was() {
        let mut pace = Pace::default();
        assert_eq!(pace.time_of(0), f64::INFINITY);
        for _ in 0..100 {
            pace.spend(Duration::from_millis(100));
            pace.receive(1000, Duration::from_millis(50));
        }
        assert!((pace.time_of(0) - 0.1).abs() < 1e-9);
        // Half of the time is forgotten with up to one reply more than half of the bytes.
        let is_about = |pace: &Pace, expected: f64| {
            let time = pace.time_of(10_000);
            assert!((time / expected - 1.0).abs() < 0.3, "{time}");
        };
        is_about(&pace, 2.1);
        // It slows down to a tenth; what was before is forgotten.
        for _ in 0..40 {
            pace.spend(Duration::from_millis(1000));
            pace.receive(1000, Duration::from_millis(50));
        }
        is_about(&pace, 20.1);
    }
}
