//! Checks that the locator is a tree of limited depth whose leaves hold existing cells.

use super::error::{Findings, GraphError};
use crate::{CellId, Locator};

pub(super) fn check_locator(locator: &Locator, n_cells: usize, found: &mut Findings) {
    let bounds = locator.bounds;
    let finite = bounds.min.is_finite() && bounds.max.is_finite() && !bounds.is_empty();
    if !finite && bounds != enfilade_geom::Aabb::EMPTY {
        let (min, max) = (bounds.min.into(), bounds.max.into());
        found.push(GraphError::LocatorBounds { min, max });
    }
    if let Some(CellId(cell)) = locator.outside
        && cell as usize >= n_cells
    {
        found.push(GraphError::LocatorOutside { cell, n_cells });
    }
    for (i, &value) in locator.planes.iter().enumerate() {
        if !value.iter().all(|v| v.is_finite()) || value[..3] == [0.0; 3] {
            found.push(GraphError::LocatorPlane {
                plane: i as u32,
                value,
            });
        }
    }
    let n_nodes = locator.nodes.len();
    let fits = |parent: i64, child: i32| {
        if child >= 0 {
            i64::from(child) > parent && (child as usize) < n_nodes
        } else {
            child == -1 || (-2 - i64::from(child)) < n_cells as i64
        }
    };
    if !fits(-1, locator.root) {
        found.push(GraphError::LocatorChild {
            node: None,
            child: locator.root,
        });
    }
    let n_planes = locator.planes.len();
    for (i, node) in locator.nodes.iter().enumerate() {
        let i32_id = i as u32;
        if node.plane as usize >= n_planes {
            found.push(GraphError::LocatorNode {
                node: i32_id,
                plane: node.plane,
                n_planes,
            });
        }
        for child in node.children {
            if !fits(i as i64, child) {
                found.push(GraphError::LocatorChild {
                    node: Some(i32_id),
                    child,
                });
            }
        }
    }
    check_tree(locator, found);
}

/// Checks that each node has at most one parent and is not too deep.
///
/// Readers that take the tree apart reach each node once; with shared nodes, a few kilobytes could have an
/// astronomical number of leaves.
fn check_tree(locator: &Locator, found: &mut Findings) {
    // Number of nodes on the path to each, including itself; 0 until a parent is found. A parent comes before its
    // children.
    let mut depth = vec![0_u32; locator.nodes.len()];
    let mut is_deep = false;
    let mut lead_to = |depth: &mut [u32], child: i32, above: u32| {
        let Some(own) = usize::try_from(child).ok().and_then(|c| depth.get_mut(c)) else {
            return;
        };
        let node = child as u32;
        if *own > 0 {
            found.push(GraphError::LocatorShared { node });
        }
        *own = above + 1;
        if *own > Locator::MAX_DEPTH && !is_deep {
            is_deep = true;
            found.push(GraphError::LocatorDepth { node });
        }
    };
    lead_to(&mut depth, locator.root, 0);
    for (i, node) in locator.nodes.iter().enumerate() {
        let above = depth[i];
        for child in node.children {
            lead_to(&mut depth, child, above);
        }
    }
}
