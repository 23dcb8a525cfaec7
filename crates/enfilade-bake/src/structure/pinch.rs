//! Where rooms end: at openings that are a *pinch*, narrower than the space on either side of them.
//!
//! One rule and one loop for all builders that merge cells into rooms. They differ in how they look up an opening and
//! the sections of space beside it: in voxels, or in a tree.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use rayon::prelude::*;

/// Two cells that touch.
pub(crate) type Pair = (u32, u32);

/// Cells that may be joined across the openings between them.
pub(crate) trait Mergeable: Sync {
    /// Returns `true` while the work budget lasts; after that, the joins so far are final.
    fn may_go_on(&self) -> bool;
    /// Returns all pairs of cells with an opening between them.
    fn pairs(&self) -> Vec<Pair>;
    /// Returns `true` if there still is an opening between the two.
    fn is_pair(&self, pair: Pair) -> bool;
    /// Returns the openness of the openings between the two; from 1 on, they are one room.
    fn openness(&self, pair: Pair) -> f64;
    /// Returns how often each of the two was joined with others.
    fn ages(&self, pair: Pair) -> [u32; 2];
    /// Is told of each join before it is made, so that close ones can be kept.
    fn keep_close(&mut self, pair: Pair, openness: f64);
    /// Joins the two; returns the pairs whose openings have changed.
    fn join(&mut self, pair: Pair) -> Vec<Pair>;
}

/// Number of pairs that are weighed again side by side.
const BATCH: usize = 64;

/// A pair waiting to be joined; the most open comes first, ties by number.
struct Waiting {
    openness: f64,
    pair: Pair,
    ages: [u32; 2],
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Waiting {}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        self.openness
            .total_cmp(&other.openness)
            .then_with(|| other.pair.cmp(&self.pair))
            .then_with(|| other.ages.cmp(&self.ages))
    }
}

/// Joins cells across openings that are not a pinch, the most open first, until only pinches are left.
///
/// Pairs whose opening a join changes are weighed again at once. The other pairs now compare with a larger cell, which
/// can only lower their openness: they are weighed again when their turn comes.
pub(crate) fn join_rooms<M: Mergeable>(cells: &mut M) {
    let mut queue: BinaryHeap<Waiting> = weighed(cells, &cells.pairs()).into();
    while let Some(top) = queue.pop() {
        if !cells.may_go_on() {
            return;
        }
        if !cells.is_pair(top.pair) {
            continue; // one of them was joined to a third; that pair has its own entry
        }
        if cells.ages(top.pair) != top.ages {
            let mut stale = vec![top.pair];
            while stale.len() < BATCH
                && let Some(next) = queue.peek()
                && cells.ages(next.pair) != next.ages
            {
                stale.extend(queue.pop().map(|w| w.pair).filter(|&p| cells.is_pair(p)));
            }
            queue.extend(weighed(cells, &stale));
            continue;
        }
        cells.keep_close(top.pair, top.openness);
        let changed = cells.join(top.pair);
        queue.extend(weighed(cells, &changed));
    }
}

/// Returns those of the given pairs whose two cells are one room.
fn weighed<M: Mergeable>(cells: &M, pairs: &[Pair]) -> Vec<Waiting> {
    let weigh = |&pair: &Pair| {
        if !cells.may_go_on() {
            return None;
        }
        let openness = cells.openness(pair);
        (openness >= 1.0).then(|| Waiting {
            openness,
            pair,
            ages: cells.ages(pair),
        })
    };
    pairs.par_iter().filter_map(weigh).collect()
}
