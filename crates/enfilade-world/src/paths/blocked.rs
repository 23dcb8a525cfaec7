//! Why there is no path: how far a walker gets, and the obstacle there.
//!
//! The floors that the walker reaches are flooded, and a route from cell to cell is found through any portals, those preferred that
//! walkers pass. The first portal of it that is not reached is the place to look at: it is closed, or the walker does not fit through
//! it, or something before it is in the way. O(floors + portals · log).

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use enfilade_cpg::{CellId, PortalId, PortalKind};
use enfilade_geom::DVec3;

use super::Path;
use super::floors::{Floors, Hindrance, is_walked};
use super::grounds::NONE;
use super::path_search::{PathSearch, crawls, is_void};
use super::walk_map::{Stand, WalkMap};
use crate::layout::LayoutExit;
use crate::space::{PartId, Space};

/// How far a walker gets who finds no path, and the obstacle there.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Blocked {
    /// The place before the obstacle, on the floor. [Units: wu]
    pub at: DVec3,
    /// Its cell.
    pub cell: CellId,
    /// Length of the walk to it. [Units: wu]
    pub length: f64,
    /// The place beyond the obstacle: a floor, the middle of a portal's lower edge, or the end. [Units: wu]
    pub beyond: DVec3,
    /// The obstacle.
    pub by: Obstacle,
}

/// The obstacle of a [`Blocked`] walker.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Obstacle {
    /// A portal that may not be passed, such as a closed door.
    Closed(PortalId),
    /// A pane, or other parts that fill a window.
    Filled(PortalId),
    /// A portal less wide than the walker: its width. [Units: wu]
    Narrow(PortalId, f64),
    /// A portal less high than the walker: its height. [Units: wu]
    Low(PortalId, f64),
    /// A portal with a sill or floor higher (above 0) or lower than the highest step. [Units: wu]
    Sill(PortalId, f64),
    /// A portal without a floor on one side, or with something standing in it.
    Unfit(PortalId),
    /// A floor higher (above 0) or lower than the highest step. [Units: wu]
    Step(f64),
    /// Too little room, such as below a slab over a stair: nothing else is between two floors, side by side.
    Tight,
    /// The open leaf of a door that the walk passes, or must pass.
    Leaf(PortalId),
    /// No floor, or something that stands there.
    Gap,
}

/// Farthest from a portal that a walker is at it. [Units: wu]
const AT: f64 = 1.0;
/// Price of an obstacle on a route: more than any way round. [Units: wu]
const DETOUR: f64 = 1e4;
/// Width of the squares in which the nearest floors across a gap are looked for; gaps up to this width are found. [Units: wu]
const ACROSS: f64 = 2.0;

impl PathSearch {
    /// Finds out why [`PathSearch::find`] found [no way](super::NoPath::NoWay); `None` if an end is not on a floor of the root, or if there
    /// is one. Allocates. [Units: wu]
    pub fn blocked(
        &mut self,
        map: &WalkMap,
        space: &Space,
        ends: [(PartId, DVec3); 2],
        mut may_pass: impl FnMut(PartId, PortalId) -> bool,
    ) -> Option<Blocked> {
        let [start, goal] = ends.map(|end| map.stand(space, end.0, end.1));
        let (start, goal) = (start?, goal?);
        if [start, goal].iter().any(|s| s.part != PartId::ROOT) {
            return None;
        }
        let look = Look {
            map,
            space,
            goal,
            crawls: crawls(map, space, [start, goal]),
        };
        let reached = look.flood(start.floor, |p| may_pass(PartId::ROOT, p), true);
        if reached[goal.floor as usize] {
            let free = look.flood(start.floor, |p| may_pass(PartId::ROOT, p), false);
            let mut found = look.before_leaf(&reached, &free, goal.at)?;
            found.length = self.length_to(map, space, [ends[0].1, found.at], may_pass)?;
            return Some(found);
        }
        let mut path = Path::default();
        let open = self.find(map, space, ends, |_, _| true, &mut path);
        let mut portals = path.portals.iter().map(|p| p.exit.portal);
        let closed = portals.find(|p| !may_pass(PartId::ROOT, *p));
        let closed = closed.filter(|_| open.is_ok());
        let mut found = match closed {
            Some(portal) => look.before(&reached, portal, None),
            None => look.on_route(&reached, start)?,
        };
        match self.length_to(map, space, [ends[0].1, found.at], &mut may_pass) {
            Some(length) => found.length = length,
            // Leaves of doors on the way there are in the way before.
            None => {
                let free = look.flood(start.floor, |p| may_pass(PartId::ROOT, p), false);
                found = look.before_leaf(&reached, &free, found.at)?;
                found.length = self.length_to(map, space, [ends[0].1, found.at], may_pass)?;
            }
        }
        Some(found)
    }

    /// Returns the length of the path between two points of the root; `None` if there is none.
    fn length_to(
        &mut self,
        map: &WalkMap,
        space: &Space,
        ends: [DVec3; 2],
        may_pass: impl FnMut(PartId, PortalId) -> bool,
    ) -> Option<f64> {
        let mut path = Path::default();
        let ends = ends.map(|p| (PartId::ROOT, p));
        let found = self.find(map, space, ends, may_pass, &mut path);
        found.ok().map(|()| path.length)
    }
}

/// A search for the obstacle.
struct Look<'a> {
    map: &'a WalkMap,
    space: &'a Space,
    goal: Stand,
    /// Voids are passed.
    crawls: bool,
}

impl Look<'_> {
    fn floors(&self) -> &Floors {
        self.map.floors(PartId::ROOT)
    }

    /// Returns for each floor `true` if a walker comes there; `leaves`: also where open leaves of doors stand, though never through
    /// their own door.
    fn flood(
        &self,
        from: u32,
        mut is_open: impl FnMut(PortalId) -> bool,
        leaves: bool,
    ) -> Vec<bool> {
        let floors = self.floors();
        let layout = self.space.layout(PartId::ROOT);
        let mut open: HashMap<PortalId, bool> = HashMap::new();
        let mut may = |hindrance| match hindrance {
            Hindrance::Portal(p) => *open.entry(p).or_insert_with(|| {
                let mut cells = layout.opening(p).cells().into_iter();
                is_open(p) && (self.crawls || !cells.any(|c| is_void(self.space, PartId::ROOT, c)))
            }),
            Hindrance::Leaf(_) => leaves,
            Hindrance::Edge(_) => false,
        };
        let mut is_reached = vec![false; floors.n_floors()];
        let mut next = vec![from];
        is_reached[from as usize] = true;
        while let Some(at) = next.pop() {
            for to in (0..4).filter_map(|d| floors.step(at, d, &mut may)) {
                if !std::mem::replace(&mut is_reached[to as usize], true) {
                    next.push(to);
                }
            }
        }
        is_reached
    }

    /// Returns the portals from the start's cell to the end's: the fewest that walkers do not pass, and then the shortest way. Each
    /// with the cell before it.
    fn route(&self, reached: &[bool], start: Stand) -> Option<Vec<(CellId, PortalId)>> {
        let (layout, floors) = (self.space.layout(PartId::ROOT), self.floors());
        let [from, to] = [start, self.goal].map(|s| floors.floor(s.floor).cell);
        let mut best: HashMap<CellId, (f64, Option<(CellId, PortalId)>)> = HashMap::new();
        let mut heap = BinaryHeap::new();
        best.insert(from, (0.0, None));
        heap.push(Reverse((0_u64, from)));
        while let Some(Reverse((bits, cell))) = heap.pop() {
            let (cost, via) = best[&cell];
            if bits != cost.to_bits() {
                continue;
            }
            if cell == to {
                break;
            }
            let here = via.map_or(start.at, |(_, p)| layout.opening(p).center());
            for exit in layout.exits(cell) {
                let price = self.price(exit) + self.price_within(reached, cell, via, exit.portal);
                let way = here.distance(layout.opening(exit.portal).center());
                let through = cost + DETOUR * price + way;
                if best.get(&exit.to).is_none_or(|b| through < b.0) {
                    best.insert(exit.to, (through, Some((cell, exit.portal))));
                    heap.push(Reverse((through.to_bits(), exit.to)));
                }
            }
        }
        let mut route = Vec::new();
        let mut at = to;
        while let (_, Some((before, portal))) = *best.get(&at)? {
            route.push((before, portal));
            at = before;
        }
        route.reverse();
        Some(route)
    }

    /// The price of a portal, in detours.
    fn price(&self, exit: &LayoutExit) -> f64 {
        let layout = self.space.layout(PartId::ROOT);
        let is_void = !self.crawls && is_void(self.space, PartId::ROOT, exit.to);
        match layout.opening(exit.portal).kind() {
            _ if is_void => 100.0,
            _ if self.map.is_walkable(PartId::ROOT, exit.portal) => 0.0,
            PortalKind::Door | PortalKind::Open => 1.0,
            PortalKind::Window => 3.0,
            PortalKind::Crack => 100.0,
        }
    }

    /// The price of the way in a cell to a portal, in detours: from another portal, or else from the start. Portals that walkers do not
    /// pass have their own price.
    fn price_within(
        &self,
        reached: &[bool],
        cell: CellId,
        via: Option<(CellId, PortalId)>,
        to: PortalId,
    ) -> f64 {
        let own = &self.map.parts[PartId::ROOT.idx()];
        let layout = self.space.layout(PartId::ROOT);
        let mut ends = own.ways.range(to);
        let is_way = match via {
            _ if ends.is_empty() => true,
            None => ends.any(|k| {
                let side = usize::from(layout.opening(to).cells()[1] == cell);
                reached[own.sides[k as usize][side] as usize]
            }),
            Some((_, from)) => {
                let mut starts = own.ways.range(from);
                let leads = |k: u32| own.ways.lengths(cell, k, to).any(f64::is_finite);
                starts.is_empty() || from == to || starts.any(leads)
            }
        };
        if is_way { 0.0 } else { 2.0 }
    }

    /// Finds the obstacle on the route.
    fn on_route(&self, reached: &[bool], start: Stand) -> Option<Blocked> {
        let floors = self.floors();
        let route = self.route(reached, start)?;
        let is_passed = |portal: PortalId| {
            let mut all = floors.crossings().iter().filter(|c| c.portal == portal);
            all.any(|c| {
                let to = floors.floor(c.from).steps[c.direction as usize];
                reached[c.from as usize] && reached[to as usize]
            })
        };
        let Some(&(cell, portal)) = route.iter().find(|r| !is_passed(r.1)) else {
            let cell = floors.floor(self.goal.floor).cell;
            return Some(self.within(reached, cell, self.goal.floor));
        };
        let found = self.before(reached, portal, Some(cell));
        let bounds = self.space.layout(PartId::ROOT).opening(portal).bounds();
        let far = bounds
            .distance_squared(found.at + DVec3::Y * 0.5 * floors.walker().height)
            .sqrt();
        if far <= AT + floors.walker().radius && !self.map.is_walkable(PartId::ROOT, portal) {
            return Some(found);
        }
        // Something in the cell keeps the walker from the portal.
        let target = self.nearest(found.beyond, |f| {
            floors.floor(f).cell == cell && !reached[f as usize]
        });
        Some(target.map_or(found, |target| self.within(reached, cell, target)))
    }

    /// Returns the floor nearest to a point, among some.
    fn nearest(&self, to: DVec3, mut among: impl FnMut(u32) -> bool) -> Option<u32> {
        let floors = self.floors();
        let all = (0..floors.n_floors() as u32).filter(|f| among(*f));
        let far = |f: &u32| floors.point(*f).distance_squared(to);
        all.min_by(|a, b| far(a).total_cmp(&far(b)))
    }

    /// The walker before a portal that it does not pass; `cell` is the one before it, if the portal is not just closed.
    fn before(&self, reached: &[bool], portal: PortalId, cell: Option<CellId>) -> Blocked {
        let (floors, layout) = (self.floors(), self.space.layout(PartId::ROOT));
        let opening = layout.opening(portal);
        let sill = opening.center().with_y(opening.bounds().min.y);
        let is_before = |f: u32| {
            let own = floors.floor(f).cell;
            reached[f as usize] && cell.map_or_else(|| opening.cells().contains(&own), |c| own == c)
        };
        // Not in the way of a leaf, where the walk would have to end.
        let at = self.nearest(sill, |f| is_before(f) && !floors.floor(f).is_swung);
        let at = at.or_else(|| self.nearest(sill, |f| reached[f as usize]));
        let at = at.unwrap_or(self.goal.floor);
        let by = match cell {
            None => Obstacle::Closed(portal),
            Some(cell) => self.unfit(portal, cell, floors.point(at)),
        };
        self.blocked(at, sill, by)
    }

    /// The walker before the open leaf nearest to a point, among those that part `free` floors from the others reached.
    fn before_leaf(&self, reached: &[bool], free: &[bool], to: DVec3) -> Option<Blocked> {
        let floors = self.floors();
        let is_leaf = |f: u32| {
            f != NONE && reached[f as usize] && !free[f as usize] && floors.floor(f).is_swung
        };
        let far = |f: u32| floors.point(f).distance_squared(to);
        let all = (0..floors.n_floors() as u32).filter(|f| free[*f as usize]);
        let steps = all.flat_map(|f| floors.floor(f).steps.map(|s| (f, s)));
        let steps = steps.filter(|s| is_leaf(s.1));
        let (at, leaf) = steps.min_by(|a, b| far(a.1).total_cmp(&far(b.1)))?;
        let portal = floors.leaves_at(leaf).next()?;
        Some(self.blocked(at, floors.point(leaf), Obstacle::Leaf(portal)))
    }

    /// Why a walker at a point before a portal does not pass it.
    fn unfit(&self, portal: PortalId, cell: CellId, at: DVec3) -> Obstacle {
        let (floors, layout) = (self.floors(), self.space.layout(PartId::ROOT));
        let (world, opening) = (self.space.world(PartId::ROOT), layout.opening(portal));
        let (walker, [width, height]) =
            (floors.walker(), world.graph[portal].size().map(f64::from));
        if opening.kind() == PortalKind::Window && !is_walked(world, portal) {
            return Obstacle::Filled(portal);
        }
        // The wall beside takes a square.
        if width < 2.0 * walker.radius + floors.side() {
            return Obstacle::Narrow(portal, width);
        }
        if height < walker.height {
            return Obstacle::Low(portal, height);
        }
        let sill = opening.center().with_y(opening.bounds().min.y);
        let behind = self.nearest(sill, |f| {
            let own = floors.floor(f).cell;
            own != cell && opening.cells().contains(&own)
        });
        let behind = behind.map(|f| floors.point(f));
        let behind = behind.filter(|q| (*q - sill).with_y(0.0).length() <= AT + walker.radius);
        let up = sill.y - at.y;
        let rise = behind.map_or(up, |q| if up > walker.step { up } else { q.y - at.y });
        if rise.abs() > walker.step {
            return Obstacle::Sill(portal, rise);
        }
        Obstacle::Unfit(portal)
    }

    /// The walker in a cell in which a floor is out of its reach.
    fn within(&self, reached: &[bool], cell: CellId, target: u32) -> Blocked {
        let floors = self.floors();
        let beyond = self.flood(target, |_| true, true);
        let Some((at, to)) = self.across(cell, [reached, &beyond]) else {
            let to = floors.point(target);
            let own = |f: u32| reached[f as usize] && floors.floor(f).cell == cell;
            let at = self.nearest(to, own);
            let at = at.or_else(|| self.nearest(to, |f| reached[f as usize]));
            return self.blocked(at.unwrap_or(target), to, Obstacle::Gap);
        };
        let way = floors.point(to) - floors.point(at);
        let walker = floors.walker();
        let is_beside = way.with_y(0.0).length() <= 2.0 * (walker.radius + floors.side());
        let by = if way.y.abs() > walker.step && is_beside {
            Obstacle::Step(way.y)
        } else if way.with_y(0.0).length() < 2.0 * (walker.radius - floors.side()) {
            // Even a wall without thickness parts floors by the walker's width.
            Obstacle::Tight
        } else {
            Obstacle::Gap
        };
        self.blocked(at, floors.point(to), by)
    }

    /// Returns the nearest two floors of two sets in a cell, if they are close.
    fn across(&self, cell: CellId, [from, to]: [&[bool]; 2]) -> Option<(u32, u32)> {
        let floors = self.floors();
        let is_rim = |set: &[bool], f: u32| {
            let steps = floors.floor(f).steps;
            let is_in = set[f as usize] && floors.floor(f).cell == cell;
            is_in && steps.iter().any(|s| *s == NONE || !set[*s as usize])
        };
        let all = 0..floors.n_floors() as u32;
        let key = |p: DVec3| [p.x, p.z].map(|v| (v / ACROSS).floor() as i64);
        let mut rims: HashMap<[i64; 2], Vec<u32>> = HashMap::new();
        for f in all.clone().filter(|f| is_rim(from, *f)) {
            rims.entry(key(floors.point(f))).or_default().push(f);
        }
        let mut best: Option<(f64, u32, u32)> = None;
        for f in all.filter(|f| is_rim(to, *f)) {
            let p = floors.point(f);
            let [x, z] = key(p);
            let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dz| [x + dx, z + dz]));
            for other in around.filter_map(|k| rims.get(&k)).flatten() {
                let found = (floors.point(*other).distance(p), *other, f);
                if best.is_none_or(|b| found < b) {
                    best = Some(found);
                }
            }
        }
        let best = best.filter(|b| b.0 <= ACROSS);
        best.map(|(_, from, to)| (from, to))
    }

    fn blocked(&self, at: u32, beyond: DVec3, by: Obstacle) -> Blocked {
        let floors = self.floors();
        Blocked {
            at: floors.point(at),
            cell: floors.floor(at).cell,
            length: 0.0,
            beyond,
            by,
        }
    }
}
