//! Measures each leaf: its volume and a point well inside.

use enfilade_geom::Purse;

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
        tolerance.cut,
        purse,
        &mut |leaf, region| {
            out[leaf as usize] = shape_of(&region);
        },
    );
    out
}

fn visit(
    tree: &Tree,
    child: i32,
    region: Region,
    eps: f64,
    purse: Purse<'_>,
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
        visit(tree, child, region, eps, purse, take);
    }
}
