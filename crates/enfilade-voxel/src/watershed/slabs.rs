//! Labels by ascent, slab by slab, and the contacts between basins.

use std::sync::Mutex;

use enfilade_geom::Allowance;
use rayon::prelude::*;

use super::crests::{Crests, Shape, is_outdoors, level};

/// Least number of voxels of a slab, if there are as many: fewer are mostly border.
const SLAB: usize = 1 << 20;

/// Root of the outdoors; the root of a peak is one more than its number.
pub(super) const OUTER: u32 = 0;
const SOLID: u32 = u32::MAX;
const UNKNOWN: u32 = u32::MAX - 1;
/// Marks an ascent that leaves the slab; with [`ABOVE`], upward. The other bits are the position in the layer it comes to.
const EXIT: u32 = 1 << 31;
const ABOVE: u32 = 1 << 30;

/// Returns the number of layers of a slab: with fewer there are more borders to keep, with more a slab takes more memory.
pub(super) fn thickness(shape: Shape) -> usize {
    let least = SLAB.div_ceil(shape.layer());
    least.max((shape.dims[2] as f64).sqrt() as usize)
}

/// Contact of two roots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// Lesser root first.
    pub(super) pair: [u32; 2],
    /// Greatest level at which they touch.
    pub(super) level: u16,
    /// First voxel at that level with a neighbor in the other.
    pub(super) voxel: u32,
    pub(super) n_faces: u64,
}

impl Contact {
    fn add(&mut self, other: &Self) {
        self.n_faces += other.n_faces;
        let is_better = (other.level, self.voxel) > (self.level, other.voxel);
        if is_better {
            (self.level, self.voxel) = (other.level, other.voxel);
        }
    }
}

/// Merges contacts of the same pairs; sorts by pair.
pub(super) fn merged(mut contacts: Vec<Contact>) -> Vec<Contact> {
    contacts.sort_unstable_by_key(|c| (c.pair, c.voxel));
    contacts.dedup_by(|next, kept| {
        let is_same = next.pair == kept.pair;
        if is_same {
            kept.add(next);
        }
        is_same
    });
    contacts
}

/// The root of each voxel of a slab.
pub(super) enum Roots {
    /// The words of the slab hold positions in this list.
    Palette(Vec<u32>),
    /// More roots than words can tell.
    Each(Vec<u32>),
}

/// Roots of a layer as runs: a root, and the voxel at which the next one begins.
struct RootRuns(Vec<(u32, u32)>);

impl RootRuns {
    fn of(roots: &[u32]) -> Self {
        let mut end = 0;
        let run = |run: &[u32]| {
            end += run.len() as u32;
            (run[0], end)
        };
        Self(roots.chunk_by(|a, b| a == b).map(run).collect())
    }

    fn get(&self, at: u32) -> u32 {
        self.0[self.0.partition_point(|run| run.1 <= at)].0
    }

    fn write(&self, roots: &mut [u32]) {
        let mut from = 0;
        for &(root, to) in &self.0 {
            roots[from..to as usize].fill(root);
            from = to as usize;
        }
    }
}

/// Replaces the levels in `words` by roots; returns these by slabs of `thick` layers, and the contacts between roots.
///
/// Follows the ascents from the borders of slabs first, so that slabs can be labeled independently. An ascent ends at a voxel
/// whose root is known, so each voxel is passed about once.
pub(super) fn label(
    shape: Shape,
    words: &mut [u16],
    crests: &Crests,
    thick: usize,
    allowance: &Allowance,
) -> (Vec<Roots>, Vec<Contact>) {
    let layer = shape.layer();
    let n_slabs = shape.dims[2].div_ceil(thick);
    // The layers on either side of the borders between slabs.
    let beside: Vec<[Vec<u16>; 2]> = (1..n_slabs)
        .map(|s| [s * thick - 1, s * thick].map(|z| words[z * layer..(z + 1) * layer].to_vec()))
        .collect();
    let is_allowed =
        |(_, words): &(usize, &mut [u16])| allowance.spend(1 + words.len() as u64 / 16);
    // Buffers for one slab a thread, so that their memory is mapped once.
    let pool: Mutex<Vec<Buffers>> = Mutex::default();
    let take = || {
        pool.lock()
            .ok()
            .and_then(|mut pool| pool.pop())
            .unwrap_or_default()
    };
    let give = |buffers| {
        if let Ok(mut pool) = pool.lock() {
            pool.push(buffers);
        }
    };
    let borders: Vec<[RootRuns; 2]> = words
        .par_chunks_mut(thick * layer)
        .enumerate()
        .filter(is_allowed)
        .map(|(s, words)| {
            let first = s * thick * layer;
            let mut slab = Slab::new(shape, crests, first, words, halo(&beside, s), take());
            let borders = slab.borders();
            give(slab.buffers);
            borders
        })
        .collect();
    if borders.len() < n_slabs {
        return (Vec::new(), Vec::new());
    }
    let labeled: Vec<(Roots, Vec<Contact>)> = words
        .par_chunks_mut(thick * layer)
        .enumerate()
        .filter(is_allowed)
        .map(|(s, words)| {
            let first = s * thick * layer;
            let mut slab = Slab::new(shape, crests, first, words, halo(&beside, s), take());
            slab.enter(s, &borders);
            slab.ascend(slab.own());
            let contacts = slab.contacts();
            let roots = slab.write();
            give(slab.buffers);
            (roots, contacts)
        })
        .collect();
    let (roots, contacts): (Vec<_>, Vec<_>) = labeled.into_iter().unzip();
    (roots, merged(contacts.concat()))
}

/// Writes the way up from each voxel of a row, given the rows before it along z and y, and after it along y and z.
///
/// Without branches, so that several voxels are compared at once.
fn ways_along(wide: &[u16], [before_z, before_y, after_y, after_z]: [&[u16]; 4], ways: &mut [u8]) {
    let n = ways.len();
    let (left, here, right) = (&wide[..n], &wide[1..=n], &wide[2..]);
    let around = [
        &before_z[..n],
        &before_y[..n],
        left,
        right,
        &after_y[..n],
        &after_z[..n],
    ];
    for x in 0..n {
        let (mut most, mut way) = (0, 0);
        for (words, code) in around.iter().zip(0..) {
            let there = level(words[x]) as i16; // below 2^14
            way = if there >= most { code } else { way };
            most = most.max(there);
        }
        let is_crest = most <= level(here[x]) as i16;
        ways[x] = if is_crest { CREST } else { way } as u8;
    }
}

/// Returns the layers on either side of slab `s`.
fn halo(beside: &[[Vec<u16>; 2]], s: usize) -> [Option<&[u16]>; 2] {
    let below = s.checked_sub(1).map(|at| &beside[at][0][..]);
    [below, beside.get(s).map(|beside| &beside[1][..])]
}

/// Returns the root behind `exit` from slab `s`: the one in the slab that it leads to, and so on.
fn behind(borders: &[[RootRuns; 2]], mut s: usize, mut exit: u32) -> u32 {
    while (EXIT..UNKNOWN).contains(&exit) {
        let at = exit & (ABOVE - 1);
        exit = if exit & ABOVE == 0 {
            s -= 1;
            borders[s][1].get(at)
        } else {
            s += 1;
            borders[s][0].get(at)
        };
    }
    exit
}

/// A slab of the box, with a layer on either side.
struct Slab<'a> {
    shape: Shape,
    crests: &'a Crests,
    /// Index of the first voxel of the layer below it.
    base: usize,
    /// Own words.
    words: &'a mut [u16],
    /// Words of the layers below and above.
    beside: [Option<&'a [u16]>; 2],
    buffers: Buffers,
}

/// Memory for a slab.
#[derive(Default)]
struct Buffers {
    /// Way up from each own voxel: position in the order of its neighbors, or [`CREST`].
    ways: Vec<u8>,
    /// Roots of the layer below, of own voxels, and of the layer above.
    roots: Vec<u32>,
}

/// A way that ends, or runs along a plateau.
const CREST: i16 = 6;

impl<'a> Slab<'a> {
    fn new(
        shape: Shape,
        crests: &'a Crests,
        first: usize,
        words: &'a mut [u16],
        beside: [Option<&'a [u16]>; 2],
        mut buffers: Buffers,
    ) -> Self {
        let layer = shape.layer();
        let roots = &mut buffers.roots;
        roots.clear();
        let add_layer = |roots: &mut Vec<u32>, beside: Option<&[u16]>, side: u32| match beside {
            Some(_) => roots.extend((0..layer as u32).map(|at| side | at)),
            None => roots.extend(std::iter::repeat_n(SOLID, layer)),
        };
        add_layer(roots, beside[0], EXIT);
        roots.extend(words.iter().map(|&word| match word {
            0 => SOLID,
            word if is_outdoors(word) => OUTER,
            _ => UNKNOWN,
        }));
        add_layer(roots, beside[1], EXIT | ABOVE);
        let mut slab = Self {
            shape,
            crests,
            base: first.wrapping_sub(layer),
            words,
            beside,
            buffers,
        };
        slab.find_ways();
        slab
    }

    /// Returns the words of a row, counted from the layer below; none outside the box.
    fn row(&self, row: usize) -> Option<&[u16]> {
        let [nx, ny, _] = self.shape.dims;
        if row < ny {
            return self.beside[0].map(|words| &words[row * nx..][..nx]);
        }
        let at = (row - ny) * nx;
        if at < self.words.len() {
            return Some(&self.words[at..][..nx]);
        }
        self.beside[1].map(|words| &words[at - self.words.len()..][..nx])
    }

    /// Returns the level of a voxel counted from the layer below.
    fn level(&self, at: usize) -> u16 {
        let nx = self.shape.dims[0];
        self.row(at / nx).map_or(0, |row| level(row[at % nx]))
    }

    /// Finds the way up from each own voxel: to the highest neighbor, the last of several.
    fn find_ways(&mut self) {
        let [nx, ny, _] = self.shape.dims;
        let nothing = vec![0_u16; nx];
        // A row with a voxel before and after it.
        let mut wide = vec![0_u16; nx + 2];
        let mut ways = std::mem::take(&mut self.buffers.ways);
        ways.resize(self.words.len(), 0);
        for (ways, row) in ways.chunks_exact_mut(nx).zip(ny..) {
            let y = row % ny;
            let is_in = [true, y > 0, y + 1 < ny, true];
            let rows = [row - ny, row - 1, row + 1, row + ny];
            let row_at = |k: usize| is_in[k].then(|| self.row(rows[k])).flatten();
            let rows: [&[u16]; 4] = std::array::from_fn(|k| row_at(k).unwrap_or(&nothing));
            wide[1..=nx].copy_from_slice(&self.words[(row - ny) * nx..][..nx]);
            ways_along(&wide, rows, ways);
        }
        self.buffers.ways = ways;
    }

    /// Returns the own voxels, counted from the layer below.
    fn own(&self) -> std::ops::Range<usize> {
        let layer = self.shape.layer();
        layer..layer + self.words.len()
    }

    /// Finds the roots of own `voxels`, counted from the layer below.
    fn ascend(&mut self, voxels: std::ops::Range<usize>) {
        let [nx, layer] = [self.shape.dims[0], self.shape.layer()];
        let [row, slice] = [nx as isize, layer as isize];
        let steps = [-slice, -row, -1, 1, row, slice];
        let mut path: Vec<usize> = Vec::new();
        for voxel in voxels {
            let mut at = voxel;
            let root = loop {
                let root = self.buffers.roots[at];
                if root != UNKNOWN {
                    break root;
                }
                path.push(at);
                match steps.get(usize::from(self.buffers.ways[at - layer])) {
                    Some(&step) => at = at.wrapping_add_signed(step),
                    None => match self.along(at) {
                        Ok(next) => at = next,
                        Err(root) => break root,
                    },
                }
            };
            for at in path.drain(..) {
                self.buffers.roots[at] = root;
            }
        }
    }

    /// Returns the next voxel of the ascent from a crest voxel, or its root.
    fn along(&self, at: usize) -> Result<usize, u32> {
        let voxel = at.wrapping_add(self.base);
        let level = |q: usize| self.level(q.wrapping_sub(self.base));
        match self.crests.ascend(self.shape, level, voxel) {
            Ok(next) => Ok(next.wrapping_sub(self.base)),
            Err(peak) => Err(peak + 1),
        }
    }

    /// Returns the roots of the first and last own layer, which may be exits.
    fn borders(&mut self) -> [RootRuns; 2] {
        let layer = self.shape.layer();
        let own = self.own();
        [own.start, own.end - layer].map(|from| {
            self.ascend(from..from + layer);
            RootRuns::of(&self.buffers.roots[from..from + layer])
        })
    }

    /// Puts the roots of the layers beside slab `s` in place.
    fn enter(&mut self, s: usize, borders: &[[RootRuns; 2]]) {
        let (layer, end) = (self.shape.layer(), self.own().end);
        let below = s.checked_sub(1).map(|s| (s, 1, 0..layer));
        let above = (s + 1 < borders.len()).then(|| (s + 1, 0, end..end + layer));
        for (of, side, range) in below.into_iter().chain(above) {
            let roots = &mut self.buffers.roots[range];
            borders[of][side].write(roots);
            for root in roots {
                *root = behind(borders, of, *root);
            }
        }
    }

    /// Returns the contacts across the faces from own voxels to the next ones.
    fn contacts(&self) -> Vec<Contact> {
        let [nx, ny, _] = self.shape.dims;
        let layer = nx * ny;
        let mut all: Vec<Contact> = Vec::new();
        let mut add = |here: usize, there: usize| {
            let [a, b] = [here, there].map(|at| self.buffers.roots[at]);
            if a == SOLID || b == SOLID {
                return;
            }
            let [low, high] = [here, there].map(|at| self.level(at));
            let (level, at) = if low <= high {
                (low, here)
            } else {
                (high, there)
            };
            let contact = Contact {
                pair: [a.min(b), a.max(b)],
                level,
                voxel: at.wrapping_add(self.base) as u32,
                n_faces: 1,
            };
            match all.last_mut() {
                Some(last) if last.pair == contact.pair => last.add(&contact),
                _ => all.push(contact),
            }
        };
        let mut meet = |here: usize, there: usize, n: usize| {
            let roots = self.buffers.roots[here..here + n]
                .iter()
                .zip(&self.buffers.roots[there..there + n]);
            for (k, (a, b)) in roots.enumerate() {
                if a != b {
                    add(here + k, there + k);
                }
            }
        };
        for from in self.own().step_by(nx) {
            meet(from, from + 1, nx - 1);
            if from / nx % ny + 1 < ny {
                meet(from, from + nx, nx);
            }
            meet(from, from + layer, nx);
        }
        merged(all)
    }

    /// Writes positions in a list of the roots, 0 for solid, if words can hold them.
    fn write(&mut self) -> Roots {
        let own = &self.buffers.roots[self.own()];
        let mut palette = vec![SOLID];
        let mut position = vec![0_u16; self.crests.peaks.len() + 1];
        for (word, &root) in self.words.iter_mut().zip(own) {
            if root == SOLID {
                *word = 0;
                continue;
            }
            let position = &mut position[root as usize];
            if *position == 0 {
                let Ok(fresh) = u16::try_from(palette.len()) else {
                    return Roots::Each(own.to_vec());
                };
                palette.push(root);
                *position = fresh;
            }
            *word = *position;
        }
        Roots::Palette(palette)
    }
}
