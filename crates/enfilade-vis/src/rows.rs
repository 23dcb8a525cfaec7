//! Rows of a block of cells as bytes, and the answer that the rows of all blocks make together.
//!
//! A row lists the cells seen as runs, each as the gap before it and its length, in variable-length numbers; the whole
//! is compressed, and a checksum covers the block's key, too. A pair of cells of two blocks is in the row of one of them only, so rows of a
//! graph's blocks are united with what they say the other way round. That is a union of sets: blocks may come in any
//! order, and twice.

use std::io::{Read, Write};

use enfilade_cpg::Pvs;
use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;

use crate::checkpoint::front;

const MAGIC: &[u8; 8] = b"ENFVBLK2";

/// Pairs turned round at a time, which bounds the memory for it. [Units: 4 bytes]
const MOST_TURNED: usize = 1 << 23;

/// Cells that might be seen from a cell, as runs: first cell and one past the last, ascending.
pub(crate) type Runs = Vec<[u32; 2]>;

/// Row of a cell.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CellRow {
    pub(crate) cell: u32,
    /// Cells that might be seen, itself included.
    pub(crate) seen: Runs,
    /// Those of `seen` that no line proves.
    pub(crate) undecided: Runs,
}

/// Results for a block of cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct BlockRows {
    /// Rows, ascending by cell.
    pub(crate) rows: Vec<CellRow>,
    /// Counts of [`VisOutput`](crate::VisOutput).
    pub(crate) n_base: u64,
    pub(crate) n_steps: u64,
    pub(crate) n_lines: u64,
}

/// Returns ascending numbers as runs.
pub(crate) fn runs_of(ascending: impl IntoIterator<Item = u32>) -> Runs {
    let mut runs: Runs = Vec::new();
    for cell in ascending {
        match runs.last_mut() {
            Some(run) if run[1] == cell => run[1] += 1,
            _ => runs.push([cell, cell + 1]),
        }
    }
    runs
}

/// Writes a number, seven bits a byte, the lowest first.
fn put(out: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

fn put_runs(out: &mut Vec<u8>, runs: &Runs) {
    put(out, runs.len() as u64);
    let mut at = 0;
    for &[first, end] in runs {
        put(out, u64::from(first - at));
        put(out, u64::from(end - first));
        at = end;
    }
}

impl BlockRows {
    pub(crate) fn encode(&self, key: u64) -> Vec<u8> {
        let mut body = Vec::new();
        let counts = [
            self.n_base,
            self.n_steps,
            self.n_lines,
            self.rows.len() as u64,
        ];
        counts.into_iter().for_each(|n| put(&mut body, n));
        let mut before = 0;
        for row in &self.rows {
            put(&mut body, u64::from(row.cell - before));
            before = row.cell;
            put_runs(&mut body, &row.seen);
            put_runs(&mut body, &row.undecided);
        }
        // Writing to memory cannot fail; if it did, the empty block would be refused later.
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
        let written = encoder.write_all(&body).and_then(|()| encoder.finish());
        let packed = written.unwrap_or_default();
        let front = front(*MAGIC, key, &packed);
        [front.as_flattened(), &packed].concat()
    }

    /// Reads the rows of `cells`, ascending numbers, in a graph of `n_cells`. `None` if the bytes are damaged or not
    /// theirs.
    pub(crate) fn decode(bytes: &[u8], key: u64, cells: &[u32], n_cells: u32) -> Option<Self> {
        let (head, packed) = bytes.split_at_checked(24)?;
        if head != front(*MAGIC, key, packed).as_flattened() {
            return None;
        }
        // A row has at most as many runs as cells, of two numbers with at most ten bytes.
        let most = 64 + (cells.len() as u64).saturating_mul(u64::from(n_cells) * 40 + 40);
        let mut body = Vec::new();
        let decoder = ZlibDecoder::new(packed);
        decoder.take(most).read_to_end(&mut body).ok()?;
        let mut reader = Numbers(&body);
        let [n_base, n_steps, n_lines] = [reader.next()?, reader.next()?, reader.next()?];
        if reader.next()? != cells.len() as u64 {
            return None;
        }
        let mut before = 0;
        let mut rows = Vec::with_capacity(cells.len());
        for &cell in cells {
            if reader.next()? != u64::from(cell - before) {
                return None;
            }
            before = cell;
            rows.push(CellRow {
                cell,
                seen: reader.runs(n_cells)?,
                undecided: reader.runs(n_cells)?,
            });
        }
        reader.0.is_empty().then_some(Self {
            rows,
            n_base,
            n_steps,
            n_lines,
        })
    }
}

/// Bytes from which numbers are read.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn next(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let (&byte, rest) = self.0.split_first()?;
            self.0 = rest;
            number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(number);
            }
        }
        None
    }

    /// Reads ascending runs of numbers below `n`.
    fn runs(&mut self, n: u32) -> Option<Runs> {
        let n_runs = self.next()?;
        let mut runs = Vec::new();
        let mut at = 0u64;
        for _ in 0..n_runs {
            let first = at.checked_add(self.next()?)?;
            let end = first.checked_add(self.next()?)?;
            if end <= first || end > u64::from(n) {
                return None;
            }
            runs.push([first as u32, end as u32]);
            at = end;
        }
        Some(runs)
    }
}

/// Returns the symmetric union of rows, one for each of `n_cells` cells: a cell without a row sees itself if
/// `is_alone_in`.
///
/// `rows` are ascending by cell. Memory: the result, and 32 MiB.
pub(crate) fn united(rows: &[(u32, &Runs)], n_cells: u32, is_alone_in: bool) -> Pvs {
    let n = n_cells as usize;
    // Number of rows that a cell is in, by differences first.
    let mut counts = vec![0i64; n + 1];
    for &[first, end] in rows.iter().flat_map(|(_, runs)| runs.iter()) {
        counts[first as usize] += 1;
        counts[end as usize] -= 1;
    }
    for c in 1..=n {
        counts[c] += counts[c - 1];
    }
    let mut own = vec![usize::MAX; n];
    for (i, &(cell, _)) in rows.iter().enumerate() {
        own[cell as usize] = i;
    }
    let mut next = 0;
    let mut turned: Vec<Vec<u32>> = Vec::new();
    let mut first = 0;
    let all = (0..n).map(|cell| {
        if cell == next {
            first = next;
            next = end_of_chunk(&counts[..n], first);
            turned = turn(rows, first as u32, next as u32);
        }
        let mut row = std::mem::take(&mut turned[cell - first]);
        match own[cell] {
            usize::MAX if is_alone_in => row.push(cell as u32),
            usize::MAX => {}
            i => row.extend(rows[i].1.iter().flat_map(|&[a, b]| a..b)),
        }
        row.sort_unstable();
        row.dedup();
        row
    });
    Pvs::of_ascending(all)
}

/// Returns the end of the cells from `first` on whose columns are turned together: at least one.
fn end_of_chunk(counts: &[i64], first: usize) -> usize {
    let mut sum = counts[first] as usize;
    let mut end = first + 1;
    while end < counts.len() && sum + counts[end] as usize <= MOST_TURNED {
        sum += counts[end] as usize;
        end += 1;
    }
    end
}

/// Returns for each of some cells the cells in whose rows it is, ascending.
fn turn(rows: &[(u32, &Runs)], first: u32, end: u32) -> Vec<Vec<u32>> {
    let mut columns = vec![Vec::new(); (end - first) as usize];
    for &(cell, runs) in rows {
        let start = runs.partition_point(|run| run[1] <= first);
        for &[a, b] in runs[start..].iter().take_while(|run| run[0] < end) {
            for column in a.max(first)..b.min(end) {
                columns[(column - first) as usize].push(cell);
            }
        }
    }
    columns
}
