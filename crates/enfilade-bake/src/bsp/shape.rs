//! Measures each leaf: its volume and a point well inside.

use enfilade_geom::{DVec3, Purse};

use crate::complex::region::{Region, RegionShape, halves, shape_of, whole};

use super::tolerance::Tolerance;
use super::tree::{Tree, leaf_index};

/// Returns measures of all leaves; `None` for those that rounding left without a volume.
pub(super) fn shapes(
    tree: &Tree,
    tolerance: &Tolerance,
    purse: Purse<'_>,
) -> Vec<Option<RegionShape>> {
    let mut out = vec![None; tree.contents.len()];
    visit(
        tree,
        tree.root,
        whole(&tree.bounds, tolerance.cut),
        (tolerance.cut, purse),
        &mut |leaf, region| {
            out[leaf as usize] = shape_of(&region);
        },
    );
    out
}

/// Returns the least width of each cell along any of `directions`, given the cell of each leaf. [Units: wu]
///
/// Infinite for a cell that has no leaf with a volume. Time: `O(directions · vertices of leaves)`.
pub(super) fn widths(
    tree: &Tree,
    tolerance: &Tolerance,
    of_leaf: &[u32],
    n_cells: usize,
    directions: &[DVec3],
    purse: Purse<'_>,
) -> Vec<f64> {
    let n = directions.len();
    let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; n_cells * n];
    let region = whole(&tree.bounds, tolerance.cut);
    visit(
        tree,
        tree.root,
        region,
        (tolerance.cut, purse),
        &mut |leaf, region| {
            let cell = of_leaf[leaf as usize] as usize;
            if cell >= n_cells || shape_of(&region).is_none() {
                return;
            }
            let ranges = &mut ranges[cell * n..(cell + 1) * n];
            for p in region.iter().flat_map(|(_, points)| points) {
                for (range, direction) in ranges.iter_mut().zip(directions) {
                    let at = direction.dot(*p);
                    *range = [range[0].min(at), range[1].max(at)];
                }
            }
        },
    );
    let width = |[low, high]: &[f64; 2]| {
        if low <= high {
            high - low
        } else {
            f64::INFINITY
        }
    };
    (0..n_cells)
        .map(|c| {
            ranges[c * n..(c + 1) * n]
                .iter()
                .map(width)
                .fold(f64::INFINITY, f64::min)
        })
        .collect()
}

fn visit(
    tree: &Tree,
    child: i32,
    region: Region,
    (eps, purse): (f64, Purse<'_>),
    take: &mut dyn FnMut(u32, Region),
) {
    // A region is cut face by face.
    if !purse.spend(5 * region.len() as u64) {
        return;
    }
    if child < 0 {
        return take(leaf_index(child), region);
    }
    let node = &tree.nodes[child as usize];
    let plane = tree.planes[node.plane as usize];
    for (region, child) in halves(region, &plane, &tree.bounds, eps)
        .into_iter()
        .zip(node.children)
    {
        visit(tree, child, region, (eps, purse), take);
    }
}
