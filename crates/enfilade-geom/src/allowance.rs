//! How much work may be done: asked inside long loops, so that no input makes them run away.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// How much work looks at the clock once. About ten milliseconds.
const LOOK: u64 = 1 << 16;

/// What is left to be spent on one task, by all its threads.
///
/// Work is counted in units of about 100 ns, the cut of a polygon. Whether it suffices does not depend on threads: what is
/// spent is a sum. Once it is over, loops end early with a result that makes no sense, and who gave it must ask
/// [`Allowance::is_over`].
#[derive(Debug)]
pub struct Allowance {
    spent: AtomicU64,
    most: AtomicU64,
    end: Option<Instant>,
    is_late: AtomicBool,
}

impl Default for Allowance {
    fn default() -> Self {
        Self::new(u64::MAX, None)
    }
}

impl Allowance {
    /// An allowance of so much work, until then.
    #[must_use]
    pub fn new(most: u64, end: Option<Instant>) -> Self {
        Self {
            spent: AtomicU64::new(0),
            most: AtomicU64::new(most),
            end,
            is_late: AtomicBool::new(false),
        }
    }

    /// Adds some: the task has turned out larger, by what is bounded elsewhere.
    pub fn grant(&self, work: u64) {
        let most = self.most().saturating_add(work);
        self.most.store(most, Ordering::Relaxed);
    }

    fn most(&self) -> u64 {
        self.most.load(Ordering::Relaxed)
    }

    /// Spends some; says whether to go on. A few nanoseconds, and a look at the clock now and then.
    #[inline]
    pub fn spend(&self, work: u64) -> bool {
        let before = self.spent.fetch_add(work, Ordering::Relaxed);
        let after = before.saturating_add(work);
        if before / LOOK != after / LOOK {
            self.look();
        }
        after <= self.most() && !self.is_late()
    }

    #[cold]
    fn look(&self) {
        if self.end.is_some_and(|end| Instant::now() >= end) {
            self.is_late.store(true, Ordering::Relaxed);
        }
    }

    /// Whether the time is up.
    #[must_use]
    pub fn is_late(&self) -> bool {
        self.is_late.load(Ordering::Relaxed)
    }

    /// Whether all is spent or the time is up, at the last look; looks at the clock.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.look();
        self.is_late() || self.spent() > self.most()
    }

    /// What was spent.
    #[must_use]
    pub fn spent(&self) -> u64 {
        self.spent.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn it_is_over_when_all_is_spent_and_when_time_is_up() {
        let some = Allowance::new(10, None);
        assert!(some.spend(10) && !some.is_over());
        assert!(!some.spend(1) && some.is_over() && !some.is_late());
        some.grant(2);
        assert!(!some.is_over() && some.spend(1) && !some.spend(1));
        let late = Allowance::new(u64::MAX, Some(Instant::now()));
        assert!(!late.spend(LOOK) && late.is_late());
        let early = Allowance::new(u64::MAX, Some(Instant::now() + Duration::from_secs(1000)));
        assert!(early.spend(10 * LOOK) && !early.is_over());
        assert!(Allowance::default().spend(u64::MAX / 2));
    }
}
