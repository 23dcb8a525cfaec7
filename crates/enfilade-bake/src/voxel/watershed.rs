//! Watershed of the distance field: rooms as the basins around its maxima.
//!
//! The free voxels are flooded from deep to shallow (Meyer, "Topographic distance and watershed
//! lines", 1994; Haumont, Debeir and Sillion, "Volumetric Cell-and-Portal Generation", 2003): each
//! regional maximum of the distance starts a basin when its level comes up, and a basin spreads to
//! its neighbors in order of level, first come first served within one, so that plateaus are
//! shared out by influence zones. Where two basins first meet is their saddle. A basin whose
//! dynamics (peak minus saddle; Grimaud, "A new measure of contrast", 1992) stay below `h` joins
//! the deeper one on the spot. Once the flood is `h` below a peak that basin stays for good, so
//! every contact that is recorded is one between two basins of the answer.
//!
//! **Levels** are distances in steps of 1/64 voxel ([`levels_per_voxel`]), rounded down. As
//! consecutive squares of distances below 32 voxels lie further apart than that, only wider
//! spaces lose any order at all.
//!
//! **Memory:** the flood works in place, in the array that held the squared distances: a word
//! holds a voxel's level until a basin reaches it and the basin's number from then on. 16-bit
//! words number 16,383 basins alive at once; the numbers of merged ones are used again. More than
//! half of that alive moves the volume into 32-bit words. The queue holds the shell of voxels that
//! lie within one voxel below the flood's level.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::grid::BitVolume;

/// Levels to a voxel of distance.
const STEPS: u32 = 64;

/// What to flood.
#[derive(Clone, Copy, Debug, Default)]
pub struct WatershedOptions<'a> {
    /// Basins with dynamics (peak minus highest saddle) below this join a deeper one. [Units: vx]
    /// [Limit: >= 0]
    pub h: f64,
    /// The free voxels set here are one basin, infinitely deep, with label 1.
    pub outdoors: Option<&'a BitVolume>,
}

/// The basin of each voxel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Labels {
    /// Up to 65,535 basins: 2 bytes a voxel.
    U16(Vec<u16>),
    /// More: 4 bytes a voxel.
    U32(Vec<u32>),
}

impl Labels {
    /// Label of the voxel at `index`; 0 when it is occupied.
    #[must_use]
    pub fn get(&self, index: usize) -> u32 {
        match self {
            Self::U16(v) => v[index].into(),
            Self::U32(v) => v[index],
        }
    }

    /// Voxels.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U16(v) => v.len(),
            Self::U32(v) => v.len(),
        }
    }

    /// Whether there is no voxel.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All labels in index order.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.len()).map(|i| self.get(i))
    }
}

/// A basin of the distance field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basin {
    /// Greatest distance in it, rounded down to 1/64; infinite outdoors. [Units: vx]
    pub peak: f64,
    /// Index of a voxel at that distance; outdoors, of its first voxel.
    pub peak_voxel: usize,
    /// Voxels in it.
    pub n_voxels: u64,
}

/// Where two basins touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saddle {
    /// Label of the one basin; less than `b`.
    pub a: u32,
    /// Label of the other.
    pub b: u32,
    /// Greatest distance at which they touch, rounded down to 1/64. [Units: vx]
    pub distance: f64,
    /// Index of a voxel at that distance that has a neighbor in the other basin.
    pub voxel: usize,
    /// Voxel faces that they share.
    pub n_faces: u64,
}

/// Basins of the distance field and how they touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Watershed {
    /// Basin of each voxel, 0 where occupied. Every basin except outdoors is 6-connected.
    pub labels: Labels,
    /// Basin with label `i + 1` at `i`: outdoors first if asked for, then deepest first, then by
    /// index of the peak.
    pub basins: Vec<Basin>,
    /// Touching pairs, by distance from great to small, then by labels.
    pub saddles: Vec<Saddle>,
}

/// Levels that a voxel of distance is divided into.
#[must_use]
pub const fn levels_per_voxel() -> u32 {
    STEPS
}

/// Floods a field of squared distances from deep to shallow.
///
/// `squared` is what [`distance_squared`](super::distance_squared) gives for a box of `dims`; 0 is
/// occupied, and distances of 256 voxels and more count as one level. It is consumed, and its
/// memory becomes the labels.
///
/// Time is linear in the voxels. On top of the 2 bytes a voxel it takes about 4 bytes for each
/// voxel of the widest shell one voxel thick, and 8 for each local maximum.
///
/// # Panics
/// When `squared` or `outdoors` is not of size `dims`, there are 2³² voxels or more, or `h` is
/// negative or NaN.
#[must_use]
pub fn watershed(dims: [usize; 3], squared: Vec<u16>, options: &WatershedOptions) -> Watershed {
    let n: usize = dims.iter().product();
    assert_eq!(squared.len(), n, "a distance for each of {dims:?} voxels");
    assert!(u32::try_from(n).is_ok(), "fewer than 2^32 voxels");
    assert!(
        options.h >= 0.0,
        "h must not be negative, got {}",
        options.h
    );
    let mut words = squared;
    to_levels(&mut words);
    let starts = local_maxima(dims, &words);
    let h = (options.h * f64::from(STEPS))
        .ceil()
        .min(f64::from(u32::MAX)) as u32;
    let mut flood = Flood::new(dims, words, starts, h);
    if let Some(outdoors) = options.outdoors {
        assert_eq!(outdoors.dims(), dims, "outdoors of the same size");
        flood.seed(outdoors);
    }
    let outdoors = options.outdoors.is_some();
    if flood.run() {
        return flood.finish(outdoors);
    }
    let mut wide = flood.widened();
    assert!(
        wide.run(),
        "30 bits number more basins than there are voxels"
    );
    wide.finish(outdoors)
}

/// Marks the dams between basins, one voxel thick: each voxel that shares a face with one of a
/// lesser label other than 0. What is left of different basins does not touch.
///
/// # Panics
/// When `labels` is not of size `dims`.
#[must_use]
pub fn mark_dams(dims: [usize; 3], labels: &Labels) -> BitVolume {
    assert_eq!(
        labels.len(),
        dims.iter().product::<usize>(),
        "a label for each voxel"
    );
    match labels {
        Labels::U16(v) => dams(dims, v),
        Labels::U32(v) => dams(dims, v),
    }
}

fn dams<T: Copy + Ord + Default + Sync>(dims: [usize; 3], labels: &[T]) -> BitVolume {
    let [nx, ny, _] = dims;
    let mut out = BitVolume::new(dims);
    if labels.is_empty() {
        return out;
    }
    let per_row = out.row_words();
    out.words_mut()
        .par_chunks_mut(per_row)
        .enumerate()
        .with_min_len(16)
        .for_each(|(row, words)| {
            let rows = Neighbors::of(labels, dims, row, ny);
            for x in 0..nx {
                let here = rows.here[x];
                let dam = |other: T| other != T::default() && other < here;
                if (x > 0 && dam(rows.here[x - 1]))
                    || (x + 1 < nx && dam(rows.here[x + 1]))
                    || rows.around.iter().flatten().any(|r| dam(r[x]))
                {
                    words[x / 64] |= 1 << (x % 64);
                }
            }
        });
    out
}

/// A row and the four that share faces with it: y - 1, z - 1, y + 1, z + 1.
struct Neighbors<'a, T> {
    here: &'a [T],
    around: [Option<&'a [T]>; 4],
}

impl<'a, T> Neighbors<'a, T> {
    fn of(values: &'a [T], [nx, _, nz]: [usize; 3], row: usize, ny: usize) -> Self {
        let (y, z) = (row % ny, row / ny);
        let at = |row: usize| &values[row * nx..(row + 1) * nx];
        Self {
            here: at(row),
            around: [
                (y > 0).then(|| at(row - 1)),
                (z > 0).then(|| at(row - ny)),
                (y + 1 < ny).then(|| at(row + 1)),
                (z + 1 < nz).then(|| at(row + ny)),
            ],
        }
    }
}

/// Squared distances to levels, in place.
fn to_levels(words: &mut [u16]) {
    let table: Vec<u16> = (0..=u16::MAX)
        .map(|d| (f64::from(d).sqrt() * f64::from(STEPS)) as u16)
        .collect();
    words.par_chunks_mut(1 << 14).for_each(|part| {
        for w in part {
            *w = table[usize::from(*w)];
        }
    });
}

/// Voxels where a basin may start, deepest first, then by index: `(level, index)`.
///
/// No neighbor is higher, and none of those before it in the scan is as high: every regional
/// maximum has such a voxel, its first.
fn local_maxima(dims: [usize; 3], levels: &[u16]) -> Vec<(u16, u32)> {
    let [nx, ny, nz] = dims;
    let mut found: Vec<(u16, u32)> = (0..ny * nz)
        .into_par_iter()
        .with_min_len(16)
        .fold(Vec::new, |mut found, row| {
            let rows = Neighbors::of(levels, dims, row, ny);
            let [y0, z0, y1, z1] = rows.around;
            for x in 0..nx {
                let here = rows.here[x];
                let below = |r: Option<&[u16]>| r.is_none_or(|r| r[x] < here);
                let not_above = |r: Option<&[u16]>| r.is_none_or(|r| r[x] <= here);
                if here > 0
                    && (x == 0 || rows.here[x - 1] < here)
                    && (x + 1 == nx || rows.here[x + 1] <= here)
                    && below(y0)
                    && below(z0)
                    && not_above(y1)
                    && not_above(z1)
                {
                    found.push((here, (row * nx + x) as u32));
                }
            }
            found
        })
        .reduce(Vec::new, |mut a, mut b| {
            a.append(&mut b);
            a
        });
    found.par_sort_unstable_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    found
}

/// A word of the volume: a level, or a basin's number once reached.
///
/// The two top bits say which: reached, and done with (off the queue). All clear is a level, 0
/// for occupied.
trait Word: Copy + Send + Sync {
    const REACHED: u32;
    const DONE: u32;
    const NUMBER: u32;
    fn get(self) -> u32;
    fn of(value: u32) -> Self;
}

impl Word for u16 {
    const REACHED: u32 = 0x8000;
    const DONE: u32 = 0x4000;
    const NUMBER: u32 = 0x3FFF;
    #[inline(always)]
    fn get(self) -> u32 {
        self.into()
    }
    #[inline(always)]
    fn of(value: u32) -> Self {
        value as u16
    }
}

impl Word for u32 {
    const REACHED: u32 = 0x8000_0000;
    const DONE: u32 = 0x4000_0000;
    const NUMBER: u32 = 0x3FFF_FFFF;
    #[inline(always)]
    fn get(self) -> u32 {
        self
    }
    #[inline(always)]
    fn of(value: u32) -> Self {
        value
    }
}

/// Queue entries to a chunk.
const CHUNK: usize = 510;
const NONE: u32 = u32::MAX;

/// First-in-first-out queues, one a level, in chunks of one pool.
struct Queue {
    chunks: Vec<[u32; CHUNK]>,
    next: Vec<u32>,
    free: Vec<u32>,
    /// For each level: first and last chunk, where to read in the first, where to write in the last.
    ends: Vec<[u32; 4]>,
}

impl Queue {
    fn new(n_levels: usize) -> Self {
        Self {
            chunks: Vec::new(),
            next: Vec::new(),
            free: Vec::new(),
            ends: vec![[NONE, NONE, 0, CHUNK as u32]; n_levels],
        }
    }

    #[inline(always)]
    fn push(&mut self, level: u32, voxel: u32) {
        let end = &mut self.ends[level as usize];
        if end[3] == CHUNK as u32 {
            let fresh = self.free.pop().unwrap_or_else(|| {
                self.chunks.push([0; CHUNK]);
                self.next.push(NONE);
                self.chunks.len() as u32 - 1
            });
            self.next[fresh as usize] = NONE;
            if end[0] == NONE {
                end[0] = fresh;
                end[2] = 0;
            } else {
                self.next[end[1] as usize] = fresh;
            }
            end[1] = fresh;
            end[3] = 0;
        }
        self.chunks[end[1] as usize][end[3] as usize] = voxel;
        end[3] += 1;
    }

    #[inline(always)]
    fn pop(&mut self, level: u32) -> Option<u32> {
        let end = &mut self.ends[level as usize];
        if end[0] == NONE {
            return None;
        }
        if end[0] == end[1] && end[2] == end[3] {
            self.free.push(end[0]);
            *end = [NONE, NONE, 0, CHUNK as u32];
            return None;
        }
        let voxel = self.chunks[end[0] as usize][end[2] as usize];
        end[2] += 1;
        if end[2] == CHUNK as u32 && end[0] != end[1] {
            self.free.push(end[0]);
            end[0] = self.next[end[0] as usize];
            end[2] = 0;
        }
        Some(voxel)
    }
}

/// A basin while flooding.
#[derive(Clone, Copy)]
struct Pool {
    /// Level of the peak; `u32::MAX` outdoors.
    peak: u32,
    voxel: u32,
}

/// First contact of two basins.
#[derive(Clone, Copy)]
struct Contact {
    level: u32,
    voxel: u32,
    n_faces: u64,
}

struct Flood<W> {
    dims: [usize; 3],
    words: Vec<W>,
    starts: Vec<(u16, u32)>,
    next_start: usize,
    level: u32,
    h: u32,
    queue: Queue,
    /// Basin by number; number 0 is the outdoors or unused.
    pools: Vec<Pool>,
    /// The basin that each has joined, or itself.
    joined: Vec<u32>,
    contacts: BTreeMap<(u32, u32), Contact>,
}

impl<W: Word> Flood<W> {
    fn new(dims: [usize; 3], words: Vec<W>, starts: Vec<(u16, u32)>, h: u32) -> Self {
        let level = starts.first().map_or(0, |s| u32::from(s.0));
        Self {
            dims,
            words,
            starts,
            next_start: 0,
            level,
            h,
            queue: Queue::new(level as usize + 1),
            pools: vec![Pool {
                peak: u32::MAX,
                voxel: 0,
            }],
            joined: vec![0],
            contacts: BTreeMap::new(),
        }
    }

    /// Gives the outdoors its voxels; those that touch other free voxels are queued.
    fn seed(&mut self, outdoors: &BitVolume) {
        let mut first = None;
        for v in outdoors.iter_set() {
            let level = self.words[v].get();
            if level == 0 {
                continue;
            }
            first.get_or_insert(v as u32);
            let rim = neighbors(self.dims, v as u32).iter().any(|&q| {
                q != NONE && self.words[q as usize].get() != 0 && !outdoors.get_index(q as usize)
            });
            if rim {
                self.queue.push(level, v as u32);
            }
        }
        // The queue knows the level of what it holds; the rest touches nothing else.
        for v in outdoors.iter_set() {
            let word = &mut self.words[v];
            if word.get() != 0 {
                *word = W::of(W::REACHED);
            }
        }
        self.pools[0].voxel = first.unwrap_or(0);
    }

    /// Floods until all is flooded, or `false` when numbers have run out.
    fn run(&mut self) -> bool {
        while self.level > 0 {
            self.drain();
            while let Some(&(level, voxel)) = self.starts.get(self.next_start) {
                if u32::from(level) != self.level {
                    break;
                }
                if self.words[voxel as usize].get() & W::REACHED == 0 {
                    if self.pools.len() as u32 > W::NUMBER {
                        self.renumber();
                        if self.pools.len() as u32 > W::NUMBER / 2 {
                            return false;
                        }
                    }
                    let number = self.pools.len() as u32;
                    self.pools.push(Pool {
                        peak: self.level,
                        voxel,
                    });
                    self.joined.push(number);
                    self.words[voxel as usize] = W::of(W::REACHED | number);
                    self.queue.push(self.level, voxel);
                    self.drain();
                }
                self.next_start += 1;
            }
            self.level -= 1;
        }
        true
    }

    /// Floods from all that is queued at the current level.
    fn drain(&mut self) {
        while let Some(voxel) = self.queue.pop(self.level) {
            let mut number = self.find(self.words[voxel as usize].get() & W::NUMBER);
            self.words[voxel as usize] = W::of(W::REACHED | W::DONE | number);
            for q in neighbors(self.dims, voxel) {
                if q == NONE {
                    continue;
                }
                let other = self.words[q as usize].get();
                if other == 0 {
                    continue;
                }
                if other & W::REACHED == 0 {
                    debug_assert!(other <= self.level);
                    self.words[q as usize] = W::of(W::REACHED | number);
                    self.queue.push(other, q);
                } else if other & W::DONE != 0 && other & W::NUMBER != number {
                    number = self.touch(number, other & W::NUMBER, voxel);
                }
            }
        }
    }

    fn find(&mut self, mut number: u32) -> u32 {
        while self.joined[number as usize] != number {
            let up = self.joined[self.joined[number as usize] as usize];
            self.joined[number as usize] = up;
            number = up;
        }
        number
    }

    /// Two basins touch at `voxel`: merges them or notes it. Returns what `number` is now.
    #[cold]
    fn touch(&mut self, number: u32, other: u32, voxel: u32) -> u32 {
        let other = self.find(other);
        if other == number {
            return number;
        }
        let rank = |n: u32| (self.pools[n as usize].peak, std::cmp::Reverse(n));
        let (deep, shallow) = if rank(number) > rank(other) {
            (number, other)
        } else {
            (other, number)
        };
        if self.pools[shallow as usize].peak - self.level < self.h {
            self.joined[shallow as usize] = deep;
            return deep;
        }
        let level = self.level;
        self.contacts
            .entry((number.min(other), number.max(other)))
            .or_insert(Contact {
                level,
                voxel,
                n_faces: 0,
            })
            .n_faces += 1;
        number
    }

    /// Drops the numbers of merged basins.
    fn renumber(&mut self) {
        let mut fresh = vec![0u32; self.pools.len()];
        let mut kept = Vec::new();
        for (n, pool) in self.pools.iter().enumerate() {
            if self.joined[n] as usize == n {
                fresh[n] = kept.len() as u32;
                kept.push(*pool);
            }
        }
        for n in 0..self.pools.len() as u32 {
            let root = self.find(n);
            fresh[n as usize] = fresh[root as usize];
        }
        self.words.par_chunks_mut(1 << 14).for_each(|part| {
            for w in part {
                let value = w.get();
                if value & W::REACHED != 0 {
                    *w = W::of(value & !W::NUMBER | fresh[(value & W::NUMBER) as usize]);
                }
            }
        });
        self.joined = (0..kept.len() as u32).collect();
        self.pools = kept;
        // Numbers keep their order, so pairs keep theirs.
        self.contacts = std::mem::take(&mut self.contacts)
            .into_iter()
            .map(|((a, b), c)| ((fresh[a as usize], fresh[b as usize]), c))
            .collect();
    }
}

impl Flood<u16> {
    /// The same state in 32-bit words.
    fn widened(self) -> Flood<u32> {
        let words = self
            .words
            .par_iter()
            .map(|&w| {
                let value = u32::from(w);
                if value & <u16 as Word>::REACHED == 0 {
                    value
                } else {
                    value & <u16 as Word>::NUMBER
                        | (value & (<u16 as Word>::REACHED | <u16 as Word>::DONE)) << 16
                }
            })
            .collect();
        Flood {
            dims: self.dims,
            words,
            starts: self.starts,
            next_start: self.next_start,
            level: self.level,
            h: self.h,
            queue: self.queue,
            pools: self.pools,
            joined: self.joined,
            contacts: self.contacts,
        }
    }
}

/// How a finished volume becomes labels.
trait Relabel {
    /// `label` by number, 0 where the number is not used.
    fn relabel(self, label: &[u32]) -> Labels;
}

impl Relabel for Vec<u16> {
    fn relabel(mut self, label: &[u32]) -> Labels {
        self.par_chunks_mut(1 << 14).for_each(|part| {
            for w in part {
                if *w != 0 {
                    *w = label[usize::from(*w & <u16 as Word>::NUMBER as u16)] as u16;
                }
            }
        });
        Labels::U16(self)
    }
}

impl Relabel for Vec<u32> {
    fn relabel(mut self, label: &[u32]) -> Labels {
        self.par_chunks_mut(1 << 14).for_each(|part| {
            for w in part {
                if *w != 0 {
                    *w = label[(*w & <u32 as Word>::NUMBER) as usize];
                }
            }
        });
        if label.iter().all(|&l| l <= u32::from(u16::MAX)) {
            return Labels::U16(self.par_iter().map(|&l| l as u16).collect());
        }
        Labels::U32(self)
    }
}

impl<W: Word> Flood<W>
where
    Vec<W>: Relabel,
{
    fn finish(mut self, outdoors: bool) -> Watershed {
        // Numbers were given deepest first, in order of index, so their order is the answer's.
        let mut label = vec![0u32; self.pools.len()];
        let mut basins = Vec::new();
        for (n, pool) in self.pools.iter().enumerate() {
            if self.joined[n] as usize != n || (n == 0 && !outdoors) {
                continue;
            }
            let peak = if n == 0 {
                f64::INFINITY
            } else {
                f64::from(pool.peak) / f64::from(STEPS)
            };
            basins.push(Basin {
                peak,
                peak_voxel: pool.voxel as usize,
                n_voxels: 0,
            });
            label[n] = basins.len() as u32;
        }
        for n in 0..label.len() {
            let root = self.find(n as u32);
            label[n] = label[root as usize];
        }
        let mut saddles: Vec<Saddle> = self
            .contacts
            .iter()
            .map(|(&(a, b), c)| Saddle {
                a: label[a as usize],
                b: label[b as usize],
                distance: f64::from(c.level) / f64::from(STEPS),
                voxel: c.voxel as usize,
                n_faces: c.n_faces,
            })
            .collect();
        saddles.sort_by(|p, q| {
            q.distance
                .total_cmp(&p.distance)
                .then((p.a, p.b).cmp(&(q.a, q.b)))
        });
        let labels = self.words.relabel(&label);
        count(&labels, &mut basins);
        Watershed {
            labels,
            basins,
            saddles,
        }
    }
}

/// Fills in the sizes of the basins.
fn count(labels: &Labels, basins: &mut [Basin]) {
    let mut counts = vec![0u64; basins.len() + 1];
    match labels {
        Labels::U16(v) => v.iter().for_each(|&l| counts[usize::from(l)] += 1),
        Labels::U32(v) => v.iter().for_each(|&l| counts[l as usize] += 1),
    }
    for (basin, n) in basins.iter_mut().zip(&counts[1..]) {
        basin.n_voxels = *n;
    }
}

/// The six voxels that share a face; [`NONE`] outside the box.
#[inline(always)]
fn neighbors([nx, ny, nz]: [usize; 3], voxel: u32) -> [u32; 6] {
    let (nx, ny, nz) = (nx as u32, ny as u32, nz as u32);
    let row = voxel / nx;
    let x = voxel - row * nx;
    let z = row / ny;
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

#[cfg(test)]
mod tests;
