//! The portals left after a step of the decimation, with their weights at that step.
//!
//! Gjørup 1999, §4.2.3: a person looks at the portals that are left, and decides which to remove. The record of steps
//! has the weight of a portal only when it is removed; here the decimation runs again up to the step.

use std::collections::BTreeMap;

use enfilade_geom::{Allowance, DVec3};

use super::{Choice, Choices, Merging, Rules, Weight, decided};
use crate::delaunay::cells::Cells;

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
    /// Center of the widest of the portals that it was merged from, for [`Choices`]. [Units: wu]
    pub position: DVec3,
    /// Decision of the user on it.
    pub choice: Option<Choice>,
    /// Places of all decisions on it, as in [`Choices`]. [Units: wu]
    pub decided_at: Vec<DVec3>,
    /// The next step removes it.
    pub is_next: bool,
    /// Its openings: indices of links in the space, ascending.
    pub links: Vec<u32>,
}

/// Returns the portals left after the first `n_steps` of the decimation that [`decimate`](super::decimate) records, in
/// the order of their cells.
pub(crate) fn remaining(
    cells: &Cells,
    (weight, stop, min_radius): (Weight, f64, f64),
    choices: &Choices,
    n_steps: usize,
) -> Vec<RemainingPortal> {
    let rules = Rules {
        weight,
        stop,
        min_radius,
    };
    let (record, resolved) = decided(cells, rules, choices, &Allowance::default());
    let by_portal = resolved.iter().map(|r| (r.0, r.1)).collect();
    let mut merging = Merging::new(cells, rules, &by_portal);
    let mut next = merging.next_candidate();
    while merging.steps.len() < n_steps
        && let Some(candidate) = next
    {
        merging.remove(&candidate);
        next = merging.next_candidate();
    }
    let room_of_cell = record.after(n_steps);
    let pair_of = |(a, b): (u32, u32)| {
        let [a, b] = [a, b].map(|c| room_of_cell[c as usize]);
        [a.min(b), a.max(b)]
    };
    let mut links: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    for (&pair, portal) in &cells.portals {
        links
            .entry(pair_of(pair))
            .or_default()
            .extend(&portal.links);
    }
    let mut decided_at: BTreeMap<[u32; 2], Vec<DVec3>> = BTreeMap::new();
    for (pair, _, at) in resolved {
        decided_at.entry(pair_of(pair)).or_default().push(at);
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
            is_mouth: rules.is_mouth(live, weight),
            position: cells.portals[&live.widest].center,
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
