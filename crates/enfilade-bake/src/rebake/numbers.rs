//! The numbers of cells after a change.
//!
//! Cells keep theirs. Those of the part that do not go on beyond the block become the old cell with which they have most in
//! common, if it was in the block; others take numbers that became free, or new ones.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{CellId, Locator};
use enfilade_geom::Aabb;

use super::joint::{Joint, Share};
use super::tree::cell_of;

/// The numbers of cells, first as long as those that are gone leave gaps, and the last ones.
pub(super) struct Numbers {
    /// For each cell of the part, its number with gaps.
    of_part: Vec<Option<u32>>,
    /// For each old cell, `false` if it is gone.
    is_kept: Vec<bool>,
    /// The last number for each with gaps; its own in gaps.
    last: Vec<u32>,
    n: usize,
    /// Numbers with gaps that no old cell had or kept.
    fresh: Vec<u32>,
}

impl Numbers {
    pub(super) fn of(joint: &Joint<'_>, is_beyond: &[bool], after: &[Share]) -> Self {
        let n_old = is_beyond.len();
        let mut of_part: Vec<Option<u32>> = vec![None; after.len()];
        for (&n, o) in &joint.seam.old_of {
            of_part[n as usize] = Some(o.0);
        }
        let is_inner =
            |n: u32| after[n as usize].volume > 0.0 && !joint.seam.old_of.contains_key(&n);
        let mut is_kept = is_beyond.to_vec();
        for (n, o) in claims(joint, is_beyond, &is_inner) {
            if of_part[n as usize].is_none() && !is_kept[o as usize] {
                of_part[n as usize] = Some(o);
                is_kept[o as usize] = true;
            }
        }
        let gaps: Vec<u32> = (0..n_old as u32)
            .filter(|&o| !is_kept[o as usize])
            .collect();
        let (mut free, mut n, mut fresh) = (gaps.into_iter(), n_old as u32, Vec::new());
        for c in 0..after.len() as u32 {
            if of_part[c as usize].is_none() && is_inner(c) {
                let id = free.next().unwrap_or_else(|| {
                    n += 1;
                    n - 1
                });
                of_part[c as usize] = Some(id);
                fresh.push(id);
            }
        }
        // The last ones move into the gaps that are left.
        let mut last: Vec<u32> = (0..n).collect();
        let gaps: BTreeSet<u32> = free.collect();
        let kept_last = (0..n).rev().filter(|id| !gaps.contains(id));
        let n_left = n as usize - gaps.len();
        for (&gap, id) in gaps.iter().zip(kept_last) {
            if (id as usize) < n_left {
                break;
            }
            last[id as usize] = gap;
        }
        Self {
            of_part,
            is_kept,
            last,
            n: n_left,
            fresh,
        }
    }

    /// Returns the number of cells.
    pub(super) fn len(&self) -> usize {
        self.n
    }

    /// Returns the number of a cell of the part, with gaps; `None` if it has nothing in the block.
    pub(super) fn of_part(&self, n: u32) -> Option<u32> {
        self.of_part.get(n as usize).copied().flatten()
    }

    /// Returns the last number of an old cell; `None` if it is gone.
    pub(super) fn of_old(&self, c: CellId) -> Option<CellId> {
        self.is_kept[c.0 as usize].then(|| CellId(self.last(c.0)))
    }

    /// Returns the last number of one with gaps.
    pub(super) fn last(&self, id: u32) -> u32 {
        self.last[id as usize]
    }

    /// Returns the last numbers of cells that no old one became.
    pub(super) fn fresh(&self) -> impl Iterator<Item = CellId> + '_ {
        self.fresh.iter().map(|&id| CellId(self.last(id)))
    }

    fn last_leaf(&self, at: i32) -> i32 {
        match cell_of(at) {
            Some(cell) => Locator::leaf(Some(CellId(self.last(cell.0)))),
            None => at,
        }
    }

    /// Gives the cells of a locator their last numbers.
    pub(super) fn renumber_locator(&self, locator: &mut Locator) {
        locator.root = self.last_leaf(locator.root);
        locator.outside = locator.outside.map(|c| CellId(self.last(c.0)));
        for node in &mut locator.nodes {
            node.children = node.children.map(|c| self.last_leaf(c));
        }
    }
}

/// Returns pairs of cells of the part and old cells, both all in the block, those with the largest volume in common first.
fn claims(
    joint: &Joint<'_>,
    is_beyond: &[bool],
    is_inner: &dyn Fn(u32) -> bool,
) -> Vec<(u32, u32)> {
    let mut common: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    let region = joint.block.region.clone();
    let wants = |leaf: i32| cell_of(leaf).is_some_and(|c| is_inner(c.0));
    joint.trees[1].parts(region, &wants, &mut |leaf, shape, _: Aabb| {
        let old = joint.old.graph.locator.locate(shape.middle);
        if let Some((n, o)) = cell_of(leaf).zip(old)
            && !is_beyond[o.0 as usize]
        {
            *common.entry((n.0, o.0)).or_default() += shape.volume;
        }
    });
    let mut claims: Vec<_> = common.into_iter().collect();
    claims.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    claims.into_iter().map(|(pair, _)| pair).collect()
}
