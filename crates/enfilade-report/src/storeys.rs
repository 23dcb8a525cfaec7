//! Finds the storeys of a world: connected floors, none of which lies above another.
//!
//! Levels of cells are joined in three rounds: where a doorway leads from one to the other without a step; then
//! levels of equal height, such as the wings of a building; then, from the smallest step to the largest, levels
//! connected by a stair, a ramp or a drop. A level is not joined to a group that it would lie above or below. So the
//! storeys of a building stay apart, whatever stairs connect them, and the level of a game, whose floors rise and
//! fall beside each other, becomes one or two plans instead of one for each height.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, PortalKind, World};

use crate::floors::{Floors, Level, Samples, Tiles, find_floors, floor_samples};
use crate::shafts::{Shaft, find_shafts};

/// Largest difference of floors that meet without a stair: a threshold, a ramp's end, a tall step of a game.
/// [Units: wu]
const STEP: f64 = 0.6;
/// Floors this close in height may share a plan even if nothing connects them: split levels. [Units: wu]
const SPLIT: f64 = 1.5;
/// Largest fraction of the smaller of two groups that may lie above or below the other; tiles at a common border do,
/// because they are coarse.
const MOST_HIDDEN: f64 = 0.3;
/// Floors in one tile that differ by less lie beside each other, not above. [Units: wu]
const ABOVE: f64 = 1.5;
/// A group with a smaller share of the largest storey's area is not a storey of its own if its cells are on another.
const LEAST_SHARE: f64 = 0.05;
/// Largest fraction of a room that a space without a floor, such as one under a stair, may cover on the room's plan.
const INSET: f64 = 0.2;
/// If at least this fraction of a page's floor is at one height, the page reports that height alone.
const NEARLY_ALL: f64 = 0.75;
/// Floors that differ by less are cut at one height. [Units: wu]
const SAME_CUT: f64 = 0.5;

/// A storey: connected floors and the cells above them; or the cells without a floor above such a storey.
#[derive(Clone, Debug, PartialEq)]
pub struct Storey {
    /// `1`, `2`, … from below; `2a`, `2b`, … for spaces without a floor, such as those above the ceilings of storey 2.
    pub name: String,
    /// Height of most of its floor. [Units: wu]
    pub floor: f64,
    /// Heights of its lowest and highest floor; both are `floor` if most of the area is at that height. [Units: wu]
    pub range: [f64; 2],
    /// Height of the next storey's floor, or the top of the highest room. [Units: wu]
    pub top: f64,
    /// Area of its floor. [Units: wu²]
    pub area: f64,
    /// The cells that stand on it, ascending. A cell of several levels may be in several storeys.
    pub cells: Vec<CellId>,
    /// `true` for spaces without a floor to stand on.
    pub is_between: bool,
}

/// The cells cut at one height.
#[derive(Clone, Debug)]
pub(crate) struct Cut {
    /// Height of the floor. [Units: wu]
    pub(crate) floor: f64,
    /// The height of the cut itself, if the floor does not determine it. [Units: wu]
    pub(crate) at: Option<f64>,
    /// The cells shown by this cut, each with the height up to which it belongs to the cut. [Units: wu]
    pub(crate) tops: BTreeMap<CellId, f64>,
    /// Tiles of their floors.
    pub(crate) tiles: Tiles,
}

/// A storey with everything needed to draw it.
#[derive(Clone, Debug)]
pub(crate) struct Page {
    pub(crate) storey: Storey,
    /// The cut with the largest area first; never empty.
    pub(crate) cuts: Vec<Cut>,
    /// Side of a tile. [Units: wu]
    pub(crate) tile: f64,
    /// The cell shown at each tile.
    ground: BTreeMap<(i32, i32), CellId>,
}

/// Returns the storeys, lowest first; at least one if there is a room. Every room is in one of them, and no void.
///
/// O(floor area + triangles + levels²) where nothing connects the levels, much less where doorways do.
#[must_use]
pub fn find_storeys(world: &World) -> Vec<Storey> {
    let pages = find_pages(world, &floor_samples(world)).0;
    pages.into_iter().map(|p| p.storey).collect()
}

/// Like [`find_storeys`], with the cuts; and the rooms without a floor to stand on, ascending.
pub(crate) fn find_pages(world: &World, samples: &Samples) -> (Vec<Page>, Vec<CellId>) {
    let floors = find_floors(world, samples);
    let groups = grouped(world, &floors);
    let mut pages: Vec<Page> = groups.iter().map(|g| page(world, &floors, g)).collect();
    drop_landings(&mut pages);
    pages.sort_by(|a, b| a.storey.floor.total_cmp(&b.storey.floor));
    let highest = world.graph.places().map(|(_, c)| c.aabb[1][1]);
    let highest = f64::from(highest.fold(f32::NEG_INFINITY, f32::max));
    for k in 0..pages.len() {
        pages[k].storey.name = (k + 1).to_string();
        let next = pages.get(k + 1).map(|p| p.storey.floor);
        pages[k].storey.top = next.unwrap_or(highest);
    }
    let shafts = find_shafts(world, &floors.unfloored, floors.tile);
    (
        place(&shafts, pages, floors.tile, highest),
        floors.unfloored,
    )
}

/// Levels drawn on one plan.
#[derive(Clone, Default)]
struct Group {
    /// Indices of levels; ascending after [`grouped`].
    levels: Vec<usize>,
    /// Height of the floor at each tile.
    ground: BTreeMap<(i32, i32), f64>,
    area: f64,
    /// Height and area of its largest level.
    main: (f64, f64),
}

impl Group {
    fn of_level(index: usize, level: &Level) -> Self {
        Self {
            levels: vec![index],
            ground: level.tiles.iter().map(|&t| (t, level.height)).collect(),
            area: level.area,
            main: (level.height, level.area),
        }
    }

    /// Returns `true` if too much of one lies above or below the other.
    fn hides(&self, other: &Self) -> bool {
        let (small, large) = if self.ground.len() <= other.ground.len() {
            (self, other)
        } else {
            (other, self)
        };
        let is_above = |(t, h): (&(i32, i32), &f64)| {
            large.ground.get(t).is_some_and(|g| (g - h).abs() > ABOVE)
        };
        let hidden = small.ground.iter().filter(|g| is_above(*g)).count();
        hidden as f64 > MOST_HIDDEN * small.ground.len() as f64
    }

    fn join(&mut self, mut other: Self) {
        if other.main.1 > self.main.1 {
            self.main = other.main;
        }
        if other.ground.len() > self.ground.len() {
            std::mem::swap(&mut self.ground, &mut other.ground);
        }
        self.ground.append(&mut other.ground);
        self.levels.append(&mut other.levels);
        self.area += other.area;
    }
}

/// Two levels with a way between them.
struct Link {
    ends: [usize; 2],
    step: f64,
}

/// Joins the levels to groups, as described at the head of this file.
fn grouped(world: &World, floors: &Floors) -> Vec<Group> {
    let levels = &floors.levels;
    let mut slots: Vec<Option<Group>> = levels
        .iter()
        .enumerate()
        .map(|(i, level)| Some(Group::of_level(i, level)))
        .collect();
    let mut slot_of: Vec<usize> = (0..levels.len()).collect();
    let links = links(world, levels);
    let n_flat = links.partition_point(|l| l.step <= STEP);
    join_linked(&links[..n_flat], &mut slots, &mut slot_of);
    join_alike(STEP, &mut slots, &mut slot_of);
    join_linked(&links[n_flat..], &mut slots, &mut slot_of);
    join_alike(SPLIT, &mut slots, &mut slot_of);
    // A small group is better placed beside a storey of any height than alone.
    let largest = slots.iter().flatten().map(|g| g.area).fold(0.0, f64::max);
    let (small, mut out): (Vec<Group>, Vec<Group>) = slots
        .into_iter()
        .flatten()
        .partition(|g| g.area < LEAST_SHARE * largest);
    for group in small {
        let mut hosts: Vec<usize> = (0..out.len()).collect();
        let far = |k: &usize| (out[*k].main.0 - group.main.0).abs();
        hosts.sort_by(|a, b| far(a).total_cmp(&far(b)));
        match hosts.into_iter().find(|&k| !out[k].hides(&group)) {
            Some(k) => out[k].join(group),
            None => out.push(group),
        }
    }
    for group in &mut out {
        group.levels.sort_unstable();
    }
    out
}

/// Joins the groups at the ends of each link, in order, if neither hides the other.
fn join_linked(links: &[Link], slots: &mut [Option<Group>], slot_of: &mut [usize]) {
    for link in links {
        let [a, b] = link.ends.map(|level| slot_of[level]);
        if a != b
            && let (Some(one), Some(other)) = (&slots[a], &slots[b])
            && !one.hides(other)
        {
            join_slots(a, b, slots, slot_of);
        }
    }
}

/// Joins groups whose main heights differ by at most `most`, largest first, if neither hides the other.
fn join_alike(most: f64, slots: &mut [Option<Group>], slot_of: &mut [usize]) {
    let mut order: Vec<usize> = (0..slots.len()).filter(|&k| slots[k].is_some()).collect();
    // The largest first: it keeps its height.
    let area = |k: usize| slots[k].as_ref().map_or(0.0, |g| g.area);
    order.sort_by(|&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));
    let mut hosts: Vec<usize> = Vec::new();
    for k in order {
        let host = hosts.iter().copied().find(|&host| {
            let (Some(one), Some(other)) = (&slots[host], &slots[k]) else {
                return false;
            };
            (one.main.0 - other.main.0).abs() <= most && !one.hides(other)
        });
        match host {
            Some(host) => join_slots(host, k, slots, slot_of),
            None => hosts.push(k),
        }
    }
}

fn join_slots(into: usize, from: usize, slots: &mut [Option<Group>], slot_of: &mut [usize]) {
    if let (Some(gone), Some(kept)) = (slots[from].take(), slots[into].as_mut()) {
        for &level in &gone.levels {
            slot_of[level] = into;
        }
        kept.join(gone);
    }
}

/// All links: from level to level within a cell, and through doorways. The smallest step first.
fn links(world: &World, levels: &[Level]) -> Vec<Link> {
    let mut of_cell: BTreeMap<CellId, Vec<usize>> = BTreeMap::new();
    for (i, level) in levels.iter().enumerate() {
        of_cell.entry(level.cell).or_default().push(i);
    }
    let mut out = Vec::new();
    let mut link = |a: usize, b: usize| {
        let step = (levels[a].height - levels[b].height).abs();
        out.push(Link { ends: [a, b], step });
    };
    for of in of_cell.values() {
        for (k, &a) in of.iter().enumerate() {
            of[k + 1..].iter().for_each(|&b| link(a, b));
        }
    }
    for portal in &world.graph.portals {
        if !matches!(portal.kind, PortalKind::Open | PortalKind::Door) {
            continue;
        }
        let [Some(one), Some(other)] = portal.cells.map(|c| of_cell.get(&c)) else {
            continue;
        };
        let heights = || portal.outline.iter().map(|p| f64::from(p[1]));
        let low = heights().fold(f64::INFINITY, f64::min);
        let high = heights().fold(f64::NEG_INFINITY, f64::max);
        for &a in one {
            for &b in other {
                // A person stands in the opening on the higher of the two floors; another pair of floors has its own
                // doorway.
                let stand = levels[a].height.max(levels[b].height);
                if low < stand + STEP && high > stand + STEP {
                    link(a, b);
                }
            }
        }
    }
    out.sort_by(|a, b| a.step.total_cmp(&b.step).then(a.ends.cmp(&b.ends)));
    out
}

/// Makes a page from a group, without its name and top.
fn page(world: &World, floors: &Floors, group: &Group) -> Page {
    let mut order = group.levels.clone();
    let level = |k: usize| &floors.levels[k];
    order.sort_by(|&a, &b| level(b).area.total_cmp(&level(a).area).then(a.cmp(&b)));
    let mut cuts: Vec<(Cut, f64)> = Vec::new();
    for k in order {
        let Level { cell, height, .. } = *level(k);
        // The cell is shown here up to its next floor.
        let first = floors.levels.partition_point(|l| l.cell < cell);
        let own = (floors.levels[first..].iter()).take_while(|l| l.cell == cell);
        let next = own.map(|l| l.height).filter(|&h| h > height + SAME_CUT);
        let top = next.fold(f64::from(world.graph[cell].aabb[1][1]), f64::min);
        let cut = match cuts
            .iter()
            .position(|c| (c.0.floor - height).abs() < SAME_CUT)
        {
            Some(at) => &mut cuts[at],
            None => {
                cuts.push((Cut::new(height, None), 0.0));
                let last = cuts.len() - 1;
                &mut cuts[last]
            }
        };
        let highest = cut.0.tops.entry(cell).or_insert(top);
        *highest = highest.max(top);
        cut.0.tiles.extend(&level(k).tiles);
        cut.1 += level(k).area;
    }
    cuts.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.floor.total_cmp(&b.0.floor)));
    let floor = cuts.first().map_or(0.0, |c| c.0.floor);
    let is_even = cuts.first().is_none_or(|c| c.1 >= NEARLY_ALL * group.area);
    let heights = || {
        let all = group.levels.iter().map(|&k| level(k).height);
        all.map(move |h| if is_even { floor } else { h })
    };
    let mut ground = BTreeMap::new();
    for level in group.levels.iter().map(|&k| level(k)) {
        ground.extend(level.tiles.iter().map(|&t| (t, level.cell)));
    }
    let mut cells: Vec<CellId> = group.levels.iter().map(|&k| level(k).cell).collect();
    cells.sort_unstable();
    cells.dedup();
    Page {
        storey: Storey {
            name: String::new(),
            floor,
            range: [
                heights().fold(f64::INFINITY, f64::min),
                heights().fold(f64::NEG_INFINITY, f64::max),
            ],
            top: 0.0,
            area: group.area,
            cells,
            is_between: false,
        },
        cuts: cuts.into_iter().map(|c| c.0).collect(),
        tile: floors.tile,
        ground,
    }
}

impl Cut {
    fn new(floor: f64, at: Option<f64>) -> Self {
        Self {
            floor,
            at,
            tops: BTreeMap::new(),
            tiles: Tiles::new(),
        }
    }
}

/// Drops small pages whose cells are all on other pages: landings of stairs, mostly.
fn drop_landings(pages: &mut Vec<Page>) {
    let largest = pages.iter().map(|p| p.storey.area).fold(0.0, f64::max);
    let mut shown: BTreeMap<CellId, usize> = BTreeMap::new();
    for cell in pages.iter().flat_map(|p| &p.storey.cells) {
        *shown.entry(*cell).or_default() += 1;
    }
    pages.sort_by(|a, b| a.storey.area.total_cmp(&b.storey.area));
    pages.retain(|page| {
        let is_needed = page.storey.area >= LEAST_SHARE * largest
            || page.storey.cells.iter().any(|c| shown[c] == 1);
        if !is_needed {
            for cell in &page.storey.cells {
                *shown.entry(*cell).or_default() -= 1;
            }
        }
        is_needed
    });
}

/// Puts the cells without a floor on the storeys beside them, or on pages of their own.
fn place(shafts: &[Shaft], mut pages: Vec<Page>, tile: f64, highest: f64) -> Vec<Page> {
    // Keyed by the page below: the pages between, in order of creation.
    let mut between: BTreeMap<usize, Vec<Page>> = BTreeMap::new();
    for shaft in shafts {
        let below = pages.iter().rposition(|p| p.storey.floor <= shaft.at);
        let host = below.unwrap_or(0);
        if pages.get(host).is_some_and(|p| p.has_room_for(shaft)) {
            pages[host].add(shaft);
            continue;
        }
        let extras = between.entry(host).or_default();
        match extras.iter().position(|p| p.has_room_for(shaft)) {
            Some(k) => extras[k].add(shaft),
            None => {
                let mut page = Page {
                    storey: Storey {
                        name: String::new(),
                        floor: shaft.floor,
                        range: [shaft.floor; 2],
                        top: highest,
                        area: 0.0,
                        cells: Vec::new(),
                        is_between: true,
                    },
                    cuts: Vec::new(),
                    tile,
                    ground: BTreeMap::new(),
                };
                page.add(shaft);
                extras.push(page);
            }
        }
    }
    if pages.is_empty() {
        // No floor anywhere: these become the storeys.
        let mut out: Vec<Page> = between.into_values().flatten().collect();
        out.sort_by(|a, b| a.storey.floor.total_cmp(&b.storey.floor));
        for (k, page) in out.iter_mut().enumerate() {
            page.storey.name = (k + 1).to_string();
        }
        return out;
    }
    let mut out = Vec::new();
    for (k, page) in pages.into_iter().enumerate() {
        let mut extras = between.remove(&k).unwrap_or_default();
        extras.sort_by(|a, b| a.storey.floor.total_cmp(&b.storey.floor));
        for (i, extra) in extras.iter_mut().enumerate() {
            extra.storey.name = format!("{}{}", page.storey.name, letters(i));
        }
        out.push(page);
        out.append(&mut extras);
    }
    out
}

/// `a` to `z`, then `aa`, `ab`, ….
fn letters(mut index: usize) -> String {
    let mut out = String::new();
    loop {
        out.insert(0, char::from(b'a' + (index % 26) as u8));
        if index < 26 {
            return out;
        }
        index = index / 26 - 1;
    }
}

impl Page {
    /// Returns `true` if a shaft can be shown here: most of its place is free, or it is a small part of the rooms
    /// that it covers.
    fn has_room_for(&self, shaft: &Shaft) -> bool {
        let mut covered: BTreeMap<CellId, usize> = BTreeMap::new();
        for cell in shaft.tiles.iter().filter_map(|t| self.ground.get(t)) {
            *covered.entry(*cell).or_default() += 1;
        }
        let n = shaft.tiles.len() as f64;
        let is_free = covered.values().sum::<usize>() as f64 <= MOST_HIDDEN * n;
        is_free
            || covered.keys().all(|cell| {
                let whole = self.ground.values().filter(|c| *c == cell).count();
                n <= INSET * whole as f64
            })
    }

    /// Shows a cell of the page by a cut of its own, whatever is there.
    pub(crate) fn show_apart(&mut self, shaft: &Shaft) {
        for cut in &mut self.cuts {
            cut.tops.remove(&shaft.cell);
        }
        let mut cut = Cut::new(shaft.floor, Some(shaft.at));
        cut.tops.insert(shaft.cell, shaft.top);
        cut.tiles.extend(&shaft.tiles);
        self.cuts.push(cut);
    }

    /// Shows a shaft, at the height of an existing cut if that serves.
    fn add(&mut self, shaft: &Shaft) {
        let storey = &mut self.storey;
        if let Err(at) = storey.cells.binary_search(&shaft.cell) {
            storey.cells.insert(at, shaft.cell);
        }
        if storey.is_between {
            storey.area += shaft.area;
            storey.range[0] = storey.range[0].min(shaft.floor);
            storey.range[1] = storey.range[1].max(shaft.floor);
        }
        let serves = |c: &Cut| c.at.is_some_and(|at| shaft.is_shown_at(at));
        let k = match self.cuts.iter().position(serves) {
            Some(k) => k,
            None => {
                self.cuts.push(Cut::new(shaft.floor, Some(shaft.at)));
                self.cuts.len() - 1
            }
        };
        self.cuts[k].tops.insert(shaft.cell, shaft.top);
        self.cuts[k].tiles.extend(&shaft.tiles);
        let place = shaft.tiles.iter().map(|&t| (t, shaft.cell));
        self.ground.extend(place);
    }
}
