//! Result of a watershed: the basin of each voxel, the basins, and their contacts.

use std::ops::{BitOr, BitXor, Range};

use rayon::prelude::*;

/// Levels per voxel of distance.
pub(super) const STEPS: u32 = 64;

/// The basin of each voxel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Labels {
    /// Up to 65,535 basins: 2 bytes a voxel.
    U16(Vec<u16>),
    /// More: 4 bytes a voxel.
    U32(Vec<u32>),
}

impl Labels {
    /// Ensures that labels below `n` can be set.
    pub fn make_room_for(&mut self, n: usize) {
        if n > usize::from(u16::MAX) + 1
            && let Self::U16(v) = self
        {
            *self = Self::U32(v.iter().map(|&l| l.into()).collect());
        }
    }

    /// Labels the voxel at `index`; see [`Self::make_room_for`].
    pub fn set(&mut self, index: usize, label: u32) {
        match self {
            Self::U16(v) => v[index] = label as u16,
            Self::U32(v) => v[index] = label,
        }
    }

    /// Returns the label of the voxel at `index`; 0 if it is occupied.
    #[must_use]
    pub fn get(&self, index: usize) -> u32 {
        match self {
            Self::U16(v) => v[index].into(),
            Self::U32(v) => v[index],
        }
    }

    /// Returns the number of voxels.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U16(v) => v.len(),
            Self::U32(v) => v.len(),
        }
    }

    /// Returns `true` if there are no voxels.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Calls `run(voxels, label)` for each maximal run of voxels with one label within `range`, ascending.
    ///
    /// Compares some dozen voxels at a time where a run is long.
    pub fn for_runs(&self, range: Range<usize>, run: impl FnMut(Range<usize>, u32)) {
        match self {
            Self::U16(v) => for_runs(v, range, run),
            Self::U32(v) => for_runs(v, range, run),
        }
    }

    /// Calls `face(voxel, axis, labels)` for each face between voxels of different labels, given the lesser voxel, for
    /// those in layer `z` of a box of `dims` and above it.
    ///
    /// Compares some dozen voxels at a time where labels are alike.
    ///
    /// # Panics
    /// If the layer is outside the box, or the box is not of the size of the labels.
    pub fn for_faces(&self, dims: [usize; 3], z: usize, face: impl FnMut(usize, usize, [u32; 2])) {
        match self {
            Self::U16(v) => for_faces(v, dims, z, face),
            Self::U32(v) => for_faces(v, dims, z, face),
        }
    }

    /// Replaces each label by `new(label, y)`; see [`Self::make_room_for`]. Threads share the work.
    pub fn relabel(&mut self, dims: [usize; 3], new: impl Fn(u32, usize) -> u32 + Sync) {
        match self {
            Self::U16(v) => relabel(v, dims, |l, y| new(l, y) as u16),
            Self::U32(v) => relabel(v, dims, new),
        }
    }

    /// Returns all labels in index order.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.len()).map(|i| self.get(i))
    }
}

/// Number of labels compared at a time.
const CHUNK: usize = 64;

fn for_runs<T>(labels: &[T], range: Range<usize>, mut run: impl FnMut(Range<usize>, u32))
where
    T: Copy + PartialEq + Into<u32> + BitXor<Output = T> + BitOr<Output = T> + Default,
{
    let mut from = range.start;
    while from < range.end {
        let label = labels[from];
        let rest = &labels[from + 1..range.end];
        let is_one =
            |part: &&[T]| part.iter().fold(T::default(), |d, &l| d | (l ^ label)) == T::default();
        let whole = rest.chunks_exact(CHUNK).take_while(is_one).count() * CHUNK;
        let more = rest[whole..].iter().take_while(|l| **l == label).count();
        let to = from + 1 + whole + more;
        run(from..to, label.into());
        from = to;
    }
}

fn for_faces<T>(
    labels: &[T],
    [nx, ny, nz]: [usize; 3],
    z: usize,
    mut face: impl FnMut(usize, usize, [u32; 2]),
) where
    T: Copy + PartialEq + Into<u32> + BitXor<Output = T> + BitOr<Output = T> + Default,
{
    for y in 0..ny {
        let from = (z * ny + y) * nx;
        let row = &labels[from..from + nx];
        let mut compare = |axis: usize, next: &[T]| {
            let chunks = row.chunks(CHUNK).zip(next.chunks(CHUNK));
            for (at, (a, b)) in (from..).step_by(CHUNK).zip(chunks) {
                let pairs = || a.iter().zip(b);
                if pairs().fold(T::default(), |d, (&a, &b)| d | (a ^ b)) == T::default() {
                    continue;
                }
                for (x, (&a, &b)) in pairs().enumerate().filter(|(_, (a, b))| a != b) {
                    face(at + x, axis, [a.into(), b.into()]);
                }
            }
        };
        compare(0, &row[1..]);
        if y + 1 < ny {
            compare(1, &labels[from + nx..from + 2 * nx]);
        }
        if z + 1 < nz {
            compare(2, &labels[from + nx * ny..from + nx * ny + nx]);
        }
    }
}

fn relabel<T>(labels: &mut [T], [nx, ny, _]: [usize; 3], new: impl Fn(u32, usize) -> T + Sync)
where
    T: Copy + PartialEq + Into<u32> + Send,
{
    let rows = labels.par_chunks_mut(nx.max(1)).enumerate();
    rows.with_min_len(64).for_each(|(row, labels)| {
        for run in labels.chunk_by_mut(|a, b| a == b) {
            let label = new(run[0].into(), row % ny);
            if label != run[0] {
                run.fill(label);
            }
        }
    });
}

/// A basin of the distance field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basin {
    /// Greatest distance in it, rounded down to 1/64; infinite outdoors. [Units: vx]
    pub peak: f64,
    /// Index of a voxel at that distance; outdoors, of its first voxel.
    pub peak_voxel: usize,
    /// Number of voxels.
    pub n_voxels: u64,
}

/// Contact between two basins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saddle {
    /// Label of the first basin; less than `b`.
    pub a: u32,
    /// Label of the second.
    pub b: u32,
    /// Greatest distance at which they touch, rounded down to 1/64. [Units: vx]
    pub distance: f64,
    /// Index of a voxel at that distance that has a neighbor in the other basin.
    pub voxel: usize,
    /// Number of voxel faces that they share.
    pub n_faces: u64,
}

/// Basins of the distance field and their contacts.
#[derive(Clone, Debug, PartialEq)]
pub struct Watershed {
    /// Basin of each voxel, 0 if occupied. Every basin except outdoors is 6-connected.
    pub labels: Labels,
    /// The basin with label `i + 1` is at `i`: outdoors first if requested, then deepest first, then by index
    /// of the peak.
    pub basins: Vec<Basin>,
    /// Touching pairs, by distance from great to small, then by labels.
    pub saddles: Vec<Saddle>,
}

impl Watershed {
    /// So many voxels that no basin has.
    pub(super) fn unflooded(n_voxels: usize) -> Self {
        Self {
            labels: Labels::U16(vec![0; n_voxels]),
            basins: Vec::new(),
            saddles: Vec::new(),
        }
    }
}
