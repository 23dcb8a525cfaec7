//! Voxels around the vertices of a lattice.

use enfilade_geom::DVec3;

/// A lattice; the voxel of a vertex is the cube around it.
pub(super) struct ScanGrid {
    pub(super) origin: DVec3,
    pub(super) step: f64,
    pub(super) size: [usize; 3],
}

impl ScanGrid {
    /// Returns coordinates in voxels: the vertex with index 0 is at 0.
    pub(super) fn scaled(&self, p: DVec3) -> DVec3 {
        (p - self.origin) / self.step
    }

    pub(super) fn point(&self, at: [usize; 3]) -> DVec3 {
        self.origin + DVec3::from_array(at.map(|c| c as f64)) * self.step
    }

    /// Returns the indices of the vertex nearest to a point; `None` beyond the box.
    pub(super) fn voxel(&self, p: DVec3) -> Option<[usize; 3]> {
        let q = self.scaled(p).round().to_array();
        let is_in = (0..3).all(|a| q[a] >= 0.0 && q[a] < self.size[a] as f64);
        is_in.then(|| q.map(|c| c as usize))
    }

    pub(super) fn index(&self, at: [usize; 3]) -> usize {
        at[0] + self.size[0] * (at[1] + self.size[1] * at[2])
    }

    pub(super) fn at(&self, index: usize) -> [usize; 3] {
        let [x, y, _] = self.size;
        [index % x, index / x % y, index / (x * y)]
    }
}
