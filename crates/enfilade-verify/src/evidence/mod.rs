//! Checks the evidence of a potentially visible set; `docs/evidence.md` describes it.
//!
//! Shares no code with the search. Nothing in the evidence is believed: of a pair called visible it wants a
//! line that crosses the openings one by one, of each two openings called hidden from each other a reason,
//! and the walk through all portal chains only follows the trace, so that time is bounded by its length.

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

/// What evidence shows, after every claim in it was checked.
#[derive(Clone, Debug, PartialEq)]
pub struct EvidenceReport {
    /// By cell, the cells that are not proved hidden from it, itself included.
    pub cells: Vec<CellSet>,
    /// Ordered pairs of cells not proved hidden.
    pub n_visible: u64,
    /// Those of them that a line proves visible.
    pub n_proved: u64,
    /// Ordered pairs of cells proved hidden.
    pub n_hidden: u64,
    /// Pairs of openings that walls hide from each other.
    pub n_walled: u64,
    /// Lines followed.
    pub n_lines: u64,
    /// Bytes of the trace.
    pub n_trace: u64,
    /// Lines that pass nearer than this to an opening's edge may be lost. [Units: wu]
    pub clearance: f64,
}

/// Tells whether something solid lies between two points.
type Blocks<'a> = &'a (dyn Fn(DVec3, DVec3) -> bool + Sync);

/// Accepts evidence only if every claim in it holds on this graph.
///
/// `walls` are the triangles that stop lines, where the scene is known, in the order in which the search had them
/// ([`crate::structural_triangles`] of a world). Safe on hostile bytes: memory is bounded by
/// the graph and the bytes, time by the trace. Uses the current rayon pool.
///
/// # Errors
///
/// The first claim that does not hold.
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
                "a line proves what is called hidden",
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

/// Every pair of openings called hidden must follow from sides of planes, distance or its neighbors, or be
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
        // What some next opening might see, beyond what follows from neighbors.
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
                    return Err(fail(t, "no reason is given why they are hidden"));
                }
            }
        }
        Ok(())
    })
}

/// Whether each opening from which a line could go on through `t` is out of sight.
fn last_fails(openings: &Openings, evidence: &Evidence, s: usize, t: usize) -> bool {
    openings.all[t].from != openings.all[s].to
        && openings
            .entries(openings.all[t].from, t ^ 1)
            .all(|p| !evidence.might.get(s, p) || !evidence.might.get(p, t))
}
