//! Bricks of labels, a layer of them at a time.

/// Edge of a brick. [Units: vx]
pub(crate) const EDGE: usize = 4;
/// Voxels of a brick.
const VOLUME: usize = EDGE * EDGE * EDGE;
/// Marks the head of a brick of several labels; two more bits tell how many bits a voxel takes, the rest is the
/// position of its block.
pub(super) const MIXED: u32 = 1 << 31;
const WIDTH_SHIFT: u32 = 29;
const POSITION: u32 = (1 << WIDTH_SHIFT) - 1;
/// Words that a position counts.
const UNIT: usize = 4;
/// A width that stands for one word a voxel, without a list.
const PLAIN: u32 = 3;

/// The labels of one brick.
pub(super) type Brick = [u32; VOLUME];

/// A layer of bricks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Layer {
    /// The label of each brick, or where its block is.
    pub(super) heads: Vec<u32>,
    /// Blocks: the labels of a brick, then the position of each voxel among them.
    pub(super) blocks: Vec<u32>,
}

/// Returns the label of a voxel of the brick whose block begins here, given the bits of a voxel in it as a power of two.
#[inline]
pub(super) fn in_block(block: &[u32], bits: u32, voxel: usize) -> u32 {
    if bits == PLAIN {
        return block[voxel];
    }
    let listed = 1 << (1 << bits);
    let bit = voxel << bits;
    block[block[listed + bit / 32] as usize >> (bit % 32) & (listed - 1)]
}

impl Layer {
    /// Compresses up to four layers of `nx` by `ny` labels.
    pub(crate) fn of([nx, ny]: [usize; 2], labels: &[u32]) -> Self {
        let mut layer = Self::default();
        let last = labels.len() / (nx * ny) - 1;
        let row = |row: usize| &labels[row * nx..][..nx];
        // For each brick of a row, the bits in which some label of it differs from its first.
        let mut differs: Vec<u32> = Vec::new();
        for j in 0..ny.div_ceil(EDGE) {
            let row = |y: usize, z: usize| row((j * EDGE + y).min(ny - 1) + ny * z.min(last));
            let first = row(0, 0).iter().step_by(EDGE);
            differs.clear();
            differs.resize(nx.div_ceil(EDGE), 0);
            for k in 0..EDGE * EDGE {
                let bricks = row(k % EDGE, k / EDGE).chunks(EDGE);
                for ((differs, labels), first) in differs.iter_mut().zip(bricks).zip(first.clone())
                {
                    *differs |= labels.iter().fold(0, |d, l| d | (l ^ first));
                }
            }
            for ((i, &differs), &first) in differs.iter().enumerate().zip(first) {
                if differs == 0 {
                    assert!(first < MIXED, "labels below 2^31");
                    layer.heads.push(first);
                } else {
                    layer.push(&gather(i, row));
                }
            }
        }
        layer.blocks.shrink_to_fit();
        layer
    }

    /// Packs the heads, then the blocks.
    pub(super) fn packed(&self) -> Vec<u8> {
        let words: Vec<u32> = self.heads.iter().chain(&self.blocks).copied().collect();
        lz4_flex::block::compress_prepend_size(bytemuck::cast_slice(&words))
    }

    /// Unpacks a layer of `n` bricks; `None` if it is none.
    pub(super) fn unpacked(n: usize, bytes: &[u8]) -> Option<Self> {
        let bytes = lz4_flex::block::decompress_size_prepended(bytes).ok()?;
        let words = bytes.as_chunks::<4>().0.iter();
        let words: Vec<u32> = words.map(|&word| u32::from_ne_bytes(word)).collect();
        let (heads, blocks) = words.split_at_checked(n)?;
        // A block of each mixed brick lies within.
        let is_whole = |&head: &u32| head & MIXED == 0 || block_end(head) <= blocks.len();
        heads.iter().all(is_whole).then(|| Self {
            heads: heads.to_vec(),
            blocks: blocks.to_vec(),
        })
    }

    pub(super) fn push(&mut self, brick: &Brick) {
        self.heads.push(encode(brick, &mut self.blocks));
    }

    #[inline]
    pub(super) fn in_block(&self, head: u32, voxel: usize) -> u32 {
        let (from, bits) = place(head);
        in_block(&self.blocks[from..], bits, voxel)
    }

    /// Labels a voxel of brick `at`.
    pub(super) fn set(&mut self, at: usize, voxel: usize, label: u32) {
        let head = self.heads[at];
        if self.in_brick(head, voxel) == label {
            return;
        }
        if head & MIXED != 0 {
            let (from, width) = place(head);
            let listed = 1 << (1 << width);
            if width == PLAIN {
                self.blocks[from + voxel] = label;
                return;
            }
            let list = &self.blocks[from..from + listed];
            if let Some(which) = list.iter().position(|&l| l == label) {
                let bit = voxel << width;
                let word = &mut self.blocks[from + listed + bit / 32];
                *word &= !((listed as u32 - 1) << (bit % 32));
                *word |= (which as u32) << (bit % 32);
                return;
            }
        }
        let mut brick = self.brick(head);
        brick[voxel] = label;
        self.heads[at] = encode(&brick, &mut self.blocks);
    }

    fn in_brick(&self, head: u32, voxel: usize) -> u32 {
        if head & MIXED == 0 {
            head
        } else {
            self.in_block(head, voxel)
        }
    }

    /// Returns the list of a brick of several labels and the words with the positions in it, unless it has none.
    pub(super) fn listed(&self, head: u32) -> Option<(&[u32], &[u32])> {
        let (from, width) = place(head);
        let lists = (width != PLAIN).then(|| self.blocks[from..].split_at(1 << (1 << width)));
        lists.map(|(list, words)| (list, &words[..VOLUME << width >> 5]))
    }

    /// Returns all labels of a brick.
    pub(super) fn brick(&self, head: u32) -> Brick {
        if head & MIXED == 0 {
            return [head; VOLUME];
        }
        let (from, width) = place(head);
        let mut brick = [0; VOLUME];
        let Some((list, words)) = self.listed(head) else {
            brick.copy_from_slice(&self.blocks[from..from + VOLUME]);
            return brick;
        };
        let each = 1 << width;
        for (voxels, &word) in brick.chunks_exact_mut(32 / each).zip(words) {
            for (k, label) in voxels.iter_mut().enumerate() {
                *label = list[word as usize >> (k * each) & (list.len() - 1)];
            }
        }
        brick
    }
}

/// Collects the labels of the brick `i` of rows, those past the end from the last voxel.
fn gather<'a>(i: usize, row: impl Fn(usize, usize) -> &'a [u32]) -> Brick {
    let mut brick = [0; VOLUME];
    for (k, to) in brick.chunks_exact_mut(EDGE).enumerate() {
        let row = row(k % EDGE, k / EDGE);
        let from = &row[i * EDGE..row.len().min((i + 1) * EDGE)];
        if let Ok(from) = <[u32; EDGE]>::try_from(from) {
            to.copy_from_slice(&from);
        } else {
            to.fill(from[from.len() - 1]);
            to[..from.len()].copy_from_slice(from);
        }
    }
    brick
}

/// Returns the head of a brick, whose block, if it needs one, is added to `blocks`.
fn encode(brick: &Brick, blocks: &mut Vec<u32>) -> u32 {
    let first = brick[0];
    if brick.iter().fold(0, |d, l| d | (l ^ first)) == 0 {
        assert!(first < MIXED, "labels below 2^31");
        return first;
    }
    let at = position(blocks.len());
    // Labels in the order in which they appear, and the positions of voxels among them.
    let mut list = [first; 16];
    let mut which = [0_u8; VOLUME];
    let (mut n, mut last) = (1, 0);
    for (which, &label) in which.iter_mut().zip(brick) {
        if list[last] != label {
            last = match list[..n].iter().position(|&l| l == label) {
                Some(known) => known,
                None if n == list.len() => {
                    blocks.extend_from_slice(brick);
                    return MIXED | PLAIN << WIDTH_SHIFT | at;
                }
                None => {
                    list[n] = label;
                    n += 1;
                    n - 1
                }
            };
        }
        *which = last as u8;
    }
    let width = match n {
        ..=2 => 0,
        3..=4 => 1,
        _ => 2,
    };
    let (each, listed) = (1 << width, 1 << (1 << width));
    blocks.extend_from_slice(&list[..listed]);
    blocks.extend(which.chunks_exact(32 / each).map(|voxels| {
        let shifted = voxels.iter().enumerate();
        shifted.fold(0, |word, (k, &v)| word | u32::from(v) << (k * each))
    }));
    MIXED | width << WIDTH_SHIFT | at
}

/// Returns the first word of a block and its width, given its brick's head.
#[inline]
pub(super) fn place(head: u32) -> (usize, u32) {
    let width = head >> WIDTH_SHIFT & 3;
    ((head & POSITION) as usize * UNIT, width)
}

/// Returns the word after a block, given its brick's head.
fn block_end(head: u32) -> usize {
    let (from, width) = place(head);
    from + if width == PLAIN {
        VOLUME
    } else {
        (1 << (1 << width)) + (VOLUME << width >> 5)
    }
}

/// Returns the position of a block that begins at a word.
fn position(word: usize) -> u32 {
    let at = u32::try_from(word / UNIT).ok();
    at.filter(|&at| at <= POSITION)
        .expect("a layer below 8 GiB")
}
