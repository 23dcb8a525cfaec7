//! Evidence as bytes; `docs/evidence.md` describes the format.

use std::io::Write;

use enfilade_cpg::SightGraph;
use flate2::Compression;
use flate2::write::ZlibEncoder;

use crate::bits::{self, BitTable};
use crate::config::{KEPT, VisConfig, VisError};
use crate::dirs::Next;
use crate::flow::Shared;
use crate::search::Search;
use crate::{checkpoint, prove};

const MAGIC: &[u8; 8] = b"ENFEVID4";

/// Encodes the results of a search with their proofs.
pub(crate) fn encode(
    graph: &SightGraph,
    search: &Search<'_>,
    config: &VisConfig,
) -> Result<Vec<u8>, VisError> {
    let shared = Shared {
        dirs: search.dirs,
        might: &search.might,
        next: &Next::new(search.dirs, &search.might),
        seen: &search.seen,
        tolerance: search.tolerance,
        blocker: search.blocker,
        max_pieces: config.max_pieces,
    };
    let claims = prove::claims(&shared, &search.settled);
    let trace = prove::traces(&shared, &claims).ok_or(VisError::Evidence)?;
    let visible = search.visible();
    let n_visible = visible.count_all() + search.dirs.n_alone();
    let n_proved = n_visible - n_undecided(search, &visible);

    let mut body = Vec::new();
    body.extend(graph.content_hash().to_le_bytes());
    // The promised clearance, not the smaller one that the search used.
    body.extend((search.tolerance.clearance / KEPT).to_le_bytes());
    body.extend(config.far.unwrap_or(f64::INFINITY).to_le_bytes());
    body.extend(n_visible.to_le_bytes());
    body.extend(n_proved.to_le_bytes());
    put_table(&mut body, search, &search.might);
    put_table(&mut body, search, &claims);
    body.extend((search.lines.len() as u64).to_le_bytes());
    for line in &search.lines {
        for x in line
            .origin
            .to_array()
            .into_iter()
            .chain(line.direction.to_array())
        {
            body.extend(x.to_le_bytes());
        }
        body.extend((line.chain.len() as u32).to_le_bytes());
        for &d in &line.chain {
            body.extend(search.dirs.all[d as usize].id.to_le_bytes());
        }
    }
    body.extend((search.closed.len() as u64).to_le_bytes());
    for closed in &search.closed {
        for d in [closed.from, closed.to] {
            body.extend(search.dirs.all[d as usize].id.to_le_bytes());
        }
        body.extend((closed.tree.len() as u32).to_le_bytes());
        body.extend(&closed.tree);
    }
    body.extend(&trace);

    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing to memory cannot fail.
    let written = encoder.write_all(&body).and_then(|()| encoder.finish());
    let packed = written.map_err(|_| VisError::Evidence)?;
    let mut out = MAGIC.to_vec();
    out.extend((body.len() as u64).to_le_bytes());
    out.extend(checkpoint::fnv(&packed).to_le_bytes());
    out.extend(packed);
    Ok(out)
}

fn n_undecided(search: &Search<'_>, visible: &BitTable) -> u64 {
    let n = search.dirs.n_cells;
    (0..n)
        .map(|a| {
            bits::ones(visible.row(a))
                .filter(|&b| !search.seen.get(a, b) || search.undecided.get(a, b))
                .count() as u64
        })
        .sum()
}

/// Appends a table with rows and columns in the graph's numbers of directions, each row padded to a byte.
fn put_table(body: &mut Vec<u8>, search: &Search<'_>, table: &BitTable) {
    let dirs = search.dirs;
    let n_bytes = dirs.len().div_ceil(8);
    let mut order: Vec<usize> = (0..dirs.len()).collect();
    order.sort_by_key(|&d| dirs.all[d].id);
    for &d in &order {
        let start = body.len();
        body.resize(start + n_bytes, 0);
        for t in bits::ones(table.row(d)) {
            let id = dirs.all[t].id as usize;
            body[start + id / 8] |= 1 << (id % 8);
        }
    }
}
