//! Pairs of bodies that may touch: they share a cell and their boxes overlap.
//!
//! Bodies are listed by cell, as Gjørup's segments list their objects (1999, section 3.3.4); in each cell they are swept along x
//! (Baraff, *Dynamic Simulation of Non-Penetrating Rigid Bodies*, 1992, section 2.2.2). A pair that shares several cells is
//! reported in the least of these. O(n log n + pairs that overlap along x), each of n bodies counted once per cell. Boxes are
//! closed and compared exactly as given.

use std::ops::ControlFlow;

use enfilade_cpg::CellId;
use enfilade_geom::Aabb;

/// Finds pairs of bodies that may touch. Holds the buffers; allocates nothing once they have grown.
#[derive(Clone, Debug, Default)]
pub struct Pairs {
    entries: Vec<Entry>,
}

/// A body in one of its cells.
#[derive(Clone, Copy, Debug)]
struct Entry {
    cell: CellId,
    low: f64,
    body: u32,
}

impl Pairs {
    /// Makes it without buffers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Calls `visit` once for each pair of bodies that share a cell and whose boxes touch, the lesser index first, until it
    /// breaks.
    ///
    /// `bodies`: the bounding box of each, and the cells that it touches, ascending. An empty box, or one with NaN, touches none.
    pub fn for_each<'a>(
        &mut self,
        bodies: &[(Aabb, &'a [CellId])],
        mut visit: impl FnMut(u32, u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        self.entries.clear();
        for (body, (bounds, cells)) in (0..).zip(bodies) {
            let low = bounds.min.x;
            if bounds.min.cmple(bounds.max).all() {
                let entry = |&cell: &'a CellId| Entry { cell, low, body };
                self.entries.extend(cells.iter().map(entry));
            }
        }
        self.entries.sort_unstable_by(|a, b| {
            let by_x = a.low.total_cmp(&b.low);
            a.cell.cmp(&b.cell).then(by_x).then(a.body.cmp(&b.body))
        });
        for (i, first) in self.entries.iter().enumerate() {
            let (bounds, cells) = &bodies[first.body as usize];
            let others = self.entries[i + 1..].iter();
            for other in others.take_while(|o| o.cell == first.cell && o.low <= bounds.max.x) {
                let (its_bounds, its_cells) = &bodies[other.body as usize];
                let is_first = || least_shared(cells, its_cells) == Some(first.cell);
                if bounds.overlaps(its_bounds) && is_first() {
                    visit(first.body.min(other.body), first.body.max(other.body))?;
                }
            }
        }
        ControlFlow::Continue(())
    }
}

/// Returns the least common cell of two ascending lists.
fn least_shared(a: &[CellId], b: &[CellId]) -> Option<CellId> {
    let (mut i, mut k) = (0, 0);
    while let (Some(x), Some(y)) = (a.get(i), b.get(k)) {
        if x == y {
            return Some(*x);
        }
        if x < y {
            i += 1;
        } else {
            k += 1;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::DVec3;
    use enfilade_testkit::Rng;
    use std::collections::BTreeSet;

    /// Covers W12: pairs that share a cell and overlap are found once each, as by brute force.
    #[test]
    fn pairs_are_those_that_share_a_cell_and_overlap() {
        let mut rng = Rng::new(5);
        let mut finder = Pairs::new();
        for _ in 0..50 {
            let bodies: Vec<(Aabb, Vec<CellId>)> = (0..60)
                .map(|_| {
                    let p = DVec3::new(rng.range(0.0, 4.0), rng.range(0.0, 4.0), rng.unit());
                    let size = DVec3::splat(rng.range(0.0, 0.8));
                    let mut cells: Vec<CellId> = (0..1 + rng.below(3))
                        .map(|_| CellId(rng.below(6) as u32))
                        .collect();
                    cells.sort_unstable();
                    cells.dedup();
                    (Aabb::new(p, p + size), cells)
                })
                .collect();
            let lists: Vec<(Aabb, &[CellId])> = bodies.iter().map(|(b, c)| (*b, &c[..])).collect();
            let mut found = Vec::new();
            let _ = finder.for_each(&lists, |a, b| {
                found.push((a, b));
                ControlFlow::Continue(())
            });
            let mut expected = BTreeSet::new();
            for (i, a) in bodies.iter().enumerate() {
                for (k, b) in bodies.iter().enumerate().skip(i + 1) {
                    if a.0.overlaps(&b.0) && a.1.iter().any(|c| b.1.contains(c)) {
                        expected.insert((i as u32, k as u32));
                    }
                }
            }
            assert!(!expected.is_empty());
            assert_eq!(found.len(), expected.len(), "each once");
            assert_eq!(found.into_iter().collect::<BTreeSet<_>>(), expected);
        }
    }
}
