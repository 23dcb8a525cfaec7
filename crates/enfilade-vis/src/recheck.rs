//! Proof of a saved search before it resumes.
//!
//! A checkpoint comes from a file that anybody may have written, and a bit that wrongly marks something as hidden
//! would never be questioned again. So nothing is trusted: every line must pass its openings, and everything marked
//! as hidden is traced as for evidence ([`crate::prove`]), which fails for a false claim. Errors towards "visible"
//! may stand. Time: that of writing evidence, a part of that of the search.

use crate::bits;
use crate::config::VisError;
use crate::dirs::Next;
use crate::flow::Shared;
use crate::prove;
use crate::search::{Rest, Search};

/// Refuses a restored search that makes a claim without proof.
///
/// `base` is the table of what might be seen by sides of planes and distances, as before any search.
pub(crate) fn check(
    search: &Search<'_>,
    rest: &Rest,
    base: &bits::BitTable,
    max_pieces: u32,
) -> Result<(), VisError> {
    let refuse = |problem| Err(VisError::Checkpoint { problem });
    if !is_sound(search, rest) {
        return refuse("its tables and counts do not fit the graph");
    }
    if !search.lines.iter().all(|line| search.is_proof(line)) {
        return refuse("one of its lines does not pass its openings");
    }
    if !seen_is_shown(search) {
        return refuse("it marks cells as visible without a line that proves it");
    }
    if !hidden_is_shown(search, base, max_pieces) {
        return refuse("it marks as hidden something that is not");
    }
    Ok(())
}

/// Returns `true` if no bit lies beyond the ends of rows, no opening is left twice, and all counts are possible.
fn is_sound(search: &Search<'_>, rest: &Rest) -> bool {
    let (n_dirs, n_cells) = (search.dirs.len(), search.dirs.n_cells);
    let widths = [n_dirs, n_dirs, n_cells, n_cells];
    let fits = search
        .tables()
        .into_iter()
        .zip(widths)
        .all(|(table, width)| {
            (0..width).all(|row| bits::ones(table.row(row)).all(|column| column < width))
        });
    let most = (n_dirs as u64).saturating_mul(n_dirs as u64);
    let mut is_left = vec![false; n_dirs];
    let mut order = rest.order.iter();
    fits && rest.done <= most
        && rest.total <= most
        && search.effort.steps < u64::MAX / 2
        && order.all(|&(n, d)| n <= n_dirs && !std::mem::replace(&mut is_left[d], true))
}

/// Returns `true` if each pair of cells marked as proved is on a line, and those given up on are visible both ways.
fn seen_is_shown(search: &Search<'_>) -> bool {
    let (dirs, n) = (search.dirs, search.dirs.n_cells);
    let mut shown = bits::BitTable::new(n, n);
    for c in 0..n {
        shown.set(c, c);
    }
    for line in &search.lines {
        for i in 0..line.chain.len() {
            let a = dirs.all[line.chain[i] as usize].from as usize;
            for &b in &line.chain[i..] {
                let b = dirs.all[b as usize].to as usize;
                shown.set(a, b);
                shown.set(b, a);
            }
        }
    }
    (0..n).all(|a| {
        let is_right = |b: usize| {
            let (is_seen, is_undecided) = (search.seen.get(a, b), search.undecided.get(a, b));
            let is_symmetric =
                search.seen.get(b, a) == is_seen && search.undecided.get(b, a) == is_undecided;
            let is_shown = shown.get(a, b) && !is_undecided;
            is_symmetric && is_seen == (is_shown || is_undecided)
        };
        (0..n).all(is_right)
    })
}

/// Returns `true` if all pairs hidden beyond the sides of planes were settled from one end, and can be settled again.
fn hidden_is_shown(search: &Search<'_>, base: &bits::BitTable, max_pieces: u32) -> bool {
    let (dirs, might) = (search.dirs, &search.might);
    for s in 0..dirs.len() {
        for t in bits::ones(might.row(s)) {
            if !base.get(s, t) {
                return false;
            }
        }
        for t in bits::ones(base.row(s)).filter(|&t| !might.get(s, t)) {
            let mirrored = (dirs.reverse[t] as usize, dirs.reverse[s] as usize);
            let is_settled = search.settled.get(s, t) || search.settled.get(mirrored.0, mirrored.1);
            if !is_settled || might.get(mirrored.0, mirrored.1) {
                return false;
            }
        }
        if bits::ones(search.settled.row(s)).any(|t| might.get(s, t)) {
            return false;
        }
    }
    let shared = Shared {
        dirs,
        might,
        next: &Next::new(dirs, might),
        seen: &search.seen,
        tolerance: search.tolerance,
        blocker: search.blocker,
        max_pieces,
    };
    prove::traces(&shared, &prove::claims(&shared, &search.settled)).is_some()
}
