//! The state of a search as bytes, so that it can be resumed.
//!
//! Saved between rounds, when nothing is under way, so a resumed search finds the same as an uninterrupted one. A
//! hash ties the bytes to the graph, the settings and the caller's salt; they are compressed, and a checksum covers both.
//! Bytes that do not fit are refused as a whole.

use std::io::{Read, Write};

use enfilade_cpg::SightGraph;
use enfilade_geom::DVec3;
use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;

use crate::bits::BitTable;
use crate::config::{VisConfig, VisError};
use crate::rays::Line;
use crate::search::{Rest, Search};

const MAGIC: &[u8; 8] = b"ENFVCHK3";

/// Returns the FNV-1a hash of everything that determines a search.
pub(crate) fn key(graph: &SightGraph, config: &VisConfig, salt: u64) -> u64 {
    let far = config.far.unwrap_or(f64::INFINITY).to_bits();
    let clearance = config.clearance.unwrap_or(-1.0).to_bits();
    let mut bytes = env!("CARGO_PKG_VERSION").as_bytes().to_vec();
    for word in [
        graph.content_hash(),
        salt,
        far,
        clearance,
        config.n_rays as u64,
        u64::from(config.max_pieces),
    ] {
        bytes.extend(word.to_le_bytes());
    }
    fnv(&bytes)
}

/// Returns the 64-bit FNV-1a hash.
pub(crate) fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Returns what a state on disk begins with: a name of its kind, the hash of what it belongs to, and a sum of both and of
/// its packed bytes.
pub(crate) fn front(magic: [u8; 8], key: u64, packed: &[u8]) -> [[u8; 8]; 3] {
    let key = key.to_le_bytes();
    let sum = fnv(&[&magic, &key, packed].concat());
    [magic, key, sum.to_le_bytes()]
}

pub(crate) fn encode(search: &Search<'_>, rest: &Rest, key: u64) -> Vec<u8> {
    let mut words = vec![rest.done, rest.total, search.effort.steps];
    for table in search.tables() {
        words.extend(table.words());
    }
    words.push(rest.order.len() as u64);
    for &(weight, d) in &rest.order {
        words.extend([weight as u64, d as u64]);
    }
    words.push(search.lines.len() as u64);
    for line in &search.lines {
        let ends = [line.origin, line.direction].map(|v| v.to_array().map(f64::to_bits));
        words.extend(ends.as_flattened());
        words.push(line.chain.len() as u64);
        words.extend(line.chain.iter().map(|&d| u64::from(d)));
    }
    let body: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
    // Writing to memory cannot fail; if it did, the empty checkpoint would be refused later.
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    let written = encoder.write_all(&body).and_then(|()| encoder.finish());
    let packed = written.unwrap_or_default();
    let front = front(*MAGIC, key, &packed);
    [front.as_flattened(), &packed].concat()
}

/// Restores a search from bytes; returns the work left.
pub(crate) fn decode(
    bytes: &[u8],
    search: &mut Search<'_>,
    expected: u64,
) -> Result<Rest, VisError> {
    let refuse = |problem| VisError::Checkpoint { problem };
    let damaged = || refuse("it is damaged");
    let (head, body) = bytes.split_at_checked(24).ok_or_else(damaged)?;
    let (magic, rest) = head.split_at(8);
    if magic != MAGIC {
        return Err(refuse("it is not a checkpoint"));
    }
    if rest[..8] != expected.to_le_bytes() {
        return Err(refuse("it belongs to another graph or other settings"));
    }
    // The checksum of zlib ignores the bits that pad its last byte.
    if head != front(*MAGIC, expected, body).as_flattened() {
        return Err(damaged());
    }
    let n = search.dirs.len() as u64;
    let n_words: usize = search.tables().iter().map(|t| t.words().len()).sum();
    // The graph fixes the size of tables and order; lines are at most one for each pair, as each proves a new one.
    let n_pairs = (search.dirs.n_cells as u64).saturating_mul(search.dirs.n_cells as u64);
    let limit = (n_words as u64 + 2 * n + 16)
        .saturating_add(n_pairs.saturating_mul(16))
        .saturating_mul(8);
    let mut body_bytes = Vec::new();
    ZlibDecoder::new(body)
        .take(limit)
        .read_to_end(&mut body_bytes)
        .map_err(|_| damaged())?;
    let (chunks, []) = body_bytes.as_chunks::<8>() else {
        return Err(damaged());
    };
    let mut words = chunks.iter().map(|&c| u64::from_le_bytes(c));
    let mut next = || words.next().ok_or_else(damaged);
    let (done, total, steps) = (next()?, next()?, next()?);
    let mut tables: [BitTable; 4] = search.tables().map(Clone::clone);
    for table in &mut tables {
        for word in table.words_mut() {
            *word = next()?;
        }
    }
    let direction = |d: u64| (d < n).then_some(d as usize).ok_or_else(damaged);
    let n_left = next()?;
    if n_left > n {
        return Err(damaged());
    }
    let order = (0..n_left)
        .map(|_| Ok((next()? as usize, direction(next()?)?)))
        .collect::<Result<_, VisError>>()?;
    let n_lines = next()?;
    let mut lines = Vec::new();
    for _ in 0..n_lines {
        let mut vector = || -> Result<DVec3, VisError> {
            Ok(DVec3::new(
                f64::from_bits(next()?),
                f64::from_bits(next()?),
                f64::from_bits(next()?),
            ))
        };
        let (origin, direction_of) = (vector()?, vector()?);
        let length = next()?;
        let chain = (0..length)
            .map(|_| Ok(direction(next()?)? as u32))
            .collect::<Result<Vec<u32>, VisError>>()?;
        lines.push(Line {
            origin,
            direction: direction_of,
            chain,
        });
    }
    if words.next().is_some() {
        return Err(damaged());
    }
    search.restore(tables, lines, steps);
    Ok(Rest { order, done, total })
}
