//! Cells: sets of leaves that no separator divides (Lefebvre & Hornus 2003, §2.1 step 3).

use enfilade_geom::Sets;

use super::leaves::Bsp;
use super::separator::Separator;

/// Marks a leaf without a cell.
pub(super) const NO_CELL: u32 = u32::MAX;

/// The cells of leaves, and the separators kept.
pub(super) struct LeafCells {
    /// Cell of each leaf, or [`NO_CELL`].
    pub(super) of_leaf: Vec<u32>,
    pub(super) n_cells: usize,
    pub(super) separators: Vec<Separator>,
    /// Number of separators dropped because they crossed others.
    pub(super) n_crossing: usize,
    /// Number of separators dropped because the same cell was on both sides.
    pub(super) n_useless: usize,
}

/// Divides the leaves by the separators. Of separators that cross, drops those that touch fewest cells,
/// largest first among equals, until none cross. Drops separators with one cell on both sides, too.
pub(super) fn part(bsp: &Bsp<'_>, separators: Vec<Separator>) -> LeafCells {
    let mut kept = separators;
    let (mut n_crossing, mut n_useless) = (0, 0);
    loop {
        // Each round joins all portals and tests all kept separators anew.
        let may_go_on = bsp.purse.spend(bsp.portals.len() as u64);
        let (of_leaf, n_cells) = components(bsp, &kept);
        let sides: Vec<[Vec<u32>; 2]> = kept.iter().map(|s| sides_of(bsp, s, &of_leaf)).collect();
        // A separator that divides nothing can go at once: it changes no cell.
        let is_useless = |i: usize| sides[i][0] == sides[i][1] && sides[i][0].len() == 1;
        let n = kept.len();
        // All crossing separators that share no cell with a worse one go together.
        let mut crossing: Vec<usize> = (0..n)
            .filter(|&i| sides[i].iter().any(|s| s.len() > 1))
            .collect();
        crossing.sort_by(|&a, &b| {
            let cells = |i: usize| sides[i][0].len() + sides[i][1].len();
            cells(a)
                .cmp(&cells(b))
                .then(kept[b].area.total_cmp(&kept[a].area))
                .then(a.cmp(&b))
        });
        let mut touched = vec![false; n_cells];
        let mut goes = vec![false; n];
        for i in crossing {
            let cells = || sides[i].iter().flatten();
            if cells().all(|&c| !touched[c as usize]) {
                cells().for_each(|&c| touched[c as usize] = true);
                goes[i] = true;
                n_crossing += 1;
            }
        }
        let is_final = !goes.contains(&true) || !may_go_on;
        for (i, goes) in goes.iter_mut().enumerate() {
            if is_useless(i) {
                *goes = true;
                n_useless += 1;
            }
        }
        let mut goes = goes.into_iter();
        kept.retain(|_| !goes.next().unwrap_or(false));
        if is_final {
            return LeafCells {
                of_leaf,
                n_cells,
                separators: kept,
                n_crossing,
                n_useless,
            };
        }
    }
}

/// Returns the cells on the positive and on the negative side, ascending.
pub(super) fn sides_of(bsp: &Bsp<'_>, s: &Separator, of_leaf: &[u32]) -> [Vec<u32>; 2] {
    [0, 1].map(|side| {
        let mut cells: Vec<u32> = s
            .portals
            .iter()
            .map(|&p| of_leaf[bsp.portals[p as usize].leaves[side] as usize])
            .collect();
        cells.sort_unstable();
        cells.dedup();
        cells
    })
}

/// Returns the connected components of the open leaves without the separators' portals, numbered by least leaf.
pub(super) fn components(bsp: &Bsp<'_>, separators: &[Separator]) -> (Vec<u32>, usize) {
    let mut is_cut = vec![false; bsp.portals.len()];
    for &p in separators.iter().flat_map(|s| &s.portals) {
        is_cut[p as usize] = true;
    }
    let mut sets = Sets::new(bsp.is_open.len());
    for (p, _) in bsp.portals.iter().zip(&is_cut).filter(|(_, cut)| !**cut) {
        sets.join(p.leaves[0], p.leaves[1]);
    }
    let mut number = vec![NO_CELL; sets.len()];
    let mut n = 0;
    let of_leaf = (0..sets.len() as u32)
        .map(|l| {
            if !bsp.is_open[l as usize] {
                return NO_CELL;
            }
            let slot = &mut number[sets.find(l) as usize];
            if *slot == NO_CELL {
                *slot = n;
                n += 1;
            }
            *slot
        })
        .collect();
    (of_leaf, n as usize)
}
