//! Does a walk down the locator always end, in a cell that exists?

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
}
