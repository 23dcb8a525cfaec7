//! Shells: triangles connected over edges with exactly two of them.

/// Triangles joined edge by edge, by union-find with path halving (Tarjan & van Leeuwen 1984). Each records whether
/// its orientation is opposite to its parent's.
///
/// Time: nearly constant per call, whatever the number of triangles.
pub(crate) struct Shells {
    parent: Vec<u32>,
    is_turned: Vec<bool>,
    /// Triangles with an edge that not exactly two triangles of their object use.
    pub(crate) is_unclosed: Vec<bool>,
    /// Triangles at which a surface turned out to have one side only.
    pub(crate) is_one_sided: Vec<bool>,
}

impl Shells {
    pub(crate) fn new(n: usize) -> Self {
        Self {
            parent: (0..n as u32).collect(),
            is_turned: vec![false; n],
            is_unclosed: vec![false; n],
            is_one_sided: vec![false; n],
        }
    }

    /// Returns the root of `t`, and `true` if `t` is oriented against it.
    pub(crate) fn root(&mut self, t: u32) -> (u32, bool) {
        let mut at = t;
        let mut turned = false;
        while self.parent[at as usize] != at {
            let up = self.parent[at as usize];
            let above = self.parent[up as usize];
            // Path halving: link to the grandparent, with both orientations combined.
            let turn = self.is_turned[at as usize] ^ (up != above && self.is_turned[up as usize]);
            self.parent[at as usize] = above;
            self.is_turned[at as usize] = turn;
            turned ^= turn;
            at = above;
        }
        (at, turned)
    }

    /// Joins two triangles; `is_turned` if they traverse their edge in the same direction, so that one is turned.
    pub(crate) fn join(&mut self, a: u32, b: u32, is_turned: bool) {
        let ((ra, ta), (rb, tb)) = (self.root(a), self.root(b));
        if ra != rb {
            let (low, high) = (ra.min(rb), ra.max(rb));
            self.parent[high as usize] = low;
            self.is_turned[high as usize] = ta ^ tb ^ is_turned;
        } else if ta ^ tb != is_turned {
            // A surface with one side only, such as a Möbius strip.
            self.is_one_sided[a as usize] = true;
        }
    }

    pub(crate) fn mark_unclosed(&mut self, t: u32) {
        self.is_unclosed[t as usize] = true;
    }
}
