//! Room in a buffer, given out in ranges and taken back.

use std::collections::BTreeMap;
use std::ops::Range;

/// Room for a number of elements. Neighboring free ranges are one.
///
/// Elements may be scattered over several ranges, so room is never short for being in pieces: vertices go anywhere,
/// since indices name each, and triangles are drawn wherever they are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FreeRoom {
    /// Length of each free range, by its start.
    free: BTreeMap<u32, u32>,
    n_free: u32,
}

impl FreeRoom {
    /// Makes room for `n` elements.
    pub(super) fn new(n: u32) -> Self {
        let free = (n > 0).then_some((0, n)).into_iter().collect();
        Self { free, n_free: n }
    }

    /// Returns the number of free elements.
    pub(super) fn n_free(&self) -> u32 {
        self.n_free
    }

    /// Takes room for `n` elements: the tightest free range that holds them all, else several, the largest first. The
    /// elements fill these in order, `unit` by `unit`; `n` must be a multiple of it. `None` if
    /// there is no room: nothing is taken then. O(free ranges), and O(n log n) in them if several are needed.
    pub(super) fn take(&mut self, n: u32, unit: u32) -> Option<Vec<Range<u32>>> {
        if n == 0 {
            return Some(Vec::new());
        }
        if n > self.n_free {
            return None;
        }
        let holding = self.free.iter().filter(|r| *r.1 >= n);
        if let Some((&start, _)) = holding.min_by_key(|r| (*r.1, *r.0)) {
            self.cut(start, n);
            let one = start..start + n;
            return Some(Vec::from([one]));
        }
        let mut by_size: Vec<(u32, u32)> = self.free.iter().map(|r| (*r.1, *r.0)).collect();
        by_size.sort_unstable_by(|a, b| b.cmp(a));
        let (mut done, mut taken) = (0, Vec::new());
        for (length, start) in by_size {
            let own = length.min(n - done) / unit * unit;
            if own > 0 {
                taken.push(start..start + own);
                done += own;
            }
            if done == n {
                for range in &taken {
                    self.cut(range.start, range.end - range.start);
                }
                return Some(taken);
            }
        }
        None
    }

    /// Takes the first elements of a free range.
    fn cut(&mut self, start: u32, n: u32) {
        if let Some(length) = self.free.remove(&start) {
            if length > n {
                self.free.insert(start + n, length - n);
            }
            self.n_free -= n;
        }
    }

    /// Takes back a range that was taken.
    pub(super) fn give(&mut self, range: Range<u32>) {
        let Range { mut start, mut end } = range;
        self.n_free += end - start;
        if let Some(after) = self.free.remove(&end) {
            end += after;
        }
        if let Some((&before, &length)) = self.free.range(..start).next_back()
            && before + length == start
        {
            start = before;
        }
        self.free.insert(start, end - start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::Rng;

    /// Owner of each element, by brute force.
    struct Owners(Vec<Option<usize>>);

    impl Owners {
        fn mark(&mut self, range: &Range<u32>, from: Option<usize>, to: Option<usize>) {
            for owner in &mut self.0[range.start as usize..range.end as usize] {
                assert_eq!(*owner, from);
                *owner = to;
            }
        }

        fn free_ranges(&self) -> Vec<(u32, u32)> {
            let mut out: Vec<(u32, u32)> = Vec::new();
            for (i, owner) in (0..).zip(&self.0) {
                match out.last_mut() {
                    _ if owner.is_some() => {}
                    Some(last) if last.0 + last.1 == i => last.1 += 1,
                    _ => out.push((i, 1)),
                }
            }
            out
        }
    }

    #[test]
    fn no_element_is_given_twice_and_none_is_lost() {
        let mut n_scattered = 0;
        for seed in 0..20 {
            let mut rng = Rng::new(seed);
            let size = 200 + rng.below(200);
            let mut room = FreeRoom::new(size as u32);
            let mut owners = Owners(vec![None; size]);
            let mut held: Vec<Option<Vec<Range<u32>>>> = Vec::new();
            // Parts of three stay together.
            let unit = [1, 3][rng.below(2)];
            for _ in 0..600 {
                let give = rng.below(held.len() + 1);
                if rng.below(2) == 0 && held.get(give).is_some_and(Option::is_some) {
                    for range in held[give].take().into_iter().flatten() {
                        owners.mark(&range, Some(give), None);
                        room.give(range);
                    }
                } else {
                    let n = unit * rng.below(30) as u32;
                    let before = room.clone();
                    let taken = room.take(n, unit);
                    let n_units: u32 = owners.free_ranges().iter().map(|r| r.1 / unit).sum();
                    assert_eq!(taken.is_some(), n_units >= n / unit);
                    let Some(taken) = taken else {
                        assert_eq!(room, before);
                        continue;
                    };
                    assert_eq!(taken.iter().map(|r| r.end - r.start).sum::<u32>(), n);
                    assert!(taken.iter().all(|r| (r.end - r.start).is_multiple_of(unit)));
                    n_scattered += usize::from(taken.len() > 1);
                    for range in &taken {
                        owners.mark(range, None, Some(held.len()));
                    }
                    held.push(Some(taken));
                }
                let free: Vec<(u32, u32)> = room.free.iter().map(|r| (*r.0, *r.1)).collect();
                assert_eq!(free, owners.free_ranges());
                assert_eq!(room.n_free(), free.iter().map(|r| r.1).sum::<u32>());
            }
        }
        assert!(n_scattered > 100, "{n_scattered}");
    }

    #[test]
    fn what_fits_in_one_range_is_not_scattered() {
        let mut room = FreeRoom::new(100);
        let parts: Vec<_> = (0..5)
            .map(|_| room.take(20, 1).unwrap().remove(0))
            .collect();
        room.give(parts[0].clone());
        room.give(parts[2].clone());
        room.give(parts[3].clone());
        // The tightest range, not the first or the largest.
        let mut take = |n| room.take(n, 1).unwrap_or_default();
        assert!(take(30).iter().eq([&(40..70)]));
        assert!(take(15).iter().eq([&(0..15)]));
        assert!(take(16).is_empty());
        assert_eq!(take(15), [70..80, 15..20]);
        assert_eq!((room.n_free(), room.take(0, 1)), (0, Some(Vec::new())));
    }
}
