//! The flood itself, in place; see the module above for the method.

use std::collections::BTreeMap;

use enfilade_geom::{Allowance, Sets};
use rayon::prelude::*;

use super::super::grid::{BitVolume, for_runs};
use super::basins::{Basin, Labels, STEPS, Saddle, Watershed};
use super::queue::{BATCH, NONE, Queue, Shape};

/// A word of the volume: a level, or a basin's number once reached.
///
/// The two top bits tell which: reached, and finished (off the queue). If both are clear it is a level, 0
/// for occupied.
pub(super) trait Word: Copy + Send + Sync {
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

pub(super) struct Flood<W> {
    dims: [usize; 3],
    shape: Shape,
    words: Vec<W>,
    /// Voxels where basins may start, deepest first.
    starts: Vec<u32>,
    next_start: usize,
    level: u32,
    h: u32,
    queue: Queue,
    /// Basin by number; number 0 is the outdoors or unused.
    pools: Vec<Pool>,
    /// Joined basins; numbers are given deepest first, so the least of a set is the deepest.
    joined: Sets,
    contacts: BTreeMap<(u32, u32), Contact>,
}

impl<W: Word> Flood<W> {
    pub(super) fn new(dims: [usize; 3], words: Vec<W>, starts: Vec<u32>, h: u32) -> Self {
        let level = words.par_iter().map(|w| w.get()).max().unwrap_or(0);
        Self {
            dims,
            shape: Shape::new(dims),
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
            joined: Sets::new(1),
            contacts: BTreeMap::new(),
        }
    }

    /// Assigns the outdoors its voxels; queues those that touch other free voxels.
    pub(super) fn seed(&mut self, outdoors: &BitVolume) {
        let mut first = None;
        for v in outdoors.rim().iter_set() {
            let level = self.words[v].get();
            if level == 0 {
                continue;
            }
            let rim = self.shape.neighbors(v as u32).iter().any(|&q| {
                q != NONE && self.words[q as usize].get() != 0 && !outdoors.get_index(q as usize)
            });
            if rim {
                self.queue.push(level, v as u32);
            }
        }
        // The queue remembers the level of its voxels; the others touch nothing else.
        let nx = self.dims[0];
        for row in 0..self.dims[1] * self.dims[2] {
            for_runs(outdoors.row(row), |from, to| {
                let range = row * nx + from as usize..row * nx + to as usize;
                for (at, word) in self.words[range.clone()].iter_mut().enumerate() {
                    if word.get() != 0 {
                        first.get_or_insert((range.start + at) as u32);
                        *word = W::of(W::REACHED);
                    }
                }
            });
        }
        self.pools[0].voxel = first.unwrap_or(0);
    }

    /// Floods everything, or until the allowance is over; returns `false` if numbers have run out.
    pub(super) fn run(&mut self, allowance: &Allowance) -> bool {
        while self.level > 0 && allowance.spend(1) {
            self.drain(allowance);
            while let Some(&voxel) = self.starts.get(self.next_start) {
                // A voxel that is not reached still holds its level.
                let word = self.words[voxel as usize].get();
                if word & W::REACHED == 0 {
                    if word != self.level {
                        break;
                    }
                    if self.pools.len() as u32 > W::NUMBER {
                        self.renumber();
                        if self.pools.len() as u32 > W::NUMBER / 2 {
                            return false;
                        }
                    }
                    let number = self.joined.add();
                    self.pools.push(Pool {
                        peak: self.level,
                        voxel,
                    });
                    self.words[voxel as usize] = W::of(W::REACHED | number);
                    self.queue.push(self.level, voxel);
                    self.drain(allowance);
                }
                self.next_start += 1;
            }
            self.level -= 1;
        }
        true
    }

    /// Floods from all voxels queued at the current level.
    fn drain(&mut self, allowance: &Allowance) {
        let mut batch = [0; BATCH];
        loop {
            let n = self.queue.pop(self.level, &mut batch);
            // A quarter of a unit a voxel.
            if n == 0 || !allowance.spend(1 + n as u64 / 4) {
                return;
            }
            self.fetch(&batch[..n]);
            for &voxel in &batch[..n] {
                self.spread(voxel);
            }
        }
    }

    /// Reads the words that [`Self::spread`] needs, all at once, so that no load waits for another.
    fn fetch(&self, batch: &[u32]) {
        let [row, slice] = [self.dims[0], self.dims[0] * self.dims[1]];
        let mut seen = 0;
        let mut look = |at: usize| seen |= self.words.get(at).map_or(0, |w| w.get());
        for &voxel in batch {
            let voxel = voxel as usize;
            look(voxel);
            look(voxel.wrapping_sub(slice));
            look(voxel + slice);
            look(voxel.wrapping_sub(row));
            look(voxel + row);
        }
        std::hint::black_box(seen);
    }

    #[inline(always)]
    fn spread(&mut self, voxel: u32) {
        let mut number = self
            .joined
            .find(self.words[voxel as usize].get() & W::NUMBER);
        self.words[voxel as usize] = W::of(W::REACHED | W::DONE | number);
        for q in self.shape.neighbors(voxel) {
            if q == NONE {
                continue;
            }
            let other = self.words[q as usize].get();
            if other & W::REACHED == 0 {
                if other != 0 {
                    debug_assert!(other <= self.level);
                    self.words[q as usize] = W::of(W::REACHED | number);
                    self.queue.push(other, q);
                }
            } else if other & W::DONE != 0 && other & W::NUMBER != number {
                number = self.touch(number, other & W::NUMBER, voxel);
            }
        }
    }

    /// Merges two basins that touch at `voxel`, or records the contact. Returns the current number of `number`.
    #[cold]
    fn touch(&mut self, number: u32, other: u32, voxel: u32) -> u32 {
        let other = self.joined.find(other);
        if other == number {
            return number;
        }
        // Numbers are given deepest first, ties in order of index, and keep that order.
        let (deep, shallow) = (number.min(other), number.max(other));
        debug_assert!(self.pools[deep as usize].peak >= self.pools[shallow as usize].peak);
        if self.pools[shallow as usize].peak - self.level < self.h {
            return self.joined.join(deep, shallow);
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
            if self.joined.find(n as u32) as usize == n {
                fresh[n] = kept.len() as u32;
                kept.push(*pool);
            }
        }
        for n in 0..self.pools.len() as u32 {
            let root = self.joined.find(n);
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
        self.joined = Sets::new(kept.len());
        self.pools = kept;
        // Numbers keep their order, so pairs keep theirs.
        self.contacts = std::mem::take(&mut self.contacts)
            .into_iter()
            .map(|((a, b), c)| ((fresh[a as usize], fresh[b as usize]), c))
            .collect();
    }
}

impl Flood<u16> {
    /// Returns the same state in 32-bit words.
    pub(super) fn widened(self) -> Flood<u32> {
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
            shape: self.shape,
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

/// Conversion of a finished volume to labels.
pub(super) trait Relabel {
    /// Replaces each number by its `label`, 0 for an unused number.
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
    pub(super) fn finish(mut self, outdoors: bool) -> Watershed {
        // Numbers are given deepest first, in order of index, which is the order of the answer.
        let mut label = vec![0u32; self.pools.len()];
        let mut basins = Vec::new();
        for (n, pool) in self.pools.iter().enumerate() {
            if self.joined.find(n as u32) as usize != n || (n == 0 && !outdoors) {
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
            let root = self.joined.find(n as u32);
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
    labels.for_runs(0..labels.len(), |voxels, label| {
        counts[label as usize] += voxels.len() as u64;
    });
    for (basin, n) in basins.iter_mut().zip(&counts[1..]) {
        basin.n_voxels = *n;
    }
}
