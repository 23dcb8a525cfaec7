//! Point to cell: a tree of planes whose leaves are cells.

use enfilade_geom::{Aabb, DVec3};

use crate::CellId;

/// Answers which cell a point lies in, whatever built the graph.
///
/// A binary tree of planes over the box `bounds`; every leaf is one cell or solid matter. Points
/// outside the box belong to `outside`. Cost: one plane test a level, about 20 levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Locator {
    /// What the tree covers. [Units: wu]
    pub bounds: Aabb,
    /// The cell of everything beyond `bounds`; `None` for worlds without an outdoors.
    pub outside: Option<CellId>,
    /// Distinct planes as `[nx, ny, nz, d]`.
    pub planes: Vec<[f64; 4]>,
    /// Inner nodes; children always come after their parent, so that no walk can loop.
    pub nodes: Vec<LocatorNode>,
    /// The tree: a node (`>= 0`) or a leaf (see [`Locator::leaf`]).
    pub root: i32,
}

/// An inner node of the [`Locator`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocatorNode {
    /// Index into [`Locator::planes`].
    pub plane: u32,
    /// Child on the positive side (points on the plane included) and on the negative side: a node
    /// index, or a leaf as [`Locator::leaf`] encodes it.
    pub children: [i32; 2],
}

impl Default for Locator {
    fn default() -> Self {
        Self {
            bounds: Aabb::EMPTY,
            outside: None,
            planes: Vec::new(),
            nodes: Vec::new(),
            root: Self::leaf(None),
        }
    }
}

impl Locator {
    /// The child value that stands for a leaf: `-1` for solid, `-2 - cell` for a cell.
    #[must_use]
    pub const fn leaf(cell: Option<CellId>) -> i32 {
        match cell {
            None => -1,
            Some(CellId(id)) => -2 - id as i32,
        }
    }

    /// The cell that `p` lies in; `None` inside solid matter and for points that are not finite.
    #[must_use]
    pub fn locate(&self, p: DVec3) -> Option<CellId> {
        if !p.is_finite() {
            return None;
        }
        if !self.bounds.contains(p) {
            return self.outside;
        }
        let mut at = self.root;
        while at >= 0 {
            let node = &self.nodes[at as usize];
            let [x, y, z, d] = self.planes[node.plane as usize];
            let side = x * p.x + y * p.y + z * p.z + d;
            at = node.children[usize::from(side < 0.0)];
        }
        (at <= -2).then(|| CellId((-2 - at) as u32))
    }
}
