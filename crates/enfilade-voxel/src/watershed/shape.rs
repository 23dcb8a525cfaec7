//! Positions of voxels in a box.

/// A box whose voxels are numbered along x, then y, then z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) dims: [usize; 3],
}

impl Shape {
    pub(super) fn layer(&self) -> usize {
        self.dims[0] * self.dims[1]
    }

    /// Returns the number of voxels of slab `s` of those of `thick` layers.
    pub(super) fn n_of_slab(&self, s: usize, thick: usize) -> usize {
        thick.min(self.dims[2] - s * thick) * self.layer()
    }

    pub(super) fn coords(&self, voxel: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [voxel % nx, voxel / nx % ny, voxel / (nx * ny)]
    }

    /// Returns the voxels that share a face with the one at `at`, in ascending order.
    pub(super) fn neighbors(&self, [x, y, z]: [usize; 3]) -> impl Iterator<Item = usize> + use<> {
        let [nx, ny, nz] = self.dims;
        let layer = nx * ny;
        let voxel = x + nx * y + layer * z;
        let all = [
            (z > 0, voxel.wrapping_sub(layer)),
            (y > 0, voxel.wrapping_sub(nx)),
            (x > 0, voxel.wrapping_sub(1)),
            (x + 1 < nx, voxel + 1),
            (y + 1 < ny, voxel + nx),
            (z + 1 < nz, voxel + layer),
        ];
        all.into_iter().filter(|n| n.0).map(|n| n.1)
    }
}
