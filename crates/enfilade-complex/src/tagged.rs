//! The tree with the cell of each subtree that lies in one.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use enfilade_cpg::{CellId, Locator, LocatorNode};

use super::leaf_cells::SOLID;
use super::tree::{Tree, leaf_index};

/// The tag of a subtree whose leaves are not all in one cell.
pub(super) const MIXED: u32 = u32::MAX - 1;

/// The tree, with a tag for each subtree.
pub(super) struct TaggedTree<'a> {
    pub(super) tree: &'a Tree,
    pub(super) cell_of_leaf: &'a [u32],
    tags: Vec<u32>,
    /// The first and the last leaf below each node.
    leaves: Vec<[u32; 2]>,
}

impl<'a> TaggedTree<'a> {
    pub(super) fn new(tree: &'a Tree, cell_of_leaf: &'a [u32]) -> Self {
        let mut tagged = Self {
            tree,
            cell_of_leaf,
            tags: vec![MIXED; tree.nodes.len()],
            leaves: vec![[0; 2]; tree.nodes.len()],
        };
        // Children come after their parents.
        for i in (0..tree.nodes.len()).rev() {
            let [f, b] = tree.nodes[i].children.map(|c| tagged.tag(c));
            tagged.tags[i] = if f == b { f } else { MIXED };
            let [[first, _], [_, last]] = tree.nodes[i].children.map(|c| tagged.ends(c));
            tagged.leaves[i] = [first, last];
        }
        tagged
    }

    fn ends(&self, child: i32) -> [u32; 2] {
        if child >= 0 {
            self.leaves[child as usize]
        } else {
            [leaf_index(child); 2]
        }
    }

    /// Returns the leaves below a child.
    pub(super) fn leaves(&self, child: i32) -> RangeInclusive<u32> {
        let [first, last] = self.ends(child);
        first..=last
    }

    /// Returns the node in whose plane two leaves meet.
    pub(super) fn node_between(&self, leaves: [u32; 2]) -> i32 {
        let mut at = self.tree.root;
        while at >= 0 {
            let children = self.tree.nodes[at as usize].children;
            let is_in = |&c: &i32| leaves.iter().all(|l| self.leaves(c).contains(l));
            match children.into_iter().find(is_in) {
                Some(child) => at = child,
                None => break,
            }
        }
        at
    }

    /// Returns the common cell of all leaves below, [`SOLID`], or [`MIXED`].
    pub(super) fn tag(&self, child: i32) -> u32 {
        if child >= 0 {
            self.tags[child as usize]
        } else {
            self.cell_of_leaf[leaf_index(child) as usize]
        }
    }

    /// Returns the point location tree of the cells: only as much of the tree as they need.
    pub(super) fn locator(&self, outside: Option<u32>) -> Locator {
        let mut locator = Locator {
            bounds: self.tree.bounds,
            outside: outside.map(CellId),
            ..Locator::default()
        };
        let mut plane_ids = BTreeMap::new();
        locator.root = self.add_to_locator(self.tree.root, &mut locator, &mut plane_ids);
        locator
    }

    fn add_to_locator(
        &self,
        child: i32,
        locator: &mut Locator,
        plane_ids: &mut BTreeMap<u32, u32>,
    ) -> i32 {
        match self.tag(child) {
            MIXED => {}
            SOLID => return Locator::leaf(None),
            cell => return Locator::leaf(Some(CellId(cell))),
        }
        let node = self.tree.nodes[child as usize];
        let plane = *plane_ids.entry(node.plane).or_insert_with(|| {
            let p = self.tree.planes[node.plane as usize];
            locator
                .planes
                .push([p.normal.x, p.normal.y, p.normal.z, p.d]);
            locator.planes.len() as u32 - 1
        });
        let at = locator.nodes.len();
        locator.nodes.push(LocatorNode {
            plane,
            children: [0; 2],
        });
        let children = node
            .children
            .map(|c| self.add_to_locator(c, locator, plane_ids));
        locator.nodes[at].children = children;
        at as i32
    }
}
