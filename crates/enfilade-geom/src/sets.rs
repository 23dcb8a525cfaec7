//! Disjoint sets.

/// Disjoint sets of the numbers `0..n`, joined two at a time (union-find).
///
/// The least member of a set represents it, so that results do not depend on the order of joins.
///
/// Uses path halving without ranks: `O(log n)` per call, amortized; Tarjan & van Leeuwen, "Worst-case analysis of set union
/// algorithms" (1984).
#[derive(Clone, Debug)]
pub struct Sets(Vec<u32>);

impl Sets {
    /// Makes `n` sets of one member each.
    ///
    /// # Panics
    ///
    /// If `n` exceeds `u32`.
    #[must_use]
    pub fn new(n: usize) -> Self {
        let n = u32::try_from(n).expect("more than 2^32 members");
        Self((0..n).collect())
    }

    /// Returns the number of members of all sets.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns `true` if there are no members.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds a set of one new member; returns its number, which follows all others.
    ///
    /// # Panics
    ///
    /// If the number of members exceeds `u32`.
    pub fn add(&mut self) -> u32 {
        let x = u32::try_from(self.0.len()).expect("more than 2^32 members");
        self.0.push(x);
        x
    }

    /// Returns the least member of each member's set, in one pass.
    #[must_use]
    pub fn into_least(mut self) -> Vec<u32> {
        // No member points to a greater one, so all before are done.
        for x in 0..self.0.len() {
            self.0[x] = self.0[self.0[x] as usize];
        }
        self.0
    }

    /// Returns the least member of the set of `x`.
    ///
    /// # Panics
    ///
    /// If `x` is not a member.
    #[inline]
    pub fn find(&mut self, mut x: u32) -> u32 {
        while self.0[x as usize] != x {
            self.0[x as usize] = self.0[self.0[x as usize] as usize];
            x = self.0[x as usize];
        }
        x
    }

    /// Joins the sets of `a` and `b`; returns the least member of the union.
    ///
    /// # Panics
    ///
    /// If one of the two is not a member.
    #[inline]
    pub fn join(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (self.find(a), self.find(b));
        let (low, high) = (a.min(b), a.max(b));
        self.0[high as usize] = low;
        low
    }
}

#[cfg(test)]
mod tests {
    use super::Sets;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sets_equal_those_of_relabeling(
            n in 1_usize..40, joins in prop::collection::vec((0_u32..40, 0_u32..40), 0..60),
        ) {
            // The last member is added later than the rest.
            let mut sets = Sets::new(n - 1);
            prop_assert_eq!(sets.add() as usize, n - 1);
            let mut label: Vec<u32> = (0..n as u32).collect();
            for (a, b) in joins.into_iter().map(|(a, b)| (a % n as u32, b % n as u32)) {
                let (p, q) = (label[a as usize], label[b as usize]);
                label.iter_mut().filter(|l| **l == p.max(q)).for_each(|l| *l = p.min(q));
                prop_assert_eq!(sets.join(a, b), p.min(q));
            }
            for x in 0..n as u32 {
                prop_assert_eq!(sets.find(x), label[x as usize]);
            }
            prop_assert_eq!(sets.into_least(), label);
        }
    }
}
