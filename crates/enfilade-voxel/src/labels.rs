//! Labels of voxels in bricks of 4³.
//!
//! A brick of one label is one number. Another has a list of its labels, and for each voxel an index into it of 1, 2 or 4
//! bits; with more than 16 labels, it has one word for each voxel.
//!
//! Memory grows with the surfaces between labels rather than with volume: 1/16 byte a voxel, and a quarter of a byte for
//! those near a surface. A look-up reads up to three words; scans skip uniform bricks, 64 voxels at a time.

use std::ops::Range;

use rayon::prelude::*;

mod bricks;

use bricks::{Brick, MIXED, in_block, place};
pub(crate) use bricks::{EDGE, Layer};

/// The label of each voxel of a box, below 2³¹.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Labels {
    dims: [usize; 3],
    /// Layers of bricks along z, the last bricks along each axis filled up.
    layers: Vec<Layer>,
}

impl Labels {
    /// Labels all voxels of a box of `dims` by 0.
    #[must_use]
    pub fn zero(dims: [usize; 3]) -> Self {
        let [bx, by, bz] = dims.map(|n| n.div_ceil(EDGE));
        let layer = Layer {
            heads: vec![0; bx * by],
            blocks: Vec::new(),
        };
        Self {
            dims,
            layers: vec![layer; bz],
        }
    }

    /// Compresses labels given in index order. Linear in voxels; threads share the work.
    ///
    /// # Panics
    /// If there is not one for each voxel of a box of `dims`.
    #[must_use]
    pub fn of(dims: [usize; 3], labels: &[u32]) -> Self {
        let n: usize = dims.iter().product();
        assert_eq!(labels.len(), n, "a label for each voxel");
        if n == 0 {
            return Self::zero(dims);
        }
        let layers = labels.par_chunks(EDGE * dims[0] * dims[1]);
        let layer = |labels| Layer::of([dims[0], dims[1]], labels);
        Self::from_layers(dims, layers.map(layer).collect())
    }

    /// Labels a box of `dims` in layers of bricks: `fill(z, labels)` writes those of the layers of voxels from `z` on, which are 0.
    /// Threads share the work; besides the answer, each takes 16 bytes for each voxel of a layer.
    #[must_use]
    pub fn filled(dims: [usize; 3], fill: impl Fn(usize, &mut [u32]) + Sync) -> Self {
        let [nx, ny, nz] = dims;
        if dims.contains(&0) {
            return Self::zero(dims);
        }
        let layer = |labels: &mut Vec<u32>, z: usize| {
            labels.clear();
            labels.resize(nx * ny * EDGE.min(nz - z), 0);
            fill(z, labels);
            Layer::of([nx, ny], labels)
        };
        let starts: Vec<usize> = (0..nz).step_by(EDGE).collect();
        let layers = starts.into_par_iter().map_init(Vec::new, layer);
        Self::from_layers(dims, layers.collect())
    }

    /// Returns a box of `dims` of these layers.
    pub(crate) fn from_layers(dims: [usize; 3], layers: Vec<Layer>) -> Self {
        debug_assert_eq!(layers.len(), dims[2].div_ceil(EDGE), "layers of {dims:?}");
        Self { dims, layers }
    }

    /// Packs the layers, each by itself, for [`Self::unpacked`]. Threads share the work.
    #[must_use]
    pub fn packed(&self) -> Vec<Vec<u8>> {
        self.layers.par_iter().map(Layer::packed).collect()
    }

    /// Unpacks layers; `None` if they are not those of a box of `dims`.
    #[must_use]
    pub fn unpacked(dims: [usize; 3], layers: &[Vec<u8>]) -> Option<Self> {
        let [bx, by, bz] = dims.map(|n| n.div_ceil(EDGE));
        let layer = |bytes: &Vec<u8>| Layer::unpacked(bx * by, bytes);
        let layers: Vec<Layer> = layers.par_iter().map(layer).collect::<Option<_>>()?;
        (layers.len() == bz).then(|| Self::from_layers(dims, layers))
    }

    /// Returns the number of bricks along x.
    fn width(&self) -> usize {
        self.dims[0].div_ceil(EDGE)
    }

    /// Returns the number of voxels along each axis.
    #[must_use]
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Returns the number of voxels.
    #[must_use]
    pub fn len(&self) -> usize {
        self.dims.iter().product()
    }

    /// Returns `true` if there are no voxels.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of bytes that the labels take.
    #[must_use]
    pub fn memory(&self) -> usize {
        let words = |layer: &Layer| layer.heads.capacity() + layer.blocks.capacity();
        4 * self.layers.iter().map(words).sum::<usize>()
    }

    /// Returns the label of the voxel `[x, y, z]`; 0 if it is occupied.
    #[must_use]
    #[inline]
    pub fn at(&self, [x, y, z]: [usize; 3]) -> u32 {
        let layer = &self.layers[z / EDGE];
        let head = layer.heads[x / EDGE + self.width() * (y / EDGE)];
        if head & MIXED == 0 {
            return head;
        }
        layer.in_block(head, x % EDGE + EDGE * (y % EDGE + EDGE * (z % EDGE)))
    }

    /// Returns a reader of labels at places near each other.
    #[must_use]
    pub fn reader(&self) -> Reader<'_> {
        Reader {
            labels: self,
            width: self.width(),
            brick: [usize::MAX; 2],
            head: 0,
            block: &[],
            bits: 0,
        }
    }

    /// Returns the label of the voxel at `index`; 0 if it is occupied.
    #[must_use]
    #[inline]
    pub fn get(&self, index: usize) -> u32 {
        self.at(self.coords(index))
    }

    #[inline]
    fn coords(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        let row = index / nx;
        [index - row * nx, row % ny, row / ny]
    }

    /// Labels the voxel `[x, y, z]`.
    ///
    /// Space that a brick outgrows is not used again, so labels of many voxels are better replaced by [`Self::relabel`].
    pub fn set(&mut self, [x, y, z]: [usize; 3], label: u32) {
        let brick = x / EDGE + self.width() * (y / EDGE);
        let voxel = x % EDGE + EDGE * (y % EDGE + EDGE * (z % EDGE));
        self.layers[z / EDGE].set(brick, voxel, label);
    }

    /// Calls `run(voxels, label)` for each maximal run of voxels of a row with one label within `range`, ascending.
    pub fn for_runs(&self, range: Range<usize>, mut run: impl FnMut(Range<usize>, u32)) {
        let nx = self.dims[0];
        let mut from = range.start;
        while from < range.end {
            let [x, y, z] = self.coords(from);
            let to = range.end.min(from - x + nx);
            self.runs_of_row([y, z], x..x + to - from, |voxels, label| {
                run(from - x + voxels.start..from - x + voxels.end, label);
            });
            from = to;
        }
    }

    /// Calls `run(voxels, label)` for each maximal run within `along` in the row at y and z.
    fn runs_of_row(
        &self,
        [y, z]: [usize; 2],
        along: Range<usize>,
        mut run: impl FnMut(Range<usize>, u32),
    ) {
        let layer = &self.layers[z / EDGE];
        let heads = &layer.heads[self.width() * (y / EDGE)..][..self.width()];
        let row = EDGE * (y % EDGE + EDGE * (z % EDGE));
        let (mut start, mut label) = (along.start, None);
        let mut next = |x: usize, here: u32| {
            if let Some(before) = label.replace(here)
                && before != here
            {
                run(start..x, before);
                start = x;
            }
        };
        let mut x = along.start;
        while x < along.end {
            let head = heads[x / EDGE];
            let end = along.end.min((x / EDGE + 1) * EDGE);
            if head & MIXED == 0 {
                next(x, head);
            } else if let Some((list, words)) = layer.listed(head) {
                let width = place(head).1;
                let (bit, each) = (row << width, 1 << width);
                // All four lie in one word.
                let which = words[bit / 32] as usize >> (bit % 32);
                for x in x..end {
                    next(x, list[which >> (x % EDGE * each) & (list.len() - 1)]);
                }
            } else {
                (x..end).for_each(|x| next(x, layer.in_block(head, row + x % EDGE)));
            }
            x = end;
        }
        if let Some(label) = label {
            run(start..along.end, label);
        }
    }

    /// Returns all voxels of a layer of bricks that have a label, in no particular order.
    ///
    /// # Panics
    /// If the layer is outside the box.
    #[must_use]
    pub fn voxels_of(&self, label: u32, layer: usize) -> Vec<[usize; 3]> {
        let bx = self.width();
        let mut found = Vec::new();
        let of = &self.layers[layer];
        for (at, &head) in of.heads.iter().enumerate() {
            let may_be = match head & MIXED {
                0 => head == label,
                _ => of.listed(head).is_none_or(|l| l.0.contains(&label)),
            };
            if !may_be {
                continue;
            }
            let corner = [at % bx, at / bx, layer].map(|b| b * EDGE);
            for (voxel, &here) in of.brick(head).iter().enumerate() {
                let within = [voxel % EDGE, voxel / EDGE % EDGE, voxel / (EDGE * EDGE)];
                let at = [0, 1, 2].map(|k| corner[k] + within[k]);
                if here == label && (0..3).all(|k| at[k] < self.dims[k]) {
                    found.push(at);
                }
            }
        }
        found
    }

    /// Returns the number of layers of bricks, which [`Self::for_faces`] takes one by one.
    #[must_use]
    pub fn n_layers(&self) -> usize {
        self.layers.len()
    }

    /// Calls `face(voxel, axis, labels)` for each face between voxels of different labels, given the lesser voxel, for
    /// those in a layer of bricks and above it, in no particular order.
    ///
    /// # Panics
    /// If the layer is outside the box.
    pub fn for_faces(&self, layer: usize, mut face: impl FnMut(usize, usize, [u32; 2])) {
        let (bx, by) = (self.width(), self.dims[1].div_ceil(EDGE));
        let (of, after) = (&self.layers[layer], self.layers.get(layer + 1));
        for j in 0..by {
            for i in 0..bx {
                let at = i + bx * j;
                let here = of.heads[at];
                let nexts = [
                    (i + 1 < bx).then(|| (of, of.heads[at + 1])),
                    (j + 1 < by).then(|| (of, of.heads[at + bx])),
                    after.map(|after| (after, after.heads[at])),
                ];
                let is_alike =
                    |next: &Option<(&Layer, u32)>| next.is_none_or(|(_, next)| next == here);
                if here & MIXED == 0 && nexts.iter().all(is_alike) {
                    continue;
                }
                let brick = of.brick(here);
                let corner = [i, j, layer].map(|b| b * EDGE);
                for (axis, next) in nexts.into_iter().enumerate() {
                    let beyond = next.map(|(of, next)| of.brick(next));
                    self.faces_along(axis, corner, &brick, beyond.as_ref(), &mut face);
                }
            }
        }
    }

    /// Calls `face` for the faces across `axis` of a brick whose first voxel is `corner`, up to those of the brick `beyond`.
    fn faces_along(
        &self,
        axis: usize,
        corner: [usize; 3],
        brick: &Brick,
        beyond: Option<&Brick>,
        face: &mut impl FnMut(usize, usize, [u32; 2]),
    ) {
        let shift = axis * EDGE.ilog2() as usize;
        let step = 1 << shift;
        let last = step * (EDGE - 1);
        for (voxel, &label) in brick.iter().enumerate() {
            let is_last = (voxel >> shift) % EDGE == EDGE - 1;
            let other = match (is_last, beyond) {
                (false, _) => brick[voxel + step],
                (true, Some(beyond)) => beyond[voxel - last],
                (true, None) => continue,
            };
            if other == label {
                continue;
            }
            let within = [voxel % EDGE, voxel / EDGE % EDGE, voxel / (EDGE * EDGE)];
            let [x, y, z] = [0, 1, 2].map(|k| corner[k] + within[k]);
            let mut there = [x, y, z];
            there[axis] += 1;
            // Not past the end, where bricks are filled up.
            if (0..3).all(|k| there[k] < self.dims[k]) {
                let [nx, ny, _] = self.dims;
                face(x + nx * (y + ny * z), axis, [label, other]);
            }
        }
    }

    /// Replaces each label by `new(label, y)`. Threads share the work.
    pub fn relabel(&mut self, new: impl Fn(u32, usize) -> u32 + Sync) {
        if self.is_empty() {
            return;
        }
        let (bx, most) = (self.width(), self.dims[1] - 1);
        self.layers.par_iter_mut().for_each(|of| {
            let mut part = Layer::default();
            for (at, &head) in of.heads.iter().enumerate() {
                let from = at / bx * EDGE;
                // The new label, if it is the same at all heights of the brick.
                let level = |label: u32| {
                    let of = |y: usize| new(label, (from + y).min(most));
                    let first = of(0);
                    (1..EDGE).all(|y| of(y) == first).then_some(first)
                };
                if head & MIXED == 0 {
                    if let Some(label) = level(head) {
                        part.heads.push(label);
                        continue;
                    }
                } else if let Some((list, _)) = of.listed(head) {
                    // Most often, all labels of a brick become one.
                    let label = level(list[0]);
                    if label.is_some() && list[1..].iter().all(|&l| level(l) == label) {
                        part.heads.extend(label);
                        continue;
                    }
                }
                let mut brick = of.brick(head);
                for (voxel, label) in brick.iter_mut().enumerate() {
                    *label = new(*label, (from + voxel / EDGE % EDGE).min(most));
                }
                part.push(&brick);
            }
            part.blocks.shrink_to_fit();
            *of = part;
        });
    }

    /// Returns all labels in index order.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.len()).map(|i| self.get(i))
    }
}

/// Reads labels at places near each other: the brick of the last one is at hand.
#[derive(Debug)]
pub struct Reader<'a> {
    labels: &'a Labels,
    /// Bricks along x.
    width: usize,
    /// The brick of the last voxel in its layer, and the layer.
    brick: [usize; 2],
    head: u32,
    /// The block of the brick, and the bits of a voxel in it as a power of two.
    block: &'a [u32],
    bits: u32,
}

impl Reader<'_> {
    /// Returns the label of the voxel `[x, y, z]`; 0 if it is occupied.
    #[inline]
    pub fn at(&mut self, [x, y, z]: [usize; 3]) -> u32 {
        let brick = [x / EDGE + self.width * (y / EDGE), z / EDGE];
        if brick != self.brick {
            let layer = &self.labels.layers[brick[1]];
            self.brick = brick;
            self.head = layer.heads[brick[0]];
            if self.head & MIXED != 0 {
                let (from, bits) = place(self.head);
                (self.block, self.bits) = (&layer.blocks[from..], bits);
            }
        }
        if self.head & MIXED == 0 {
            return self.head;
        }
        in_block(
            self.block,
            self.bits,
            x % EDGE + EDGE * (y % EDGE + EDGE * (z % EDGE)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Labels of a box: runs of a few dozen voxels, or each of its own, out of so many.
    fn plain([nx, ny, nz]: [usize; 3], seed: u64, run: usize, many: u64) -> Vec<u32> {
        let hash = |i: usize| (i as u64 ^ seed).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32;
        let label = |i: usize| (hash(i / run) % many) as u32;
        (0..nx * ny * nz).map(label).collect()
    }

    fn box_and_labels() -> impl Strategy<Value = ([usize; 3], Vec<u32>)> {
        let sides = [1_usize..40, 1_usize..11, 1_usize..11];
        let of = |(dims, seed, run, many)| (dims, plain(dims, seed, run, many));
        (sides, any::<u64>(), 1_usize..60, 1_u64..40).prop_map(of)
    }

    proptest! {
        // Covers V8.
        #[test]
        fn each_voxel_keeps_its_label((dims, plain) in box_and_labels(), at in any::<u64>()) {
            let mut labels = Labels::of(dims, &plain);
            prop_assert!(labels.iter().eq(plain.iter().copied()));
            let mut reader = labels.reader();
            prop_assert!((0..plain.len()).all(|i| reader.at(labels.coords(i)) == plain[i]));
            let mut plain = plain;
            // One label more, then one that is there.
            for k in 0..40 {
                let i = (at.rotate_left(k) % plain.len() as u64) as usize;
                plain[i] = if k % 2 == 0 { 1000 + k } else { plain[0] };
                labels.set(labels.coords(i), plain[i]);
                prop_assert_eq!(labels.get(i), plain[i]);
            }
            prop_assert!(labels.iter().eq(plain.iter().copied()));
        }
    }

    proptest! {
        #[test]
        fn runs_are_maximal_and_cover_the_range_with_its_labels(
            (dims, plain) in box_and_labels(), cut in (0.0..0.5f64, 0.5..1.0f64),
        ) {
            let labels = Labels::of(dims, &plain);
            let [from, to] = [cut.0, cut.1].map(|share| (share * plain.len() as f64) as usize);
            let (mut next, mut last) = (from, None);
            labels.for_runs(from..to, |run, label| {
                let is_new_row = run.start % dims[0] == 0;
                assert!(run.start == next && run.end > next && (is_new_row || last != Some(label)));
                assert!(plain[run.clone()].iter().all(|&l| l == label));
                (next, last) = (run.end, Some(label));
            });
            prop_assert_eq!(next, to);
        }
    }

    proptest! {
        #[test]
        fn faces_and_new_labels_are_those_of_single_voxels((dims, plain) in box_and_labels()) {
            let mut labels = Labels::of(dims, &plain);
            let mut plain = plain;
            // The last voxel changes beside those that fill up its brick.
            *plain.last_mut().unwrap() = 77;
            labels.set(dims.map(|n| n - 1), 77);
            let [nx, ny, _] = dims;
            let mut found = Vec::new();
            for layer in 0..labels.n_layers() {
                labels.for_faces(layer, |i, axis, pair| found.push((i, axis, pair)));
            }
            let mut expected = Vec::new();
            for (i, &label) in plain.iter().enumerate() {
                let at = [i % nx, i / nx % ny, i / (nx * ny)];
                for (axis, step) in [1, nx, nx * ny].into_iter().enumerate() {
                    if at[axis] + 1 < dims[axis] && plain[i + step] != label {
                        expected.push((i, axis, [label, plain[i + step]]));
                    }
                }
            }
            found.sort_unstable();
            prop_assert_eq!(found, expected);
            let twos = (0..labels.n_layers()).flat_map(|layer| labels.voxels_of(2, layer));
            let mut twos: Vec<usize> = twos.map(|[x, y, z]| x + nx * (y + ny * z)).collect();
            twos.sort_unstable();
            let expected = (0..plain.len()).filter(|&i| plain[i] == 2);
            prop_assert!(twos.into_iter().eq(expected));
            // Some labels become the same, some differ by height.
            let new_label = |label: u32, y: usize| match label {
                0..3 => 5,
                3..6 => label + 100 * (y % 3) as u32,
                _ => label + 1000,
            };
            labels.relabel(new_label);
            let new = |(i, l): (usize, &u32)| new_label(*l, i / nx % ny);
            let new: Vec<u32> = plain.iter().enumerate().map(new).collect();
            prop_assert!(labels.iter().eq(new.iter().copied()));
            let mut fresh = Labels::of(dims, &plain);
            fresh.relabel(new_label);
            prop_assert_eq!(fresh, Labels::of(dims, &new));
        }
    }

    #[test]
    fn memory_goes_by_surface() {
        // Two halls of 64³ and 128³ voxels, each with a wall in the middle.
        let bytes = |n: usize| {
            let wall: Vec<u32> = (0..n.pow(3))
                .map(|i| u32::from(i / (n * n) > n / 2))
                .collect();
            Labels::of([n; 3], &wall).memory()
        };
        let heads = |n: usize| n.pow(3) / 16;
        assert_eq!(bytes(64) - heads(64), 16 * 64 * 64 / 16);
        assert_eq!(bytes(128) - heads(128), 16 * 128 * 128 / 16);
        assert_eq!(Labels::zero([0, 4, 4]).memory(), 0);
    }
}
