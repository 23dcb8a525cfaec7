//! Merges cells into rooms across separators that are not a pinch.
//!
//! Separators of a building lie in each of its planes: at both faces of a wall, along every pier and
//! beam. Lefebvre & Hornus 2003 (§3) choose among them by a cost bound; in a building, that joins a toilet
//! to its corridor before it joins the two halves of a hall, since a room has fewer triangles than a stair.
//! This module uses the watershed's measure instead (`structure/pinch.rs`): an opening separates two rooms if it
//! is narrower than the sections of space beside it. Rule and settings are the same; sections are looked up
//! in the tree. Crossing separators need no choice: each is kept until it stops being a pinch.
//!
//! Time: one look-up in the tree for each of some ten thousand points around a separator; each merge
//! measures the openings of the merged cell again.

use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3};
use rayon::prelude::*;

use crate::MergeSettings;
use crate::complex::poly;
use crate::complex::region::RegionShape;
use crate::structure::{Mergeable, Pair, join_rooms, lies_in_slab};

use super::cells::{self, LeafCells, NO_CELL};
use super::lattice::{Lattice, NONE};
use super::leaves::Bsp;
use super::separator::{self, Separator};
use super::shape;

/// A door leaf this near to a separator's plane closes it. [Units: wu]
const CLOSURE_REACH: f64 = 0.25;
/// Returns `true` if a separator can be a pinch for some division of the space around it: if the larger of the two
/// sections beside it, with all open space taken together, is larger than the separator.
pub(super) fn may_be_pinch(bsp: &Bsp<'_>, s: &Separator, settings: &MergeSettings) -> bool {
    let lattice = Lattice::of(bsp, s, settings);
    let all = |_: usize, _: u32| 1;
    let section = lattice.section(bsp, s.area, &|_| true, &all, Some(0), settings);
    section.ratio < settings.wall_threshold
}

/// Evidence of rooms besides the tree.
pub(super) struct Evidence<'a> {
    pub(super) shapes: &'a [Option<RegionShape>],
    /// Triangles of door leaves and panes.
    pub(super) closures: &'a Bvh,
    /// Heights at which storeys end, ascending. [Units: wu]
    pub(super) slabs: &'a [f64],
    pub(super) allowance: &'a Allowance,
}

/// Cost of measuring an opening, in units of [`Allowance`].
const WORK: u64 = 200;

/// Part of a separator between two cells: the separator, and indices into its list of portals.
type SeparatorPart = (u32, Vec<u32>);

struct LeafMerger<'a> {
    bsp: &'a Bsp<'a>,
    settings: &'a MergeSettings,
    evidence: &'a Evidence<'a>,
    separators: &'a [Separator],
    lattices: Vec<Lattice>,
    /// For each separator, the share of each of its portals that closures fill.
    closed: Vec<Vec<f64>>,
    /// Areas of those portals.
    areas: Vec<Vec<f64>>,
    of_leaf: &'a [u32],
    /// Cell that each cell was joined to. Not [`Sets`](enfilade_geom::Sets), as the outdoors always represents its set.
    parent: Vec<u32>,
    version: Vec<u32>,
    outer: u32,
    neighbors: Vec<BTreeSet<u32>>,
    openings: BTreeMap<(u32, u32), Vec<SeparatorPart>>,
    storeys_apart: bool,
}

/// Divides the leaves by the separators that are a pinch, and merges cells that are too thin to be rooms.
pub(super) fn part(
    bsp: &Bsp<'_>,
    separators: Vec<Separator>,
    evidence: &Evidence<'_>,
    settings: &MergeSettings,
) -> LeafCells {
    let kept: Vec<Separator> = separators
        .into_par_iter()
        .filter(|s| may_be_pinch(bsp, s, settings))
        .collect();
    let (of_leaf, n_cells) = cells::components(bsp, &kept);
    let lattices: Vec<Lattice> = kept
        .par_iter()
        .map(|s| Lattice::of(bsp, s, settings))
        .collect();
    let mut merger = LeafMerger {
        bsp,
        settings,
        evidence,
        closed: kept
            .par_iter()
            .zip(&lattices)
            .map(|(s, l)| closed_shares(bsp, s, l, evidence.closures, settings))
            .collect(),
        areas: kept
            .iter()
            .map(|s| {
                let area = |&p: &u32| poly::area(&bsp.portals[p as usize].points);
                s.portals.iter().map(area).collect()
            })
            .collect(),
        separators: &kept,
        lattices,
        of_leaf: &of_leaf,
        parent: (0..n_cells as u32).collect(),
        version: vec![0; n_cells],
        outer: of_leaf[bsp.outer_leaf() as usize],
        neighbors: vec![BTreeSet::new(); n_cells],
        openings: BTreeMap::new(),
        storeys_apart: true,
    };
    merger.find_openings();
    for storeys_apart in [true, false] {
        merger.storeys_apart = storeys_apart;
        merger.run_separators();
        join_rooms(&mut merger);
    }
    merger.absorb_passages();
    let cell_of: Vec<u32> = (0..n_cells as u32).map(|c| merger.find(c)).collect();
    let openings = std::mem::take(&mut merger.openings);
    drop(merger);
    // Renumber in order.
    let mut number = vec![NONE; n_cells];
    let mut n = 0;
    let of_leaf = of_leaf
        .iter()
        .map(|&c| {
            if c == NO_CELL {
                return NO_CELL;
            }
            let slot = &mut number[cell_of[c as usize] as usize];
            if *slot == NONE {
                *slot = n;
                n += 1;
            }
            *slot
        })
        .collect();
    let separators = openings
        .into_values()
        .flatten()
        .map(|(s, places)| {
            let whole = &kept[s as usize];
            let portals: Vec<u32> = places.iter().map(|&k| whole.portals[k as usize]).collect();
            Separator {
                plane: whole.plane,
                area: portals
                    .iter()
                    .map(|&p| poly::area(&bsp.portals[p as usize].points))
                    .sum(),
                portals,
            }
        })
        .collect();
    LeafCells {
        of_leaf,
        n_cells: n as usize,
        separators,
        n_crossing: 0,
        n_useless: 0,
    }
}

/// Most directions along which cells are measured: walls of most buildings have two; the height is another.
const MAX_DIRECTIONS: usize = 16;

/// Returns `true` for each cell too narrow for a ball of the least radius of a room: layers of floors and roofs,
/// interiors of walls. The watershed has no region there either (`watershed/hollow.rs`).
///
/// Measured across the planes of the tree with the largest portals, so that the rotation of the building does not
/// matter. Errs to a room: a cell is narrow only if all of it lies between two close planes.
pub(super) fn narrow_cells(
    bsp: &Bsp<'_>,
    cells: &LeafCells,
    settings: &MergeSettings,
) -> Vec<bool> {
    let mut by_area: Vec<(f64, DVec3)> = vec![(f64::INFINITY, DVec3::Y)];
    for portal in &bsp.portals {
        let normal = bsp.tree.planes[portal.plane as usize].normal;
        let area = poly::area(&portal.points);
        let same = by_area
            .iter_mut()
            .find(|(_, n)| n.dot(normal).abs() > 0.9999);
        match same {
            Some(known) => known.0 += area,
            None => by_area.push((area, normal)),
        }
    }
    by_area.sort_by(|a, b| b.0.total_cmp(&a.0));
    by_area.truncate(MAX_DIRECTIONS);
    let directions: Vec<DVec3> = by_area.into_iter().map(|d| d.1).collect();
    let (tree, tolerance) = (&bsp.tree, &bsp.tolerance);
    let widths = shape::widths(
        tree,
        tolerance,
        &cells.of_leaf,
        cells.n_cells,
        &directions,
        bsp.purse,
    );
    let least = 2.0 * settings.min_radius;
    widths.into_iter().map(|width| width < least).collect()
}

/// Returns the share of each portal that a door leaf or a pane fills.
fn closed_shares(
    bsp: &Bsp<'_>,
    s: &Separator,
    lattice: &Lattice,
    closures: &Bvh,
    settings: &MergeSettings,
) -> Vec<f64> {
    let mut hits = vec![[0_u32; 2]; s.portals.len()];
    if !closures.is_empty() {
        let plane = &bsp.tree.planes[s.plane as usize];
        let (u, v) = plane.basis();
        let off = plane.normal * CLOSURE_REACH;
        let all = || {
            s.portals
                .iter()
                .flat_map(|&p| &bsp.portals[p as usize].points)
        };
        let low = |d: DVec3| all().map(|p| d.dot(*p)).fold(f64::MAX, f64::min) - settings.surround;
        let base = plane.normal * -plane.d + u * low(u) + v * low(v);
        for (k, &n) in lattice
            .portal_at
            .iter()
            .enumerate()
            .filter(|(_, n)| **n != NONE)
            .filter(bsp.purse.each(10))
        {
            let [i, j] =
                [k % lattice.side[0], k / lattice.side[0]].map(|t| t as f64 * lattice.step);
            let p = base + u * i + v * j;
            let slot = &mut hits[n as usize];
            slot[0] += u32::from(closures.any_hit(p - off, p + off, |_| false));
            slot[1] += 1;
        }
    }
    hits.iter()
        .map(|[h, n]| f64::from(*h) / f64::from((*n).max(1)))
        .collect()
}

impl LeafMerger<'_> {
    fn find(&self, mut c: u32) -> u32 {
        while self.parent[c as usize] != c {
            c = self.parent[c as usize];
        }
        c
    }

    fn cell_of(&self, leaf: u32) -> u32 {
        match self.of_leaf[leaf as usize] {
            NO_CELL => NO_CELL,
            c => self.find(c),
        }
    }

    /// Returns the pair with the outdoors first, else the lesser number first.
    fn ordered(&self, a: u32, b: u32) -> (u32, u32) {
        if b == self.outer || (a != self.outer && b < a) {
            (b, a)
        } else {
            (a, b)
        }
    }

    fn find_openings(&mut self) {
        for (i, s) in self.separators.iter().enumerate() {
            let mut by_pair: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
            for (k, &p) in s.portals.iter().enumerate() {
                let [a, b] = self.bsp.portals[p as usize].leaves.map(|l| self.cell_of(l));
                if a != b {
                    let pair = self.ordered(a, b);
                    by_pair.entry(pair).or_default().push(k as u32);
                }
            }
            for (pair, places) in by_pair {
                self.openings
                    .entry(pair)
                    .or_default()
                    .push((i as u32, places));
                self.neighbors[pair.0 as usize].insert(pair.1);
                self.neighbors[pair.1 as usize].insert(pair.0);
            }
        }
    }

    fn area(&self, (s, places): &SeparatorPart) -> f64 {
        let areas = &self.areas[*s as usize];
        places.iter().map(|&k| areas[k as usize]).sum()
    }

    fn closed_share(&self, (s, places): &SeparatorPart) -> f64 {
        let (areas, closed) = (&self.areas[*s as usize], &self.closed[*s as usize]);
        let sum: f64 = places
            .iter()
            .map(|&k| areas[k as usize] * closed[k as usize])
            .sum();
        sum / self.area(&(*s, places.clone())).max(1e-9)
    }

    fn lies_in_slab(&self, s: u32) -> bool {
        let plane = &self.bsp.tree.planes[self.separators[s as usize].plane as usize];
        let height = -plane.d * plane.normal.y;
        lies_in_slab(plane.normal, height, self.evidence.slabs)
    }

    fn measure(
        &self,
        separator: u32,
        area: f64,
        is_seed: &dyn Fn(u32) -> bool,
        in_side: &dyn Fn(usize, u32) -> u8,
        endless: Option<usize>,
    ) -> f64 {
        let lattice = &self.lattices[separator as usize];
        let settings = self.settings;
        let mut found = lattice.section(self.bsp, area, is_seed, in_side, endless, settings);
        if endless.is_some() {
            found.ratio *= settings.outdoor_gain;
        }
        settings.openness(found.ratio, found.wall)
    }

    /// Returns the cells before and behind each portal of a separator that still divides two.
    fn sides(&self, separator: u32) -> Vec<(u32, [u32; 2])> {
        let portals = &self.separators[separator as usize].portals;
        let cells = |(k, &p): (usize, &u32)| {
            let cells = self.bsp.portals[p as usize].leaves.map(|l| self.cell_of(l));
            (cells[0] != cells[1]).then_some((k as u32, cells))
        };
        portals.iter().enumerate().filter_map(cells).collect()
    }

    /// Returns the openness of a separator as a whole, however the space on either side of it is divided;
    /// and the age of its cells.
    fn pinch_of_separator(&self, separator: u32) -> (f64, u64) {
        let sides = self.sides(separator);
        if sides.is_empty() {
            return (0.0, 0);
        }
        let of_side = |i: usize| -> BTreeSet<u32> { sides.iter().map(|s| s.1[i]).collect() };
        let cells = [of_side(0), of_side(1)];
        let all = cells.iter().flatten();
        let age = all.map(|&c| u64::from(self.version[c as usize])).sum();
        let places: Vec<u32> = sides.iter().map(|s| s.0).collect();
        let opening = (separator, places);
        let apart = self.storeys_apart && self.lies_in_slab(separator);
        if apart || self.closed_share(&opening) >= self.settings.closed_share {
            return (0.0, age);
        }
        let is_seed = |k: u32| opening.1.binary_search(&k).is_ok();
        let in_side = |side: usize, leaf: u32| {
            if cells[side].contains(&self.cell_of(leaf)) {
                side as u8
            } else {
                2
            }
        };
        let endless = (0..2).find(|&i| cells[i].contains(&self.outer));
        let area = self.area(&opening);
        (
            self.measure(separator, area, &is_seed, &in_side, endless),
            age,
        )
    }

    /// Removes whole separators, least pinched first: separators that cross one cut it into pieces that are
    /// narrow by themselves, and would open a way through it.
    fn run_separators(&mut self) {
        let weigh = |merger: &Self, s: u32| {
            if !merger.may_go_on() {
                return None;
            }
            let (pinch, age) = merger.pinch_of_separator(s);
            (pinch >= 1.0).then_some((pinch.to_bits(), std::cmp::Reverse(s), age))
        };
        let n = self.separators.len() as u32;
        let all: Vec<_> = (0..n)
            .into_par_iter()
            .filter_map(|s| weigh(self, s))
            .collect();
        let mut queue: BinaryHeap<_> = all.into();
        while let Some((_, std::cmp::Reverse(s), age)) = queue.pop() {
            let now = weigh(self, s);
            if now.is_none_or(|n| n.2 != age) {
                queue.extend(now);
                continue;
            }
            for (_, [a, b]) in self.sides(s) {
                let pair = self.ordered(self.find(a), self.find(b));
                if pair.0 != pair.1 {
                    self.join(pair);
                }
            }
        }
    }

    /// Groups openings that share an edge: they are one opening that bends, whose area is the length of the
    /// vector area. Returns the area of each group with its largest flat part.
    fn together<'a>(
        &self,
        pair: (u32, u32),
        openings: &'a [SeparatorPart],
    ) -> Vec<(f64, &'a SeparatorPart)> {
        let n = openings.len();
        let mut group: Vec<usize> = (0..n).collect();
        let eps = 4.0 * self.bsp.tolerance.plane;
        let portals = |o: &'a SeparatorPart| {
            let all = &self.separators[o.0 as usize].portals;
            o.1.iter()
                .map(move |&k| &self.bsp.portals[all[k as usize] as usize])
        };
        let boxes: Vec<Aabb> = openings
            .iter()
            .map(|o| Aabb::of_points(portals(o).flat_map(|p| &p.points)).expanded(eps))
            .collect();
        for i in 0..n {
            for j in (0..i).filter(self.bsp.purse.each(1)) {
                let touches = group[i] != group[j]
                    && boxes[i].overlaps(&boxes[j])
                    && portals(&openings[i]).any(|p| {
                        portals(&openings[j]).any(|q| separator::touch(&p.points, &q.points, eps))
                    });
                if touches {
                    let (from, to) = (group[i], group[j]);
                    group
                        .iter_mut()
                        .filter(|g| **g == from)
                        .for_each(|g| *g = to);
                }
            }
        }
        let mut out: Vec<(f64, &SeparatorPart)> = Vec::new();
        for g in 0..n {
            let members = || (0..n).filter(|&i| group[i] == g);
            let vector: DVec3 = members()
                .flat_map(|i| portals(&openings[i]))
                .map(|p| {
                    let normal = self.bsp.tree.planes[p.plane as usize].normal;
                    let leads_up = self.cell_of(p.leaves[0]) == pair.1;
                    let area = poly::area(&p.points);
                    normal * if leads_up { area } else { -area }
                })
                .sum();
            let flat = |i: usize| self.area(&openings[i]);
            if let Some(i) = members().max_by(|&i, &j| flat(i).total_cmp(&flat(j)).then(j.cmp(&i)))
            {
                out.push((vector.length().max(flat(i)), &openings[i]));
            }
        }
        out
    }

    /// Merges cells that are only the depth of an opening (the way through a wall) into the neighbor that is
    /// least closed off: behind their largest opening they are less deep than sections reach, so no section
    /// could distinguish them from the opening itself.
    fn absorb_passages(&mut self) {
        let mut volumes = vec![0.0; self.parent.len()];
        for (leaf, shape) in self.evidence.shapes.iter().enumerate() {
            let cell = self.cell_of(leaf as u32);
            if let Some(sum) = volumes.get_mut(cell as usize) {
                *sum += shape.map_or(0.0, |s| s.volume);
            }
        }
        let mut order: Vec<u32> = (0..self.parent.len() as u32)
            .filter(|&c| self.find(c) == c && c != self.outer)
            .collect();
        order.sort_by(|&a, &b| {
            volumes[a as usize]
                .total_cmp(&volumes[b as usize])
                .then(a.cmp(&b))
        });
        for c in order {
            if self.find(c) != c {
                continue;
            }
            let mut largest = 0.0;
            let mut home: Option<(bool, f64, u32)> = None;
            for &n in &self.neighbors[c as usize] {
                let openings = &self.openings[&self.ordered(c, n)];
                let (mut open, mut shut) = (0.0, 0.0);
                for o in openings {
                    let area = self.area(o);
                    largest = f64::max(largest, area);
                    shut += area * self.closed_share(o);
                    open += area;
                }
                let key = (shut < self.settings.closed_share * open, open - shut, n);
                let is_better = |h: &(bool, f64, u32)| {
                    key.0
                        .cmp(&h.0)
                        .then(key.1.total_cmp(&h.1))
                        .then(h.2.cmp(&n))
                        .is_gt()
                };
                if home.as_ref().is_none_or(is_better) {
                    home = Some(key);
                }
            }
            if let Some((.., n)) = home
                && volumes[c as usize] < self.settings.reach * largest
            {
                let pair = self.ordered(c, n);
                volumes[pair.0 as usize] += volumes[pair.1 as usize];
                self.join(pair);
            }
        }
    }
}

impl Mergeable for LeafMerger<'_> {
    fn may_go_on(&self) -> bool {
        self.evidence.allowance.spend(WORK)
    }

    fn pairs(&self) -> Vec<Pair> {
        self.openings.keys().copied().collect()
    }

    fn is_pair(&self, pair: Pair) -> bool {
        self.openings.contains_key(&pair)
    }

    fn ages(&self, (a, b): Pair) -> [u32; 2] {
        [a, b].map(|c| self.version[c as usize])
    }

    fn openness(&self, pair: Pair) -> f64 {
        let Some(openings) = self.openings.get(&pair) else {
            return 0.0;
        };
        // Largest first. Two are enough: a third between the same two cells is smaller still.
        let mut groups = self.together(pair, openings);
        groups.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(b.1)));
        groups
            .into_iter()
            .take(2)
            .map(|(area, o)| {
                let (s, places) = o;
                let apart = self.storeys_apart && self.lies_in_slab(*s);
                if apart || self.closed_share(o) >= self.settings.closed_share {
                    return 0.0;
                }
                let is_seed = |k: u32| places.binary_search(&k).is_ok();
                let in_side = |_: usize, leaf: u32| match self.cell_of(leaf) {
                    c if c == pair.0 => 0,
                    c if c == pair.1 => 1,
                    _ => 2,
                };
                let endless = (pair.0 == self.outer).then_some(0);
                self.measure(*s, area, &is_seed, &in_side, endless)
            })
            .fold(0.0, f64::max)
    }

    fn join(&mut self, (a, b): Pair) -> Vec<Pair> {
        self.parent[b as usize] = a;
        self.version[a as usize] += 1;
        self.openings.remove(&(a, b));
        self.neighbors[a as usize].remove(&b);
        let mut changed = Vec::new();
        for c in std::mem::take(&mut self.neighbors[b as usize]) {
            if c == a {
                continue;
            }
            let moved = self
                .openings
                .remove(&self.ordered(b, c))
                .unwrap_or_default();
            let pair = self.ordered(a, c);
            let all = self.openings.entry(pair).or_default();
            for (s, places) in moved {
                // Parts of one separator become one opening again.
                if let Some(same) = all.iter_mut().find(|o| o.0 == s) {
                    same.1.extend(places);
                    same.1.sort_unstable();
                } else {
                    all.push((s, places));
                }
            }
            all.sort_unstable();
            self.neighbors[c as usize].remove(&b);
            self.neighbors[c as usize].insert(a);
            self.neighbors[a as usize].insert(c);
            changed.push(pair);
        }
        changed
    }
}
