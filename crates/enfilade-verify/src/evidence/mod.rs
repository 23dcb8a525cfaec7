//! Checks the evidence of a potentially visible set; `docs/evidence.md` describes it.
//!
//! Shares no code with the search and trusts nothing in the evidence: a pair claimed visible needs a line that
//! crosses the openings one by one, two openings claimed hidden from each other need a reason, and the walk through
//! all portal chains only follows the trace, so that its length bounds the time.

mod beams;
mod decode;
mod error;
mod lines;
mod shape;
mod walk;

use enfilade_cpg::{CellId, CellSet, SightGraph};
use enfilade_geom::{Bvh, DVec3, Triangle};
use rayon::prelude::*;

pub use error::EvidenceError;

use decode::Evidence;
use shape::Openings;

/// The result of evidence, after every claim in it was checked.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct EvidenceReport {
    /// For each cell, the cells not proved hidden from it, itself included.
    pub cells: Vec<CellSet>,
    /// Ordered pairs of cells not proved hidden.
    pub n_visible: u64,
    /// Those of `n_visible` that a line proves visible.
    pub n_proved: u64,
    /// Ordered pairs of cells proved hidden.
    pub n_hidden: u64,
    /// Pairs of openings hidden from each other by walls.
    pub n_walled: u64,
    /// Lines followed.
    pub n_lines: u64,
    /// Bytes of the trace.
    pub n_trace: u64,
    /// Lines that pass closer than this to an opening's edge may be lost. [Units: wu]
    pub clearance: f64,
    /// Only what is nearer than this is claimed: farther pairs are hidden by the distance alone. Infinite for none. [Units: wu]
    pub far: f64,
}

/// Returns `true` if something solid lies between two points.
type Blocks<'a> = &'a (dyn Fn(DVec3, DVec3) -> bool + Sync);

/// Accepts evidence only if every claim in it holds on this graph.
///
/// `walls` are the triangles that block lines, if the scene is known, in the order of the search
/// ([`crate::structural_triangles`] of a world). Safe on hostile bytes: the graph and the bytes bound the memory, the
/// trace the time. Uses the current rayon pool.
///
/// # Errors
///
/// The first claim that fails.
pub fn verify_evidence(
    graph: &SightGraph,
    bytes: &[u8],
    walls: Option<&[Triangle]>,
) -> Result<EvidenceReport, EvidenceError> {
    graph.validate()?;
    let openings = Openings::new(graph);
    let evidence = decode::decode(graph, &openings, bytes)?;
    beams::check(&openings, &evidence.trees, evidence.clearance, walls)?;
    check_reasons(&openings, &evidence)?;
    walk::check_trace(&openings, &evidence)?;

    let n = graph.n_cells as usize;
    let bvh = walls.map(Bvh::build);
    let blocks = bvh
        .as_ref()
        .map(|bvh| move |a: DVec3, b: DVec3| bvh.any_hit(a, b, |_| false));
    let blocks = blocks.as_ref().map(|f| f as Blocks<'_>);
    let proved = lines::check(&openings, &evidence, n, blocks)?;
    let mut cells: Vec<CellSet> = (0..n).map(|_| CellSet::new(n)).collect();
    for (c, set) in cells.iter_mut().enumerate() {
        set.insert(CellId(c as u32));
    }
    for (s, opening) in openings.all.iter().enumerate() {
        let set = &mut cells[opening.from as usize];
        set.insert(CellId(opening.to));
        for t in evidence.might.ones(s) {
            set.insert(CellId(openings.all[t].to));
        }
    }
    let n_visible = cells.iter().map(|set| set.len() as u64).sum();
    let mut n_proved = 0;
    for (visible, proved) in cells.iter().zip(&proved) {
        if !proved.is_subset(visible) {
            return Err(EvidenceError::Damaged(
                "a line shows a cell that is claimed hidden",
            ));
        }
        n_proved += proved.len() as u64;
    }
    total("visible pairs", evidence.n_visible, n_visible)?;
    total("proved pairs", evidence.n_proved, n_proved)?;
    Ok(EvidenceReport {
        n_visible,
        n_proved,
        n_hidden: (n as u64) * (n as u64) - n_visible,
        n_walled: evidence.trees.len() as u64,
        n_lines: evidence.lines.len() as u64,
        n_trace: evidence.trace.len() as u64,
        clearance: evidence.clearance,
        far: evidence.far,
        cells,
    })
}

fn total(what: &'static str, said: u64, found: u64) -> Result<(), EvidenceError> {
    if said == found {
        Ok(())
    } else {
        Err(EvidenceError::Totals { what, said, found })
    }
}

/// Checks that every pair of openings claimed hidden follows from sides of planes, distance or neighbors, or is
/// claimed by a trace.
fn check_reasons(openings: &Openings, evidence: &Evidence) -> Result<(), EvidenceError> {
    let n = openings.all.len();
    let mut walled = shape::Table::new(n);
    for tree in &evidence.trees {
        walled.set(tree.from, tree.to);
        walled.set(tree.to ^ 1, tree.from ^ 1);
    }
    (0..n).into_par_iter().try_for_each(|s| {
        let fail = |to: usize, problem: &'static str| EvidenceError::Hidden {
            from: s,
            to,
            problem,
        };
        let might = &evidence.might;
        // Openings that some next opening might see: all others follow from neighbors.
        let mut open = vec![0u64; might.n_words()];
        for q in openings.exits(openings.all[s].to, s ^ 1) {
            shape::set(&mut open, q);
            if might.get(s, q) {
                for (o, m) in open.iter_mut().zip(might.row(q)) {
                    *o |= m;
                }
            }
        }
        for t in might.ones(s) {
            if !might.get(t ^ 1, s ^ 1) {
                return Err(fail(t, "hidden one way, not the other"));
            }
        }
        for t in evidence.claims.ones(s) {
            if might.get(s, t) {
                return Err(fail(t, "claimed hidden and not hidden"));
            }
        }
        for (i, &word) in open.iter().enumerate() {
            let mut rest = word & !might.row(s)[i];
            while rest != 0 {
                let t = i * 64 + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let has_reason = t == s
                    || t == s ^ 1
                    || evidence.claims.get(s, t)
                    || evidence.claims.get(t ^ 1, s ^ 1)
                    || walled.get(s, t)
                    || openings.are_apart(s, t, evidence.clearance, evidence.far)
                    || last_fails(openings, evidence, s, t);
                if !has_reason {
                    return Err(fail(t, "no reason shows that they are hidden"));
                }
            }
        }
        Ok(())
    })
}

/// Returns `true` if each opening through which a line could continue after `t` is hidden.
fn last_fails(openings: &Openings, evidence: &Evidence, s: usize, t: usize) -> bool {
    openings.all[t].from != openings.all[s].to
        && openings
            .entries(openings.all[t].from, t ^ 1)
            .all(|p| !evidence.might.get(s, p) || !evidence.might.get(p, t))
}
