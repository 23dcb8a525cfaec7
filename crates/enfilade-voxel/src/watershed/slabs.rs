//! Labels by ascent, slab by slab, and the contacts between basins.

use std::sync::Mutex;

use enfilade_geom::Allowance;
use rayon::prelude::*;

use super::super::labels::{EDGE, Labels, Layer};
use super::crests::Crests;
use super::levels::{Levels, is_outdoors, level};
use super::shape::Shape;

/// Least number of voxels of a slab, if there are as many: fewer are mostly border.
const LEAST: usize = 1 << 20;
/// Greatest number, unless layers are large: more take more memory.
const MOST: usize = 1 << 23;
/// Number of layers that a slab may have in any case.
const THICK: usize = 12;

/// Root of the outdoors; the root of a peak is one more than its number.
pub(super) const OUTER: u32 = 0;
const SOLID: u32 = u32::MAX;
const UNKNOWN: u32 = u32::MAX - 1;
/// Marks an ascent that leaves the slab; with [`ABOVE`], upward. The other bits are the position in the layer it comes to.
const EXIT: u32 = 1 << 31;
const ABOVE: u32 = 1 << 30;

/// Returns the number of layers of a slab: whole bricks of labels.
pub(super) fn thickness(shape: Shape) -> usize {
    let enough = (LEAST / shape.layer()).max((shape.dims[2] as f64).sqrt() as usize);
    let most = (MOST / shape.layer()).max(THICK);
    enough.min(most).next_multiple_of(EDGE).max(EDGE)
}

/// Returns the memory that each thread takes for a slab: [`Buffers`] with a layer on either side. [Units: bytes]
pub(super) fn bytes_of_slab(shape: Shape) -> usize {
    let thick = thickness(shape).min(shape.dims[2]);
    let each = size_of::<u8>() + size_of::<u32>() + size_of::<u16>();
    (thick + 2) * shape.layer() * each
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

/// Roots of a layer as runs, and its number of voxels.
struct RootRuns(Vec<RootRun>, u32);

/// Voxels one after the other with one root, or with exits one after the other.
struct RootRun {
    root: u32,
    /// First voxel, and in the highest bit the difference from each root to the next. The run ends where the next one begins.
    start: u32,
}

/// Marks a run whose roots differ by 1.
const RISING: u32 = 1 << 31;

impl RootRun {
    fn first(&self) -> u32 {
        self.start & !RISING
    }

    fn get(&self, at: u32) -> u32 {
        self.root + (self.start >> 31) * (at - self.first())
    }
}

impl RootRuns {
    fn of(roots: &[u32]) -> Self {
        let mut runs: Vec<RootRun> = Vec::new();
        for (at, &root) in (0..).zip(roots) {
            if let Some(run) = runs.last_mut() {
                let is_second = at - run.first() == 1;
                if is_second && is_exit(root) && root == run.root.wrapping_add(1) {
                    run.start |= RISING;
                }
                if root == run.get(at) {
                    continue;
                }
            }
            runs.push(RootRun { root, start: at });
        }
        runs.shrink_to_fit();
        Self(runs, roots.len() as u32)
    }

    fn get(&self, at: u32) -> u32 {
        let after = self.0.partition_point(|run| run.first() <= at);
        self.0[after - 1].get(at)
    }

    fn write(&self, roots: &mut [u32]) {
        let ends = self.0.iter().skip(1).map(RootRun::first);
        for (run, end) in self.0.iter().zip(ends.chain([self.1])) {
            for (at, root) in (run.first()..end).zip(&mut roots[run.first() as usize..]) {
                *root = run.get(at);
            }
        }
    }

    /// Returns the roots behind these of slab `s`: with exits, there are many more runs.
    fn resolved(&self, s: usize, borders: &[[Self; 2]]) -> Self {
        let mut roots = vec![0; self.1 as usize];
        self.write(&mut roots);
        for root in &mut roots {
            *root = behind(borders, s, *root);
        }
        Self::of(&roots)
    }
}

fn is_exit(root: u32) -> bool {
    (EXIT..UNKNOWN).contains(&root)
}

/// Returns one more than the root of each voxel, 0 for solid ones, and the contacts between roots; `None` if the allowance is
/// over.
///
/// Follows the ascents from the borders of slabs of `thick` layers first, so that slabs can be labeled independently. An
/// ascent ends at a voxel whose root is known, so each voxel is passed about once.
pub(super) fn label(
    shape: Shape,
    levels: &Levels,
    crests: &Crests,
    thick: usize,
    allowance: &Allowance,
) -> Option<(Labels, Vec<Contact>)> {
    let field = Field {
        shape,
        levels,
        crests,
        thick,
        pool: Mutex::default(),
    };
    let n_slabs = shape.dims[2].div_ceil(thick);
    let is_allowed = |s: &usize| allowance.spend(1 + shape.n_of_slab(*s, thick) as u64 / 16);
    let slabs = || (0..n_slabs).into_par_iter().filter(is_allowed);
    let borders: Vec<[RootRuns; 2]> = slabs()
        .map(|s| field.with_slab(s, |slab, _| slab.borders()))
        .collect();
    if borders.len() < n_slabs {
        return None;
    }
    let resolved =
        |(s, of): (usize, &[RootRuns; 2])| [0, 1].map(|side| of[side].resolved(s, &borders));
    let borders: Vec<[RootRuns; 2]> = borders.par_iter().enumerate().map(resolved).collect();
    let all_of = |slab: &mut Slab<'_>, s: usize| {
        slab.enter(s, &borders);
        slab.ascend(slab.own());
        let contacts = slab.contacts();
        (slab.write(), contacts)
    };
    let labeled: Vec<(Vec<Layer>, Vec<Contact>)> =
        slabs().map(|s| field.with_slab(s, all_of)).collect();
    if labeled.len() < n_slabs {
        return None;
    }
    let (layers, contacts): (Vec<_>, Vec<_>) = labeled.into_iter().unzip();
    let layers = layers.into_iter().flatten().collect();
    let labels = Labels::from_layers(shape.dims, layers);
    Some((labels, merged(contacts.concat())))
}

/// A field that is worked on slab by slab.
struct Field<'a> {
    shape: Shape,
    levels: &'a Levels,
    crests: &'a Crests,
    /// Layers of a slab.
    thick: usize,
    /// Buffers for one slab a thread, so that their memory is mapped once.
    pool: Mutex<Vec<Buffers>>,
}

impl Field<'_> {
    /// Reads slab `s`, and returns the result of `work` on it.
    fn with_slab<T>(&self, s: usize, work: impl FnOnce(&mut Slab<'_>, usize) -> T) -> T {
        let spare = self.pool.lock().ok().and_then(|mut pool| pool.pop());
        let mut buffers = spare.unwrap_or_default();
        let mut words = std::mem::take(&mut buffers.words);
        let mut slab = Slab::new(self, s, &mut words, buffers);
        let result = work(&mut slab, s);
        let buffers = slab.buffers;
        if let Ok(mut pool) = self.pool.lock() {
            pool.push(Buffers { words, ..buffers });
        }
        result
    }
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

/// Returns the root behind `exit` from slab `s`: the one in the slab that it leads to, and so on.
fn behind(borders: &[[RootRuns; 2]], mut s: usize, mut exit: u32) -> u32 {
    while is_exit(exit) {
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
    words: &'a [u16],
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
    /// Words, if they are packed.
    words: Vec<u16>,
}

/// A way that ends, or runs along a plateau.
const CREST: i16 = 6;

impl<'a> Slab<'a> {
    fn new(field: &Field<'a>, s: usize, words: &'a mut Vec<u16>, mut buffers: Buffers) -> Self {
        let Field {
            shape,
            levels,
            crests,
            thick,
            ..
        } = *field;
        let (layer, nz) = (shape.layer(), shape.dims[2]);
        let (from, to) = (s * thick, nz.min((s + 1) * thick));
        let read = [from.saturating_sub(1), nz.min(to + 1)];
        let words = levels.read(shape, read, words);
        let (below, words) = words.split_at((from - read[0]) * layer);
        let (words, above) = words.split_at((to - from) * layer);
        let beside = [below, above].map(|words| (!words.is_empty()).then_some(words));
        let first = from * layer;
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

    /// Puts the roots of the layers beside slab `s` in place, given those of all borders.
    fn enter(&mut self, s: usize, borders: &[[RootRuns; 2]]) {
        let (layer, end) = (self.shape.layer(), self.own().end);
        let below = s.checked_sub(1).map(|s| (s, 1, 0..layer));
        let above = (s + 1 < borders.len()).then(|| (s + 1, 0, end..end + layer));
        for (of, side, range) in below.into_iter().chain(above) {
            borders[of][side].write(&mut self.buffers.roots[range]);
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

    /// Compresses one more than each root, 0 for solid.
    fn write(&mut self) -> Vec<Layer> {
        let [nx, ny, _] = self.shape.dims;
        let own = self.own();
        let roots = &mut self.buffers.roots[own];
        for root in &mut *roots {
            *root = root.wrapping_add(1);
        }
        let layers = roots.chunks(EDGE * nx * ny);
        layers.map(|roots| Layer::of([nx, ny], roots)).collect()
    }
}
