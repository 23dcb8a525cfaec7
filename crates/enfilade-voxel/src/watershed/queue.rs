//! Data structures of the flood: queues by level, and the neighbors of a voxel.

/// Queue entries per chunk: half a kilobyte, because in a small scene most of the hundreds of waiting levels hold few.
const CHUNK: usize = 128;
pub(super) const NONE: u32 = u32::MAX;

/// Voxels taken from the queue at a time, so that the memory they need is fetched at once.
///
/// The flood is bound by memory, not by arithmetic: on a building of 256³ voxels, taking entries one by one
/// spent four fifths of the time on the first access to a neighbor.
pub(super) const BATCH: usize = 32;

/// First-in-first-out queues, one per level, in chunks of one pool.
pub(super) struct Queue {
    chunks: Vec<[u32; CHUNK]>,
    next: Vec<u32>,
    free: Vec<u32>,
    /// Per level: first and last chunk, read position in the first, write position in the last.
    ends: Vec<[u32; 4]>,
}

impl Queue {
    pub(super) fn new(n_levels: usize) -> Self {
        Self {
            chunks: Vec::new(),
            next: Vec::new(),
            free: Vec::new(),
            ends: vec![[NONE, NONE, 0, CHUNK as u32]; n_levels],
        }
    }

    #[inline(always)]
    pub(super) fn push(&mut self, level: u32, voxel: u32) {
        if self.ends[level as usize][3] == CHUNK as u32 {
            let fresh = self.free.pop().unwrap_or_else(|| self.grow());
            let end = &mut self.ends[level as usize];
            if end[0] == NONE {
                end[0] = fresh;
                end[2] = 0;
            } else {
                self.next[end[1] as usize] = fresh;
            }
            end[1] = fresh;
            end[3] = 0;
        }
        let end = &mut self.ends[level as usize];
        self.chunks[end[1] as usize][end[3] as usize] = voxel;
        end[3] += 1;
    }

    /// Adds a chunk. Capacity grows by an eighth: doubling, as vectors do, would take half of all memory that
    /// a flood needs besides the volume.
    #[cold]
    fn grow(&mut self) -> u32 {
        let n = self.chunks.len();
        if n == self.chunks.capacity() {
            self.chunks.reserve_exact(16.max(n / 8));
        }
        self.chunks.push([0; CHUNK]);
        self.next.push(NONE);
        n as u32
    }

    /// Takes the oldest entries of a level, [`BATCH`] at most, and returns their number; 0 if there are none.
    pub(super) fn pop(&mut self, level: u32, into: &mut [u32; BATCH]) -> usize {
        let end = &mut self.ends[level as usize];
        if end[0] == end[1] && (end[0] == NONE || end[2] == end[3]) {
            if end[0] != NONE {
                self.free.push(end[0]);
                *end = [NONE, NONE, 0, CHUNK as u32];
            }
            return 0;
        }
        if end[2] == CHUNK as u32 {
            self.free.push(end[0]);
            end[0] = self.next[end[0] as usize];
            end[2] = 0;
        }
        let from = end[2] as usize;
        let to = if end[0] == end[1] {
            end[3] as usize
        } else {
            CHUNK
        };
        let n = (to - from).min(BATCH);
        into[..n].copy_from_slice(&self.chunks[end[0] as usize][from..from + n]);
        end[2] += n as u32;
        n
    }
}

/// A box with division-free neighbor search.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    n: [u32; 3],
    /// 2⁶⁴ / nx and 2⁶⁴ / ny, rounded up; 0 for 1.
    inverse: [u64; 2],
}

impl Shape {
    pub(super) fn new(dims: [usize; 3]) -> Self {
        let n = dims.map(|n| n as u32);
        let inverse = |d: u32| (u64::MAX / u64::from(d.max(1))).wrapping_add(1);
        Self {
            n,
            inverse: [inverse(n[0]), inverse(n[1])],
        }
    }

    /// Returns `value / divisor`. The inverse is too large by less than 1, which adds less than
    /// `value / 2⁶⁴ < 2⁻³²` to the quotient: less than its distance to the next integer above,
    /// which is at least `1 / divisor`.
    #[inline(always)]
    fn divided(value: u32, inverse: u64) -> u32 {
        if inverse == 0 {
            value
        } else {
            ((u128::from(value) * u128::from(inverse)) >> 64) as u32
        }
    }

    /// Returns the six voxels that share a face; [`NONE`] outside the box.
    #[inline(always)]
    pub(super) fn neighbors(&self, voxel: u32) -> [u32; 6] {
        let [nx, ny, nz] = self.n;
        let row = Self::divided(voxel, self.inverse[0]);
        let x = voxel - row * nx;
        let z = Self::divided(row, self.inverse[1]);
        let y = row - z * ny;
        let slice = nx * ny;
        [
            if x > 0 { voxel - 1 } else { NONE },
            if x + 1 < nx { voxel + 1 } else { NONE },
            if y > 0 { voxel - nx } else { NONE },
            if y + 1 < ny { voxel + nx } else { NONE },
            if z > 0 { voxel - slice } else { NONE },
            if z + 1 < nz { voxel + slice } else { NONE },
        ]
    }
}
