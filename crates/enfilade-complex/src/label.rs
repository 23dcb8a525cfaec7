//! Groups leaves into cells by votes.
//!
//! 1. Leaves connected without crossing a candidate portal or a gap form components. A gap is an opening through
//!    which no ball of the smallest hole passes. Where rooms leak into each other in this way, cracks, which are a
//!    few times as wide, are not crossed either.
//! 2. A component with one dominant label belongs to it. One with several strong labels has a leak: it is grown
//!    together along its openings, widest first, unless that would join two labels (Kruskal's forest), so that cells
//!    meet at the narrowest places.
//! 3. Parts of one label that open to each other are rejoined, across candidates too.
//! 4. Groups without a label, or with too little volume for a cell, join the neighbor with which a border would cost
//!    most: the one they open to most, through a candidate if need be. Groups without votes that open only through
//!    gaps are voids where the caller knows points of one region's, else solid.
//! 5. Crumbs, too thin for a ball of the smallest hole, join the cell or solid to which they have the largest gaps,
//!    through gaps in the air if there are any: a sliver that leads from within a wall into the air is not solid.
//! 6. Labels that no plane separates are one: where two meet in the open, beside their candidates, the border between
//!    them would follow arbitrary planes, in dozens of meaningless portals.
//!
//! Time: `O(F log F)` in open facets. Every merge reduces the number of groups, so it ends.

use std::borrow::Cow;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};
use std::ops::AddAssign;

use enfilade_geom::{DVec3, Sets};
use rayon::prelude::*;

use super::cut::{absorb_chips, dissolve_slivers, move_borders};
use super::graph::{LeafGraph, NO_CANDIDATE, OpenFacet};
use super::leaf_cells::{LeafCells, SOLID, Tally};
use super::unparted::join_unparted;
use super::{Label, LabelInput, LabelSettings};

/// Adds up the values of each key.
fn sums<K: Ord, V: Default + AddAssign>(entries: impl Iterator<Item = (K, V)>) -> BTreeMap<K, V> {
    let mut out = BTreeMap::new();
    for (key, value) in entries {
        *out.entry(key).or_default() += value;
    }
    out
}

/// A maximal set of leaves that will be one cell, or part of one.
struct Group {
    /// Its least leaf. Merging keeps the id of a group, so that a large group need not update all its neighbors
    /// whenever it takes in another.
    root: u32,
    label: Option<Label>,
    /// Numbers of points of voids in it, by region.
    voids: BTreeMap<u32, u32>,
    /// It is a cell, whatever happens around it.
    keeps: bool,
    volume: f64,
    /// For each neighboring group, the cost of a border with it.
    neighbors: BTreeMap<u32, f64>,
    /// Open area to other groups.
    open: f64,
    /// The part of `open` that lies on no candidate.
    leak: f64,
}

/// Numbers of points of voids, by leaf and region.
type Voids = BTreeMap<(u32, u32), u32>;

/// Cost of locating and counting a vote, in units of [`enfilade_geom::Allowance`].
const WORK_A_VOTE: u64 = 2;

/// Divides the leaves among cells. `leaf_of` returns the leaf of a point.
pub(super) fn label_leaves(
    graph: &LeafGraph<'_>,
    input: &LabelInput<'_>,
    has_seals: bool,
    leaf_of: impl Fn(DVec3) -> Option<u32> + Sync + Send,
) -> LeafCells {
    let LabelInput {
        votes, settings, ..
    } = input;
    let n_leaves = graph.volumes.len();
    let mut tally = Tally::new();
    // Located in parallel but counted in order, so that sums round alike for any number of threads.
    let leaf_of = |p: DVec3| {
        let may_look = graph.purse.spend(WORK_A_VOTE);
        may_look.then(|| leaf_of(p)).flatten()
    };
    let located = votes.par_iter().with_min_len(1024);
    let leaves: Vec<Option<u32>> = located.map(|v| leaf_of(v.point)).collect();
    for (vote, leaf) in votes.iter().zip(leaves) {
        if let Some(leaf) = leaf
            && vote.label != Label::Solid
        {
            *tally.entry((leaf, vote.label)).or_default() += f64::from(vote.weight);
        }
    }
    let mut component_of = Cow::from(graph.components());
    let mut strong = strong_labels(graph, &tally, &component_of, settings);
    let has_leak =
        |strong: &BTreeMap<u32, Vec<Label>>, c: u32| strong.get(&c).is_some_and(|s| s.len() > 1);
    if strong.keys().any(|&c| has_leak(&strong, c)) {
        // Rooms leak into each other, perhaps only through cracks.
        let leaked: Vec<bool> = component_of.iter().map(|&c| has_leak(&strong, c)).collect();
        let parts = |f: &OpenFacet| f.is_narrow && leaked[f.leaves[0] as usize];
        component_of = graph.components_without(parts).into();
        strong = strong_labels(graph, &tally, &component_of, settings);
    }

    // Leaves of components with several strong labels are grown together; all others are joined at once.
    let mut sets = Sets::new(n_leaves);
    let mut label_of_set = vec![Label::Solid; n_leaves];
    let leaked = |leaf: u32| {
        strong
            .get(&component_of[leaf as usize])
            .is_some_and(|s| s.len() > 1)
    };
    for leaf in 0..n_leaves as u32 {
        if !leaked(leaf) {
            sets.join(component_of[leaf as usize], leaf);
        }
    }
    for (&component, labels) in &strong {
        if let [label] = labels[..] {
            label_of_set[component as usize] = label;
        }
    }
    let mut best_of_leaf: BTreeMap<u32, (f64, Label)> = BTreeMap::new();
    for (&(leaf, label), &w) in &tally {
        let labels = strong
            .get(&component_of[leaf as usize])
            .map_or(&[][..], Vec::as_slice);
        if labels.len() > 1 && labels.contains(&label) {
            let best = best_of_leaf.entry(leaf).or_insert((w, label));
            if w > best.0 {
                *best = (w, label);
            }
        }
    }
    for (&leaf, &(_, label)) in &best_of_leaf {
        label_of_set[leaf as usize] = label;
    }
    grow_together(graph, &mut sets, &mut label_of_set, &component_of, leaked);
    rejoin(graph, &mut sets, &mut label_of_set);

    let voids = input.voids.iter();
    let voids = sums(voids.filter_map(|&(p, region)| Some(((leaf_of(p)?, region), 1))));
    let mut groups = merge_groups(graph, &mut sets, &label_of_set, &voids, settings);
    make_voids(&mut groups, settings);
    let groups = give_away_crumbs(graph, &mut sets, groups, has_seals);
    let mut cells = number_cells(graph, &mut sets, &groups);
    move_borders(graph, &mut cells, &tally);
    absorb_chips(graph, &mut cells, settings.min_volume);
    dissolve_slivers(graph, &mut cells);
    join_unparted(graph, &mut cells, input.may_join);
    cells.keep_border_outside(&graph.at_border, &graph.volumes);
    cells
}

/// Returns the strong labels in each component, and leaves out components without any.
fn strong_labels(
    graph: &LeafGraph<'_>,
    tally: &Tally,
    component_of: &[u32],
    settings: &LabelSettings,
) -> BTreeMap<u32, Vec<Label>> {
    let mut volume = vec![0.0; component_of.len()];
    for (leaf, &c) in component_of.iter().enumerate() {
        volume[c as usize] += graph.volumes[leaf];
    }
    let entries = tally.iter();
    let by_component: Tally =
        sums(entries.map(|(&(leaf, label), &w)| ((component_of[leaf as usize], label), w)));
    let (mut of_label, mut of_component) =
        (BTreeMap::<Label, f64>::new(), BTreeMap::<u32, f64>::new());
    for (&(c, label), &w) in &by_component {
        *of_label.entry(label).or_default() += w;
        *of_component.entry(c).or_default() += w;
    }
    let mut strong: BTreeMap<u32, Vec<Label>> = BTreeMap::new();
    for (&(c, label), &w) in &by_component {
        // A share of the label, not of the component: a toilet that leaks into a hall is a small part of both
        // together, yet all of the toilet.
        let main = w >= settings.strong_share * of_label[&label];
        let rules = w >= (1.0 - settings.dominance) * of_component[&c]
            && of_component[&c] >= 0.25 * volume[c as usize];
        if main || rules {
            strong.entry(c).or_default().push(label);
        }
    }
    strong
}

/// Grows Kruskal's forest over the openings of leaked components, never with two labels in one tree.
fn grow_together(
    graph: &LeafGraph<'_>,
    sets: &mut Sets,
    label_of_set: &mut [Label],
    component_of: &[u32],
    leaked: impl Fn(u32) -> bool,
) {
    graph.spend_pass();
    let mut order: Vec<u32> = (0..graph.facets.len() as u32)
        .filter(|&i| {
            let f = &graph.facets[i as usize];
            let [a, b] = f.leaves.map(|l| component_of[l as usize]);
            f.candidate == NO_CANDIDATE && !f.is_gap && a == b && leaked(f.leaves[0])
        })
        .collect();
    order.sort_by(|&a, &b| {
        graph.facets[b as usize]
            .width
            .total_cmp(&graph.facets[a as usize].width)
            .then(a.cmp(&b))
    });
    for i in order {
        let [a, b] = graph.facets[i as usize].leaves.map(|l| sets.find(l));
        let (la, lb) = (label_of_set[a as usize], label_of_set[b as usize]);
        if a != b && (la == lb || la == Label::Solid || lb == Label::Solid) {
            label_of_set[sets.join(a, b) as usize] = la.min(lb);
        }
    }
}

/// Joins parts of one region that only a candidate separates: a candidate reaches beyond its opening, and two
/// candidates of one opening have a slice of a room between them.
fn rejoin(graph: &LeafGraph<'_>, sets: &mut Sets, label_of_set: &mut [Label]) {
    for f in &graph.facets {
        let [a, b] = f.leaves.map(|l| sets.find(l));
        let label = label_of_set[a as usize];
        if a != b && label != Label::Solid && label == label_of_set[b as usize] {
            label_of_set[sets.join(a, b) as usize] = label;
        }
    }
}

/// Returns, by least leaf, the sets that have a label or an opening other than a gap to another set.
fn open_sets(graph: &LeafGraph<'_>, sets: &mut Sets, label_of_set: &[Label]) -> Vec<bool> {
    graph.spend_pass();
    let mut is_open: Vec<bool> = label_of_set.iter().map(|&l| l != Label::Solid).collect();
    for f in graph.facets.iter().filter(|f| !f.is_gap) {
        let [a, b] = f.leaves.map(|l| sets.find(l));
        if a != b {
            is_open[a as usize] = true;
            is_open[b as usize] = true;
        }
    }
    is_open
}

/// Spends the cost of merging two groups; returns `false` once the purse is empty.
fn may_merge(graph: &LeafGraph<'_>, a: &Group, b: &Group) -> bool {
    let n_neighbors = a.neighbors.len() + b.neighbors.len();
    graph.purse.spend(2 + n_neighbors as u64)
}

/// Makes a group of each set that is open or holds a point of a void, by least leaf.
fn groups_of(
    graph: &LeafGraph<'_>,
    sets: &mut Sets,
    label_of_set: &[Label],
    voids: &Voids,
) -> BTreeMap<u32, Group> {
    const NOT_OPEN: usize = usize::MAX;
    let mut is_open = open_sets(graph, sets, label_of_set);
    let mut voids_of_set: BTreeMap<u32, BTreeMap<u32, u32>> = BTreeMap::new();
    for (&(leaf, region), &n) in voids {
        let set = sets.find(leaf);
        is_open[set as usize] = true;
        *voids_of_set
            .entry(set)
            .or_default()
            .entry(region)
            .or_default() += n;
    }
    let mut place = vec![NOT_OPEN; is_open.len()];
    let mut list: Vec<(u32, Group)> = Vec::new();
    for leaf in 0..graph.volumes.len() as u32 {
        let set = sets.find(leaf);
        if !is_open[set as usize] {
            continue;
        }
        let at = &mut place[set as usize];
        if *at == NOT_OPEN {
            *at = list.len();
            let label = label_of_set[set as usize];
            let group = Group {
                root: set,
                label: (label != Label::Solid).then_some(label),
                voids: voids_of_set.remove(&set).unwrap_or_default(),
                keeps: false,
                volume: 0.0,
                neighbors: BTreeMap::new(),
                open: 0.0,
                leak: 0.0,
            };
            list.push((set, group));
        }
        list[*at].1.volume += graph.volumes[leaf as usize];
    }
    for f in graph.facets.iter().filter(|f| !f.is_gap) {
        let [a, b] = f.leaves.map(|l| sets.find(l));
        if a != b {
            for (from, to) in [(a, b), (b, a)] {
                let group = &mut list[place[from as usize]].1;
                *group.neighbors.entry(to).or_default() += f.cost();
                group.open += f64::from(f.area);
                if f.candidate == NO_CANDIDATE {
                    group.leak += f64::from(f.area);
                }
            }
        }
    }
    list.into_iter().collect()
}

/// Makes voids of groups that are not cells by their votes, and hold points of voids of one region that has a cell: with
/// several, it is a cavity of the construction, and solid. Regions count by the shares of [`strong_labels`].
fn make_voids(groups: &mut BTreeMap<u32, Group>, settings: &LabelSettings) {
    let kept = groups.values().filter(|g| g.keeps);
    let rooms: BTreeSet<u32> = kept.filter_map(|g| g.label?.region()).collect();
    let closed = groups.values().filter(|g| !g.keeps);
    let found = closed.flat_map(|g| g.voids.clone());
    let of_region: BTreeMap<u32, u32> = sums(found);
    for group in groups.values_mut().filter(|g| !g.keeps) {
        let n_all: u32 = group.voids.values().sum();
        let is_strong = |(r, n): &(&u32, &u32)| {
            f64::from(**n) >= settings.strong_share * f64::from(of_region[r])
                || f64::from(**n) >= (1.0 - settings.dominance) * f64::from(n_all)
        };
        let mut strong = group.voids.iter().filter(is_strong);
        if let (Some((region, _)), None) = (strong.next(), strong.next())
            && rooms.contains(region)
        {
            group.label = Some(Label::Void(*region));
        }
    }
    keep_cells(groups, |label| matches!(label, Label::Void(_)), settings);
}

/// Decides which of the groups with labels that `of` accepts are cells.
fn keep_cells(groups: &mut BTreeMap<u32, Group>, of: fn(&Label) -> bool, settings: &LabelSettings) {
    // The largest group of each label keeps it, whatever its size.
    let mut main: BTreeMap<Label, (f64, Reverse<u32>)> = BTreeMap::new();
    for (&id, group) in groups.iter() {
        if let Some(label) = group.label.filter(of) {
            let key = (group.volume, Reverse(id));
            let best = main.entry(label).or_insert(key);
            if key > *best {
                *best = key;
            }
        }
    }
    for (&id, group) in groups.iter_mut() {
        // A closet opens at its door and a shaft not at all, but a hollow in furniture leaks all over.
        let is_cavity = group.volume < settings.min_room && group.leak > 0.25 * group.open;
        let is_part = group.volume >= settings.min_volume
            && (settings.keeps_closed || !group.neighbors.is_empty());
        let is_cell = |label: Label| !is_cavity && (is_part || main[&label].1.0 == id);
        group.keeps |= group.label.filter(of).is_some_and(is_cell);
    }
}

/// Merges groups without a label, and small duplicates of a label, into their neighbors; voids not into the space beyond.
fn merge_groups(
    graph: &LeafGraph<'_>,
    sets: &mut Sets,
    label_of_set: &[Label],
    voids: &Voids,
    settings: &LabelSettings,
) -> BTreeMap<u32, Group> {
    let mut groups = groups_of(graph, sets, label_of_set, voids);
    keep_cells(&mut groups, |_| true, settings);
    // Smallest first; volumes are not negative, so their bits compare like numbers.
    let entry = |id: u32, group: &Group| Reverse((group.volume.to_bits(), group.root, id));
    let mut queue: BinaryHeap<Reverse<(u64, u32, u32)>> = groups
        .iter()
        .filter(|(_, group)| !group.keeps && !group.neighbors.is_empty())
        .map(|(&id, group)| entry(id, group))
        .collect();
    while let Some(Reverse((bits, _, id))) = queue.pop() {
        let is_current = |g: &&Group| !g.keeps && g.volume.to_bits() == bits;
        let to = groups.get(&id).filter(is_current).and_then(|group| {
            let root = |id: &u32| groups[id].root;
            let by_cost = |a: &(&u32, &f64), b: &(&u32, &f64)| {
                a.1.total_cmp(b.1).then_with(|| root(b.0).cmp(&root(a.0)))
            };
            let is_void = !group.voids.is_empty();
            let is_taken = |id: &u32| is_void && groups[id].label == Some(Label::Beyond);
            let others = group.neighbors.iter().filter(|n| !is_taken(n.0));
            others.max_by(by_cost)
        });
        let Some(to) = to.map(|(&to, _)| to) else {
            continue;
        };
        let (Some(merged), Some(mut host)) = (groups.remove(&id), groups.remove(&to)) else {
            continue;
        };
        if !may_merge(graph, &merged, &host) {
            break;
        }
        host.root = sets.join(merged.root, host.root);
        host.volume += merged.volume;
        host.label = host.label.or(merged.label);
        host.voids = sums(host.voids.into_iter().chain(merged.voids));
        host.neighbors.remove(&id);
        for (other, cost) in merged.neighbors.into_iter().filter(|n| n.0 != to) {
            *host.neighbors.entry(other).or_default() += cost;
            if let Some(n) = groups.get_mut(&other) {
                let cost = n.neighbors.remove(&id).unwrap_or(0.0);
                *n.neighbors.entry(to).or_default() += cost;
            }
        }
        if !host.keeps {
            queue.push(entry(to, &host));
        }
        groups.insert(to, host);
    }
    groups.into_values().map(|g| (g.root, g)).collect()
}

/// Merges crumbs, which have room for nothing, into the cell or solid to which they have the largest gaps; without
/// seals, does so for everything that opens only through gaps.
///
/// Kruskal's forest over the gaps, those in the air first, then largest first, never with two cells or solids in one
/// tree, so that little is left to be sealed. `O(F log F)` in gaps.
fn give_away_crumbs(
    graph: &LeafGraph<'_>,
    sets: &mut Sets,
    groups: BTreeMap<u32, Group>,
    has_seals: bool,
) -> BTreeMap<u32, Group> {
    graph.spend_pass();
    let n = graph.volumes.len();
    let mut stays = vec![false; n];
    for (&id, _) in groups.iter().filter(|g| g.1.keeps) {
        stays[id as usize] = true;
    }
    if has_seals {
        for leaf in (0..n as u32).filter(|&l| !graph.is_thin(l)) {
            stays[sets.find(leaf) as usize] = true;
        }
    }
    for gap in graph.gaps() {
        let [a, b] = gap.leaves.map(|l| sets.find(l));
        let [a_stays, b_stays] = [a, b].map(|s| stays[s as usize]);
        if a != b && !(a_stays && b_stays) {
            stays[sets.join(a, b) as usize] = a_stays || b_stays;
        }
    }
    let mut out: BTreeMap<u32, Group> = BTreeMap::new();
    for (_, mut group) in groups.into_iter().filter(|g| g.1.keeps) {
        group.root = sets.find(group.root);
        group.volume = 0.0;
        out.insert(group.root, group);
    }
    for leaf in 0..n as u32 {
        if let Some(group) = out.get_mut(&sets.find(leaf)) {
            group.volume += graph.volumes[leaf as usize];
        }
    }
    out
}

/// Numbers the groups that are cells by label, then by falling volume; all others are solid.
fn number_cells(
    graph: &LeafGraph<'_>,
    sets: &mut Sets,
    groups: &BTreeMap<u32, Group>,
) -> LeafCells {
    let mut cells: Vec<(&u32, &Group)> = groups.iter().filter(|(_, g)| g.keeps).collect();
    cells.sort_by(|a, b| {
        a.1.label
            .cmp(&b.1.label)
            .then(b.1.volume.total_cmp(&a.1.volume))
            .then(a.0.cmp(b.0))
    });
    // Groups at the border are all open to the space beyond it, so they are one cell.
    let mut border: BTreeMap<u32, f64> = BTreeMap::new();
    for leaf in (0..graph.volumes.len()).filter(|&l| graph.at_border[l]) {
        *border.entry(sets.find(leaf as u32)).or_default() += graph.volumes[leaf];
    }
    let outer = (0..cells.len())
        .filter_map(|i| Some((i, *border.get(cells[i].0)?)))
        .filter(|(_, volume)| *volume > 0.0)
        .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
        .map(|(i, _)| *cells[i].0);
    let also_outer: Vec<(&u32, &Group)> = cells
        .extract_if(.., |(id, _)| {
            outer.is_some_and(|o| o != **id) && border.contains_key(id)
        })
        .collect();
    let mut cell_of_set: BTreeMap<u32, u32> = cells
        .iter()
        .enumerate()
        .map(|(i, (id, _))| (**id, i as u32))
        .collect();
    let outside = outer.map(|id| cell_of_set[&id]);
    let mut volumes: Vec<f64> = cells.iter().map(|(_, g)| g.volume).collect();
    if let Some(outside) = outside {
        for (id, group) in also_outer {
            cell_of_set.insert(*id, outside);
            volumes[outside as usize] += group.volume;
        }
    }
    LeafCells {
        cell_of_leaf: (0..graph.volumes.len() as u32)
            .map(|leaf| cell_of_set.get(&sets.find(leaf)).copied().unwrap_or(SOLID))
            .collect(),
        label_of_cell: cells
            .iter()
            .map(|(_, g)| g.label.unwrap_or(Label::Solid))
            .collect(),
        volumes,
        outside,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Known;
    use enfilade_geom::Purse;

    /// A band above the floor of one room, beneath a door to another, joined to the rest of its room only by cracks.
    #[test]
    fn what_has_no_label_goes_to_what_it_opens_to_beside_a_candidate() {
        let facet = |other: u32, candidate: u32, area: f32| OpenFacet {
            leaves: [other, 2],
            width: 0.1,
            area,
            candidate,
            is_narrow: candidate == NO_CANDIDATE,
            is_gap: false,
            is_clear: true,
        };
        let graph = LeafGraph {
            facets: vec![facet(0, NO_CANDIDATE, 0.06), facet(1, 0, 0.1)],
            volumes: vec![30.0, 20.0, 0.005],
            faces: vec![10.0, 10.0, 0.1],
            boxes: Vec::new(),
            at_border: vec![false; 3],
            hole: 0.023,
            rounding: 1e-5,
            purse: Purse::endless(),
            known: Known::default(),
        };
        let settings = LabelSettings::default();
        let home = |graph: &LeafGraph<'_>| {
            let mut sets = Sets::new(3);
            let labels = [Label::Region(10), Label::Region(20), Label::Solid];
            merge_groups(graph, &mut sets, &labels, &Voids::new(), &settings);
            (0..2).find(|&room| sets.find(room) == sets.find(2))
        };
        assert_eq!(home(&graph), Some(0));
        // It passes through a candidate only if nothing else is open.
        let shut = LeafGraph {
            facets: vec![facet(1, 0, 0.1)],
            ..graph
        };
        assert_eq!(home(&shut), Some(1));
    }
    /// A needle that leads from within a wall into the air: most of it opens to matter.
    #[test]
    fn a_needle_that_reaches_the_air_is_not_matter() {
        let facet = |other: u32, area: f32, is_clear: bool| OpenFacet {
            leaves: [other, 1],
            width: 1e-5,
            area,
            candidate: NO_CANDIDATE,
            is_narrow: true,
            is_gap: true,
            is_clear,
        };
        let home_of_needle = |is_clear| {
            let graph = LeafGraph {
                facets: vec![facet(0, 1e-7, is_clear), facet(2, 2e-6, false)],
                volumes: vec![30.0, 5e-12, 1.0],
                faces: vec![10.0, 2e-6, 1.0],
                boxes: Vec::new(),
                at_border: vec![false; 3],
                hole: 0.023,
                rounding: 1e-5,
                purse: Purse::endless(),
                known: Known::default(),
            };
            let mut sets = Sets::new(3);
            let groups = merge_groups(
                &graph,
                &mut sets,
                &[Label::Region(10), Label::Solid, Label::Solid],
                &Voids::new(),
                &LabelSettings::default(),
            );
            give_away_crumbs(&graph, &mut sets, groups, true);
            [0, 2].map(|other| sets.find(1) == sets.find(other))
        };
        assert_eq!(home_of_needle(true), [true, false]);
        assert_eq!(home_of_needle(false), [false, true]);
    }
}
