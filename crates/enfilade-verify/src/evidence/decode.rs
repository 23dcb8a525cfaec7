//! Decoding of evidence.

use std::io::Read;

use enfilade_cpg::SightGraph;
use enfilade_geom::DVec3;

use super::EvidenceError;
use super::shape::{Openings, Table};

/// All claims of the evidence.
pub(super) struct Evidence {
    pub(super) clearance: f64,
    pub(super) far: f64,
    pub(super) n_visible: u64,
    pub(super) n_proved: u64,
    /// For each direction, the directions not claimed hidden from it.
    pub(super) might: Table,
    /// For each direction, those whose being hidden its trace must show.
    pub(super) claims: Table,
    pub(super) lines: Vec<SightLine>,
    /// Pairs of openings hidden from each other by walls.
    pub(super) trees: Vec<Tree>,
    pub(super) trace: Vec<u8>,
}

pub(super) struct SightLine {
    pub(super) origin: DVec3,
    pub(super) direction: DVec3,
    pub(super) chain: Vec<u32>,
}

/// How walls block the lines from one opening to another.
pub(super) struct Tree {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) bytes: Vec<u8>,
}

const MAGIC: &[u8; 8] = b"ENFEVID4";
/// Largest ratio of deflate.
const MAX_RATIO: u64 = 1032;
/// Largest accepted clearance, relative to the largest coordinate.
const MAX_CLEARANCE: f64 = 1e-6;

/// Returns the 64-bit FNV-1a hash.
fn check_sum(bytes: &[u8]) -> u64 {
    let mut sum: u64 = 0xcbf2_9ce4_8422_2325;
    for &byte in bytes {
        sum = (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    }
    sum
}

/// Decodes the bytes. Memory is bounded by their number, not by the sizes that they declare.
pub(super) fn decode(
    graph: &SightGraph,
    openings: &Openings,
    bytes: &[u8],
) -> Result<Evidence, EvidenceError> {
    let damaged = EvidenceError::Damaged;
    let Some((head, packed)) = bytes.split_at_checked(24) else {
        return Err(damaged("it is too short"));
    };
    let (magic, rest) = head.split_at(8);
    let (size, sum) = rest.split_at(8);
    if magic != MAGIC {
        return Err(damaged("it does not begin with ENFEVID4"));
    }
    let size = u64::from_le_bytes(size.try_into().map_err(|_| damaged("it is too short"))?);
    if size > packed.len() as u64 * MAX_RATIO {
        return Err(damaged("its declared size is impossible"));
    }
    // Deflate ignores some bits: a change there would go unnoticed.
    if sum != check_sum(packed).to_le_bytes() {
        return Err(damaged("its check sum is wrong"));
    }
    let mut body = Vec::new();
    let mut decoder = flate2::bufread::ZlibDecoder::new(packed);
    let unpacked = decoder.by_ref().take(size + 1).read_to_end(&mut body);
    if unpacked.is_err() || body.len() as u64 != size || !decoder.into_inner().is_empty() {
        return Err(damaged("it cannot be unpacked"));
    }
    let mut reader = Reader(&body);
    if reader.u64()? != graph.content_hash() {
        return Err(EvidenceError::OtherGraph);
    }
    let (clearance, far) = (reader.f64()?, reader.f64()?);
    if !(clearance >= 0.0 && clearance <= MAX_CLEARANCE * openings.scale) {
        return Err(EvidenceError::Weak("its clearance is too wide"));
    }
    if far.is_nan() || far < 0.0 {
        return Err(damaged("its far plane is not a distance"));
    }
    let (n_visible, n_proved) = (reader.u64()?, reader.u64()?);
    let n = openings.all.len();
    let might = reader.table(n)?;
    let claims = reader.table(n)?;
    let n_lines = reader.u64()?;
    let mut lines = Vec::new();
    for _ in 0..n_lines {
        lines.push(reader.line(n)?);
    }
    let n_trees = reader.u64()?;
    let mut trees = Vec::new();
    for _ in 0..n_trees {
        trees.push(reader.tree(n)?);
    }
    Ok(Evidence {
        clearance,
        far,
        n_visible,
        n_proved,
        might,
        claims,
        lines,
        trees,
        trace: reader.0.to_vec(),
    })
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take(&mut self, n: usize) -> Result<&[u8], EvidenceError> {
        let (taken, rest) = self
            .0
            .split_at_checked(n)
            .ok_or(EvidenceError::Damaged("it ends early"))?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], EvidenceError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N)?);
        Ok(out)
    }

    fn u64(&mut self) -> Result<u64, EvidenceError> {
        self.array().map(u64::from_le_bytes)
    }

    fn u32(&mut self) -> Result<u32, EvidenceError> {
        self.array().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, EvidenceError> {
        self.array().map(f64::from_le_bytes)
    }

    fn point(&mut self) -> Result<DVec3, EvidenceError> {
        Ok(DVec3::new(self.f64()?, self.f64()?, self.f64()?))
    }

    fn line(&mut self, n: usize) -> Result<SightLine, EvidenceError> {
        let (origin, direction) = (self.point()?, self.point()?);
        let len = self.u32()? as usize;
        if len > self.0.len() / 4 {
            return Err(EvidenceError::Damaged("it ends early"));
        }
        let chain = (0..len)
            .map(|_| self.u32())
            .collect::<Result<Vec<_>, _>>()?;
        if chain.iter().any(|&d| d as usize >= n) {
            return Err(EvidenceError::Damaged(
                "a line contains an opening that is not in the graph",
            ));
        }
        Ok(SightLine {
            origin,
            direction,
            chain,
        })
    }

    fn tree(&mut self, n: usize) -> Result<Tree, EvidenceError> {
        let (from, to) = (self.u32()? as usize, self.u32()? as usize);
        if from.max(to) >= n {
            return Err(EvidenceError::Damaged(
                "a tree contains an opening that is not in the graph",
            ));
        }
        let len = self.u32()? as usize;
        let bytes = self.take(len)?.to_vec();
        Ok(Tree { from, to, bytes })
    }

    fn table(&mut self, n: usize) -> Result<Table, EvidenceError> {
        let n_bytes = n.div_ceil(8);
        if n.saturating_mul(n_bytes) > self.0.len() {
            return Err(EvidenceError::Damaged("it ends early"));
        }
        let mut table = Table::new(n);
        for row in 0..n {
            let bytes = self.take(n_bytes)?;
            if !n.is_multiple_of(8) && bytes[n_bytes - 1] >> (n % 8) != 0 {
                return Err(EvidenceError::Damaged("a table has bits beyond its rows"));
            }
            table.fill_row(row, bytes);
        }
        Ok(table)
    }
}
