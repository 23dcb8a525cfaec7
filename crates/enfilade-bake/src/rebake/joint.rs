//! A baked part, and the world that it is put into.

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, World};
use enfilade_geom::Aabb;

use super::block::Block;
use super::ground::Ground;
use super::part::BakedPart;
use super::seam::Seam;
use super::tree::PlaneTree;

/// A part and the world that it is put into.
pub(super) struct Joint<'a> {
    pub(super) old: &'a World,
    pub(super) ground: &'a Ground<'a>,
    pub(super) part: &'a BakedPart,
    pub(super) seam: &'a Seam,
    pub(super) block: &'a Block,
    /// The old world's and the part's.
    pub(super) trees: [&'a PlaneTree<'a>; 2],
    pub(super) touched: &'a BTreeSet<CellId>,
}

/// Volume and box of a cell in the block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Share {
    pub(super) volume: f64,
    pub(super) aabb: Aabb,
}

impl Default for Share {
    fn default() -> Self {
        Self {
            volume: 0.0,
            aabb: Aabb::EMPTY,
        }
    }
}
