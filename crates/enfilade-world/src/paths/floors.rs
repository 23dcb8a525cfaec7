//! Floors: the places where a walker can stand, and the steps between them.
//!
//! Squares in plan, each with the floors above one another in it, after Recast (Mononen, "Recast Navigation", 2009): a floor is
//! the top of matter that is flat enough and has room for the walker above; a step leads to the floor beside it that is not
//! too much higher or lower, with room on the path. Recast leaves out the floors closer to a wall than the walker's radius, by
//! distances in squares; here the walker's own body must stand free there ([`Room`]), so a wall is as thick as it is. Only drops
//! are kept away from by distances along the floors (Danielsson, "Euclidean distance mapping", 1980). Each floor stores its cell,
//! and a step between cells its portal. Walkers cannot pass cracks, windows with anything in them, or openings that are too
//! narrow, too low, or above a sill too high for a step.
//!
//! An open leaf is in the way of a path through its own door only: floors where it would touch the walker are marked with its
//! portals. Who stands there may walk away, but not through that portal: the door opens afterwards.
//!
//! O(squares covered) memory, about 40 bytes a floor; time grows by the logarithm of a heap more. The middle of a square is free,
//! so a path may come closer to a wall than the radius by 0.7 squares, where a walker slides along it; a gap less than a square
//! and 2 cm wider than the walker may be lost.

use enfilade_cpg::{CellId, PortalId, PortalKind, World};
use enfilade_geom::{Aabb, DVec3, Triangle};
use enfilade_runtime::DetailId;

use crate::bodies::Agent;
use crate::bodies::WalkerRoom;
use crate::layout::Layout;
use crate::paths::columns::{Squares, spans};
use crate::paths::grounds::{
    Ground, NONE, bounds_of, clear, edges_of, first_of, grounds, squares_of, step_from_each,
};
use crate::paths::solid::solid_of;

/// The floors of a world for one walker.
#[derive(Clone, Debug)]
pub struct Floors {
    pub(super) squares: Squares,
    /// For each square, its first floor; and the number of all.
    pub(super) first: Vec<u32>,
    pub(super) floors: Vec<Floor>,
    /// Steps between cells, sorted.
    pub(super) crossings: Vec<Crossing>,
    /// Floors in the way of leaves, each with the portal that they open, sorted.
    pub(super) swung: Vec<(u32, PortalId)>,
    /// Portals with leaves, sorted.
    pub(super) doors: Vec<PortalId>,
    pub(super) walker: Agent,
}

/// A place to stand, one square in size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Floor {
    pub(crate) square: u32,
    pub(crate) y: f32,
    pub(crate) cell: CellId,
    /// True if an open leaf may stand there.
    pub(super) is_swung: bool,
    /// True if it is closer to a drop than the walker's radius, at a portal: to step on only where a joint leads over the drop.
    pub(crate) is_edge: bool,
    /// The floors beside it: to +x, +z, −x, −z.
    pub(crate) steps: [u32; 4],
}

/// A step from one cell to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Crossing {
    pub(crate) from: u32,
    pub(crate) direction: u32,
    pub(crate) portal: PortalId,
}

/// Condition of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hindrance {
    /// A portal to pass.
    Portal(PortalId),
    /// The place of a portal's leaf when it is open.
    Leaf(PortalId),
    /// A floor beside a drop.
    Edge(u32),
}

/// Returns `true` for portals that walkers pass. An opening that bakes call a window may have a sill on one side only: there the
/// floor decides. Behind glass, none does.
pub(crate) fn is_walked(world: &World, portal: PortalId) -> bool {
    let portal = &world.graph[portal];
    match portal.kind {
        PortalKind::Open | PortalKind::Door => true,
        PortalKind::Window => portal.fittings.is_empty(),
        PortalKind::Crack => false,
    }
}

impl Floors {
    /// Lays out the floors of a world with those objects for which `counts` returns `true`; outdoors, ground up to 30 m around
    /// the rooms. Leaves of doors are obstacles in their open pose, to walkers that open them.
    ///
    /// Squares are a quarter of the walker's radius wide, or wider if there would be more than 8 million; if there
    /// would be more than half a million, they are at least 5 cm wide, so a thinner walker gets the same floors as
    /// one with a radius of 0.2 m.
    #[must_use]
    pub(crate) fn new(
        layout: &Layout,
        border: Option<CellId>,
        world: &World,
        walker: Agent,
        counts: impl FnMut(DetailId) -> bool,
    ) -> Self {
        let (solid, leaves) = solid_of(world, counts);
        let triangles = || solid.iter().copied();
        let bounds = bounds_of(layout, triangles().flatten());
        let squares = squares_of(&bounds, walker.radius / 4.0, triangles());
        let spans = spans(&squares, triangles(), walker.slope);
        let mut grounds = grounds(&spans, walker.height as f32);
        let first = first_of(&squares, grounds.iter().map(|g| g.square));
        step_from_each(&squares, &first, &mut grounds, &walker);
        let edges = edges_of(&squares, &spans, &grounds, &walker);
        drop(spans);
        // Distances are only as exact as a square's side.
        let is_clear = clear(
            &squares,
            &grounds,
            &edges,
            walker.radius - 0.5 * squares.side,
        );
        let mut floors = Self {
            squares,
            first: Vec::new(),
            floors: Vec::new(),
            crossings: Vec::new(),
            swung: Vec::new(),
            doors: leaves.iter().map(|l| l.0).collect(),
            walker,
        };
        let room = WalkerRoom::new(&solid, &walker);
        floors.keep(layout, border, &grounds, &is_clear, &room);
        for (portal, leaf) in &leaves {
            floors.swing(*portal, leaf, &room);
        }
        floors.swung.sort_unstable();
        floors.swung.dedup();
        floors.find_crossings(layout, |p| is_walked(world, p));
        floors
    }

    /// Keeps the floors where a walker has room, in a cell; the border of a part is none. Of those beside drops, the ones at
    /// portals.
    fn keep(
        &mut self,
        layout: &Layout,
        border: Option<CellId>,
        grounds: &[Ground],
        is_clear: &[bool],
        room: &WalkerRoom,
    ) {
        let mut number = vec![NONE; grounds.len()];
        let reach = self.walker.radius + 2.0 * self.squares.side;
        for (i, ground) in grounds.iter().enumerate() {
            let at = self.center(ground.square, f64::from(ground.y));
            // Doors are as high as walkers; at the feet, the matter of a step may be in the way.
            let heights = [0.5, 0.25, 0.75].map(|share| DVec3::Y * share * self.walker.height);
            let cell = heights.into_iter().find_map(|up| layout.locate(at + up));
            let is_edge = !is_clear[i];
            let middle = at + heights[0];
            let is_kept = |c: &CellId| !is_edge || layout.distance_to_exits(*c, middle) <= reach;
            let cell = cell.filter(|c| border != Some(*c) && is_kept(c));
            if let Some(cell) = cell.filter(|_| room.is_free(room.standing(at))) {
                number[i] = self.floors.len() as u32;
                self.floors.push(Floor {
                    square: ground.square,
                    y: ground.y,
                    cell,
                    is_swung: false,
                    is_edge,
                    steps: ground.steps,
                });
            }
        }
        for floor in &mut self.floors {
            let to = |s: u32| number.get(s as usize).copied().unwrap_or(NONE);
            floor.steps = floor.steps.map(to);
        }
        self.first = first_of(&self.squares, self.floors.iter().map(|f| f.square));
    }

    /// Marks the floors where an open leaf of a portal is in the way.
    fn swing(&mut self, portal: PortalId, leaf: &[Triangle], room: &WalkerRoom) {
        let own = WalkerRoom::new(leaf, &self.walker);
        let reach = self.walker.radius + self.squares.side;
        let bounds = Aabb::of_points(leaf.as_flattened()).expanded(reach);
        let n = self.squares.n.map(|n| n as f64 - 1.0);
        let [low, high] = [bounds.min, bounds.max].map(|p| {
            let at = self.squares.along(p);
            [0, 1].map(|k| at[k].clamp(0.0, n[k]) as usize)
        });
        for z in low[1]..=high[1] {
            let row = [low[0], high[0]].map(|x| self.squares.number([x, z]));
            for floor in self.first[row[0]]..self.first[row[1] + 1] {
                if !own.is_free(room.standing(self.point(floor))) {
                    self.floors[floor as usize].is_swung = true;
                    self.swung.push((floor, portal));
                }
            }
        }
    }

    /// Returns `true` if a portal has leaves that open it.
    pub(crate) fn has_leaves(&self, portal: PortalId) -> bool {
        self.doors.binary_search(&portal).is_ok()
    }

    /// Returns the portals whose open leaves are in the way on a floor.
    pub(crate) fn leaves_at(&self, floor: u32) -> impl Iterator<Item = PortalId> {
        let first = self.swung.partition_point(|s| s.0 < floor);
        let own = self.swung[first..].iter().take_while(move |s| s.0 == floor);
        own.map(|s| s.1)
    }

    /// Finds the portals of steps between cells; removes steps without one.
    fn find_crossings(&mut self, layout: &Layout, is_open: impl Fn(PortalId) -> bool) {
        for i in 0..self.floors.len() as u32 {
            for direction in 0..2 {
                let floor = self.floors[i as usize];
                let to = floor.steps[direction as usize];
                if to == NONE || self.floors[to as usize].cell == floor.cell {
                    continue;
                }
                let other = self.floors[to as usize];
                let middle =
                    (self.point(i) + self.point(to)) * 0.5 + DVec3::Y * 0.5 * self.walker.height;
                let near = |p: &PortalId| layout.opening(*p).bounds().distance_squared(middle);
                let between = layout.exits(floor.cell).iter();
                let open = between.filter(|e| e.to == other.cell && is_open(e.portal));
                let nearest = open.min_by(|a, b| near(&a.portal).total_cmp(&near(&b.portal)));
                // Steps resolve distances to a square.
                let reach = self.walker.radius.max(self.squares.side);
                let is_there = |p: &PortalId| near(p) <= reach.powi(2);
                let portal = nearest.map(|e| e.portal).filter(is_there);
                match portal {
                    Some(portal) => {
                        let back = direction + 2;
                        self.crossings.push(Crossing {
                            from: i,
                            direction,
                            portal,
                        });
                        self.crossings.push(Crossing {
                            from: to,
                            direction: back,
                            portal,
                        });
                    }
                    None => {
                        self.floors[i as usize].steps[direction as usize] = NONE;
                        self.floors[to as usize].steps[direction as usize + 2] = NONE;
                    }
                }
            }
        }
        self.crossings.sort_unstable();
    }

    /// Returns the number of floors: squares, some above one another.
    #[must_use]
    #[doc(hidden)]
    pub fn n_floors(&self) -> usize {
        self.floors.len()
    }

    /// Returns the walker of these floors.
    #[must_use]
    pub fn walker(&self) -> &Agent {
        &self.walker
    }

    /// Returns the width of a square. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn side(&self) -> f64 {
        self.squares.side
    }

    /// Returns the floor nearest to a point, to tell where a walker could stand; `None` if there is none. O(floors). [Units: wu]
    #[must_use]
    pub fn nearest(&self, p: DVec3) -> Option<DVec3> {
        let all = (0..self.floors.len() as u32).filter(|f| !self.floor(*f).is_edge);
        let points = all.map(|f| self.point(f));
        points.min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p)))
    }

    pub(crate) fn squares(&self) -> &Squares {
        &self.squares
    }

    pub(crate) fn floor(&self, floor: u32) -> &Floor {
        &self.floors[floor as usize]
    }

    pub(crate) fn crossings(&self) -> &[Crossing] {
        &self.crossings
    }

    /// Returns the center of a floor. [Units: wu]
    pub(crate) fn point(&self, floor: u32) -> DVec3 {
        let floor = self.floor(floor);
        self.center(floor.square, f64::from(floor.y))
    }

    fn center(&self, square: u32, y: f64) -> DVec3 {
        let Squares { origin, side, n } = self.squares;
        let at = [square as usize % n[0], square as usize / n[0]];
        let [x, z] = [0, 1].map(|k| origin[k] + (at[k] as f64 + 0.5) * side);
        DVec3::new(x, y, z)
    }

    /// Returns the floor of a walker with any part, from the feet to the head, at a point: the nearest within the
    /// walker's diameter in plan, if the point is closer to a wall than walkers get. `None` if there is none. [Units:
    /// wu]
    pub(crate) fn below(&self, p: DVec3) -> Option<u32> {
        let reach = (2.0 * self.walker.radius / self.squares.side).ceil() as isize;
        let is_near = |k: usize| {
            let x = self.squares.along(p)[k];
            x > -(reach as f64) && x < self.squares.n[k] as f64 + reach as f64
        };
        if !(is_near(0) && is_near(1) && p.y.is_finite()) {
            return None;
        }
        let [x, z] = self.squares.along(p).map(|x| x.floor() as isize);
        let mut best: Option<(f64, u32)> = None;
        for dz in -reach..=reach {
            for dx in -reach..=reach {
                let at = [x + dx, z + dz];
                let is_in = |k: usize| at[k] >= 0 && (at[k] as usize) < self.squares.n[k];
                if !(is_in(0) && is_in(1)) {
                    continue;
                }
                let square = self.squares.number(at.map(|x| x as usize));
                for floor in self.first[square]..self.first[square + 1] {
                    let q = self.point(floor);
                    let down = p.y - q.y;
                    let is_edge = self.floor(floor).is_edge;
                    if is_edge || down < -self.walker.step || down > self.walker.height {
                        continue;
                    }
                    // A point anywhere in its own square is on the floor.
                    let beside = (q - p).with_y(0.0).length() * f64::from(dx != 0 || dz != 0);
                    let away = beside + down.abs() * 0.5;
                    if best.is_none_or(|b| away < b.0) {
                        best = Some((away, floor));
                    }
                }
            }
        }
        best.map(|b| b.1)
    }

    /// Adds the floors beside drops within a distance of a box.
    pub(crate) fn add_edges(&self, bounds: &Aabb, reach: f64, edges: &mut Vec<u32>) {
        let around = bounds.expanded(reach);
        let n = self.squares.n.map(|n| n as f64 - 1.0);
        let [low, high] = [around.min, around.max].map(|p| {
            let at = self.squares.along(p);
            [0, 1].map(|k| at[k].clamp(0.0, n[k]) as usize)
        });
        for z in low[1]..=high[1] {
            let row = [low[0], high[0]].map(|x| self.squares.number([x, z]));
            let all = self.first[row[0]]..self.first[row[1] + 1];
            let is_near = |floor: &u32| {
                let up = DVec3::Y * 0.5 * self.walker.height;
                bounds.distance_squared(self.point(*floor) + up) <= reach * reach
            };
            edges.extend(all.filter(|f| self.floor(*f).is_edge && is_near(f)));
        }
    }

    /// Returns `true` if one comes from a floor to others that are not beside a drop, within its cell.
    pub(crate) fn leads_off_edge(&self, floor: u32) -> bool {
        let (mut seen, mut at) = (vec![floor], 0);
        while let Some(&here) = seen.get(at) {
            at += 1;
            let own = self.floor(here);
            if !own.is_edge {
                return true;
            }
            for to in own.steps.into_iter().filter(|to| *to != NONE) {
                if self.floor(to).cell == own.cell && !seen.contains(&to) {
                    seen.push(to);
                }
            }
        }
        false
    }

    /// Returns the floor in the square of a point that is nearest to it in height, if it is within a step.
    pub(crate) fn at(&self, p: DVec3) -> Option<u32> {
        let square = self.squares.number(self.squares.at(p)?);
        let away = |floor: &u32| (self.point(*floor).y - p.y).abs();
        let nearest =
            (self.first[square]..self.first[square + 1]).min_by(|a, b| away(a).total_cmp(&away(b)));
        nearest.filter(|floor| away(floor) <= self.walker.step)
    }

    /// Returns the portal of a step between cells.
    pub(crate) fn portal_of(&self, from: u32, direction: usize) -> Option<PortalId> {
        let key = (from, direction as u32);
        let i = self
            .crossings
            .partition_point(|c| (c.from, c.direction) < key);
        let crossing = self.crossings.get(i)?;
        ((crossing.from, crossing.direction) == key).then_some(crossing.portal)
    }

    /// Returns the floor beside one, if a step leads there and nothing that it depends on hinders it.
    #[inline]
    pub(crate) fn step(
        &self,
        from: u32,
        direction: usize,
        may: &mut impl FnMut(Hindrance) -> bool,
    ) -> Option<u32> {
        let floor = self.floor(from);
        let to = floor.steps[direction];
        if to == NONE {
            return None;
        }
        let other = self.floor(to);
        let is_in_way = |p| floor.is_swung && self.leaves_at(from).any(|q| q == p);
        let is_open = other.cell == floor.cell
            || (self.portal_of(from, direction))
                .is_some_and(|p| !is_in_way(p) && may(Hindrance::Portal(p)));
        // A walker in the way of a leaf may go on there, before it opens.
        let is_free = !other.is_swung
            || self
                .leaves_at(to)
                .all(|p| is_in_way(p) || may(Hindrance::Leaf(p)));
        let is_safe = !other.is_edge || may(Hindrance::Edge(to));
        (is_open && is_free && is_safe).then_some(to)
    }
}
