//! Lines that prove that cells see each other.

use enfilade_cpg::{CellId, CellSet};

use super::decode::{Evidence, SightLine};
use super::shape::Openings;
use super::{Blocks, EvidenceError};

/// Follows every line; returns, for each cell, the cells proved visible from it, itself included.
pub(super) fn check(
    openings: &Openings,
    evidence: &Evidence,
    n_cells: usize,
    blocks: Option<Blocks<'_>>,
) -> Result<Vec<CellSet>, EvidenceError> {
    let mut proved: Vec<CellSet> = (0..n_cells).map(|_| CellSet::new(n_cells)).collect();
    for (c, set) in proved.iter_mut().enumerate() {
        set.insert(CellId(c as u32));
    }
    for (i, line) in evidence.lines.iter().enumerate() {
        follow(openings, line, evidence.far, blocks).map_err(|problem| EvidenceError::Line {
            line: i as u64,
            problem,
        })?;
        for (k, &first) in line.chain.iter().enumerate() {
            let from = openings.all[first as usize].from;
            for &last in &line.chain[k..] {
                let to = openings.all[last as usize].to;
                proved[from as usize].insert(CellId(to));
                proved[to as usize].insert(CellId(from));
            }
        }
    }
    Ok(proved)
}

fn follow(
    openings: &Openings,
    line: &SightLine,
    far: f64,
    blocks: Option<Blocks<'_>>,
) -> Result<(), &'static str> {
    if !(line.origin.is_finite() && line.direction.is_finite()) {
        return Err("it has no direction");
    }
    let margin = openings.rounding();
    let mut before: Option<(u32, f64)> = None;
    let mut first_t = 0.0;
    for &d in &line.chain {
        let opening = &openings.all[d as usize];
        let t = openings
            .crossing(d as usize, line.origin, line.direction)
            .ok_or("it does not cross an opening from front to back")?;
        let p = line.origin + line.direction * t;
        if !openings.is_inside(d as usize, p, margin) {
            return Err("it misses an opening");
        }
        match before {
            None => first_t = t,
            Some((cell, earlier)) => {
                if cell != opening.from {
                    return Err("its openings do not follow each other");
                }
                if t < earlier {
                    return Err("it crosses its openings in another order");
                }
                let from = line.origin + line.direction * earlier;
                if blocks.is_some_and(|blocks| blocks(from, p)) {
                    return Err("something solid is in its way");
                }
            }
        }
        before = Some((opening.to, t));
    }
    let (_, last_t) = before.ok_or("it crosses nothing")?;
    if (last_t - first_t) * line.direction.length() > far {
        return Err("it is longer than the far plane allows");
    }
    Ok(())
}
