//! Limits on work, time and memory, checked inside long loops so that no input makes them run away.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};

use crate::Instant;

/// Work between two looks at the clock. About half a millisecond.
const LOOK: u64 = 1 << 12;

/// Work between two looks at the memory held, which take longer. About ten milliseconds.
const LOOK_AT_MEMORY: u64 = 1 << 16;

/// Memory of a program before any work: its code and the libraries it links. [Units: bytes]
pub const PROGRAM: u64 = 64 << 20;

/// Returns the memory that the process holds; `None` if the system does not report it. [Units: bytes]
pub type MemoryProbe = fn() -> Option<u64>;

/// The budget of one task, shared by all its threads.
///
/// Work is counted in units of about 100 ns, the cut of a polygon. It is a sum, so the number of threads does
/// not matter. Once the budget is spent, loops end early with a meaningless result; their callers must check
/// [`Allowance::end`].
#[derive(Debug)]
pub struct Allowance {
    spent: AtomicU64,
    most: AtomicU64,
    until: Option<Instant>,
    memory: Option<(u64, MemoryProbe)>,
    cancel: Option<Arc<AtomicBool>>,
    /// The end found at the last look, [`LATE`], [`FULL`] or [`CANCELLED`]; 0 for none.
    seen: AtomicU8,
}

/// The reason why an allowance is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AllowanceEnd {
    /// The allowed work is done.
    Work,
    /// The time is up.
    Time,
    /// The process holds more memory than allowed.
    Memory,
    /// The caller does not want the result anymore.
    Cancelled,
}

const LATE: u8 = 1;
const FULL: u8 = 2;
const CANCELLED: u8 = 3;

impl Default for Allowance {
    fn default() -> Self {
        Self::new(u64::MAX, None)
    }
}

impl Allowance {
    /// Allows `most` units of work, and none after `until`.
    #[must_use]
    pub fn new(most: u64, until: Option<Instant>) -> Self {
        Self {
            spent: AtomicU64::new(0),
            most: AtomicU64::new(most),
            until,
            memory: None,
            cancel: None,
            seen: AtomicU8::new(0),
        }
    }

    /// Adds a limit on memory: over when the probe returns more than `bytes` plus [`PROGRAM`].
    #[must_use]
    pub fn holding(mut self, bytes: u64, probe: MemoryProbe) -> Self {
        self.memory = Some((bytes.saturating_add(PROGRAM), probe));
        self
    }

    /// Adds a way to end it from outside: over soon after `cancel` becomes true.
    #[must_use]
    pub fn unless(mut self, cancel: Option<Arc<AtomicBool>>) -> Self {
        self.cancel = cancel;
        self
    }

    /// Returns `true` if it ends at some time, however much work is left.
    #[must_use]
    #[doc(hidden)]
    pub fn is_timed(&self) -> bool {
        self.until.is_some()
    }

    /// Returns `true` if it has a limit on memory.
    #[must_use]
    #[doc(hidden)]
    pub fn holds_memory(&self) -> bool {
        self.memory.is_some()
    }

    /// Adds work: the task turned out larger, by an amount that is bounded elsewhere.
    #[doc(hidden)]
    pub fn grant(&self, work: u64) {
        let most = self.most().saturating_add(work);
        self.most.store(most, Ordering::Relaxed);
    }

    fn most(&self) -> u64 {
        self.most.load(Ordering::Relaxed)
    }

    /// Spends work; returns `false` once it is over. A few nanoseconds, and now and then a look at clock and
    /// memory.
    #[inline]
    #[doc(hidden)]
    pub fn spend(&self, work: u64) -> bool {
        // Counts only work that is done.
        if self.spent() > self.most() || self.seen.load(Ordering::Relaxed) != 0 {
            return false;
        }
        let before = self.spent.fetch_add(work, Ordering::Relaxed);
        let after = before.saturating_add(work);
        if before / LOOK != after / LOOK {
            self.look(before / LOOK_AT_MEMORY != after / LOOK_AT_MEMORY);
        }
        after <= self.most() && self.seen.load(Ordering::Relaxed) == 0
    }

    /// Returns a filter for a loop's items: spends `work` on each, and rejects all once the allowance is over.
    #[doc(hidden)]
    pub fn each<T: ?Sized>(&self, work: u64) -> impl Fn(&T) -> bool + Copy + '_ {
        move |_| self.spend(work)
    }

    #[cold]
    fn look(&self, at_memory: bool) {
        let is_cancelled = |cancel: &Arc<AtomicBool>| cancel.load(Ordering::Relaxed);
        if self.cancel.as_ref().is_some_and(is_cancelled) {
            self.seen.store(CANCELLED, Ordering::Relaxed);
        } else if self.until.is_some_and(|until| Instant::now() >= until) {
            self.seen.store(LATE, Ordering::Relaxed);
        } else if let Some((most, probe)) = self.memory
            && at_memory
            && probe().is_some_and(|held| held > most)
        {
            self.seen.store(FULL, Ordering::Relaxed);
        }
    }

    /// Returns the reason why it is over, if it is; looks at clock and memory. An end other than by work stays.
    #[must_use]
    pub fn end(&self) -> Option<AllowanceEnd> {
        if self.seen.load(Ordering::Relaxed) == 0 {
            self.look(true);
        }
        match self.seen.load(Ordering::Relaxed) {
            LATE => Some(AllowanceEnd::Time),
            FULL => Some(AllowanceEnd::Memory),
            CANCELLED => Some(AllowanceEnd::Cancelled),
            _ => (self.spent() > self.most()).then_some(AllowanceEnd::Work),
        }
    }

    /// Returns `true` if it is over; looks at clock and memory.
    #[must_use]
    #[doc(hidden)]
    pub fn is_over(&self) -> bool {
        self.end().is_some()
    }

    /// Returns the work spent.
    #[must_use]
    #[doc(hidden)]
    pub fn spent(&self) -> u64 {
        self.spent.load(Ordering::Relaxed)
    }
}

/// An allowance, or none for loops without a limit.
#[derive(Clone, Copy, Debug, Default)]
pub struct Purse<'a>(Option<&'a Allowance>);

impl<'a> From<&'a Allowance> for Purse<'a> {
    fn from(allowance: &'a Allowance) -> Self {
        Self(Some(allowance))
    }
}

impl<'a> Purse<'a> {
    /// A purse without an allowance.
    #[must_use]
    pub fn endless() -> Self {
        Self(None)
    }

    /// Spends work; returns `false` once the allowance is over.
    #[inline]
    pub fn spend(self, work: u64) -> bool {
        self.0.is_none_or(|allowance| allowance.spend(work))
    }

    /// Returns a filter like [`Allowance::each`].
    pub fn each<T: ?Sized>(self, work: u64) -> impl Fn(&T) -> bool + Copy + 'a {
        move |_| self.spend(work)
    }
}

/// A purse for one thread's short steps. It pays for many at once, since threads wait for each other when they pay.
#[derive(Debug)]
pub struct Tab<'a> {
    purse: Purse<'a>,
    owed: u64,
    is_over: bool,
}

impl<'a> From<Purse<'a>> for Tab<'a> {
    fn from(purse: Purse<'a>) -> Self {
        Self {
            purse,
            owed: 0,
            is_over: false,
        }
    }
}

impl Tab<'_> {
    /// Spends work; returns `false` once the allowance is over, soon after that.
    #[inline]
    pub fn spend(&mut self, work: u64) -> bool {
        self.owed += work;
        if self.owed >= LOOK / 4 {
            self.pay();
        }
        !self.is_over
    }

    #[cold]
    fn pay(&mut self) {
        let owed = std::mem::take(&mut self.owed);
        self.is_over = self.is_over || !self.purse.spend(owed);
    }
}

impl Drop for Tab<'_> {
    fn drop(&mut self) {
        self.pay();
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
        assert!(!some.spend(1));
        assert_eq!(some.end(), Some(AllowanceEnd::Work));
        some.grant(2);
        assert!(!some.is_over() && some.spend(1) && !some.spend(1));
        let late = Allowance::new(u64::MAX, Some(Instant::now()));
        assert!(!late.spend(LOOK));
        assert_eq!(late.end(), Some(AllowanceEnd::Time));
        let early = Allowance::new(u64::MAX, Some(Instant::now() + Duration::from_secs(1000)));
        assert!(early.spend(10 * LOOK) && !early.is_over());
        assert!(Allowance::default().spend(u64::MAX / 2));
    }

    #[test]
    fn it_is_over_when_more_memory_is_held() {
        let of = |most| Allowance::default().holding(most, || Some(PROGRAM + 1000));
        assert!(of(1000).spend(LOOK_AT_MEMORY) && !of(1000).is_over());
        let full = of(999);
        assert!(full.spend(LOOK), "not yet looked");
        assert!(!full.spend(LOOK_AT_MEMORY));
        assert_eq!(full.end(), Some(AllowanceEnd::Memory));
        let unknown = Allowance::default().holding(0, || None);
        assert!(unknown.spend(LOOK_AT_MEMORY) && !unknown.is_over());
    }

    #[test]
    fn it_is_over_when_its_caller_cancels() {
        let cancel = Arc::new(AtomicBool::new(false));
        let some = Allowance::default().unless(Some(Arc::clone(&cancel)));
        assert!(some.spend(10 * LOOK) && !some.is_over());
        cancel.store(true, Ordering::Relaxed);
        assert!(some.spend(1), "not yet looked");
        assert!(!some.spend(LOOK));
        cancel.store(false, Ordering::Relaxed);
        assert_eq!(some.end(), Some(AllowanceEnd::Cancelled), "it stays");
    }

    #[test]
    fn a_tab_pays_for_all_and_ends_with_its_allowance() {
        let some = Allowance::new(LOOK, None);
        let mut tab = Tab::from(Purse::from(&some));
        let n = (0..10 * LOOK).take_while(|_| tab.spend(1)).count() as u64;
        assert!((LOOK..2 * LOOK).contains(&n), "{n}");
        assert!(!tab.spend(1));
        let some = Allowance::default();
        let mut tab = Tab::from(Purse::from(&some));
        assert!(tab.spend(3));
        drop(tab);
        assert_eq!(some.spent(), 3);
    }

    #[test]
    fn a_loop_ends_with_its_allowance() {
        let some = Allowance::new(10, None);
        let n = (0..100).filter(some.each(3)).count();
        assert_eq!(n, 3);
    }
}
