//! The bandwidth that a walk needs, known its end.

use std::collections::BTreeMap;
use std::time::Duration;

use enfilade_cpg::{CellId, CellPortalGraph, Pvs};

use crate::deadlines::{Search, Ways};
use crate::{Catalog, Eye, PieceId};

/// A piece, and the time at which it has to be in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Due {
    /// The time.
    pub at: Duration,
    /// The piece.
    pub piece: PieceId,
}

/// Returns when each piece is due for an eye that may go anywhere from now on, at its speed: pieces that may be seen now at time 0,
/// all others when it can first be where they may be seen. Pieces that it cannot get to see are left out. In the order of the
/// times. On its way, no deadline gets earlier; so a link on which these can be met, the first due first, is never late.
#[must_use]
pub fn deadlines(eye: &Eye, catalog: &Catalog, graph: &CellPortalGraph, pvs: &Pvs) -> Vec<Due> {
    let mut search = Search::new(Ways::of(graph, false), Some(pvs.clone()), catalog);
    search.follow(eye.cell, eye.position, 0.0, true);
    while !search.is_over() {
        search.find(catalog, &mut u32::MAX.clone());
    }
    let mut is_due = vec![false; catalog.pieces().len()];
    let mut out = Vec::new();
    for planned in &search.order {
        let seconds = f64::from(planned.due) / f64::from(eye.speed);
        let Ok(at) = Duration::try_from_secs_f64(if planned.due > 0.0 { seconds } else { 0.0 })
        else {
            continue;
        };
        for &piece in catalog.pieces_of(planned.cell) {
            if !std::mem::replace(&mut is_due[piece.idx()], true) {
                out.push(Due { at, piece });
            }
        }
    }
    out
}

/// Returns when each piece is first due on a recorded walk: when the eye enters a cell from which it may be seen. `walk` lists
/// times, ascending, with the cell of the eye. In the order of the times. O(cells entered × pieces seen from each).
#[must_use]
pub fn due_times(walk: &[(Duration, CellId)], catalog: &Catalog, pvs: &Pvs) -> Vec<Due> {
    let mut is_due = vec![false; catalog.pieces().len()];
    let mut out = Vec::new();
    let mut entered = BTreeMap::new();
    for &(at, cell) in walk {
        if entered.insert(cell, at).is_some() {
            continue;
        }
        for seen in pvs.visible_from(cell) {
            for &piece in catalog.pieces_of(seen) {
                if !std::mem::replace(&mut is_due[piece.idx()], true) {
                    out.push(Due { at, piece });
                }
            }
        }
    }
    out
}

/// Returns the least bandwidth of a link with this latency over which all pieces can come in time: the least B such that for
/// all t, the bytes due by t are at most B · (t − latency). Pieces due at time 0 are there already. Infinite if a piece is due
/// within the latency. `due` is in the order of the times. [Units: bytes/s]
#[must_use]
pub fn least_bandwidth(due: &[Due], catalog: &Catalog, latency: Duration) -> f64 {
    let (mut n_bytes, mut least) = (0, 0.0);
    for Due { at, piece } in due.iter().filter(|d| !d.at.is_zero()) {
        let piece = catalog.pieces().get(piece.idx());
        n_bytes += piece.map_or(0, |p| p.n_packed);
        let seconds = at.saturating_sub(latency).as_secs_f64();
        least = f64::max(least, n_bytes as f64 / seconds);
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PieceSizes, SimulatedLink, SimulatedLinkOptions, Source};
    use enfilade_cpg::CellSet;
    use enfilade_testkit::Rng;

    fn catalog(sizes: &[u64]) -> Catalog {
        let pieces = sizes.iter().map(|&n| PieceSizes {
            n_packed: n,
            n_resident: n,
        });
        let rows: Vec<Vec<PieceId>> = (0..sizes.len() as u32).map(|p| vec![PieceId(p)]).collect();
        Catalog::new(pieces.collect(), &rows)
    }

    #[test]
    fn pieces_are_due_when_a_cell_is_entered_from_which_they_may_be_seen() {
        let catalog = catalog(&[1, 1, 1, 1]);
        let row = |cells: &[u32]| {
            let mut set = CellSet::new(4);
            for &c in cells {
                set.insert(CellId(c));
            }
            set
        };
        let pvs = Pvs::of_rows(&[row(&[0, 1]), row(&[0, 1, 2]), row(&[1, 2]), row(&[3])]);
        let s = Duration::from_secs;
        let walk = [
            (s(0), CellId(0)),
            (s(1), CellId(0)),
            (s(2), CellId(1)),
            (s(3), CellId(0)),
        ];
        let due = due_times(&walk, &catalog, &pvs);
        let due: Vec<(u64, u32)> = due.iter().map(|d| (d.at.as_secs(), d.piece.0)).collect();
        assert_eq!(due, [(0, 0), (0, 1), (2, 2)]);
    }

    // Covers W1.
    #[test]
    fn a_link_with_the_least_bandwidth_is_just_in_time() {
        let mut rng = Rng::new(1);
        for _ in 0..50 {
            let sizes: Vec<u64> = (0..20).map(|_| 1 + rng.below(100_000) as u64).collect();
            let catalog = catalog(&sizes);
            let mut due: Vec<Due> = (0..20)
                .map(|p| Due {
                    at: Duration::from_millis(200 + rng.below(5000) as u64),
                    piece: PieceId(p),
                })
                .collect();
            due.sort_by_key(|d| d.at);
            let latency = Duration::from_millis(100);
            let least = least_bandwidth(&due, &catalog, latency);
            // One after the other in the order of their deadlines, which no order betters; asked for ahead, so that there is
            // one latency in all.
            let options = SimulatedLinkOptions {
                latency: Duration::ZERO,
                bandwidth: least * 1.001,
                ..SimulatedLinkOptions::default()
            };
            let mut link = SimulatedLink::new(&catalog, options);
            let (mut replies, mut now, mut was_late) = (Vec::new(), latency, false);
            let mut n_ms = 0;
            for d in &due {
                link.request(d.piece);
                while replies.is_empty() {
                    n_ms += 1;
                    link.advance(Duration::from_micros(100 * n_ms));
                    link.poll(&mut replies);
                }
                replies.clear();
                now = latency + Duration::from_micros(100 * n_ms);
                // A tick of the test's clock for each piece.
                was_late |= now > d.at + Duration::from_micros(100 * 20);
            }
            assert!(!was_late, "{now:?}");
            // At some time, the link has had time for no more than what is due.
            let is_tight = |d: &Due| {
                let by = due.iter().filter(|e| e.at <= d.at);
                let bytes: u64 = by.map(|e| sizes[e.piece.idx()]).sum();
                bytes as f64 >= 0.999 * least * (d.at - latency).as_secs_f64()
            };
            assert!(due.iter().any(is_tight));
        }
        let soon = [Due {
            at: Duration::from_millis(50),
            piece: PieceId(0),
        }];
        let at_once = least_bandwidth(&soon, &catalog(&[1]), Duration::from_millis(100));
        assert_eq!(at_once, f64::INFINITY);
    }
}
