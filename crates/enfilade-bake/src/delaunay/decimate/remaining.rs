//! The portals left after a step of the decimation, with their weights at that step.
//!
//! Gjørup 1999, §4.2.3: a person looks at the portals that are left, and decides which to remove. The record of steps
//! has the weight of a portal only when it is removed; here the decimation runs again up to the step.

use std::collections::BTreeMap;

use enfilade_geom::DVec3;

use super::{Choice, Decimation, Merging, QueuedPortal, Rules, by_portal};
use crate::delaunay::cells::Cells;

/// A choice, and the portal between initial cells that it is about.
pub(in crate::delaunay) struct Resolved {
    /// The initial cells, lesser id first.
    pub(super) pair: (u32, u32),
    pub(super) choice: Choice,
    /// Its place, as in [`Choices`](super::Choices). [Units: wu]
    pub(super) at: DVec3,
}

/// A portal that is left after some steps.
#[derive(Clone, Debug, PartialEq)]
pub struct RemainingPortal {
    /// The cells on both sides, lesser id first.
    pub cells: [u32; 2],
    /// Weight at this step: infinite if the user kept it, [`JOINED`](super::JOINED) if the user joined it and nothing
    /// else goes by itself any more.
    pub weight: f64,
    /// The weight is that of a branch at its mouth, not that of a pinch.
    pub is_mouth: bool,
    /// Center of the widest of the portals that it was merged from, for [`Choices`](super::Choices). [Units: wu]
    pub position: DVec3,
    /// Decision of the user on it.
    pub choice: Option<Choice>,
    /// Places of all decisions on it, as in [`Choices`](super::Choices). [Units: wu]
    pub decided_at: Vec<DVec3>,
    /// The next step removes it.
    pub is_next: bool,
    /// Its openings: indices of links in the space, ascending.
    pub links: Vec<u32>,
}

/// Steps between the decimation in progress that is kept and the step that was asked for.
const LAG: usize = 100;

/// Returns a decimation in progress that is at most some steps before `n_steps`: that of an earlier request, if it is, or goes on
/// from it. `resolved` are the choices.
pub(in crate::delaunay) fn begun_before(
    begun: Option<Merging>,
    cells: &Cells,
    rules: Rules,
    resolved: &[Resolved],
    n_steps: usize,
) -> Merging {
    let is_before = |merging: &Merging| merging.steps.len() <= n_steps;
    let begun = begun.filter(is_before);
    let mut merging = begun.unwrap_or_else(|| Merging::new(cells, rules, &by_portal(resolved)));
    if merging.steps.len() + 2 * LAG < n_steps {
        merging.advance(n_steps - LAG);
    }
    merging
}

impl Merging {
    /// Goes on until `n_steps` are taken, or no portal is left; returns the next portal.
    fn advance(&mut self, n_steps: usize) -> Option<QueuedPortal> {
        while self.steps.len() < n_steps {
            let candidate = self.next_candidate()?;
            self.remove(&candidate);
        }
        let next = self.next_candidate();
        // It is still to be taken by whoever goes on.
        self.queue.extend(next.clone());
        next
    }
}

/// Returns the portals left after the first `n_steps` of a record, in the order of their cells. `merging` is the same
/// decimation, not further than that, and `resolved` its choices.
pub(in crate::delaunay) fn remaining(
    cells: &Cells,
    mut merging: Merging,
    record: &Decimation,
    resolved: &[Resolved],
    n_steps: usize,
) -> Vec<RemainingPortal> {
    let next = merging.advance(n_steps);
    let room_of_cell = record.after(n_steps);
    let pair_of = |(a, b): (u32, u32)| {
        let [a, b] = [a, b].map(|c| room_of_cell[c as usize]);
        [a.min(b), a.max(b)]
    };
    let mut links: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    for (&pair, portal) in &cells.portals {
        let pair = pair_of(pair);
        if pair[0] != pair[1] {
            links.entry(pair).or_default().extend(&portal.links);
        }
    }
    let mut decided_at: BTreeMap<[u32; 2], Vec<DVec3>> = BTreeMap::new();
    for choice in resolved {
        let all = decided_at.entry(pair_of(choice.pair)).or_default();
        all.push(choice.at);
    }
    let next = next.map(|candidate| candidate.pair);
    let left = merging.portals.iter().map(|(&pair, live)| {
        let [a, b] = [pair.0, pair.1].map(|slot| merging.ids[slot as usize]);
        let ids = [a.min(b), a.max(b)];
        let weight = merging.candidate(pair, live).weight;
        let mut links = links.remove(&ids).unwrap_or_default();
        links.sort_unstable();
        RemainingPortal {
            cells: ids,
            weight,
            is_mouth: merging.rules.is_mouth(live, weight),
            position: live.center,
            choice: match (live.stays, live.goes) {
                (true, _) => Some(Choice::Keep),
                (false, true) => Some(Choice::Join),
                (false, false) => None,
            },
            decided_at: decided_at.remove(&ids).unwrap_or_default(),
            is_next: next == Some(pair),
            links,
        }
    });
    let mut left: Vec<RemainingPortal> = left.collect();
    left.sort_by_key(|portal| portal.cells);
    left
}
