//! Cells that a guide makes where there are no walls: vessels, caves, tunnels (Lefebvre & Hornus 2003, §3.0.2).
//!
//! Where surfaces are curved, none of their planes closes a path, and only the user's planes remain. The shape of an
//! opening carries no information there either: a grid cuts a tube anywhere. So a separator in a guide's plane is kept
//! if its rim is round. Where walls stand, shape decides on rooms (`rooms`), and a guide is only a start.
//!
//! Time: `O(separators of guides · portals)`.

use std::collections::BTreeMap;

use enfilade_geom::{Aabb, BoxTree, DVec3, Purse, Sets};

use crate::complex::{Label, Vote};
use crate::config::{Guide, Heuristic};
use crate::proposal::Proposal;
use crate::structure::OUTDOORS;

use super::cells::{self, NO_CELL};
use super::input::BspInput;
use super::leaves::Bsp;
use super::separator::{self, Separator};

/// Share of a rim in its two main planes from which on they count as walls: that of a hexagon. A rectangle has half or
/// more, an octagon a quarter.
const FLAT: f64 = 1.0 / 3.0;

/// Builds the tree of a scene. If a guide is given and matter leaves no air but the outdoors, the scene is only a shell
/// whose inside is wanted, whichever way it faces: then there is no matter.
pub(super) fn build<'a>(
    input: &BspInput<'_>,
    heuristic: Heuristic,
    guide: &Guide,
    purse: Purse<'a>,
) -> Bsp<'a> {
    let build = |has_matter| Bsp::build_of(input, heuristic, guide, has_matter, purse);
    let bsp = build(true);
    let is_shell = || input.solids.is_empty() && cells::components(&bsp, &[]).1 <= 1;
    if !guide.is_empty() && is_shell() {
        return build(false);
    }
    bsp
}

/// Returns the separators with a round rim in planes of guides.
pub(super) fn separators(bsp: &Bsp<'_>) -> Vec<Separator> {
    let found = separator::find_in_guides(bsp);
    if found.is_empty() {
        return found;
    }
    let boxes: Vec<Aabb> = bsp
        .surfaces
        .iter()
        .map(|f| Aabb::of_points(&f.points))
        .collect();
    let solids = BoxTree::new(&boxes);
    let is_round = |s: &Separator| {
        let mut sides: Vec<f64> = separator::rim(bsp, s, &solids).into_values().collect();
        sides.sort_by(|a, b| b.total_cmp(a));
        let longest: f64 = sides.iter().take(2).sum();
        longest < FLAT * sides.iter().sum::<f64>()
    };
    uncrossed(bsp, found.into_iter().filter(is_round).collect())
}

/// Divides the rooms of a proposal by such separators. `walls` are the separators that divided the air before; parts of
/// one room are joined again, except across the separators of guides.
pub(super) fn divide(
    bsp: &Bsp<'_>,
    guides: &[Separator],
    walls: Vec<Separator>,
    proposal: &mut Proposal,
) {
    let mut all = walls;
    all.extend_from_slice(guides);
    let (part_of_leaf, n_parts) = cells::components(bsp, &all);
    let part_at = |p: DVec3| part_of_leaf[bsp.tree.leaf_of(p) as usize];
    // The room that most votes in a part are for.
    let mut votes: BTreeMap<(u32, Label), u32> = BTreeMap::new();
    for vote in &proposal.votes {
        *votes.entry((part_at(vote.point), vote.label)).or_default() += 1;
    }
    let mut room_of_part: BTreeMap<u32, (u32, Label)> = BTreeMap::new();
    for ((part, room), n) in votes {
        let most = room_of_part.entry(part).or_insert((n, room));
        *most = (*most).max((n, room));
    }
    let mut is_guide = vec![false; bsp.portals.len()];
    for &p in guides.iter().flat_map(|s| &s.portals) {
        is_guide[p as usize] = true;
    }
    let mut sets = Sets::new(n_parts);
    for (p, _) in bsp.portals.iter().zip(&is_guide).filter(|(_, is)| !**is) {
        let [a, b] = p.leaves.map(|l| part_of_leaf[l as usize]);
        let [of_a, of_b] = [a, b].map(|part| room_of_part.get(&part).map(|r| r.1));
        if of_a.is_some() && of_a == of_b {
            sets.join(a, b);
        }
    }
    let mut number = BTreeMap::new();
    let is_indoors = |v: &&mut Vote| v.label != Label::Region(OUTDOORS);
    for vote in proposal.votes.iter_mut().filter(is_indoors) {
        let part = part_at(vote.point);
        let set = (part != NO_CELL).then(|| sets.find(part));
        let next = Label::Region(OUTDOORS + 1 + number.len() as u32);
        vote.label = *number.entry((vote.label, set)).or_insert(next);
    }
}

/// Returns separators that do not cross each other, chosen smallest first: those go across a tube and not along it.
/// Drops those with one cell on both sides.
fn uncrossed(bsp: &Bsp<'_>, mut found: Vec<Separator>) -> Vec<Separator> {
    found.sort_by(|a, b| a.area.total_cmp(&b.area));
    let mut kept: Vec<Separator> = Vec::new();
    for s in found {
        // Each round joins all portals and tests all kept separators anew.
        if !bsp
            .purse
            .spend((bsp.portals.len() / 4 + 10 * kept.len()) as u64)
        {
            break;
        }
        kept.push(s);
        let (of_leaf, _) = cells::components(bsp, &kept);
        let crosses = |s: &Separator| {
            cells::sides_of(bsp, s, &of_leaf)
                .iter()
                .any(|c| c.len() > 1)
        };
        if kept.iter().any(crosses) {
            kept.pop();
        }
    }
    let (of_leaf, _) = cells::components(bsp, &kept);
    kept.retain(|s| {
        let [front, back] = cells::sides_of(bsp, s, &of_leaf);
        front != back
    });
    kept
}
